"""How large the house is and how its rooms hang together, counted from the syntax trees of a checkout.

``python tools/measure.py [CHECKOUT ...]``: one column a checkout, so that before and after stand side by side.
"""

from __future__ import annotations

import argparse
import ast
import re
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path

LONG = 60  # lines of a function
MANY = 10  # arguments of a function
SHORT = 60  # code lines of a file that might join what it serves
SENTENCES = {"status", "outcome", "reason", "doubt", "rule", "next_step", "note", "notes", "words"}
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


class Source:
    """One file: its tree, its lines of code, and what it imports."""

    def __init__(self, path: Path, package: Path) -> None:
        self.path = path
        parts = path.relative_to(package.parent).with_suffix("").parts
        self.is_package = parts[-1] == "__init__"
        self.module = ".".join(parts[:-1] if self.is_package else parts)
        self.text = path.read_text("utf-8")
        self.tree = ast.parse(self.text)

    @cached_property
    def code(self) -> int:
        """Lines that are neither blank, comment nor docstring."""
        prose = {line for node in ast.walk(self.tree) if (doc := docstring(node)) for line in lines_of(doc)}
        lines = enumerate(self.text.splitlines(), 1)
        return sum(bool(line.strip()) and not line.strip().startswith("#") for i, line in lines if i not in prose)

    @cached_property
    def comments(self) -> int:
        return sum(line.strip().startswith("#") for line in self.text.splitlines())

    def functions(self) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
        return (node for node in ast.walk(self.tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))

    def imports(self, known: set[str]) -> Iterator[tuple[str, bool]]:
        """Modules of the package that it imports, and whether within a function."""
        for node, inside in imports_among(self.tree.body):
            for name in targets(node, self.module, self.is_package):
                if (module := longest_known(name, known)) and module != self.module:
                    yield module, inside


def imports_among(
    statements: Iterable[ast.AST], inside: bool = False
) -> Iterator[tuple[ast.Import | ast.ImportFrom, bool]]:
    """Import statements, and whether within a function, but those that type-checkers alone read."""
    for node in statements:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node, inside
        for_types = isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")
        deeper = inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        for field in ("orelse",) if for_types else ("body", "orelse", "handlers", "finalbody", "cases"):
            inner = getattr(node, field, ())
            yield from imports_among(inner if isinstance(inner, list) else (), deeper)


def docstring(node: ast.AST) -> ast.Expr | None:
    """The statement that is a node's docstring."""
    body = getattr(node, "body", None)
    if not isinstance(node, DOCUMENTED) or not body or not isinstance(body[0], ast.Expr):
        return None
    value = body[0].value
    return body[0] if isinstance(value, ast.Constant) and isinstance(value.value, str) else None


def lines_of(node: ast.stmt) -> range:
    return range(node.lineno, (node.end_lineno or node.lineno) + 1)


def targets(node: ast.Import | ast.ImportFrom, module: str, is_package: bool) -> list[str]:
    """The dotted names that an import statement reaches for."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    base = node.module or ""
    if node.level:
        home = module.split(".")[: len(module.split(".")) - node.level + is_package]
        base = ".".join([*home, *([base] if base else [])])
    return [f"{base}.{alias.name}" for alias in node.names]


def longest_known(name: str, known: set[str]) -> str | None:
    """The module of the package that a dotted name lies in; the package itself counts only where it is named alone."""
    while name not in known and "." in name:
        name = name.rpartition(".")[0]
    return name if name in known else None


def knots(edges: dict[str, set[str]]) -> list[list[str]]:
    """Groups of modules that import each other, by Tarjan's strongly connected components."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    groups: list[list[str]] = []

    def visit(module: str) -> None:
        index[module] = low[module] = len(index)
        stack.append(module)
        for other in edges[module]:
            if other not in index:
                visit(other)
                low[module] = min(low[module], low[other])
            elif other in stack:
                low[module] = min(low[module], index[other])
        if low[module] == index[module]:
            at = stack.index(module)
            groups.append(sorted(stack[at:]))
            del stack[at:]

    sys.setrecursionlimit(10_000)
    for module in list(edges):
        if module not in index:
            visit(module)
    return [group for group in groups if len(group) > 1]


def arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    given = function.args
    return sum(name.arg not in ("self", "cls") for name in [*given.posonlyargs, *given.args, *given.kwonlyargs])


def sentences_read(source: Source) -> list[int]:
    """Lines on which a status, an outcome or a history is searched for words."""
    lines = []
    for node in ast.walk(source.tree):
        if isinstance(node, ast.Compare) and any(isinstance(op, ast.In | ast.NotIn) for op in node.ops):
            read = any(is_sentence(side) for side in node.comparators)
            words = isinstance(node.left, ast.Constant) and isinstance(node.left.value, str)
            read = read or (words and any(getattr(side, "attr", "") == "value" for side in node.comparators))
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            searches = node.func.attr in (
                "startswith",
                "endswith",
                "split",
                "partition",
                "removeprefix",
                "removesuffix",
            )
            read = searches and is_sentence(node.func.value)
            matches = node.func.attr in ("fullmatch", "match", "search") and len(node.args) > 1
            read = read or (matches and is_sentence(node.args[1]))
        else:
            read = history_read(node)
        if read:
            lines.append(node.lineno)
    return sorted(set(lines))


def is_sentence(node: ast.AST) -> bool:
    return isinstance(node, ast.Attribute) and (node.attr in SENTENCES or (node.attr == "value" and error_like(node)))


def error_like(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id in ("error", "reason", "refusal")


def history_read(node: ast.AST) -> bool:
    """A comprehension over a history that looks for an action: the history as a bus of parameters."""
    if not isinstance(node, ast.ListComp | ast.GeneratorExp | ast.SetComp | ast.DictComp):
        return False
    over = any(isinstance(part.iter, ast.Attribute) and part.iter.attr == "history" for part in node.generators)
    return over and any("action" in ast.unparse(test) for part in node.generators for test in part.ifs)


def public_names(package: Path) -> int:
    """The names that a package offers: those of its stub, of its list, or of its table of rooms."""
    stub = package / "__init__.pyi"
    if stub.exists():
        imports = [node for node in ast.parse(stub.read_text("utf-8")).body if isinstance(node, ast.ImportFrom)]
        return sum(len(node.names) for node in imports) + 1  # and the version
    tree = ast.parse((package / "__init__.py").read_text("utf-8"))
    for node in tree.body:
        name = getattr(node, "target", None) or (node.targets[0] if isinstance(node, ast.Assign) else None)
        if isinstance(name, ast.Name) and name.id == "__all__" and isinstance(node.value, ast.List):
            listed = [part for part in node.value.elts if isinstance(part, ast.Constant)]
            if len(listed) == len(node.value.elts):
                return len(listed)
    for node in tree.body:
        name = getattr(node, "target", None) or (node.targets[0] if isinstance(node, ast.Assign) else None)
        if isinstance(name, ast.Name) and name.id in ("_ROOMS", "_NAMES") and isinstance(node.value, ast.Dict):
            return sum(
                len(value.value.split()) if isinstance(value, ast.Constant) and key is None else 1
                for key, value in zip(node.value.keys, node.value.values, strict=True)
            )
    raise SystemExit(f"{package}/__init__.py lists no names")


def measured(checkout: Path, show: bool) -> dict[str, int | str]:
    """Every count of one checkout."""
    package = checkout / "src" / "stickslip"
    sources = [Source(path, package) for path in sorted(package.rglob("*.py"))]
    known = {source.module for source in sources}
    edges: dict[str, set[str]] = defaultdict(set)
    hidden = []
    for source in sources:
        edges[source.module] |= set()
        for module, inside in source.imports(known):
            edges[source.module] |= {module}
            hidden += [f"{source.module} -> {module}"] if inside else []
    importers = Counter(module for module, used in edges.items() for module in used)
    functions = [(source, function) for source in sources for function in source.functions()]
    long = [(s, f) for s, f in functions if len(lines_of(f)) > LONG + doc_lines(f)]
    many = [(s, f) for s, f in functions if arguments(f) > MANY]
    read = [f"{source.module}:{line}" for source in sources for line in sentences_read(source)]
    alone = [s.module for s in sources if importers[s.module] == 1 and not s.is_package]
    tied = knots(edges)
    if show:
        for title, rows in {
            "hidden imports": hidden,
            f"functions over {LONG} lines": [f"{s.module}:{f.lineno} {f.name}" for s, f in long],
            f"functions over {MANY} arguments": [f"{s.module}:{f.lineno} {f.name} ({arguments(f)})" for s, f in many],
            "sentences read": read,
            "knots": [" ".join(group) for group in tied],
            "one importer": alone,
        }.items():
            print(f"{title}:", *rows, sep="\n  ")
    return {
        "files": len(sources),
        "code lines": sum(source.code for source in sources),
        "comment lines": sum(source.comments for source in sources),
        "public names": public_names(package),
        "hidden internal imports": len(hidden),
        "import knots": len(tied),
        f"functions over {LONG} lines": len(long),
        f"functions over {MANY} arguments": len(many),
        "modules with one importer": len(alone),
        f"files under {SHORT} code lines": sum(s.code < SHORT and not s.is_package for s in sources),
        "places that read a sentence": len(read),
        "fmt: skip": sum(len(re.findall(r"# fmt: skip", source.text)) for source in sources),
    }


def floors() -> list[list[str]]:
    """The rooms of each floor of this checkout, from the top down, as the import-linter's contract has them."""
    settings = tomllib.loads((Path(__file__).resolve().parents[1] / "pyproject.toml").read_text("utf-8"))
    layers = settings["tool"]["importlinter"]["contracts"][0]["layers"]
    return [[room.strip() for room in layer.split("|")] for layer in layers]


def doc_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    doc = docstring(function)
    return len(lines_of(doc)) if doc else 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("checkouts", nargs="*", type=Path, default=[Path(__file__).resolve().parents[1]])
    parser.add_argument("--show", action="store_true", help="name the places, too")
    chosen = parser.parse_args()
    columns = [measured(checkout, chosen.show) for checkout in chosen.checkouts]
    for name in columns[0]:
        print(f"{name:32}" + "".join(f"{column[name]:>10}" for column in columns))


if __name__ == "__main__":
    main()
