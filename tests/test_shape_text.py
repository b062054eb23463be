"""Displacements without a name as they are said and written: how high they are, knots, log evidence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.report.shape_text import enclosing
from tests.benchmark.setting import diagnosed
from tests.command import TRIGLIDE, Done, clean, run
from tests.computed_once import run_once
from tests.truth.campaigns import Campaign, Planted, campaign

pytestmark = pytest.mark.usefixtures("unsized")

RISE = 60e-6


@pytest.fixture(scope="module")
def measured() -> Campaign:
    """The Triglide with a rise in q2 by an independent simulator."""
    return campaign("triglide", [Planted("odd_tanh", "q2", {"h": RISE})], 3)


@pytest.fixture(scope="module")
def diagnosis(measured: Campaign) -> Diagnosis:
    return diagnosed(measured, 3)


@pytest.fixture(scope="module")
def written(measured: Campaign, tmp_path_factory: pytest.TempPathFactory) -> tuple[Done, Path, Path]:
    """`improve` with rows apart, so that it searches once, the machine that it wrote, and the table."""
    folder = tmp_path_factory.mktemp("shape")
    table, apart, machine = folder / "t.csv", folder / "apart.csv", folder / "better.yaml"
    head, *rows = measured.csv_text().splitlines(keepends=True)
    for file, part in ((table, slice(0, 144)), (apart, slice(144, None))):
        file.write_text(head + "".join(rows[part]), encoding="utf-8")
    options = ("--validation", apart, "--only", "unexplained@q2", "-o", machine)
    return clean(run_once("improve", TRIGLIDE, table, *options)), machine, table


def test_the_height_of_a_clear_rise_does_not_drown_in_its_level(diagnosis: Diagnosis) -> None:
    """What parameters take up of the level is uncertain, the rise is not: its truth is within three uncertainties."""
    (shape,) = diagnosis.shapes
    height, std = shape.height
    assert abs(height - RISE) < 3 * std
    assert height > 6 * std, "a clear rise"
    assert std < 0.5 * shape.std[shape.extremes[0]], "its level is"


def test_what_is_modelled_is_not_left_and_has_evidence(written: tuple[Done, Path, Path]) -> None:
    done, machine, _ = written
    text = machine.read_text(encoding="utf-8")
    assert "unexplained@q2:" in text and "log evidence nan" not in text
    assert "not modelled" not in done.err + done.out
    assert "provisional: the cause of unexplained@q2 is unknown" in done.err + done.out


def test_the_table_that_it_came_from_is_within_its_knots(written: tuple[Done, Path, Path]) -> None:
    _, machine, table = written
    done = clean(run("calibrate", machine, table, "--holdout", "none"))
    assert "outside its knots" not in done.err + done.out


def test_written_knots_enclose_the_axis_that_they_span() -> None:
    rng = np.random.default_rng(1)
    for size in np.logspace(-3, 6, 200):
        knots = np.sort(rng.normal(size=4)) * size
        first, *inner, last = map(float, enclosing(knots.tolist()).split(", "))
        assert first <= knots[0] and last >= knots[-1]
        assert np.allclose([first, *inner, last], knots, rtol=2e-6)
    assert enclosing([0.0, 418.326092, 418.326092]) == "0, 418.3261, 418.3261"
    assert enclosing([418.3261, 500, 950.4719]) == "418.3261, 500, 950.4719"
