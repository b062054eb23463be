"""Branches of redundant machines: ranges of any width, methods of the paper, drives of what the tool does not show."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.residual import chi_square, evaluate
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.singular_drives import singular_drives
from pkmcal_cli.prediction import Method, Request, Rows, predict, solving
from pkmcal_cli.prediction.common_pose import CommonPose
from tests.benchmark.setting import ready
from tests.command import MACHINES, run
from tests.in_ci import in_ci
from tests.test_spoilt_tables import far_off, spoilt
from tests.truth.campaigns import Scenario, campaign
from tests.truth.redundant import DEG

FEET = np.array([[-0.6, -0.45], [0.6, -0.45], [0.6, 0.45], [-0.6, 0.45]])
PLATE = np.array([[-0.12, -0.08], [0.12, -0.08], [0.12, 0.08], [-0.12, 0.08]])
CROOKED = (
    np.array([[-0.7, -0.42], [0.65, -0.5], [0.72, 0.48], [-0.6, 0.53]]),
    np.array([[-0.14, -0.06], [0.11, -0.09], [0.1, 0.08], [-0.13, 0.095]]),
)
OFFSET = 0.1
COUNT, SOME = 150, 50
SLIDE = "  car: {guide: rail, at: 0, points: {C: [0, 0]}}\nguides: {rail: {at: [0, 900]}}\n"
STACKED = "  car: {guide: rail, at: 0, points: {tip: [0, 30]}}\nguides: {rail: {body: plate}}\n"


def text(
    redundant: int,
    wide: float,
    more: str = "",
    drive: str = "",
    tool: str = "tool",
    corners: tuple[Array, Array] = (FEET, PLATE),
) -> str:
    """A platform on four legs in the plane; ranges of `wide` mm."""
    ground = ", ".join(f"B{i}: [{1e3 * x:g}, {1e3 * y:g}]" for i, (x, y) in enumerate(corners[0], 1))
    plate = ", ".join(f"P{i}: [{1e3 * x:g}, {1e3 * y:g}]" for i, (x, y) in enumerate(corners[1], 1))
    drives = "".join(
        f"  q{i}: {{drives: leg{i}, offset: o{i}{', redundant: true' * (i == redundant)}}}\n" for i in range(1, 5)
    )
    return (
        "units: {length: mm, angle: deg, force: N}\nspace: planar\n"
        f"ranges: {{length: {wide}}}\nground: {{{ground}}}\n"
        f"bodies:\n  plate: {{at: [0, 0], points: {{{plate}, tool: [0, 0]}}}}\n{more}"
        'parameters: {"o{i}": {each: {i: [1, 2, 3, 4]}, nominal: 100}}\n'
        'bars: {"leg{i}": {each: {i: [1, 2, 3, 4]}, between: ["B{i}", "P{i}"], EA: 20 MN}}\n'
        f"actuators:\n{drives}{drive}"
        f"sensors:\n  t: {{at: {tool}, reads: [x, y, rz], frame: machine, "
        "sigma: {position: 1 um, orientation: 1 urad}}\n"
    )


def built(folder: Path, written: str) -> Model:
    (folder / "m.yaml").write_text(written, encoding="utf-8")
    return load_machine(str(folder / "m.yaml")).model


@cache
def poses() -> tuple[Array, Array]:
    """Poses (n, 3) turned by up to 25 deg, and what the legs' drives read there (n, 4)."""
    rng = np.random.default_rng(0)
    pose = rng.uniform(-1, 1, (COUNT, 3)) * [0.2, 0.2, 25 * DEG]
    return pose, read(pose, FEET, PLATE)


def read(pose: Array, feet: Array, plate: Array) -> Array:
    """What the legs' drives read at poses (n, 3), (n, 4)."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    points = np.einsum("nij,kj->nki", turn, plate) + pose[:, None, :2]
    return np.asarray(np.linalg.norm(points - feet, axis=2) - OFFSET)


@pytest.mark.parametrize(
    ("wide", "redundant", "method"),
    in_ci(
        ["0.1-1-rigid", "1.0-3-linear", "20.0-1-exact", "20.0-3-exact"],
        product([0.1, 1.0, 20.0], [1, 3], ["exact", "linear", "rigid"]),
    ),
)
def test_ranges_do_not_excuse_another_assembly(wide: float, redundant: int, method: Method, tmp_path: Path) -> None:
    """All drives agree on one pose, however little is known of the machine: that one and no other is found."""
    pose, readings = poses()
    m = built(tmp_path, text(redundant, wide))
    found = predict(m, m.nominal, Rows.at(readings), Request(method=method))
    assert found.solved.all()
    assert np.abs(found.values - pose).max() < 1e-9


@pytest.mark.parametrize("redundant", in_ci(["1", "4"], [1, 2, 3, 4]))
def test_assemblies_next_to_each_other_are_told_apart(redundant: int, tmp_path: Path) -> None:
    """Near poses at which all four legs are nearly singular, another pose fits within 1 mm; the right one fits exactly.

    The farther a pose is from singular ones, the more misfit another assembly has: about the square of the distance.
    """
    pose = np.random.default_rng(0).uniform(-1, 1, (400, 3)) * [0.2, 0.2, 25 * DEG]
    m = built(tmp_path, text(redundant, 1.0, corners=CROOKED))
    found = predict(m, m.nominal, Rows.at(read(pose, *CROOKED)))
    assert found.solved.all()
    assert np.abs(found.values - pose).max() < 1e-9


@pytest.mark.parametrize("moved", [0.0, 0.01])
def test_what_is_known_of_a_pose_holds_nearby_only(
    moved: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pose seen to be far from singular ones is not looked at again before it has moved; then it is."""
    pose, readings = (part[:SOME] for part in poses())
    m = built(tmp_path, text(1, 1.0))
    apart = 1e-4 * np.array([1, -1, 1, -1])  # m, of the legs: what no pose takes up is misfit
    start = predict(m, m.nominal, Rows.at(readings + apart)).start
    seen = np.nonzero(start.misfit > 0)[0]
    assert len(seen) > 0.9 * SOME
    looked: list[int] = []
    other_near = solving.no_other_near

    def counted(model: Model, numbers: SystemNumbers, state: State, misfit: Array) -> NDArray[np.bool_]:
        looked.append(int(np.isfinite(misfit).sum()))
        return other_near(model, numbers, state, misfit)

    monkeypatch.setattr(solving, "no_other_near", counted)
    shifted = read(pose[seen] + np.array([moved, 0, 0]), FEET, PLATE) + apart
    again = predict(m, m.nominal, Rows.at(shifted), start=start.take(seen))
    assert sum(looked) > 0.9 * len(seen) if moved else not sum(looked)
    cold = predict(m, m.nominal, Rows.at(shifted))
    assert (again.status == cold.status).all()
    np.testing.assert_allclose(again.values, cold.values, atol=1e-12)


@pytest.mark.parametrize(
    ("stacked", "redundant"),
    in_ci(
        ["beside-1", "beside-4", "on the platform-2"],
        product([False, True], [1, 2, 3, 4]),
        lambda value: ("beside", "on the platform")[value] if isinstance(value, bool) else str(value),
    ),
)
def test_an_axis_that_the_tool_does_not_show(stacked: bool, redundant: int, tmp_path: Path) -> None:
    """A slide beside the platform, or one on it that carries the tool: four freedoms, of which a point shows three."""
    pose, readings = poses()
    travel = np.random.default_rng(1).uniform(-0.3, 0.3, COUNT)
    more = (STACKED, "  s: {moves: car}\n", "tip") if stacked else (SLIDE, "  s: {moves: car}\n")
    m = built(tmp_path, text(redundant, 0.1, *more))
    found = predict(m, m.nominal, Rows.at(np.column_stack([readings, travel])))
    c, s, true = np.cos(pose[:, 2]), np.sin(pose[:, 2]), pose.copy()
    if stacked:
        true[:, 0] += c * travel - s * 0.03
        true[:, 1] += s * travel + c * 0.03
    assert found.solved.all()
    assert np.abs(found.values - true).max() < 1e-9
    assert singular_drives(m) is not None


def test_two_assemblies_that_fit_equally_well_are_refused(tmp_path: Path) -> None:
    """All joints of base and plate on a line each: mirrored at the base's line all legs are as long.

    Next to the reference configuration it says which; far off, turned by 140 deg, nothing does.
    """
    feet, plate = np.array([-0.6, -0.1, 0.25, 0.6]), np.array([-0.15, 0.12, -0.05, 0.15])
    ground = ", ".join(f"B{i}: [{1e3 * x:g}, 0]" for i, x in enumerate(feet, 1))
    points = ", ".join(f"P{i}: [{1e3 * x:g}, 0]" for i, x in enumerate(plate, 1))
    drives = ", ".join(f"q{i}: {{drives: leg{i}, offset: o{i}{', redundant: true' * (i == 4)}}}" for i in range(1, 5))
    m = built(
        tmp_path,
        "units: {length: mm, angle: deg, force: N}\nspace: planar\nranges: {length: 0.1}\n"
        f"ground: {{{ground}}}\nbodies: {{plate: {{at: [0, 300], turn: 20, points: {{{points}}}}}}}\n"
        'parameters: {"o{i}": {each: {i: [1, 2, 3, 4]}, nominal: 100}}\n'
        'bars: {"leg{i}": {each: {i: [1, 2, 3, 4]}, between: ["B{i}", "P{i}"], EA: 20 MN}}\n'
        f"actuators: {{{drives}}}\n"
        "sensors: {t: {at: plate, reads: [x, y], sigma: 1 um, frame: machine}}\n",
    )
    pose = np.array([[0.02, 0.28, 25 * DEG], [-0.002056983720688188, 0.2752776304249219, -2.4871994879357313]])
    c, s = np.cos(pose[:, 2:]), np.sin(pose[:, 2:])
    readings = np.hypot(c * plate + pose[:, :1] - feet, s * plate + pose[:, 1:2]) - OFFSET
    found = predict(m, m.nominal, Rows.at(readings))
    assert np.abs(found.values[0] - pose[0, :2]).max() < 1e-9
    assert not found.solved[1] and found.reason(1).startswith("two assemblies fit")


def test_trial_steps_of_a_fit_stay_in_their_assemblies(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One reading is half a metre off, so that the fit strains the machine in all rows beyond what ranges explain.

    Compared with other assemblies at each step, chi-square is not continuous: the fit took 44 steps and did not end.
    """
    compared: list[int] = []
    common = solving.common_pose

    def counted(model: Model, coefficients: Array) -> CommonPose:
        compared.append(len(coefficients))
        return common(model, coefficients)

    monkeypatch.setattr(solving, "common_pose", counted)
    files = spoilt(MACHINES / "triglide.csv", far_off, tmp_path)
    done = run("calibrate", *files, "--holdout", "none", "--starts", "1", "--json")
    assert done.code == 1 and done.json["status"] == "implausible"
    assert compared.count(231) == len(compared) <= 3  # where fits end, of this and of the ranges as they turned out


def test_the_end_of_a_fit_is_the_equilibrium_of_least_energy() -> None:
    """Steps that keep their assemblies end elsewhere here: they are taken again, each compared with others."""
    measured = ready(campaign("triglide", [], 1, rows=12, scenario=Scenario(sessions=1)))
    readings = measured.problem.readings.copy()
    readings[6, 0] += 0.1
    problem = replace(measured.problem, readings=readings)
    fit = identify(problem, measured.selected, iterations=3)
    cold = evaluate(problem, fit.values)
    assert not fit.failed and cold.solved and fit.chi2 < chi_square(problem, fit.before)
    np.testing.assert_allclose(cold.residual, fit.after.residual, atol=1e-9)
