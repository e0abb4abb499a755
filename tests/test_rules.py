"""The rules of the house, kept by walking the package."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import types
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import stickslip
from scripts import loaded
from stickslip.lazy import named

PACKAGE = Path(stickslip.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
ROOMS = sorted(stub.parent for stub in PACKAGE.glob("*/__init__.pyi"))
MODULES = sorted(module.name for module in pkgutil.walk_packages([str(PACKAGE)], "stickslip."))
HEAVY = {"scipy", "pandas", "matplotlib", "pint", "h5py", "pyarrow", "xarray", "jinja2", "pooch", "nptdms", "soundfile"}
HEAVY |= {"concurrent", "multiprocessing"}
EMPTY_NAMES = {"utils", "util", "core", "common", "helpers", "misc", "tools"}

BY_PLACE = {
    "fs",
    "path",
    "record",
    "channel",
    "b",
    "parameter",
    "load",
    "oscillator",
    "grid",
}  # may follow the first argument without being named


@cache
def trees() -> dict[str, ast.Module]:
    """The syntax trees of all files: made where a test looks at them, and not by whoever collects the tests."""
    return {str(file.relative_to(PACKAGE)): ast.parse(file.read_text("utf-8")) for file in FILES}


def public_names() -> Iterator[tuple[str, object]]:
    """Every name that a user meets: those of the package, and those of its rooms, as "laws.Coulomb"."""
    for name in stickslip.__all__:
        thing = getattr(stickslip, name)
        if isinstance(thing, types.ModuleType):
            yield from ((f"{name}.{inner}", getattr(thing, inner)) for inner in inside(thing))
        elif callable(thing):
            yield name, thing


def inside(module: types.ModuleType) -> list[str]:
    """What a room lists, or the callables that a module of its own defines."""
    own = [name for name, member in vars(module).items() if is_own(name, member, module)]
    return list(getattr(module, "__all__", own))


def is_own(name: str, member: object, module: types.ModuleType) -> bool:
    return not name.startswith("_") and callable(member) and getattr(member, "__module__", "") == module.__name__


PUBLIC = dict(public_names())
FUNCTIONS = {name: thing for name, thing in PUBLIC.items() if inspect.isfunction(thing)}
CLASSES = {name: thing for name, thing in PUBLIC.items() if inspect.isclass(thing)}
DATACLASSES = {
    f"{module}.{name}": thing
    for module in MODULES
    for name, thing in vars(importlib.import_module(module)).items()
    if dataclasses.is_dataclass(thing) and inspect.isclass(thing) and thing.__module__ == module
}


def sections(thing: object) -> dict[str, str]:
    """The numpydoc sections of a docstring by heading; "" is what stands before the first."""
    parts = re.split(r"\n([A-Z][A-Za-z ]+)\n-{3,}\n", "\n" + inspect.cleandoc(thing.__doc__ or ""))
    return dict(zip(["", *parts[1::2]], parts[0::2], strict=True))


def documented(text: str) -> list[str]:
    """The parameter names of a numpydoc section."""
    heads = re.findall(r"^(\S[^:\n]*?)(?: *:.*)?$", text, flags=re.MULTILINE)
    return [name.strip().lstrip("*") for head in heads for name in head.split(",")]


def test_every_public_name_exists() -> None:
    assert not [name for name in stickslip.__all__ if getattr(stickslip, name) is None]


def test_few_names_stand_at_the_top() -> None:
    assert len(stickslip.__all__) <= 60


def test_no_file_of_a_room_hides_one_of_its_names() -> None:
    """Once imported, ``signals/x.py`` is what ``signals.x`` means."""
    names = {room.name: set(named(room / "__init__.pyi")) & {file.stem for file in room.glob("*.py")} for room in ROOMS}
    assert not {room: hidden for room, hidden in names.items() if hidden}


def test_every_public_name_stands_in_the_reference() -> None:
    page = (PACKAGE.parents[1] / "docs" / "api" / "index.md").read_text("utf-8")
    # a module of its own is listed as a whole
    rooms = {name: name.partition(".")[0] for name in PUBLIC}
    listed = {room if (PACKAGE / f"{room}.py").exists() else name for name, room in rooms.items()}
    missing = sorted(listed - set(re.findall(r"^   (\S+)$", page, flags=re.MULTILINE)))
    assert not missing, f"add to docs/api/index.md, three spaces before each, in its room's list: {' '.join(missing)}"


def test_the_map_of_the_house_names_what_stands() -> None:
    page = (PACKAGE.parents[1] / "docs" / "architecture.md").read_text("utf-8")
    standing = {
        file.name for folder in ("src", "tests", "tools") for file in (PACKAGE.parents[1] / folder).rglob("*.py")
    }
    assert set(re.findall(r"\b\w+\.py\b", page)) <= standing
    rooms = {room for row in re.findall(r"^\| (`[^|]*`) \|", page, flags=re.MULTILINE) for room in row.split("`")[1::2]}
    assert {room for room in rooms if (PACKAGE / room).is_dir()} == {file.parent.name for file in FILES} - {
        PACKAGE.name
    }


def test_the_picture_of_the_rooms_is_the_codes() -> None:
    tool = loaded("tools/draw_rooms.py")
    stale = "an import between rooms is new or gone: python tools/draw_rooms.py draws them again"
    assert tool.drawn() == tool.PICTURE.read_text("utf-8"), stale


def test_a_record_goes_its_way_without_climbing() -> None:
    """The walks of `tools/walks.py` on part of the record, but for the drawing of the page: that takes ten seconds."""
    walk, record = loaded("tools/walks.py").walk, stickslip.datasets.demo()
    rig = {name: record.truth[name] for name in ("mass", "stiffness", "damping")}
    findings = stickslip.analyze(record.rows(0, 3000), **rig)
    for run in (
        lambda: stickslip.friction_loops(stickslip.friction_force(record, **rig)),
        lambda: stickslip.summary(findings).plates,
    ):
        stays, upwards = walk(run)
        assert stays
        assert not upwards


def undocumented(function: types.FunctionType) -> Iterator[str]:
    """What the docstring of a public function lacks."""
    texts = sections(function)
    signature = inspect.signature(function)
    if not texts[""].strip():
        yield "a first line that says what it answers"
    if ">>>" not in texts.get("Examples", ""):
        yield "a runnable example"
    if not {"Returns", "Yields"} & set(texts) and signature.return_annotation not in ("None", None):
        yield "what it returns"
    if signature.parameters and documented(texts.get("Parameters", "")) != list(signature.parameters):
        yield "every parameter, in order"


def test_a_public_function_is_documented() -> None:
    assert not {name: lacking for name, function in FUNCTIONS.items() if (lacking := [*undocumented(function)])}


def test_a_public_function_takes_few_arguments_by_name() -> None:
    parameters = {name: [*inspect.signature(function).parameters.values()] for name, function in FUNCTIONS.items()}
    assert not [name for name, taken in parameters.items() if len(taken) > 8]
    by_name = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    by_place = {
        name: [p.name for p in taken[1:] if p.kind not in by_name and p.name not in BY_PLACE]
        for name, taken in parameters.items()
    }
    assert not {name: taken for name, taken in by_place.items() if taken}, "keyword-only after the first"


def test_a_public_class_is_documented() -> None:
    texts = {name: sections(thing) for name, thing in CLASSES.items()}
    assert not [name for name, text in texts.items() if not text[""].strip()]
    fields = {name: dataclasses.fields(thing) for name, thing in CLASSES.items() if dataclasses.is_dataclass(thing)}
    lacking = {
        name: {field.name for field in of_class}
        - {*documented(texts[name].get("Attributes", "") + "\n" + texts[name].get("Parameters", ""))}
        for name, of_class in fields.items()
    }
    assert not {name: missing for name, missing in lacking.items() if missing}


def test_results_are_frozen_and_draw_nothing() -> None:
    assert not [name for name, thing in DATACLASSES.items() if not thing.__dataclass_params__.frozen]
    assert not [name for name, thing in DATACLASSES.items() if hasattr(thing, "plot")]


def test_a_file_is_short_and_named_for_what_it_holds() -> None:
    places = {file.relative_to(PACKAGE).with_suffix(""): file for file in FILES}
    assert not [str(place) for place, file in places.items() if len(file.read_text("utf-8").splitlines()) > 700]
    assert not [place for place in places if {*place.parts} & EMPTY_NAMES]
    assert not [place for place in places if len(place.parts) > 2], "two levels at most"


def test_a_constant_stands_once_in_a_file() -> None:
    """The second of two would silently hold for what was written by the first."""
    twice = []
    for name, tree in trees().items():
        targets = [target for node in tree.body if isinstance(node, ast.Assign) for target in node.targets]
        names = Counter(
            node.id
            for target in targets
            for node in ast.walk(target)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        )
        twice += [(name, constant) for constant, count in names.items() if count > 1]
    assert not twice


def test_a_room_names_what_is_public_in_its_stub_alone() -> None:
    attached = ["from stickslip.lazy import attached", "__getattr__, __dir__, __all__ = attached(__name__)"]
    for name, tree in trees().items():
        if not name.endswith("/__init__.py"):
            continue
        docstring, *rest = tree.body
        assert isinstance(docstring, ast.Expr), name
        # without a stub, a docstring alone: import from the module
        wanted = attached if (PACKAGE / name).with_suffix(".pyi").exists() else []
        assert [ast.unparse(line) for line in rest] == wanted, name


def unsafe(tree: ast.Module) -> set[str]:
    """The names by which a file would evaluate or unpickle what it reads."""
    nodes = [*ast.walk(tree)]
    called = {node.func.id for node in nodes if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)}
    imported = {alias.name for node in nodes if isinstance(node, ast.Import | ast.ImportFrom) for alias in node.names}
    imported |= {str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)}
    return called & {"eval", "exec"} | imported & {"pickle", "dill", "joblib", "marshal", "shelve"}


def test_nothing_is_unpickled_or_evaluated() -> None:
    assert not {name: names for name, tree in trees().items() if (names := unsafe(tree))}


@pytest.mark.parametrize("room", ["cli", "lab"])
def test_the_command_line_and_the_page_use_public_names_alone(room: str) -> None:
    files = sorted((PACKAGE / room).glob("*.py"))
    assert files
    listed = {"stickslip": stickslip.__all__} | {
        f"stickslip.{room.name}": named(room / "__init__.pyi") for room in ROOMS
    }
    inner = [
        f"{path.name}: {node.module}.{alias.name}"
        for path in files
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom)
        and re.match(r"stickslip(?!\.(cli|lab|errors|compiled|printing|workers)\b)", node.module or "")
        for alias in node.names
        if alias.name not in listed.get(str(node.module), ())
    ]
    assert not inner


@pytest.mark.parametrize(
    "start",
    ["import stickslip", "from stickslip.cli.program import main; main(['--help'], standalone_mode=False)"],
    ids=["import", "help"],
)
def test_the_start_is_light(start: str) -> None:
    code = f"import sys; {start}; print('LOADED', *{{name.partition('.')[0] for name in sys.modules}})"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.rpartition("LOADED")[2].split())
    assert not loaded & HEAVY


def test_the_files_that_contributing_names_are_there() -> None:
    root = PACKAGE.parent.parent
    told = re.findall(r"`((?:src/)?[\w/]+(?:\.py|\.toml|/))`", (root / "CONTRIBUTING.md").read_text("utf-8"))
    assert len(told) > 8
    assert not [name for name in told if not ((root / name).exists() or (PACKAGE / name).exists())]
