"""Unit slips are warned of, and machines that are in order are not."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.loading.machine_templates import names, template
from tests.hostile.unit_slips import SLIPS, warned
from tests.shipped import TABLES, machine_of

SPANS = (0.1, 0.5, 1.0, 3.0, 10.0)
DOUBTS = {"magnitude", "gravity-up"}
HERE = Path(__file__).parent


def doubts(file: Path) -> list[str]:
    try:
        return [w.text() for w in load_machine(str(file)).warnings if w.code in DOUBTS]
    except BadInput:
        return []


def test_of_the_slips_at_least_45_are_warned_of() -> None:
    found = [slip for slip in SLIPS if set(warned(slip)) & {*DOUBTS, "value"}]
    assert len(SLIPS) >= 49 and len(found) >= 45
    assert {kind for kind, n in Counter(s.kind for s in found).items() if n > 1} == {s.kind for s in SLIPS}


@pytest.mark.parametrize("machine", sorted({machine_of(t) for t in TABLES}), ids=lambda m: m.stem)
def test_no_shipped_machine(machine: Path) -> None:
    assert doubts(machine) == []


@pytest.mark.parametrize("kind", names())
def test_no_template_at_usual_spans(kind: str, tmp_path: Path) -> None:
    for span in SPANS:
        file = tmp_path / f"{span}.yaml"
        file.write_text(template(kind).scaled(span), encoding="utf-8")
        assert doubts(file) == [], span


@pytest.mark.parametrize(
    ("slip", "text"),
    [
        ("sigma: 10", "sigma of tracker = 10 mm: did you mean 10 um?"),
        ("E: 210", "E of steel = 210 N/mm^2: did you mean 210 GPa?"),
        ("gravity: [0, 0, 9.81]", "gravity points along +z: weight acts upwards"),
        ("gravity: [0, 9.4757]", "gravity points along +y: weight acts upwards"),
        ("orientation: 10", "sigma of tracker = 10 rad: did you mean 10 urad?"),
        ("turn: 2.0944", "turn of arm1 = 2.0944 deg: did you mean 2.0944 rad?"),
    ],
)
def test_the_guess(slip: str, text: str, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(next(s for s in SLIPS if s.new == slip).text(), encoding="utf-8")
    assert any(text in found for found in doubts(file)), doubts(file)
