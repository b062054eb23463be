"""Pictures of a large machine before an instrument that stands anywhere: axes, headings, parameters without a range."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.residual import evaluate
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.pictures.error_map import PlaneErrors, error_map, places_of
from tests.command import MACHINES, run
from tests.drawn import collisions, figure_of
from tests.test_plots import MM, TITLES, grid, quivers

SET_VALUES = "set values of the nominal machine"


def corrected(left: float, heading: str = "corrected") -> PlaneErrors:
    """Errors of 2 mm, of which this share is left."""
    errors = 2e-3 * np.random.default_rng(1).normal(size=grid().shape)
    return PlaneErrors("xy", grid(size=3.0), ((SET_VALUES, errors), (heading, left * errors)), np.nan)


@pytest.mark.parametrize("left", [0.5, 1e-2, 1e-9, 0.0])
def test_headings_of_panels_do_not_lie_on_each_other(left: float) -> None:
    """Two panels, or three where what is left is shown magnified; also under a long name."""
    for heading in ("corrected", "corrected with all that was identified and with straight@rail2.z, sag@cross.z"):
        picture = error_map([corrected(left, heading)], TITLES, MM)
        assert collisions(picture) == []
        with figure_of(picture) as (_, texts):
            assert any(" mm rms" in t.text for t in texts)


def test_what_solving_leaves_is_not_shown_as_errors() -> None:
    """2e-12 m of 2 mm: rounding of the set values, neither magnified nor a number with eight zeros."""
    with figure_of(error_map([corrected(1e-9)], TITLES, MM)) as (figure, texts):
        assert len([q for q, _ in quivers(figure) if len(grid()) == q.N]) == 2
        assert "corrected: 0 um rms" in {t.text for t in texts}


@pytest.fixture
def hall(tmp_path: Path) -> Path:
    """The shipped gantry before a tracker that stands anywhere."""
    file = tmp_path / "hall.yaml"
    file.write_text(f"extends: {MACHINES / 'gantry.yaml'}\nsensors: {{tracker: {{frame: fitted}}}}\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("fitted", [True, False])
def test_axes_of_an_instrument_are_not_taken_for_those_of_the_machine(hall: Path, fitted: bool) -> None:
    loaded = load_machine(str(hall) if fitted else str(MACHINES / "gantry.yaml"))
    problem = problem_of(loaded.model, load_measurements(loaded, [str(MACHINES / "gantry.csv")]))
    (first, second) = places_of(problem, [("before", evaluate(problem, loaded.model.nominal, ()).residual)])
    with figure_of(error_map([first, second], TITLES, MM)) as (figure, _):
        names = {label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel()) if label}
    of = " of tracker" if fitted else ""
    assert names == {f"{letter}{of} [mm]" for letter in "xyz"}


def test_parameters_without_a_range_do_not_squeeze_those_with_one(hall: Path, tmp_path: Path) -> None:
    """`observability --plot`: where the tracker stands is known to 1e-8 of its range of 100 m, which nobody stated."""
    target = tmp_path / "o.svg"
    done = run("observability", hall, MACHINES / "gantry.csv", "--plot", target, "-q")
    assert done.code in (0, 1), done.err
    drawn = target.read_text(encoding="utf-8")
    assert "<!-- y1 -->" in drawn or ">y1<" in drawn
    assert "frame@tracker" not in drawn
