"""The rules of the house, kept by walking the package."""

from __future__ import annotations

import ast
import dataclasses
import doctest
import importlib
import inspect
import os
import pkgutil
import re
import subprocess
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import pytest

import stickslip
from stickslip.lazy import named

PACKAGE = Path(stickslip.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
ROOMS = sorted(stub.parent for stub in PACKAGE.glob("*/__init__.pyi"))
MODULES = sorted(module.name for module in pkgutil.walk_packages([str(PACKAGE)], "stickslip."))
HEAVY = {"scipy", "pandas", "matplotlib", "pint", "h5py", "pyarrow", "xarray", "jinja2", "pooch", "nptdms", "soundfile"}
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


@pytest.mark.parametrize("name", stickslip.__all__)
def test_every_public_name_exists(name: str) -> None:
    assert getattr(stickslip, name) is not None


def test_few_names_stand_at_the_top() -> None:
    assert len(stickslip.__all__) <= 60


@pytest.mark.parametrize("room", ROOMS)
def test_no_file_of_a_room_hides_one_of_its_names(room: Path) -> None:
    """Once imported, ``signals/x.py`` is what ``signals.x`` means."""
    names = named(room / "__init__.pyi")
    assert not set(names) & {file.stem for file in room.glob("*.py")}


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_stands_in_the_reference(name: str) -> None:
    page = PACKAGE.parents[1] / "docs" / "api" / "index.md"
    room = name.partition(".")[0]
    listed = room if (PACKAGE / f"{room}.py").exists() else name  # a module of its own is listed as a whole
    assert re.search(rf"^   {re.escape(listed)}$", page.read_text("utf-8"), flags=re.MULTILINE)


def test_the_map_of_the_house_names_files_that_stand() -> None:
    page = (PACKAGE.parents[1] / "docs" / "architecture.md").read_text("utf-8")
    standing = {
        file.name for folder in ("src", "tests", "tools") for file in (PACKAGE.parents[1] / folder).rglob("*.py")
    }
    assert set(re.findall(r"\b\w+\.py\b", page)) <= standing
    folders = re.findall(r"^  (\w+)/", page, flags=re.MULTILINE)
    assert set(folders) == {file.parent.name for file in FILES} - {PACKAGE.name}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_is_documented(name: str) -> None:
    function = FUNCTIONS[name]
    found = sections(function)
    parameters = list(inspect.signature(function).parameters)
    assert found[""].strip(), "the first line says what it answers"
    assert ">>>" in found.get("Examples", ""), "a runnable example"
    assert "Returns" in found or "Yields" in found or inspect.signature(function).return_annotation in ("None", None)
    if parameters:
        assert documented(found.get("Parameters", "")) == parameters, "every parameter, in order"


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_takes_few_arguments_by_name(name: str) -> None:
    parameters = list(inspect.signature(FUNCTIONS[name]).parameters.values())
    assert len(parameters) <= 8
    by_name = (inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    assert all(p.kind in by_name or p.name in BY_PLACE for p in parameters[1:]), "keyword-only after the first"


@pytest.mark.parametrize("name", CLASSES)
def test_a_public_class_is_documented(name: str) -> None:
    found = sections(CLASSES[name])
    assert found[""].strip()
    if dataclasses.is_dataclass(CLASSES[name]):
        fields = [field.name for field in dataclasses.fields(CLASSES[name])]
        text = found.get("Attributes", "") + "\n" + found.get("Parameters", "")
        assert set(fields) <= set(documented(text)), "every field"


@pytest.mark.parametrize("name", DATACLASSES)
def test_results_are_frozen_and_draw_nothing(name: str) -> None:
    thing = DATACLASSES[name]
    assert thing.__dataclass_params__.frozen
    assert not hasattr(thing, "plot")


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_a_file_is_short_and_named_for_what_it_holds(file: Path) -> None:
    assert len(file.read_text("utf-8").splitlines()) <= 700
    assert not {*file.relative_to(PACKAGE).with_suffix("").parts} & EMPTY_NAMES
    assert len(file.relative_to(PACKAGE).parts) <= 2, "two levels at most"


@pytest.mark.parametrize("file", [f for f in FILES if f.name == "__init__.py" and f.parent != PACKAGE], ids=str)
def test_a_room_names_what_is_public_in_its_stub_alone(file: Path) -> None:
    docstring, *rest = ast.parse(file.read_text("utf-8")).body
    assert isinstance(docstring, ast.Expr)
    if file.with_suffix(".pyi").exists():
        assert [ast.unparse(line) for line in rest] == [
            "from stickslip.lazy import attached", "__getattr__, __dir__, __all__ = attached(__name__)",
        ]  # fmt: skip
    else:
        assert not rest, "a docstring alone: import from the module"


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(PACKAGE)))
def test_nothing_is_unpickled_or_evaluated(file: Path) -> None:
    tree = ast.parse(file.read_text("utf-8"))
    calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    called = {func.id for func in calls if isinstance(func, ast.Name)}
    imported = {
        alias.name for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom) for alias in node.names
    } | {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert not called & {"eval", "exec"}
    assert not imported & {"pickle", "dill", "joblib", "marshal", "shelve"}


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
        and re.match(r"stickslip(?!\.(cli|lab|errors|compiled|printing)\b)", node.module or "")
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
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    loaded = set(run.stdout.rpartition("LOADED")[2].split())
    assert not loaded & HEAVY


@pytest.mark.parametrize("module", ["stickslip", *MODULES])
def test_the_examples_run(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(os.environ, "MPLBACKEND", "agg")
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    results = doctest.testmod(importlib.import_module(module), optionflags=flags)
    assert results.failed == 0, f"{results.failed} of {results.attempted} examples of {module} failed; see above"


def test_the_files_that_contributing_names_are_there() -> None:
    root = PACKAGE.parent.parent
    told = re.findall(r"`((?:src/)?[\w/]+(?:\.py|\.toml|/))`", (root / "CONTRIBUTING.md").read_text("utf-8"))
    assert len(told) > 8
    assert not [name for name in told if not ((root / name).exists() or (PACKAGE / name).exists())]
