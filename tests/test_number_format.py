"""Numbers as they are shown."""

from __future__ import annotations

import math

import pytest

from pkmcal_cli.report.number_format import handy, plain_number, plausible_share, uncertain, unknown
from pkmcal_cli.units.unit_text import parse_unit


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


def test_what_rounds_to_nothing_has_no_minus() -> None:
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
