"""Every name that a file of the project imports from the project is there: campaigns and benchmarks that no test runs
would else break in silence when a name moves, also inside their functions."""

from __future__ import annotations

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.command import ROOT

OWN = ("pkmcal", "pkmcal_cli", "pkmcal_machines", "tests", "benchmarks", "docs")
FILES = sorted(file for room in ("pkmcal_cli", "tests", "benchmarks", "docs") for file in (ROOT / room).rglob("*.py"))


def imported(file: Path) -> list[tuple[int, str, str]]:
    """Line, module and name of every `from MODULE import NAME` of the project's own modules."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return [
        (node.lineno, node.module, alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and not node.level and node.module
        if node.module.split(".")[0] in OWN
        for alias in node.names
    ]


def is_there(module: str, name: str) -> bool:
    """Whether the module can be imported and has the name, as a value or as a module below it."""
    try:
        loaded = import_module(module)
    except ImportError:
        return False
    if name == "*" or hasattr(loaded, name):
        return True
    return hasattr(loaded, "__path__") and find_spec(f"{module}.{name}") is not None


@pytest.mark.parametrize("room", ["pkmcal_cli", "tests", "benchmarks", "docs"])
def test_every_imported_name_is_there(room: str) -> None:
    missing = [
        f"{file.relative_to(ROOT)}:{line}: from {module} import {name}"
        for file in FILES
        if file.relative_to(ROOT).parts[0] == room
        for line, module, name in imported(file)
        if not is_there(module, name)
    ]
    assert not missing, "\n".join(missing)


def test_a_name_that_moved_is_found(tmp_path: Path) -> None:
    """The line that stopped the benchmark of the diagnosis, inside a function."""
    file = tmp_path / "campaign.py"
    file.write_text("def run():\n    from pkmcal_cli.diagnosis.linear import NONCENTRALITY\n", encoding="utf-8")
    ((line, module, name),) = imported(file)
    assert line == 2
    assert not is_there(module, name)
