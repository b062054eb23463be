"""What one-line mutants survived once: each by a closed form."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.error_budget import ErrorBudget
from pkmcal_cli.calibration.held_share import HeldShare
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.positioning_accuracy import axis_accuracy
from pkmcal_cli.calibration.prior import prior_of_ranges
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_scales import Scales
from pkmcal_cli.diagnosis import search as search_module
from pkmcal_cli.diagnosis.alpha import Alpha
from pkmcal_cli.diagnosis.confirm import HeldOutGain, _held_out
from pkmcal_cli.diagnosis.linear import Linear, Memory
from pkmcal_cli.diagnosis.score import log_evidence
from pkmcal_cli.diagnosis.scoring import Search
from pkmcal_cli.diagnosis.search import run_search
from pkmcal_cli.diagnosis.search_options import SearchOptions
from pkmcal_cli.elements import JointElement, LinkGeometry
from pkmcal_cli.equilibrium.stability import definite
from pkmcal_cli.model.tool_channels import with_loads
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.benchmark.setting import Setting
from tests.support import at, model, overlay


def test_linear_is_one_step_without_geometric_stiffness() -> None:
    """Three bars at one point: K = sum k n n^T at the rigid pose, without the tension over length across each bar."""
    machine = model("biglide")
    short = 2e-3  # m by which the leg is commanded shorter than the pose that the carriages hold
    pose = machine.tool.reference[None] + [0.08, 0.02, 0, 0, 0, 0]  # not above the middle: the leg is turned
    readings = drive_positions(machine, pose).readings
    rigid = at(machine, readings, Request(method="rigid")).values[0, :2]
    base = np.array([[readings[0, 0], 0.1], [readings[0, 1], 0.1], [0.36, 0.65]])
    chord = rigid - base
    n, stiffness = chord / np.linalg.norm(chord, axis=1)[:, None], np.array([5e7, 5e7, 2e7])
    step = np.linalg.solve((n.T * stiffness) @ n, -(n.T @ (stiffness * [0.0, 0.0, short])))
    found = at(machine, readings - [0, 0, short], Request(method="linear")).values[0, :2]
    np.testing.assert_allclose(found - rigid, step, rtol=1e-9, atol=1e-13)


@cache
def begun() -> Search:
    """A search in a campaign with nothing planted."""
    case = Setting.of("scissors", 11).ready
    fit = identify(case.problem, case.selected)
    return Search(candidates=case.candidates, problem=case.problem, declared=case.selected, fit=fit)


def test_a_held_out_row_has_no_part_in_its_own_prediction() -> None:
    """Its reading off by d: its held-out residual is off by d, not by the share that a fit would leave."""
    search, off = begun(), 1e-3
    labels = np.arange(len(search.problem)) % 3
    readings = search.problem.readings.copy()
    readings[4, 0] += off
    changed = replace(search, problem=replace(search.problem, readings=readings))
    before, after = (_held_out(s, search.fit.values, search.selected, labels)[0] for s in (search, changed))
    same = labels == labels[4]
    assert after[4, 0] - before[4, 0] == pytest.approx(off, rel=1e-9)
    rest = np.abs(after - before)[same]
    assert np.sort(rest.ravel())[-2] < 1e-9 * off, "nor in that of others of its fold"
    assert np.abs(after - before)[~same].max() > 1e-3 * off


def test_a_gain_within_its_error_confirms_nothing() -> None:
    within = HeldOutGain(with_it=1.0, without=1.0, gain=0.5, error=1.0, scheme="")
    assert not within.confirmed and not within.contradicts
    assert replace(within, gain=1.5).confirmed and replace(within, gain=-0.5).contradicts
    assert not within.harms and not replace(within, gain=-0.5).harms
    assert replace(within, gain=-2.5).harms and replace(within, gain=-0.5, with_it=2.0).harms, "twice the error"


def linear(columns: Array, projected: int, residual: Array) -> Linear:
    names = tuple(f"p{k}" for k in range(columns.shape[1]))
    return Linear(
        residual=residual, columns=columns, names=names, ranges=np.full(len(names), 2.0), projected=names[:projected],
        used=len(residual), channels=1,
    )  # fmt: skip


def test_what_is_held_moves_as_far_as_its_range_only() -> None:
    """A declared column a that noise hides: V = 1 + a a^T, so a like effect c keeps c^2 / (1 + a^2) of information."""
    unit = np.ones(16) / 4
    weak, effect = 0.3 * unit, 40.0 * unit
    found = linear(np.column_stack([weak, effect]), 1, np.zeros(16))
    assert found.spectrum.held.all()
    assert found.score(effect[:, None]).alone[0] == pytest.approx(40.0**2 / (1 + 0.3**2), rel=1e-9)


@pytest.mark.parametrize("count", [1, 3])
def test_evidence_is_the_integral_over_sizes(count: int) -> None:
    """Of k sizes with a normal prior of variance g: (1 + g)^(-k / 2) exp(T g / (1 + g) / 2), g = T / k - 1."""
    statistic = 30.0
    g = statistic / count - 1
    expected = -0.5 * count * np.log(1 + g) + 0.5 * statistic * g / (1 + g)
    assert log_evidence(np.array([statistic]), np.array([count]))[0] == pytest.approx(expected)


def test_noise_with_a_memory_is_white_afterwards() -> None:
    """x_k = 0.8 x_(k-1) + 0.6 e_k has unit variance, and what is made of it is e."""
    e = np.random.default_rng(3).normal(size=200)
    x = e.copy()
    for k in range(1, len(x)):
        x[k] = 0.8 * x[k - 1] + 0.6 * e[k]
    memory = Memory(np.arange(200), 0.8, np.ones((200, 1), dtype=bool))
    np.testing.assert_allclose(linear(np.zeros((200, 1)), 1, x).prewhitened(memory).residual, e, atol=1e-12)


@pytest.mark.parametrize("total", [0.005, 0.05])
def test_the_parts_of_alpha_are_the_whole(total: float) -> None:
    """Bonferroni: false alarms of the parts add up."""
    parts = Alpha(total)
    assert parts.catalogue + parts.groups + parts.rows == pytest.approx(total, rel=1e-12)


def test_a_search_spends_the_catalogues_part_of_alpha(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of simulated smallest p values so many are below the critical one."""
    draws = np.linspace(0.0, 1.0, 100_001)
    monkeypatch.setattr(search_module, "smallest_p", lambda *_: draws)
    monkeypatch.setattr(search_module, "_followed", lambda search, *_: search)
    assert run_search(begun(), SearchOptions(alpha=0.05, seed=0)).critical == pytest.approx(0.03, rel=1e-9)


@pytest.mark.parametrize("ahead", [-3.0, -0.1, 0.1, 3.0])
def test_a_drive_may_be_a_little_behind_its_command(ahead: float) -> None:
    """The strain of a drive that turns is the shorter way to its command, in both directions."""
    element, triad = JointElement("revolute", ("angle",)), np.eye(3)[None, None]
    link = LinkGeometry(np.zeros((1, 1, 3)), triad, triad, np.zeros((1, 1, 0)))
    for turns in (0, 2):
        e, _ = element.evaluate(link, np.full((1, 1, 1), 2 * np.pi * turns - ahead))
        assert e[0, 0, 0] == pytest.approx(ahead)


def test_a_saddle_is_not_stable_whatever_rows_are_beside_it() -> None:
    """Tangents of one constraint x = 0 beside a stiffness: only what is free of it decides."""
    along = np.array([[[1.0, 0.0]]] * 4)  # gradient of what is held
    well, saddle = np.diag([-5.0, 2.0]), np.diag([5.0, -2.0])
    found = definite(np.stack([well, saddle, well, saddle]), along)
    np.testing.assert_array_equal(found, [True, False, True, False])


def test_a_range_is_two_standard_deviations_of_its_prior() -> None:
    machine = model("biglide")
    prior = prior_of_ranges(machine, ("l1", "k3"))
    off = machine.nominal.copy()
    off[[machine.names.index("l1"), machine.names.index("k3")]] += 0.1e-3, -2e6  # the ranges of the file
    np.testing.assert_allclose(prior.errors(machine, off), [-2.0, 2.0], rtol=1e-9)


def test_repeatability_of_an_axis_is_four_standard_deviations_without_reversal() -> None:
    """ISO 230-2: the larger of 2 s + 2 s + |B| and of 4 s of either side; here only one side scatters."""
    still, wide = np.zeros(5), np.array([-1.0, 0.0, 1.0, 0.0, 0.0])  # variance 1/2
    found = axis_accuracy(np.arange(5.0), ((still, wide),) * 5)
    assert pytest.approx(4 * np.sqrt(0.5)) == found.R

TWO_BARS = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    ranges: {length: 1}
    ground: {A: [0, 0], B: [1000, 0]}
    guides: {rail: {along: x}}
    bodies: {c: {guide: rail, at: 500, points: {P: [0, 0]}}}
    bars: {driven: {between: [A, P], k: 1 kN/mm}, other: {between: [B, P], length: 500, k: 1 kN/mm}}
    actuators: {q: {drives: driven, offset: 500}}
    sensors: {s: {kind: tcp, at: c, reads: [x], sigma: 0.01, frame: machine}}
"""


@pytest.mark.parametrize(("gap", "closes"), [(0.009, True), (0.011, False), (-0.009, True), (-0.011, False)])
def test_parts_that_miss_one_another_by_a_hundredth_of_the_machine_do_not_close(gap: float, closes: bool) -> None:
    """Two like bars between walls 1 m apart: what both are too long together, each gives way by half of."""
    machine = model(TWO_BARS)
    found = predict(machine, machine.nominal, Rows.at(np.array([[2 * gap]])))
    assert found.solved[0] == closes
    if closes:
        assert found.values[0, 0] == pytest.approx(0.5 + gap, abs=1e-12)
    else:
        assert "cannot be assembled" in found.reason(0)


TWO_ROPES = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    ranges: {length: 1, force: 10}
    parameters: {EA1: 2000 N, EA2: 3000 N, L1: 480, L2: 470}
    ground: {A: [0, 0], B: [1000, 0]}
    guides: {rail: {along: x}}
    bodies: {c: {guide: rail, at: 500, points: {P: [0, 0]}}}
    ropes: {r1: {between: [A, P], length: L1, EA: EA1}, r2: {between: [B, P], length: L2, EA: EA2}}
    actuators: {q1: {winds: r1}, q2: {winds: r2, redundant: true}}
    sensors: {s: {kind: tcp, at: c, reads: [x], sigma: 0.01, frame: machine}}
"""


def test_tension_follows_the_stiffness_of_a_rope_that_stretches_by_some_per_cent() -> None:
    """Two ropes in line over D: T = (D - L1 - L2) / (L1 / EA1 + L2 / EA2), so dT / dEA = T (L / EA^2) / (the same)."""
    machine = model(TWO_ROPES)
    loaded = with_loads(machine)
    found = predict(loaded, machine.nominal, Rows.at(np.zeros((1, 2))), Request(parameters=machine.names))
    length, stiffness = np.array([0.48, 0.47]), np.array([2000.0, 3000.0])
    yields = (length / stiffness).sum()
    tension = 0.05 / yields
    by_stiffness, by_length = tension * length / stiffness**2 / yields, -(1 + tension / stiffness) / yields
    for k, channel in enumerate(loaded.channels):
        if channel.name.startswith(("force", "tension")):
            assert found.values[0, k] == pytest.approx(tension, rel=1e-9)
            assert found.jacobian is not None
            np.testing.assert_allclose(found.jacobian[0, k], [*by_stiffness, *by_length], rtol=1e-8)


def test_uncertainty_is_that_of_noise_and_of_offsets_together() -> None:
    """One reading of a length to 3 um, and what is held shifts it by 4 um: 5 um, 3 um of it by the data."""
    one = Scales(variances=np.ones((8, 2)), noise=np.ones((8, 1)), factors={})
    budget = ErrorBudget(
        names=("a",), held=("b",), instruments=("gauge",), data=np.array([[[9e-12]]]), by_own=np.zeros((1, 1)),
        by_held=np.array([[4e-6]]), half_ranges=np.ones(2), scales=one,
        counts=np.ones(1), worth=np.ones(1), once=np.zeros(1, dtype=bool),
        share=HeldShare(("b",), np.ones(1), np.ones((1, 1, 1)), np.zeros((1, 1))),
    )  # fmt: skip
    assert budget.std == pytest.approx(5e-6, rel=1e-6)
    assert budget.std_by_data == pytest.approx(3e-6, rel=1e-6) and budget.std_by_held == pytest.approx(4e-6, rel=1e-6)
    noisy = replace(budget, scales=replace(one, noise=np.full((8, 1), 4.0)))
    assert noisy.std_by_data == pytest.approx(6e-6, rel=1e-6), "noise twice as large as stated"


def test_exact_readings_give_exact_parameters_however_wide_the_ranges_are() -> None:
    """A rod 5 mm longer, with ranges of 100 mm: a twentieth of a range is no small step where a circle is followed."""
    machine = model(overlay("biglide", "ranges: {length: 100}"))
    poses = machine.tool.reference[None] + np.array([[x, y, 0, 0, 0, 0] for x in (-0.1, 0, 0.1) for y in (-0.05, 0.02)])
    rows = Rows.at(drive_positions(machine, poses).readings)
    true = machine.nominal
    true[machine.names.index("l1")] += 5e-3
    readings = predict(machine, true, rows).values
    problem = Problem(
        model=machine, rows=rows, readings=readings, sigma=np.full(readings.shape, 1e-8),
        drive_sigma=np.zeros(rows.readings.shape), measured=np.ones(readings.shape, dtype=bool),
    )  # fmt: skip
    fit = identify(problem, ("l1", "l2"))
    assert fit.status == "converged"
    np.testing.assert_allclose(fit.values, true, rtol=0, atol=1e-10)
