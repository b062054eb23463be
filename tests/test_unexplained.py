"""Displacements without a name: the shape, its entries in machine files, how they are found and what they predict."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve
from typer.testing import CliRunner

from pkmcal_cli.app import app
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.measured_problem import problem_of
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.waterfall import waterfall
from pkmcal_cli.effects.unexplained import FreeShape
from pkmcal_cli.loading.load_machine import load_machine, load_measurements
from pkmcal_cli.pictures.diagnosis_pictures import diagnosis_picture, diagnosis_pictures
from pkmcal_cli.pictures.shape_picture import curve_of
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.unknown_shapes import between_knots, outside_knots
from pkmcal_cli.units.file_units import FileUnits
from tests.benchmark.setting import FOLDER, diagnosed
from tests.drawn import collisions
from tests.nameless_campaigns import planted_case
from tests.truth.campaigns import Campaign, Planted, Scenario, campaign

pytestmark = pytest.mark.usefixtures("unsized")

KNOTS = (0.0, 0.1, 0.25, 0.3)
HEIGHT = 50e-6


def kernel(a: np.ndarray, b: np.ndarray, width: float, knots: np.ndarray) -> np.ndarray:
    """Rasmussen and Williams 2006, eq. 4.17, and a line whose level and rise have three times its variance."""
    r = np.sqrt(3) * np.abs(a[:, None] - b) / width
    u, v = (np.interp(x, knots[[0, -1]], [-1.0, 1.0]) for x in (a, b))
    return 3 * (1 + np.outer(u, v)) + (1 + r) * np.exp(-r)


def test_a_shape_is_the_conditional_mean_of_its_process() -> None:
    """Textbook kriging (eq. 2.25, 2.26 without noise): mean and variance between, at and beyond the knots."""
    knots, values = np.array(KNOTS), np.array([1.0, -2.0, 0.5, 3.0]) * 1e-6
    shape = FreeShape(knots=KNOTS, spread=2e-6, width=0.08, values=values)
    x = np.array([-0.5, 0.0, 0.05, 0.1, 0.2, 0.3, 0.9])
    prior = 4e-12 * (kernel(knots, knots, 0.08, knots) + 1e-8 * np.eye(4))
    across = 4e-12 * kernel(x, knots, 0.08, knots)
    assert np.allclose(shape.basis(x) @ shape.weights, across @ solve(prior, values), atol=1e-15)
    before = 4e-12 * np.diag(kernel(x, x, 0.08, knots))
    variance = before - np.einsum("nk,kn->n", across, solve(prior, across.T))
    assert np.allclose(shape.missing_variance(x), np.maximum(variance, 0.0), atol=1e-18)
    assert np.allclose(shape.basis(knots) @ shape.weights, values, atol=1e-12)


def test_far_beyond_its_knots_a_shape_is_as_uncertain_as_before() -> None:
    shape = FreeShape(knots=KNOTS, spread=2e-6, width=0.02)
    assert shape.missing_variance(np.array([40.0]))[0] > 0.9 * 4e-12
    assert shape.missing_variance(np.array([0.1]))[0] < 1e-6 * 4e-12


def test_weights_are_independent_before_and_after_measuring() -> None:
    """F diagonalises both: F F^T is the covariance before, F diag(s^2) F^T the one that is known."""
    rng = np.random.default_rng(1)
    root = 0.2e-6 * rng.normal(size=(4, 4))
    shape = FreeShape(knots=KNOTS, spread=2e-6, width=0.08, values=np.zeros(4), covariance=root @ root.T)
    assert np.allclose(shape.factor @ shape.factor.T, shape.prior, rtol=1e-9, atol=1e-24)
    known = shape.factor @ np.diag(shape.known_std**2) @ shape.factor.T
    assert np.allclose(known, root @ root.T, rtol=1e-6, atol=1e-20)


def test_derivatives_of_a_shape_are_those_of_its_formula() -> None:
    shape = FreeShape(knots=KNOTS, spread=2e-6, width=0.08)
    x, step = np.array([-0.1, 0.04, 0.1, 0.17, 0.5]), 1e-7
    exact = np.imag(shape.basis(x + 1e-30j)) / 1e-30
    assert np.allclose(exact, (shape.basis(x + step) - shape.basis(x - step)) / (2 * step), atol=1e-9)


# --- in machine files --------------------------------------------------------------------


def machine(folder: Path, entries: str) -> Path:
    """The Scissors with a shape at q2."""
    file = folder / "shaped.yaml"
    file.write_text(f"extends: {FOLDER / 'scissors.yaml'}\neffects:\n  unexplained@q2:\n{entries}", encoding="utf-8")
    return file


SHAPE = """    knots: [-1100, -1000, -900, -800, -700]
    values: [0.010, -0.005, 0.02, 0, 0.01]
    spread: 0.02
    width: 150
"""


def test_a_declared_shape_moves_its_drive(tmp_path: Path) -> None:
    """The readings are those of the machine whose drive reads as much more: values at knots, in the file's mm."""
    shaped = load_machine(str(machine(tmp_path, SHAPE))).model
    plain = load_machine(str(FOLDER / "scissors.yaml")).model
    at_knot = plain.reference_readings.copy()
    a = [d.name for d in plain.actuators].index("q2")
    at_knot[a] = -0.9
    moved = at_knot.copy()
    moved[a] += 0.02e-3
    with_shape = predict(shaped, shaped.nominal, Rows.at(at_knot[None])).values
    assert np.allclose(with_shape, predict(plain, plain.nominal, Rows.at(moved[None])).values, atol=1e-12)


def test_weights_are_held_unless_they_are_selected(tmp_path: Path) -> None:
    model = load_machine(str(machine(tmp_path, SHAPE))).model
    weights = {n for n in model.names if n.startswith("unexplained@q2.")}
    assert len(weights) == 5
    for text in ("auto", "all", "*"):
        assert not weights & set(select(model, text)), text
    for text in ("auto,unexplained@q2", "auto,unexplained@*", "auto,unexplained@q2.*", "auto,unexplained@q2.w1"):
        assert weights <= set(select(model, text)), text
    assert not weights & set(select(model, "auto,unexplained@q2,-unexplained@q2"))


def test_rows_outside_the_knots_are_counted_and_uncertain(tmp_path: Path) -> None:
    """What is not known of the shape, times what the drive's position does to the readings (by differences)."""
    model = load_machine(str(machine(tmp_path, SHAPE))).model
    plain = load_machine(str(FOLDER / "scissors.yaml")).model
    rows = Rows.at(measured("tanh", "q2").conditions.q)
    a = [d.name for d in model.actuators].index("q2")
    x = rows.readings[:, a]
    assert outside_knots(model, rows) == {"unexplained@q2": int(((x < -1.1) | (x > -0.7)).sum())}
    assert not outside_knots(plain, rows) and not between_knots(plain, plain.nominal, rows, None).any()
    shape = FreeShape(
        knots=(-1.1, -1.0, -0.9, -0.8, -0.7), spread=20e-6, width=0.15, values=1e-6 * np.array([10, -5, 20, 0, 10])
    )
    there, further = rows.readings.copy(), rows.readings.copy()  # of a machine whose drive reads what the shape adds
    there[:, a] += shape.basis(x) @ shape.weights
    further[:, a] = there[:, a] + 1e-6
    readings = [predict(plain, plain.nominal, Rows.at(each)).values for each in (there, further)]
    expected = ((readings[1] - readings[0]) / 1e-6) ** 2 * shape.missing_variance(x)[:, None]
    assert np.allclose(between_knots(model, model.nominal, rows, None), expected, rtol=1e-4, atol=1e-17)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"knots": "knots: [-1100, -900, -1000, -800, -700]"}, "`knots` must rise"),
        ({"knots": "knots: [-1100, -1000]"}, "`knots` must have 3 to 200 places, not 2"),
        ({"values": "values: [0, 0]"}, "`values` has 2 numbers for 5 knots"),
        ({"values": "values: 3"}, "`values` must be a list of numbers"),
        ({"spread": "spread: -0.02"}, "`spread` must be a positive number"),
        ({"spread": ""}, "`unexplained@q2` needs `spread`"),
        ({"width": "width: 3 N"}, "force"),
        ({"width": "width: 150\n    cov: [[1, 0], [0, 1]]"}, "`cov` must have 5 rows of 5 numbers"),
        ({"width": "width: 150\n    cov: 3"}, "`cov` must be a list of rows"),
        ({"width": "width: 150\n    wdth: 3"}, "`unexplained` has no entry `wdth`"),
    ],
)
def test_entries_that_are_no_shape_are_told(tmp_path: Path, changed: dict[str, str], told: str) -> None:
    lines = [line.strip() for line in SHAPE.splitlines()]
    text = "".join(f"    {changed.get(line.partition(':')[0], line)}\n" for line in lines)
    result = CliRunner().invoke(app, ["check", str(machine(tmp_path, text))])
    assert result.exit_code in (1, 3) and told in result.output + result.stderr, result.output + result.stderr
    assert "help:" in result.output + result.stderr


def test_a_covariance_that_is_none_is_told(tmp_path: Path) -> None:
    rows = ", ".join(str([float(2 * (i + j == 4)) for j in range(5)]) for i in range(5))
    result = CliRunner().invoke(app, ["check", str(machine(tmp_path, f"{SHAPE}    cov: [{rows}]\n"))])
    assert "`cov` is no covariance" in result.output + result.stderr


def test_a_place_that_is_none_is_told(tmp_path: Path) -> None:
    file = machine(tmp_path, SHAPE)
    file.write_text(file.read_text(encoding="utf-8").replace("@q2", "@left.x:time"), encoding="utf-8")
    result = CliRunner().invoke(app, ["check", str(file)])
    assert "`unexplained` cannot be placed at `left.x:time`" in result.output + result.stderr


# --- found in measurements ---------------------------------------------------------------


@cache
def measured(law: str, at: str) -> Campaign:
    """The Scissors with a displacement that no catalogue has."""
    return campaign("scissors", [Planted(f"odd_{law}", at, {"h": HEIGHT})], 1)


@cache
def diagnosis(law: str, at: str) -> Diagnosis:
    return diagnosed(measured(law, at), 1)


@pytest.mark.parametrize(("law", "at"), [("tanh", "q2"), ("step", "q4")])
def test_the_place_of_an_odd_shape_is_found(law: str, at: str) -> None:
    d = diagnosis(law, at)
    assert d.verdict == "unknown" and d.shapes[0].hypothesis.at == at
    assert not [f for f in d.findings if not f.provisional]


@pytest.mark.parametrize(("number", "law"), [(36, "odd_step"), (72, "odd_tanh")])
def test_a_named_effect_that_explains_much_of_a_shape_does_not_take_its_rest(number: int, law: str) -> None:
    """A step of a drive is two thirds a slope, which a turn of its carriage explains: the rest is no odd turn, and
    beside the whole step there is no turn. Of the other, the direction of the bed takes a part, which is not needed."""
    machine, seed, planted, _ = planted_case(number)
    d = diagnosed(campaign(machine, [planted], seed), seed)
    assert (machine, planted.keyword, planted.at) == ("triglide", law, "q1")
    assert d.verdict == "unknown" and [s.hypothesis.at for s in d.shapes] == ["q1"] and not d.findings


def test_it_leaves_nothing_but_noise() -> None:
    fit = diagnosis("tanh", "q2").search.fit
    assert 0.8 < fit.chi2_per_dof < 1.2  # before: 65


def test_the_steps_to_noise_end_with_it() -> None:
    last = waterfall(diagnosis("tanh", "q2"))[-1]
    assert last.name == "+ unexplained@q2" and 0.9 < last.noise < 1.1  # 192 poses


def test_parameters_beside_it_hold_within_their_uncertainties() -> None:
    """At 1.96 standard uncertainties one of 20 would be outside; of 9, four standard uncertainties hold all."""
    d = diagnosis("tanh", "q2")
    fit, names = d.search.fit, d.search.problem.model.names
    for name, true in measured("tanh", "q2").parameters.items():
        if name in fit.selected:
            std = fit.std[fit.selected.index(name)]
            assert abs(fit.values[names.index(name)] - true) < 4 * std, name


def test_the_curve_and_its_band_are_drawn_as_kriging_gives_them() -> None:
    """Between knots known with a covariance, and beyond (Rasmussen and Williams 2006, eq. 2.25, 2.26)."""
    shape = diagnosis("tanh", "q2").shapes[0]
    assert shape.shape.values is not None and shape.shape.covariance is not None
    knots, width, spread = np.array(shape.shape.knots), shape.shape.width, shape.shape.spread
    x = np.concatenate([knots[:1] - 0.3 * width, 0.5 * (knots[1:] + knots[:-1])])
    prior = spread**2 * (kernel(knots, knots, width, knots) + 1e-8 * np.eye(len(knots)))
    gain = solve(prior, spread**2 * kernel(knots, x, width, knots)).T
    variance = spread**2 * np.diag(kernel(x, x, width, knots)) - np.einsum("nk,nk->n", gain @ prior, gain)
    variance += np.einsum("nk,nk->n", gain @ shape.shape.covariance, gain)
    middle, std = curve_of(shape, x)
    assert np.allclose(middle, gain @ shape.shape.values, atol=1e-9 * HEIGHT)
    assert np.allclose(std, np.sqrt(variance), rtol=1e-3)
    assert std[0] > std[1:].max()  # less is known beyond the knots


@pytest.mark.parametrize("whole", [True, False])
def test_its_picture_has_no_text_on_text(whole: bool) -> None:
    d, named = diagnosis("tanh", "q2"), titles("scissors.yaml", "diagnosis", ["t.csv"])
    units = FileUnits.of({"length": "mm"})
    pictures = [diagnosis_picture(d, named, units)] if whole else list(diagnosis_pictures(d, named, units))
    drawn = [p for p in pictures if whole or p.name == "unexplained@q2"]
    assert len(drawn) == 1 and collisions(drawn[0]) == []
    assert "unexplained@q2: deviation over the reading of q2, up to" in drawn[0].alt


def test_a_named_effect_keeps_its_name() -> None:
    """The simulator's pitch error has a ripple that its formula lacks; it is its own shape, and nothing unknown."""
    d = diagnosed(campaign("triglide", [Planted("pitch_curve", "q2", {"p2": 40e-6, "p3": -25e-6})], 3), 3)
    assert not d.shapes and "pitch_curve@q2" in [f.hypothesis.name for f in d.findings]


@pytest.mark.slow
def test_a_smooth_field_over_the_workspace_has_no_place_in_the_machine() -> None:
    d = diagnosed(campaign("scissors", [Planted("smooth_field", "grid", {"rms": 2e-6})], 4), 4)
    assert d.verdict == "unknown" and not d.shapes


ONLY = ("--only", "backlash@q2,scale@q2,windup@all,unexplained@q2")


def test_improve_writes_what_calibrate_reads(tmp_path: Path) -> None:
    """Machine file and parameters give the predictions of the fit; on other poses the error is noise alone."""
    table, other, out = tmp_path / "t.csv", tmp_path / "o.csv", tmp_path / "improved.yaml"
    table.write_text(measured("tanh", "q2").csv_text(), encoding="utf-8")
    second = campaign("scissors", [Planted("odd_tanh", "q2", {"h": HEIGHT})], 1, scenario=Scenario(stream=1))
    other.write_text(second.csv_text(), encoding="utf-8")
    runner = CliRunner()
    done = runner.invoke(app, ["improve", str(FOLDER / "scissors.yaml"), str(table), *ONLY, "-o", str(out)])
    assert out.exists(), done.output + done.stderr
    assert "improved by unexplained@q2" in done.output + done.stderr
    loaded = load_machine(str(out))
    problem = problem_of(loaded.model, load_measurements(loaded, [str(other)]))
    fitted = problem_of(loaded.model, load_measurements(loaded, [str(table)]))
    model = loaded.model
    options = FitOptions()
    found = calibrated(fitted, select(model, "auto"), model.nominal, options, np.zeros(len(fitted), dtype=int))
    noise = second.sigma
    assert found.robust.fit.chi2_per_dof < 1.2
    there = predict(model, found.robust.fit.values, problem.rows).values
    assert np.sqrt(((there - problem.readings) ** 2).mean(axis=0)).max() < 1.2 * noise.max()
    free = calibrated(
        fitted, select(model, "auto,unexplained@q2"), model.nominal, options, np.zeros(len(fitted), dtype=int)
    )
    assert np.allclose(predict(model, free.robust.fit.values, problem.rows).values, there, atol=noise.max()), (
        "with its prior, the shape comes out of the same rows again"
    )
