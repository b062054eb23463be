"""What errors are made of: held parameters against fits with them moved, scales against what was drawn."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import Calibration, FitOptions, calibrated
from pkmcal_cli.calibration.error_budget import ErrorBudget, error_budget, held_parameters
from pkmcal_cli.calibration.held_share import HeldShare
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.prior import prior_of_ranges
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.range_check import range_check
from pkmcal_cli.calibration.range_scales import Evidence, Scales, drawn_scales
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Request, predict
from tests.campaigns import Plan, by_engine, shipped
from tests.command import MACHINES, clean, run


def evidence(known: Array, offsets: Array, kinds: tuple[str, ...], seed: int = 0) -> Evidence:
    """Offsets (q,) measured one by one, to 1 / known (q,) half ranges, 20 times each, by one instrument."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(20, len(offsets)))
    jacobian = known / np.sqrt(20)
    return Evidence(
        information=np.diag(known**2)[None],
        score=np.zeros((1, len(offsets))),
        squares=np.array([((noise - noise.mean(axis=0)) ** 2).sum()]),
        counts=np.array([20 * len(offsets)]),
        freedom=np.array([10.0]),
        centre=offsets + noise.mean(axis=0) / jacobian,
        kinds=kinds,
        estimated=np.ones(len(offsets), dtype=bool),
    )


def scales(factor: float, wild: float = 0.0, count: int = 30) -> Scales:
    """Of `count` lengths, `factor` half ranges off, of which one is `wild`, and of five angles that are as stated."""
    rng = np.random.default_rng(5)
    unit = rng.normal(size=count + 5)
    unit[:count] /= np.sqrt((unit[:count] ** 2).mean())
    offsets = unit * np.r_[np.full(count, factor), np.ones(5)]
    offsets[0] += wild
    return drawn_scales(evidence(np.full(count + 5, 50.0), offsets, ("length",) * count + ("angle",) * 5))


@pytest.mark.parametrize("factor", [0.3, 1.0, 3.0])
def test_ranges_are_as_wide_as_parameters_are_off(factor: float) -> None:
    """The mean of 30 offsets, of which a prior about 1 changes little."""
    found = scales(factor)
    assert np.median(found.factors["length"]) == pytest.approx(factor, rel=0.1)
    assert 0.5 < np.median(found.factors["angle"]) < 2.0, "another kind has its own"
    assert found.typical_noise == pytest.approx(1.0, abs=0.1)


def offset_density(z: Array) -> Array:
    wild = np.mean([stats.norm.pdf(z, scale=4.0**k) for k in range(1, 8)], axis=0)
    return np.asarray(0.98 * stats.t.pdf(z, 10) + 0.02 * wild)


@pytest.mark.parametrize("offsets", [(0.3, -0.2), (1.2, -0.4, 0.9), (4.0, 2.5, -3.0, 6.0)])
def test_the_scale_of_a_few_offsets_is_that_of_an_integral(offsets: tuple[float, ...]) -> None:
    """Prior times likelihood on a line: log tau normal with a factor of 2, offsets Student's with 10 degrees; of those
    that are known one of fifty is normal, and 4 to 4^7 times as wide.

    Quantiles of tau, and where 95 % of errors are that are as large as another offset, of which nothing is known.
    """
    count = len(offsets) + 1
    known, kinds = np.array([*np.full(count - 1, 1e3), 1e-3]), ("length",) * count
    found = drawn_scales(evidence(known, np.array([*offsets, 0.0]), kinds))
    log_tau = np.linspace(-5, 6, 4001)
    tau = np.exp(log_tau)
    density = stats.norm.pdf(log_tau / np.log(2)) * np.prod([offset_density(z / tau) / tau for z in offsets], axis=0)
    density /= density.sum()
    for share in (0.1, 0.5, 0.9):
        expected = tau[np.searchsorted(density.cumsum(), share)]
        assert np.quantile(found.factors["length"], share) == pytest.approx(expected, rel=0.12)
    limit = np.linspace(0, 50, 5001)
    inside = ((2 * stats.t.cdf(limit[:, None] / tau[::10], 10) - 1) * density[::10]).sum(axis=1) / density[::10].sum()
    drawn = (2 * stats.norm.cdf(limit[:, None] / np.sqrt(found.variances[:, -1])) - 1).mean(axis=1)
    ends = [limit[np.searchsorted(share, 0.95)] for share in (drawn, inside)]
    assert ends[0] == pytest.approx(ends[1], rel=0.08)


def test_one_wild_parameter_is_wide_itself_and_widens_no_other() -> None:
    found, still = scales(1.0, wild=20.0), scales(1.0)
    assert found.typical[0] > 5
    assert found.typical[1:] == pytest.approx(still.typical[1:], rel=0.5)
    assert np.median(found.typical[1:30] / still.typical[1:30]) < 1.25


def test_one_wild_parameter_of_a_few_widens_no_other() -> None:
    """Of five, of which one is 20 half ranges off; their factor was 3.2."""
    found, still = scales(1.0, wild=20.0, count=5), scales(1.0, count=5)
    assert found.typical[0] > 5
    assert np.median(found.factors["length"]) < 1.3 * np.median(still.factors["length"])


def test_what_is_known_exactly_does_no_harm() -> None:
    """Information of 1e30 beside 1e-30: no rounding spoils what is drawn."""
    known = np.array([1e15, 1e-15, 3.0, 3.0])
    found = drawn_scales(evidence(known, np.array([2.0, 0.0, 1.0, -1.0]), ("length",) * 4))
    assert np.isfinite(found.variances).all() and (found.variances > 0).all()


def test_the_noise_is_what_is_stated_and_what_scatters_by_their_degrees_of_freedom() -> None:
    """Sigma twice too large, 10 degrees stated, 25 measured: (10 + 25 / 4) / 35; exact: 1; unknown: 1/4."""
    given = evidence(np.full(3, 1e3), np.zeros(3), ("length",) * 3)
    for freedom, expected in ((10.0, (10 + 25 / 4) / 35), (np.inf, 1.0), (0.0, 1 / 4)):
        few = replace(given, counts=np.array([28]), squares=np.array([25 / 4]), freedom=np.array([freedom]))
        found = drawn_scales(replace(few, score=np.zeros((1, 3)))).noise
        assert float(np.mean(1 / found)) == pytest.approx(1 / expected, rel=0.05)


def of_scissors(selected: tuple[str, ...], seed: int = 0, noise: bool = True) -> tuple[Plan, Problem]:
    plan = by_engine(shipped("scissors"))
    rng = np.random.default_rng(seed)
    return plan, plan.measured(plan.model.nominal, rng) if noise else plan.problem(plan.simulate(plan.model.nominal))


def test_a_held_parameter_shifts_others_as_a_fit_with_it_moved_does() -> None:
    """The sensitivity of the budget is the difference of two fits, with a rod that is held longer and shorter."""
    plan, _ = of_scissors(())
    selected, held = plan.selected, ("l1", "l5")
    problem = plan.problem(plan.simulate(plan.model.nominal))
    budget = error_budget(problem, identify(problem, selected), held)
    for k, name in enumerate(held):
        place, ends = plan.model.names.index(name), []
        for sign in (0.1, -0.1):
            values = plan.model.nominal
            values[place] += sign * plan.model.ranges[place] / 2
            moved = plan.problem(plan.simulate(values))
            ends.append(identify(moved, selected).values[plan.index])
        expected = (ends[0] - ends[1]) / 0.2
        assert budget.by_held[:, k] == pytest.approx(expected, rel=1e-3, abs=1e-3 * float(np.abs(expected).max()))


def tool_std(plan: Plan, budget: ErrorBudget, calibration: Calibration) -> Array:
    """Standard uncertainties of the tool point at the measured poses (N, 2), by the joint covariance."""
    names = (*budget.names, *budget.held)
    fit = calibration.robust.fit
    rows = calibration.robust.problem.rows
    found = predict(tcp_model(plan.model), fit.values, rows, Request(parameters=names))
    assert found.jacobian is not None
    by = found.jacobian[:, :2]
    return np.asarray(np.sqrt(np.einsum("ncp,pq,ncq->nc", by, budget.joint_covariance, by)))


def test_at_the_tool_most_of_what_is_held_cancels() -> None:
    """Twenty machines, all parameters drawn, nine identified: lengths are 0.1 mm off, the tool a few um, as it says."""
    plan = by_engine(shipped("scissors"))
    inside, shares, worst = [], [], []
    for seed in range(20):
        rng = np.random.default_rng([3, seed])
        values = plan.model.nominal + rng.normal(size=len(plan.model.names)) * plan.model.ranges / 2
        problem = plan.measured(values, rng)
        found = calibrated(problem, plan.selected, plan.model.nominal, FitOptions(), np.zeros(len(problem)))
        error = found.robust.fit.values - values
        inside.append(np.abs(error[plan.index]) < 1.96 * found.intervals.std)
        true = predict(tcp_model(plan.model), values, problem.rows).values[:, :2]
        told = predict(tcp_model(plan.model), found.robust.fit.values, problem.rows).values[:, :2]
        shares.append(np.abs(told - true) < 1.96 * tool_std(plan, found.budget, found))
        worst.append(np.abs(told - true).max())
        assert found.budget.std_by_held.max() > 20e-6
    assert np.mean(inside) > 0.9
    assert np.mean(shares) > 0.85
    assert np.median(worst) < 10e-6


def test_what_is_exact_or_the_datum_adds_nothing() -> None:
    plan, problem = of_scissors(())
    held = held_parameters(problem, plan.selected, ("l1",))
    assert len(held) == 24 and "l1" not in held and "k5" in held
    fixed = [replace(p, fixed=p.name == "l2") for p in plan.model.parameters]
    problem = replace(problem, model=replace(plan.model, parameters=tuple(fixed), datum=("l5",)))
    assert set(held) - set(held_parameters(problem, plan.selected, ("l1",))) == {"l2", "l5"}


def test_ranges_that_do_not_fit_are_told() -> None:
    plan = by_engine(shipped("triglide-nonredundant"))
    for factor, doubtful in ((1.0, False), (4.0, True)):
        rng = np.random.default_rng(8)
        values = plan.model.nominal
        values[plan.index] += factor * rng.choice([-1.0, 1.0], len(plan.index)) * plan.ranges / 2
        problem = plan.measured(values, rng)
        fit = identify(problem, plan.selected)
        found = range_check(problem, fit, error_budget(problem, fit))
        assert found.doubtful == doubtful, (factor, found.p_value)
        assert bool(found.far) == (factor == 4.0)
        assert 0.5 * factor < found.factors["length"] < 1.6 * factor


def test_what_is_exact_is_no_hypothesis_and_cannot_be_selected(tmp_path: Path) -> None:
    machine = tmp_path / "m.yaml"
    more = "parameters: {l1: {fixed: true}, k1: {fixed: true}}"
    machine.write_text(f"extends: {MACHINES / 'triglide.yaml'}\n{more}\n", encoding="utf-8")
    refused = clean(run("calibrate", machine, MACHINES / "triglide.csv", "--select", "auto,l1"))
    assert refused.code == 2 and "`l1` is declared `fixed: true`" in refused.err
    found = clean(run("calibrate", machine, MACHINES / "triglide.csv", "--holdout", "none", "--json")).json
    assert "l1" not in {p["name"] for p in found["parameters"]}
    assert found["uncertainty"]["held"] == ["k2", "k3"]
    seen = clean(run("diagnose", machine, MACHINES / "triglide.csv", "--json", "-q")).json
    released = {d["at"] for d in (*seen["detectable"], *seen["invisible"]) if d["effect"] == "release"}
    assert released & {"k2", "k3", "gamma"} and not released & {"l1", "k1"}


def test_ranges_that_fit_are_not_doubted_with_a_prior() -> None:
    """Noise of 1 mm leaves little but the prior, which shrinks all: 20 machines, p below 5 % in at most 5 (0.03 %)."""
    plan = by_engine(shipped("triglide"))
    plan, low = replace(plan, sigma=100 * plan.sigma), 0
    prior = prior_of_ranges(plan.model, plan.selected)
    for seed in range(20):
        rng = np.random.default_rng([6, seed])
        problem = replace(plan.measured(plan.drawn(rng), rng), prior=prior)
        fit = identify(problem, plan.selected)
        low += range_check(problem, fit, error_budget(problem, fit)).p_value < 0.05
    assert low <= 5


def test_a_number_of_an_effect_that_is_held_in_a_range_of_its_own_adds_to_the_uncertainty(tmp_path: Path) -> None:
    """`identify: false` with a `range` is not known exactly; without one it is what its entry says."""
    heads = {"ranged": ", range: 40 um", "exact": ""}
    results = {}
    for name, more in heads.items():
        file = tmp_path / f"{name}.yaml"
        number = f"{{value: 0 um, identify: false{more}}}"
        base = MACHINES / "scissors.yaml"
        file.write_text(f"extends: {base}\neffects: {{backlash@q3: {{b: {number}}}}}\n", encoding="utf-8")
        table = MACHINES / "scissors-shopfloor.csv"
        results[name] = clean(run("calibrate", file, table, "--holdout", "none", "--json")).json
    held = {name: set(r["uncertainty"]["held"]) for name, r in results.items()}
    assert held["ranged"] - held["exact"] == {"backlash@q3.b"}
    adds = {n: [p["std_by_held"] for p in r["parameters"]] for n, r in results.items()}
    assert sum(a > b for a, b in zip(adds["ranged"], adds["exact"], strict=True)) > 0


@pytest.mark.parametrize("noise", [1.0, 0.3])
def test_the_joint_covariance_has_the_tails_of_each_cause_so_that_sums_still_cancel(noise: float) -> None:
    """A held parameter shifts an identified one by as much as it is off itself: their sum is known to the noise, which
    has no tails here, whatever those of the range are."""
    tails = np.array([1.0, 9.0, 1.0, 25.0, 1.0])[:, None]
    budget = ErrorBudget(
        names=("a",), held=("b",), instruments=("gauge",), data=np.array([[[1e-12]]]), by_own=np.zeros((1, 1)),
        by_held=np.array([[1e-3]]), half_ranges=np.full(2, 1e-3),
        scales=Scales(variances=np.hstack([np.ones((5, 1)), tails]), noise=np.full((5, 1), noise**2), factors={}),
        counts=np.ones(1), worth=np.ones(1), once=np.zeros(1, dtype=bool),
        share=HeldShare((), np.ones(1), np.zeros((1, 0, 0)), np.zeros((1, 0))),
    )  # fmt: skip
    joint, factor = budget.joint_covariance, budget.std[0] / np.hypot(1e-3, noise * 1e-6)
    assert factor > 1.5, "the tails of the mixture"
    assert np.sqrt(np.diag(joint)) == pytest.approx([budget.std[0], factor * 1e-3])
    assert np.sqrt(np.ones(2) @ joint @ np.ones(2)) == pytest.approx(noise * 1e-6, rel=1e-6)
