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
LEGS = """
space: planar
ranges: {length: 1 mm}
parameters: {o: 0.3}
ground: {A: [0, 0], B: [1, 0]}
nodes: {tip: [0.5, 0.6]}
bars: {l: {between: [A, tip]}, m: {between: [B, tip]}}
actuators: {q: {drives: l, offset: o, scale: -1}, p: {drives: m, offset: o, scale: -1}}
sensors: {tracker: {at: tip, reads: [x, y], sigma: 1 um, frame: machine}}
"""
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


@pytest.mark.parametrize(
    ("effect", "shrinks"),
    [
        ("thermal_strut@all", "If every member is of another"),
        ("thermal_strut@l", "If l is of another"),
        ("thermal_base@all", "no base shrinks"),
    ],
)
def test_what_shrinks_as_it_warms_is_doubted(effect: str, shrinks: str, tmp_path: Path) -> None:
    """Of legs whose drives count against their travel: that is no matter of how they grow."""
    file = tmp_path / "m.yaml"
    file.write_text(LEGS + f"effects: {{{effect}: {{a: 9 um/(m*K)}}}}\n")
    model = load_machine(str(file)).model
    text = sign_text(model, f"{effect}.a", -9e-6, 1e-6)
    assert text.startswith(f"{effect} is negative: ") and shrinks in text
    assert sign_text(model, f"{effect}.a", 9e-6, 1e-6) == "" == sign_text(model, f"{effect}.a", -9e-6, 6e-6)
