"""Numbers as they are shown."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from pkmcal_cli.report.number_format import (
    handy,
    plain_number,
    plausible_share,
    readable,
    uncertain,
    unit_of_size,
    unknown,
)
from pkmcal_cli.units.unit_text import parse_unit
from tests.command import run


def test_numbers_are_plain() -> None:
    assert [plain_number(x) for x in (0.001, 0.25, 20.0, 5000.0, 0.0, 1e6, 1e12)] == [
        "0.001", "0.25", "20", "5000", "0", "1000000", "1e+12"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.29e-6, "rad", "1.29 urad"),
        (0.05, "rad", "50 mrad"),
        (4.5e-5, "mm", "45 um"),
        (2.5e4, "N", "25 kN"),
        (3e-7, "1", "0.0000003"),
        (0.0, "mm", "0 mm"),
    ],
)
def test_amounts_have_units_that_suit_them(value: float, unit: str, text: str) -> None:
    assert handy(value, parse_unit(unit)) == text


@pytest.mark.parametrize(
    ("value", "unit", "own", "text"),
    [
        (0.15, "um", ("mm", "deg"), "mm"),
        (9.9e-3, "um", ("mm", "deg"), "um"),
        (-0.0254, "um", ("in", "deg"), "in"),
        (0.15, "um", ("um", "deg"), "mm"),
        (-0.437, "urad", ("mm", "deg"), "deg"),
        (0.437, "urad", ("mm", "rad"), "rad"),
        (0.437, "urad", ("mm", "urad"), "mrad"),
        (0.02, "um/m", ("mm", "deg"), "mm/m"),
        (0.5, "deg", ("mm", "rad"), "deg"),
        (0.0, "um", ("mm", "deg"), "um"),
    ],
)
def test_sizes_of_five_digits_are_told_in_a_larger_unit(
    value: float, unit: str, own: tuple[str, ...], text: str
) -> None:
    """The zero of a drive that was 25 deg off was -437300(1900) urad."""
    assert unit_of_size(value, parse_unit(unit), [parse_unit(u) for u in own]).text == text


@pytest.mark.parametrize(("unit", "text"), [("mm", "12.34 um"), ("in", "0.0004858 in"), ("deg", "12.34 urad")])
def test_small_lengths_are_in_micrometres_beside_metric_ones(unit: str, text: str) -> None:
    """A column of errors had um in one row and inches in the next."""
    assert readable(1.234e-5, parse_unit(unit)) == text


MACHINE = """
units: {length: mm, angle: deg}
space: planar
parameters:
  bx: {nominal: 350*cos(90*pi/180), range: 0.1}
  by: {nominal: 350*sin(90*pi/180), range: 0.1}
  small: {nominal: 2e-6, range: 0.1}
ground: {O: [bx, by]}
guides: {rail: {along: x}}
bodies: {car: {guide: rail, at: 0, points: {D: [small, 0]}}}
actuators: {q: {moves: car}}
sensors: {bar: {kind: distance, at: D, to: O, sigma: 1 um}}
"""


def test_a_nominal_value_that_is_rounding_is_zero(tmp_path: Path) -> None:
    """cos 90 deg is 0, and what is small by its statement stays; JSON is exact."""
    (tmp_path / "m.yaml").write_text(MACHINE)
    told = run("check", tmp_path / "m.yaml").err
    rows = {line.split()[0]: line.split()[1] for line in told.splitlines() if "+-" in line}
    assert rows == {"bx": "0", "by": "350", "small": "2e-06"}, told
    exact = {p["name"]: p["nominal"] for p in run("check", tmp_path / "m.yaml", "--json").json["parameters"]}
    assert exact["bx"] == pytest.approx(350 * math.cos(math.radians(90)), abs=0, rel=1e-12)


def test_what_rounds_to_nothing_has_no_minus() -> None:
    assert unknown(-1e-9, 0.1, "mm") == "0.000(?) mm"
    assert uncertain(-1e-9, 0.068, "mm") == "0.000(68) mm" and uncertain(-0.4, 100.0) == "0(100)"


@pytest.mark.parametrize(
    ("value", "spread", "unit", "shown"),
    [
        (250.00144938, 0.1, "mm", "250.001(?) mm"),
        (-0.000622755, 0.1, "mm", "-0.001(?) mm"),
        (0.1373, 0.5, "mm", "0.137(?) mm"),
        (12345.678, 500.0, "um", "12346(?) um"),
        (1.00004, 1e-3, "1", "1.00004(?)"),
        (3.25, math.inf, "N", "3.25(?) N"),
        (3.25, 0.0, "N", "3.25(?) N"),
    ],
)
def test_what_nothing_determines_is_shown_to_a_hundredth_of_its_range(
    value: float, spread: float, unit: str, shown: str
) -> None:
    assert unknown(value, spread, unit) == shown


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.108, "10.8 % of the plausible size"),
        (1.5, "150 % of the plausible size"),
        (1953.0, "2000 times the plausible size"),
        (33.4, "33 times the plausible size"),
        (1e4, "never"),
        (math.inf, "never"),
    ],
)
def test_sizes_that_cannot_be_seen_are_told_without_powers_of_ten(share: float, text: str) -> None:
    assert plausible_share(share) == text
