"""A negative backlash is no play: the words say what it is, where its sign is sure."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.report.effect_signs import sign_text
from tests.command import MACHINES, run
from tests.test_export_tables import STACKED

pytestmark = pytest.mark.usefixtures("unsized")

TRIGLIDE = MACHINES / "triglide-nonredundant.yaml"
AHEAD = "comes to rest ahead in its direction of motion"


@pytest.mark.parametrize("size", [-60, pytest.param(60, marks=pytest.mark.slow)])
def test_what_is_told_of_a_drive_that_is_ahead(tmp_path: Path, size: int) -> None:
    planted, table, declared = tmp_path / "m.yaml", tmp_path / "t.csv", tmp_path / "d.yaml"
    planted.write_text(f"extends: {TRIGLIDE}\neffects: {{backlash@q2: {{b: {size} um}}}}\n")
    declared.write_text(f"extends: {TRIGLIDE}\neffects: {{backlash@q2: {{b: {{identify: true}}}}}}\n")
    poses = MACHINES / "triglide-nonredundant.csv"
    assert run("simulate", planted, poses, "--noise", "declared", "--seed", "1", "-o", table).code == 0
    diagnosed = run("diagnose", TRIGLIDE, table).err
    assert "backlash@q2: Cause: " in diagnosed
    for text in (diagnosed, run("calibrate", declared, table, "--holdout", "none").err):
        assert (f"backlash@q2 is negative: q2 {AHEAD}" in text) == (size < 0)


@pytest.mark.parametrize(
    ("scale", "size", "words"), [(1, 20, ""), (1, -20, AHEAD), (-1, -20, "is negative: it is play"), (-1, 20, AHEAD)]
)
def test_readings_that_count_against_the_travel_turn_the_sign(
    tmp_path: Path, scale: int, size: int, words: str
) -> None:
    file = tmp_path / "m.yaml"
    machine = STACKED.replace("sy: {nominal: 1}", f"sy: {{nominal: {scale}}}")
    file.write_text(machine + "effects: {backlash@Y: {b: 20 um}}\n")
    model = load_machine(str(file)).model
    text = sign_text(model, "backlash@Y.b", size * 1e-6, 2e-6)
    assert words in text and bool(text) == bool(words)
    assert sign_text(model, "backlash@Y.b", size * 1e-6, 11e-6) == "", "a sign that is not sure"
