"""Effects named with a shape of their own, and shapes that no name at their place explains."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pytest import approx

from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from tests.benchmark.cases import case
from tests.benchmark.heldout import held_out
from tests.benchmark.setting import diagnosed
from tests.command import SCISSORS, run
from tests.nameless_campaigns import planted_case
from tests.truth.campaigns import Planted, campaign

pytestmark = pytest.mark.usefixtures("unsized")

HEIGHT = 50e-6
STRAIGHT = case("single", 214)  # harmonics and a ripple, of which declared parameters absorb the lowest


def names(d: Diagnosis) -> list[str]:
    """Effects that are named with a shape of their own."""
    return [s.named.name for s in d.shapes if s.named is not None]


def test_a_straightness_that_is_not_quite_the_catalogues_is_named_with_its_shape() -> None:
    """Two pitch curves fit better than the catalogue's straightness does; its own shape predicts other poses better
    than that does when declared from the start."""
    d = diagnosed(STRAIGHT.measured(), STRAIGHT.seed)
    assert names(d) == [x.name for x in STRAIGHT.drawn] == ["straight@right.x"]
    assert d.verdict == "found" and not d.findings and not d.unknown
    error = held_out(STRAIGHT, d)
    assert error["after"] < 0.5 * error["floor"] < 0.25 * error["before"]


def test_what_is_across_a_guide_is_its_straightness_where_the_catalogues_has_most_of_it() -> None:
    """By definition (ISO 230-1). A drive may deviate over its travel for many reasons, and a narrow bump for others."""
    d = diagnosed(campaign("scissors", [Planted("odd_bump", "left.x", {"h": HEIGHT})], 1), 1)
    assert names(d) == ["straight@left.x"] and d.shapes[0].hypothesis.at == "left.x"
    assert d.verdict == "found" and not d.findings and not d.unknown
    drive = diagnosed(campaign("scissors", [Planted("odd_tanh", "q2", {"h": HEIGHT})], 1), 1)
    machine, seed, planted, _ = planted_case(0)
    narrow = diagnosed(campaign(machine, [planted], seed), seed)
    assert planted.at == "rail.y"
    assert [(d.verdict, names(d)) for d in (drive, narrow)] == [("unknown", [])] * 2


@pytest.mark.parametrize(("number", "at"), [(25, "q1"), (57, "q1"), (63, "rail4.y"), (65, "rail.y")])
def test_a_shape_that_explains_much_more_than_any_name_comes_first(number: int, at: str) -> None:
    """A slope is three quarters of a rise, and no scale; a turn of a carriage has 27 less log evidence than a rise of
    its drive; waves of a guide are seen by a test for shapes, and by no test of the whole; a bump is 50 better."""
    machine, seed, planted, _ = planted_case(number)
    d = diagnosed(campaign(machine, [planted], seed), seed)
    assert planted.at == at and d.verdict == "unknown"
    assert [s.hypothesis.at for s in d.shapes] == [at] and not d.findings


def test_the_height_of_a_guide_is_off_its_reference_line() -> None:
    """A straight line across a guide is its direction, of which data know little beside parameters."""
    (shape,) = diagnosed(STRAIGHT.measured(), STRAIGHT.seed).shapes
    line = 1e-3 * np.array(shape.shape.knots)
    tilted = replace(shape, shape=replace(shape.shape, values=shape.curve + line))
    assert shape.height == approx(tilted.height, rel=1e-9)
    along = replace(tilted, guided=False)
    assert along.height[0] > 10 * shape.height[0] and along.height[1] > 2 * shape.height[1]


def test_words_and_keys_name_it(tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    table.write_text(STRAIGHT.measured().csv_text(), encoding="utf-8")
    done = run("diagnose", SCISSORS, table, "--json")
    for words in ("found 1 effect", "straight@right.x, with a shape of its own", "The guide right.x is not straight."):
        assert words in done.err
    assert [(s["name"], s["effect"]) for s in done.json["unexplained"]] == [("unexplained@right.x", "straight@right.x")]
    assert (done.code, done.json["unknown"]) == (1, [])


@pytest.mark.slow
def test_the_sheet_names_it(tmp_path: Path) -> None:
    table, page = tmp_path / "t.csv", tmp_path / "page.html"
    table.write_text(STRAIGHT.measured().csv_text(), encoding="utf-8")
    run("report", SCISSORS, table, "-o", page)
    text = page.read_text(encoding="utf-8")
    assert "The guide right.x is not straight." in text and "unexplained@right.x.w1" not in text, "weights say nothing"
