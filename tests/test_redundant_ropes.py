"""Redundant drives that hold ropes: set values of least tensions by a statics of its own, for forces of any size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from pkmcal_cli.correction.quadratic_programme import Programme, solve
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.loading.pose_source import PoseSource
from pkmcal_cli.report.console import Reporter
from tests.command import clean, column, run
from tests.redundant_ropes import Ropes, planar, spatial, suspended
from tests.truth.pinned import Array


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def written(file: str, count: int) -> Array:
    """Set values (n, R), m."""
    return np.column_stack([column(file, f"q{i}") for i in range(1, count + 1)]) * 1e-3


def assert_least(true: Ropes, least: float, readings: Array, places: Array) -> None:
    """They hold the platform at the places, with the least tensions that do."""
    for q, place in zip(readings, places, strict=True):
        tensions = true.tensions(q, place)
        assert np.abs(true.wrench(tensions, place)).max() < 1e-5 * tensions.max()
        assert tensions.min() >= least * (1 - 1e-9)
        assert tensions == pytest.approx(true.least(least, place), rel=1e-4)


@pytest.mark.parametrize("least", [1.0, 100.0, 1000.0])
def test_ropes_in_a_level_plane_tighten_though_the_tool_point_is_there_already(least: float) -> None:
    """Without strain the point is where it shall be; whatever tightens the ropes moves it first."""
    true, text = planar(50e3, least)
    Path("m.yaml").write_text(text)
    done = clean(run("correct", "m.yaml", "--grid", "x=300:1700:5,y=200:1300:5", "-o", "c.csv"))
    assert done.code == 0 and "25 of 25 targets corrected" in done.err, done.err
    places = np.column_stack([column("c.csv", f"target.{c}") for c in "xy"]) * 1e-3
    assert_least(true, least, written("c.csv", 4), places)


@pytest.mark.parametrize(
    ("ea", "least", "crossed"),
    [(200e3, 30.0, False), (200e3, 150.0, False), (5e6, 20e3, False), (200e3, 30.0, True), (200e3, 150.0, True)],
)
def test_a_platform_on_eight_ropes(ea: float, least: float, crossed: bool) -> None:
    """Also where forces are large and none is limited, and where the drives that are not redundant do not hold it."""
    true, text = spatial(ea, least, crossed=crossed)
    Path("m.yaml").write_text(text)
    done = clean(run("correct", "m.yaml", "--grid", "25", "-o", "c.csv"))
    assert done.code == 0 and "25 of 25 targets corrected" in done.err, done.err
    places = np.column_stack([column("c.csv", f"target.{c}") for c in "xyz"]) * 1e-3
    assert_least(true, least, written("c.csv", 8), places)


@pytest.mark.parametrize(("least", "choice"), [(20.0, "min-energy"), (24.0, "min-force")])
def test_a_point_that_hangs_on_four_ropes(least: float, choice: str) -> None:
    """The tensions of least squares exceed `t_min`, which is not in the way then; nor is it of least energy."""
    true, text = suspended(least)
    Path("m.yaml").write_text(text)
    grid = "x=-800:800:9,y=-600:600:9,z=500:1500:3"
    done = clean(run("correct", "m.yaml", "--grid", grid, "--redundant", choice, "-o", "c.csv"))
    assert done.code == 0 and "243 of 243 targets corrected" in done.err, done.err
    places = np.column_stack([column("c.csv", f"target.{c}") for c in "xyz"]) * 1e-3
    for q, place in zip(written("c.csv", 4), places, strict=True):
        tensions, feasible = true.tensions(q, place), true.least(least, place)
        assert np.abs(true.wrench(tensions, place)).max() < 1e-5 * tensions.max()
        assert tensions.min() >= least * (1 - 1e-9)
        assert np.abs(true.wrench(feasible, place)).max() < 1e-5 * tensions.max()
        assert choice == "min-energy" or tensions == pytest.approx(feasible, rel=1e-4)


def test_plans_and_analyses_take_the_set_values_that_tension_the_ropes() -> None:
    _, text = spatial(200e3, 100.0)
    Path("m.yaml").write_text(text)
    done = clean(run("plan", "m.yaml", "--grid", "25", "-o", "p.csv"))
    assert done.code == 0 and "note: 25 poses with set values of least forces at which ropes keep `t_min`" in done.err
    measured = {tuple(q) for q in np.round(written("p.csv", 8), 9)}
    clean(run("correct", "m.yaml", "--grid", "25", "-q", "-o", "c.csv"))
    assert measured == {tuple(q) for q in np.round(written("c.csv", 8), 9)}
    found = clean(run("observability", "m.yaml", "--grid", "25", "--json")).json
    stated = {p["name"]: p["std"] for p in found["parameters"]}
    Path("loose.yaml").write_text(text.replace(", t_min: 100.0", ""))
    loose = clean(run("observability", "loose.yaml", "--grid", "25", "--json"))
    assert all(std is not None for std in stated.values())
    assert {p["name"]: p["std"] for p in loose.json["parameters"]} != stated
    assert "note: the set values strain nothing, so ropes may hang loose; state `t_min` of the ropes" in loose.err
    refused = clean(run("plan", "loose.yaml", "--grid", "25"))
    assert refused.code == 3 and "help: " in refused.err and "state `t_min` of the ropes" in refused.err


def test_drawn_where_the_ropes_hold_it() -> None:
    """The reference configuration and a pose of a grid, with forces by statics; without `t_min` nothing stays there."""
    true, text = spatial(200e3, 100.0)
    Path("m.yaml").write_text(text)
    grid = ("--grid", "x=300:300:1,y=-200:-200:1,z=1000:1000:1")
    for place, more in ((true.home, ()), (np.array([0.3, -0.2, 1.0]), grid)):
        found = clean(run("draw", "m.yaml", *more, "--json"))
        assert found.code == 0 and "drawn with set values of least forces at which ropes keep `t_min`" in found.err
        assert [d["force"] for d in found.json["drives"]] == pytest.approx(true.least(100.0, place), rel=1e-4)
        (platform,) = (p for p in found.json["places"] if p["name"] == "platform")
        assert platform["believed"] == pytest.approx(place, abs=1e-9)
        assert np.abs(platform["displacement"]).max() < 1e-3  # um
    Path("loose.yaml").write_text(text.replace(", t_min: 100.0", ""))
    loose = clean(run("draw", "loose.yaml", "--json"))
    assert loose.code == 3 and "help: " in loose.err and "state `t_min` of the ropes" in loose.err


def test_some_poses_keep_the_targets_they_were_given() -> None:
    _, text = planar(50e3, 100.0)
    Path("m.yaml").write_text(text)
    loaded = load_machine("m.yaml")
    source = PoseSource(loaded=loaded, to=Reporter(quiet=True), path=None, grid="x=300:1700:3,y=200:1300:2")
    some = source.together().take(np.array([4, 1]))
    assert some.targets is not None
    assert some.targets[:, :2] == pytest.approx(np.array([[1.7, 0.2], [0.3, 1.3]]), abs=1e-12)


def test_a_table_of_poses_that_cannot_be_tensioned_is_refused_and_set_values_stay() -> None:
    _, text = planar(50e3, 100.0)
    Path("m.yaml").write_text(text)
    Path("t.csv").write_text("x,y\n500,500\n2500,700\n")
    done = clean(run("plan", "m.yaml", "t.csv"))
    assert done.code == 3 and "t.csv:3: " in done.err and "`t_min` of rope `r" in done.err
    made = clean(run("correct", "m.yaml", "--grid", "x=300:1700:3,y=200:1300:3", "-q", "-o", "c.csv"))
    assert made.code == 0
    done = clean(run("plan", "m.yaml", "c.csv", "-o", "p.csv"))
    assert done.code == 0 and "with set values of least forces" not in done.err
    there, stated = np.unique(written("p.csv", 4), axis=0), np.unique(written("c.csv", 4), axis=0)
    assert there == pytest.approx(stated, abs=1e-9)  # plans have nine digits


def test_the_remedy_of_a_grid_without_set_values_is_that_of_the_reason() -> None:
    """The grid surrounds the pose in which the machine is drawn: its limits are not the cause."""
    _, text = spatial(200e3, 30.0)
    Path("m.yaml").write_text(text.replace("zero: home", "zero: home, force_limit: 60"))
    done = clean(run("correct", "m.yaml", "--grid", "x=-50:50:3,y=-50:50:3"))
    assert done.code == 3 and "`force_limit` of `q1`" in done.err
    assert "help: limits leave no room at any point: raise `force_limit`" in done.err
    Path("m.yaml").write_text(text)
    done = clean(run("correct", "m.yaml", "--grid", "x=-400:-300:2", "--redundant", "nominal"))
    assert done.code == 3 and "slack ropes" in done.err
    assert "help: with `--redundant min-force` or `min-energy` no rope is slack" in done.err


def test_a_target_at_home_that_limits_refuse_is_in_no_other_unit() -> None:
    """A factor to nearer home would always do; what is in the way is the limit."""
    _, text = planar(50e3, 100.0)
    Path("m.yaml").write_text(text.replace("zero: home", "zero: home, force_limit: 60"))
    Path("t.csv").write_text("x [mm],y [mm]\n1000,760\n1200,800\n")
    done = clean(run("correct", "m.yaml", "t.csv", "-o", "c.csv"))
    assert done.code == 1 and "`force_limit` of `q3`" in done.err and "times as large" not in done.err


def test_remedies_of_slack_ropes_do_not_come_from_rounding() -> None:
    """Without weight and `t_min` no rope has a tension at any target; who has stated `t_min` is not told to."""
    _, text = planar(50e3, 100.0)
    Path("m.yaml").write_text(text.replace(", t_min: 100.0", ""))
    done = clean(run("correct", "m.yaml", "--grid", "x=300:1700:3,y=200:1300:3", "-o", "c.csv"))
    assert "ropes hardly taut: 9 of 9 targets" in done.err and "{t_min: 10 N}" in done.err, done.err
    _, text = spatial(200e3, 100.0)
    Path("m.yaml").write_text(text)
    stated = clean(run("check", "m.yaml")).err
    assert "help: set values that tension the ropes hold it" in stated and "state `t_min`" not in stated, stated
    Path("m.yaml").write_text(text.replace(", t_min: 100.0", ""))
    assert "as `pkmcal correct` gives them; state `t_min` of the ropes" in clean(run("check", "m.yaml")).err


def test_tensions_that_no_rope_bears_are_refused_in_words() -> None:
    """Of 150 times EA: no prediction is left at the end, and so no rope whose bound has a name there."""
    _, text = spatial(200e3, 3e7)
    Path("m.yaml").write_text(text)
    done = clean(run("correct", "m.yaml", "--grid", "5"))
    assert done.code == 3 and "none of 5 grid points can be used" in done.err


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("objective", [1e-6, 1.0, 1e6])
def test_units_of_a_programme_do_not_matter(unit: float, objective: float) -> None:
    """Of its unknowns and of its objective: the optimum is that of another solver."""
    rng = np.random.default_rng(4)
    root, slope, matrix = rng.normal(size=(2, 2)), 1e3 * rng.normal(size=2), rng.normal(size=(6, 2))
    curvature, bound = root @ root.T + np.eye(2), rng.uniform(-1.0, 3.0, 6)
    asked = Programme(
        curvature=objective * curvature[None] * unit**2, slope=objective * slope[None] * unit,
        matrix=matrix[None] * unit, bound=bound[None],
    )  # fmt: skip
    other = minimize(
        lambda y: 0.5 * y @ curvature @ y + slope @ y, np.zeros(2), method="SLSQP",
        constraints={"type": "ineq", "fun": lambda y: bound - matrix @ y}, options={"ftol": 1e-14, "maxiter": 500},
    ).x  # fmt: skip
    found = solve(asked)
    assert found.excess[0] < 1e-7 and unit * found.y[0] == pytest.approx(other, rel=1e-5)  # as SLSQP ends


@pytest.mark.parametrize("steep", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("count", [2, 4, 8])
def test_programmes_of_one_unknown_end_at_the_nearest_bound(steep: float, count: int) -> None:
    """Among thousands of any proportions none that goes round in circles and is told to have no solution."""
    rng, many = np.random.default_rng(1), 4000
    matrix = steep * rng.normal(size=(many, count))
    slope = rng.normal(size=many) * rng.choice([0.01, 1.0, 100.0], many) / steep
    room = rng.exponential(size=(many, count)) * rng.choice([1e-3, 1.0], (many, count))
    bound = matrix * rng.normal(size=(many, 1)) / steep + room
    curvature = np.ones((many, 1, 1))
    found = solve(Programme(curvature=curvature, slope=slope[:, None], matrix=matrix[..., None], bound=bound))
    ends = bound / matrix
    low = np.where(matrix < 0, ends, -np.inf).max(axis=1)
    high = np.where(matrix > 0, ends, np.inf).min(axis=1)
    assert found.excess.max() < 1e-9
    assert found.y[:, 0] * steep == pytest.approx(np.clip(-slope, low, high) * steep, rel=1e-6, abs=1e-6)
