"""Effects of several drives that turn, and of drives of which some turn: angles and lengths are no common number."""

from __future__ import annotations

from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.effects import catalogue
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.model.effect_sites import places, together
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows, predict
from tests.command import MACHINES
from tests.kinds import PLANAR_KINDS

MIXED = dedent(PLANAR_KINDS) + "groups: {some: [q1, q2, q4], turned: [q2, q4]}\n"
"""Of its drives q1 and q3 move, q2 and q4 turn."""


def loaded(folder: Path, text: str, *, receptive: bool = False) -> Model:
    file = folder / "m.yaml"
    file.write_text(text, encoding="utf-8")
    return load_machine(str(file), receptive=receptive).model


def five_bar(folder: Path, effects: str) -> Model:
    return loaded(folder, f"extends: {MACHINES / 'five-bar.yaml'}\neffects: {{{effects}}}\n")


@pytest.mark.parametrize(("effect", "number"), [("zero", "o: 1 mrad"), ("pitch_curve", "{p2: 50 urad, over: [0, 90]}")])
def test_all_drives_that_turn_take_an_angle(tmp_path: Path, effect: str, number: str) -> None:
    """The same as each drive by itself; a bare number is in the file's unit, degrees."""
    entry = number if number.startswith("{") else f"{{{number}}}"
    read = []
    for text in (f"{effect}@all: {entry}", ", ".join(f"{effect}@q{k}: {entry}" for k in (1, 2)), ""):
        made = five_bar(tmp_path, text)
        read.append(predict(made, made.nominal, Rows.at(np.radians([[105.0, 40.0], [95.0, 60.0]]))).values)
    assert np.array_equal(read[0], read[1]) and np.abs(read[0] - read[2]).max() > 1e-6
    (bare,) = (p for p in five_bar(tmp_path, "zero@all: {o: 0.1}").parameters if p.name == "zero@all.o")
    assert bare.nominal == pytest.approx(np.radians(0.1)) and bare.unit == "urad"


def test_a_guide_is_long_though_all_drives_turn(tmp_path: Path) -> None:
    """A displacement without a name is over millimetres there, and over degrees at a drive."""
    shape = "width: 20 {0}, spread: 0.1 {0}, knots: [0 {0}, 25 {0}, 50 {0}], values: [0 {0}, 1 {0}, 0 {0}]"
    for place, unit, known in (("rail.y", "mm", 0.05), ("q1", "deg", np.radians(50))):
        file = tmp_path / f"{unit}.yaml"
        effect = f"unexplained@{place}: {{{shape.format(unit)}}}"
        file.write_text(f"extends: {MACHINES / 'five-bar.yaml'}\neffects: {{{effect}}}\n", encoding="utf-8")
        (entries,) = read_machine(str(file)).effects.values()
        assert entries["knots"].numbers == pytest.approx((0.0, known / 2, known))


def test_a_length_at_all_drives_that_turn_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="length"):
        five_bar(tmp_path, "zero@all: {o: 1 mm}")


def test_drives_of_two_kinds_have_no_common_zero(tmp_path: Path) -> None:
    """Those of each kind have one, of a group too; a scale is a number wherever it is."""
    model = loaded(tmp_path, MIXED, receptive=True)
    zeros, scales = (set(places(model.sites, catalogue()[e], (), model.effect_groups)) for e in ("zero", "scale"))
    assert {at for at in zeros if not at.startswith("q")} == {"linear_drives", "turned"}
    assert {"all", "some", "linear_drives", "turned"} <= scales
    assert "each:some" in together(model.sites, catalogue()["zero"], model.effect_groups), "values of their own"


def test_levels_of_a_machine_with_drives_of_both_kinds_are_of_one_kind_each(tmp_path: Path) -> None:
    for name, members in loaded(tmp_path, MIXED, receptive=True).effect_groups.items():
        drives = {m for m in members if m.startswith("q")}
        assert name == "some" or drives <= {"q1", "q3"} or drives <= {"q2", "q4"}, name


@pytest.mark.parametrize(
    ("entry", "value"),
    [
        ("zero@turned: {o: 1 mrad}", 1e-3),
        ("zero@linear_drives: {o: 20 um}", 20e-6),
        ("backlash@turned: {b: 0.1}", np.radians(0.1)),
        ("backlash@linear_drives: {b: 0.1}", 1e-4),
        ("scale@some: {s: 30 um/m}", 30e-6),
    ],
)
def test_a_group_of_one_kind_takes_its_unit(tmp_path: Path, entry: str, value: float) -> None:
    placed = loaded(tmp_path, f"{MIXED}effects: {{{entry}}}\n")
    assert placed.parameters[-1].nominal == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("entry", ["zero@all: {o: 1 mm}", "zero@some: {o: 1 mrad}", "zero@some: {o: 1 mm}"])
def test_a_zero_of_both_kinds_is_refused(tmp_path: Path, entry: str) -> None:
    with pytest.raises(BadInput):
        loaded(tmp_path, f"{MIXED}effects: {{{entry}}}\n")
