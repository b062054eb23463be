"""Imports go one way; only the outer layers know the terminal; modules and functions stay small."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.command import ROOT, environment

PACKAGE = ROOT / "pkmcal_cli"
MAX_LINES, MAX_FUNCTION, MAX_DATA = 300, 40, 60
MANY = 7  # values

ROOMS = (
    "base", "units", "expressions", "yaml_source", "csv_files", "effects", "elements", "sensors", "language",
    "mechanism", "equilibrium", "model", "compiler", "prediction", "tables", "loading", "correction",
    "calibration", "gross_errors",
    "diagnosis", "report", "pictures", "sheet", "workflow", "api", "commands", "app", "__main__",
)  # fmt: skip
"""From the innermost outwards; a folder, or loose module, imports itself and those before it, also for types only."""

MODULES = sorted(PACKAGE.rglob("*.py"))
TESTS = sorted((ROOT / "tests").rglob("*.py"))


def name_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {name_of(file) for file in MODULES}


@cache
def tree_of(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def nodes_of(file: Path) -> tuple[ast.AST, ...]:
    """All nodes of a module, walked once for all tests."""
    return tuple(ast.walk(tree_of(file)))


def statements(file: Path) -> Iterator[ast.Import | ast.ImportFrom]:
    """Import statements, also those inside functions and those for type checkers only."""
    for node in nodes_of(file):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node


def inside(file: Path) -> set[str]:
    """Names of this package's modules that a module imports."""
    name = name_of(file)
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    found = set()
    for node in statements(file):
        if isinstance(node, ast.Import):
            assert not any(a.name.startswith("pkmcal_cli") for a in node.names), "write `from pkmcal_cli.x import y`"
            continue
        if node.level:
            base = [*package[: len(package) - node.level + 1], *(node.module or "").split(".")]
        elif (node.module or "").split(".")[0] == "pkmcal_cli":
            base = (node.module or "").split(".")[1:]
        else:
            continue
        path = ".".join(part for part in base if part)
        for alias in node.names:
            deep = f"{path}.{alias.name}".strip(".")
            found.add(deep if deep in NAMES else path)
    return found - {""}


def outside(file: Path) -> set[str]:
    """Other packages that a module imports."""
    found = set()
    for node in statements(file):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif not node.level and node.module:
            found.add(node.module.split(".")[0])
    return found


def room_of(name: str) -> str:
    return name.split(".")[0]


def arrows() -> set[tuple[str, str]]:
    """Ordered pairs of rooms of which the first imports from the second."""
    found = {(room_of(name_of(f)), room_of(other)) for f in MODULES if name_of(f) for other in inside(f)}
    return {(one, other) for one, other in found if one != other}


def test_rooms_do_not_grow_together() -> None:
    """Whoever draws a new arrow changes this number, and thinks about it."""
    assert (len(ROOMS), len(arrows())) == (28, 156)


@pytest.mark.parametrize("file", MODULES, ids=name_of)
def test_imports_go_one_way(file: Path) -> None:
    if not (name := name_of(file)):
        return
    outer = ROOMS[ROOMS.index(room_of(name)) + 1 :]
    assert {other for other in inside(file) if room_of(other) in outer} == set(), f"{name} imports outer rooms"


def test_there_are_no_cycles() -> None:
    import graphlib

    graph = {name_of(f): inside(f) - {name_of(f)} for f in MODULES}
    assert list(graphlib.TopologicalSorter(graph).static_order())


@pytest.mark.parametrize("family", ["elements", "effects"])
def test_members_of_a_family_do_not_know_each_other(family: str) -> None:
    for file in (PACKAGE / family).glob("[a-z]*.py"):
        assert inside(file) <= {f"{family}.{family[:-1]}", "base.rotation"}, file.name


def test_every_room_has_its_place() -> None:
    assert sorted(ROOMS) == sorted({room_of(name) for name in NAMES if name})
    assert [f.stem for f in sorted(PACKAGE.glob("*.py"))] == ["__init__", "__main__", "app"], "loose modules"


@pytest.mark.parametrize(("package", "places"), [("typer", ("app", "commands")), ("rich", ("report",))])
def test_only_the_outer_layers_know_the_terminal(package: str, places: tuple[str, ...]) -> None:
    users = {name_of(f) for f in MODULES if package in outside(f)}
    assert users and {u.split(".")[0] for u in users} <= set(places)


def test_nothing_but_the_declared_dependencies_is_imported() -> None:
    declared = {"numpy", "scipy", "pandas", "yaml", "typer", "rich", "pydantic", "pydantic_core", "typing_extensions"}
    declared |= {"matplotlib", "jinja2", "joblib", "cloudpickle", "threadpoolctl", "distributed"}
    found = set().union(*(outside(f) for f in MODULES)) - {"pkmcal_cli", "__future__"}
    assert found - set(sys.stdlib_module_names) <= declared


def test_importing_the_program_is_light() -> None:
    heavy = ("numpy", "scipy", "pandas", "pydantic", "yaml", "rich", "matplotlib", "jinja2", "pkmcal_cli.workflow")
    code = f"import sys, pkmcal_cli.app; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("file", [*MODULES, *TESTS], ids=lambda f: str(f.relative_to(ROOT)))
def test_files_and_functions_are_small(file: Path) -> None:
    lines = len(file.read_text(encoding="utf-8").splitlines())
    assert lines <= MAX_LINES, f"{lines} lines"
    most = MAX_DATA if "truth" in file.parts else MAX_FUNCTION  # descriptions of machines
    long = {
        node.name: size
        for node in nodes_of(file)
        if isinstance(node, ast.FunctionDef) and (size := (node.end_lineno or 0) - node.lineno + 1) > most
    }
    assert long == {}


@pytest.mark.parametrize("file", MODULES, ids=name_of)
def test_public_things_say_what_they_are(file: Path) -> None:
    """Modules, classes and functions without a leading underscore have a docstring."""
    tree = tree_of(file)
    nodes = [n for n in tree.body if isinstance(n, ast.ClassDef | ast.FunctionDef) and not n.name.startswith("_")]
    silent = [n.name for n in nodes if ast.get_docstring(n) is None]
    assert ast.get_docstring(tree) and silent == []


def test_nothing_names_a_place_of_this_computer() -> None:
    """No path of the machine on which something was written."""
    for file in [*MODULES, *TESTS, *ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), ROOT / ".ci" / "run"]:
        text = file.read_text(encoding="utf-8")
        assert not any(place in text for place in ("/" + "work/", "/home" + "/", "/root" + "/")), file


def is_data(node: ast.AST) -> bool:
    """Whether a class is a dataclass with seven fields or more."""
    if not isinstance(node, ast.ClassDef) or not any("dataclass" in ast.unparse(d) for d in node.decorator_list):
        return False
    return sum(isinstance(n, ast.AnnAssign) and "ClassVar" not in ast.unparse(n.annotation) for n in node.body) >= MANY


def test_many_values_have_names() -> None:
    """Seven values in a row say nothing: wide dataclasses are made by keyword, and so are calls of seven."""
    files = [*MODULES, *TESTS, *(ROOT / "benchmarks").glob("*.py")]
    wide = [n for f in files for n in nodes_of(f) if is_data(n)]
    assert len(wide) > 50
    assert [n.name for n in wide if not any("kw_only=True" in ast.unparse(d) for d in n.decorator_list)] == []
    functions = [n for f in files for n in nodes_of(f) if isinstance(n, ast.FunctionDef)]
    of_any_length = {n.name for n in functions if n.args.vararg} | {"one_of"}
    calls = [(f.name, n) for f in files for n in nodes_of(f) if isinstance(n, ast.Call)]
    long = {(name, ast.unparse(n.func)) for name, n in calls if len(n.args) >= MANY}
    assert {(name, f) for name, f in long if f.split(".")[-1] not in of_any_length} == set()
