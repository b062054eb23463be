"""Names in the code say what they hold: words that once had several meanings, or none, do not come back.

The field's terms stay (`rest` of a strain, `moment`, `bound` of a parameter); a compound that says whose (`own_weight`,
`own_slopes`) is a name, the bare adjective is none.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.command import ROOT

PACKAGE = ROOT / "pkmcal_cli"
VAGUE = frozenset(
    {
        "what", "found", "mine", "told", "given", "settled", "loose", "wanted", "aside", "usual", "warmth", "scene",
        "sight", "telling", "residue", "socket", "slot", "law", "sense",
    }
)  # fmt: skip
"""Words that are no part of a name."""
ALONE = frozenset({"own", "now", "rests", "stuff", "thing", "things", "turn"})
"""Words that are part of a name, but no name."""
KEPT = {
    "what": {"base/errors.py"},  # of errors, as docs/python.md has it
    "_given_up": {"base/processes.py"},
    "given_targets": {"tables/measurement_set.py"},
    "given": {"equilibrium/branch.py", "prediction/stages.py"},
    "turn": {"language/parts.py"},  # a key of the machine file
    "own": {
        "calibration/whitening.py", "equilibrium/assembly.py", "equilibrium/branch.py", "equilibrium/derivative.py",
        "equilibrium/energy.py", "equilibrium/fronts.py", "equilibrium/maps.py", "equilibrium/partition.py",
        "equilibrium/path_map.py", "equilibrium/readings.py", "equilibrium/system_numbers.py", "equilibrium/tangent.py",
    },  # of a front: the unknowns that it eliminates; of a block: those of its element
}  # fmt: skip
"""Names that stay, and the files where they do."""


def bound(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Names that a module binds: variables, fields, arguments, functions, classes, with their lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.attr
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.lineno, node.name


def vague(name: str) -> bool:
    bare = name.lower().strip("_")
    return bare in ALONE or not VAGUE.isdisjoint(bare.split("_"))


def faults(file: str, text: str) -> list[str]:
    names = bound(ast.parse(text))
    return [f"{file}:{line} {name}" for line, name in names if vague(name) and file not in KEPT.get(name, ())]


@pytest.mark.parametrize("room", sorted({p.parent for p in PACKAGE.rglob("*.py")}), ids=lambda p: p.name)
def test_names_say_what_they_hold(room: Path) -> None:
    files = [(str(p.relative_to(PACKAGE)), p.read_text(encoding="utf-8")) for p in sorted(room.glob("*.py"))]
    assert [fault for file, text in files for fault in faults(file, text)] == []


def test_a_vague_name_is_seen() -> None:
    text = "def f(given):\n    what, own_weight = given\n    for own in what:\n        self.told = own\n"
    assert sorted(faults("x.py", text)) == ["x.py:1 given", "x.py:2 what", "x.py:3 own", "x.py:4 told"]


def test_exceptions_are_needed() -> None:
    for name, files in KEPT.items():
        for file in files:
            tree = ast.parse((PACKAGE / file).read_text(encoding="utf-8"))
            assert name in {n for _, n in bound(tree)}, f"{file} no longer has `{name}`: delete the exception"
