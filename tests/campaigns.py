"""Simulated calibration campaigns: a machine at set values, measured with noise, identified again.

Readings come from the independent simulators of `tests.truth`, or, where these would take hours, from the engine at
the planted values; `Plan.source` says which.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.complete_fit import FitOptions, calibrated
from pkmcal_cli.calibration.error_budget import held_parameters
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.selection import select
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.support import model
from tests.truth import generate

COVER = 1.96  # standard uncertainties of a 95 % interval
ENGINE, TRUTH = "engine at the planted values", "independent energy minimisation"
BENT = ("hangprinter",)
"""Machines of which what is not identified has too wide a range: radii of 75 mm +- 2 mm move an anchor by a metre."""
SLOW_TRUTH = ("hexapod7", "hangprinter")
"""Machines of which 500 campaigns by the independent simulator take hours."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A campaign before it is measured: true drive positions (N, A), parameters to identify, who simulates.

    sigma (C,), drive_sigma (A,): of channels, and of drives as travel, m and rad.
    """

    name: str
    model: Model
    positions: Array
    selected: tuple[str, ...]
    sigma: Array
    drive_sigma: Array
    source: str
    simulate: Callable[[Array], Array]

    @property
    def index(self) -> list[int]:
        """Places of the selected parameters among all."""
        return [self.model.names.index(n) for n in self.selected]

    @property
    def ranges(self) -> Array:
        """Ranges (p,) of the selected parameters."""
        return self.model.ranges[self.index]

    def take(self, rows: Array) -> Plan:
        """Some rows, by the engine."""
        return by_engine(replace(self, positions=self.positions[rows]))

    def drawn(self, rng: np.random.Generator) -> Array:
        """Parameter values (P,) from the prior: normal about nominal, standard deviation range / 2."""
        values = self.model.nominal
        values[self.index] += rng.normal(size=len(self.selected)) * self.ranges / 2
        return values

    def all_drawn(self, rng: np.random.Generator) -> Array:
        """The same, and those that are not identified, which have ranges too."""
        values = self.drawn(rng)
        for name in held_parameters(self.problem(np.zeros((len(self.positions), len(self.sigma)))), self.selected, ()):
            place = self.model.names.index(name)
            values[place] += rng.normal() * self.model.ranges[place] / 2
        return values

    def with_exact_others(self) -> Plan:
        """The plan with all parameters exact that are not identified."""
        parameters = tuple(replace(p, fixed=p.name not in self.selected) for p in self.model.parameters)
        return replace(self, model=replace(self.model, parameters=parameters))

    def problem(self, readings: Array, positions: Array | None = None, sigma: Array | None = None) -> Problem:
        """Readings (N, C) as measured at drive readings (N, A), by default the true positions."""
        q = self.positions if positions is None else positions
        spread = np.broadcast_to(self.sigma if sigma is None else sigma, readings.shape)
        drives = np.broadcast_to(self.drive_sigma, q.shape)
        return Problem(
            model=self.model,
            rows=Rows.at(q),
            readings=readings,
            sigma=spread,
            drive_sigma=drives,
            measured=~np.isnan(readings) & ~np.isnan(spread),
        )

    def measured(self, values: Array, rng: np.random.Generator) -> Problem:
        """What is measured at parameter values (P,), with noise of channels and drives."""
        gains = np.array(
            [abs(self.model.topology.coefficients.constants[a.gain_coefficient]) for a in self.model.actuators]
        )
        read = self.positions + rng.normal(size=self.positions.shape) * self.drive_sigma / gains
        true = self.simulate(values)
        return self.problem(true + rng.normal(size=true.shape) * self.sigma, read)


def by_engine(plan: Plan) -> Plan:
    """The plan with the engine as simulator."""

    def simulate(values: Array) -> Array:
        found = predict(plan.model, values, Rows.at(plan.positions))
        assert found.solved.all()
        return found.values

    return replace(plan, source=ENGINE, simulate=simulate)


def by_truth(plan: Plan) -> Plan:
    """The plan with the machine's independent simulator."""
    machine = generate.campaigns()[plan.name].machine

    def simulate(values: Array) -> Array:
        given = plan.model.by_name(values)
        planted = {n: given.get(n, v) for n, v in machine.nominal.items()}
        return machine.forward(plan.positions, planted).tcp[:, : len(machine.channels)]

    return replace(plan, source=TRUTH, simulate=simulate)


@cache
def shipped(name: str) -> Plan:
    """The plan of a shipped measurement file; the hangprinter's: 30 poses that every machine of its prior reaches."""
    machine = model(name)
    if name == "hangprinter":
        place = generate.spread(30, [-0.25, -0.25, 0.3], [0.25, 0.25, 1.1])
        positions = drive_positions(machine, np.pad(place, ((0, 0), (0, 3)))).readings
    else:
        positions = generate.campaigns()[name].set_values()
    sigma = np.array([c.sigma for c in machine.channels])
    drive_sigma = np.nan_to_num([a.sigma for a in machine.actuators])
    plan = Plan(
        name=name,
        model=machine,
        positions=positions,
        selected=select(machine, "auto"),
        sigma=sigma,
        drive_sigma=drive_sigma,
        source="",
        simulate=lambda v: v,
    )
    return by_engine(plan) if name in SLOW_TRUTH else by_truth(plan)


def planted(name: str) -> tuple[Plan, Fit, Array]:
    """The shipped file's planted parameters from its readings without noise, sigma 1 pm (or prad).

    So small a sigma that no direction is weak. Returns the errors of the selected parameters (p,) in ranges.
    """
    campaign, plan = generate.campaigns()[name], shipped(name)
    true = campaign.planted()
    fit = identify(plan.problem(campaign.true_readings(), sigma=np.array(1e-12)), plan.selected)
    values = np.array([true[n] for n in plan.selected])
    return plan, fit, (fit.values[plan.index] - values) / plan.ranges


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Campaigns of one plan: scores (n, p), errors in standard uncertainties, nan where undetermined; errors (n, p) in
    ranges; chi2, dof and number of directions held (n,)."""

    names: tuple[str, ...]
    scores: Array
    errors: Array
    chi2: Array
    dof: Array
    held: Array
    converged: int

    def determined(self) -> Coverage:
        """Only the parameters that were determined in every campaign."""
        keep = ~np.isnan(self.scores).any(axis=0)
        names = tuple(n for n, k in zip(self.names, keep, strict=True) if k)
        return replace(self, names=names, scores=self.scores[:, keep], errors=self.errors[:, keep])

    @property
    def inside(self) -> Array:
        """Share of the campaigns (p,) in which the 95 % interval holds the true value."""
        return np.asarray((np.abs(self.scores) < COVER).mean(axis=0))

    @property
    def scatter(self) -> float:
        """Standard deviation of the average coverage of so many campaigns, parameters going together as they do."""
        return float((np.abs(self.scores) < COVER).mean(axis=1).std() / np.sqrt(len(self.scores)))

    @property
    def chi2_per_dof(self) -> float:
        """Mean chi-square per degree of freedom."""
        return float((self.chi2 / self.dof).mean())


def campaigns(plan: Plan, count: int, seed: int = 0, first: int = 0, every: bool = True) -> Coverage:
    """Parameters drawn from the prior, measured, `calibrate`d, `count` times; each campaign has a seed of its own.

    every: also those that are not identified, but for machines that these bend beyond linear statements.
    """
    rows, every = [], every and plan.name not in BENT
    plan = plan if every else plan.with_exact_others()
    for k in range(first, first + count):
        rng = np.random.default_rng([seed, k])
        values = plan.all_drawn(rng) if every else plan.drawn(rng)
        problem = plan.measured(values, rng)
        found = calibrated(problem, plan.selected, plan.model.nominal, FitOptions(), np.zeros(len(problem)))
        fit, std = found.robust.fit, found.intervals.std
        error = (fit.values - values)[plan.index]
        rows.append((error / std, error / plan.ranges, fit.chi2, fit.dof, fit.directions.held.sum(), fit.status))
    scores, errors, chi2, dof, held, status = (list(c) for c in zip(*rows, strict=True))
    done = status.count("converged")
    arrays = {"scores": scores, "errors": errors, "chi2": chi2, "dof": dof, "held": held}
    return Coverage(names=plan.selected, converged=done, **{name: np.array(v) for name, v in arrays.items()})


def joined(parts: Iterable[Coverage]) -> Coverage:
    """All campaigns of a plan together."""
    parts = list(parts)
    arrays = {n: np.concatenate([getattr(p, n) for p in parts]) for n in ("scores", "errors", "chi2", "dof", "held")}
    return Coverage(names=parts[0].names, converged=sum(p.converged for p in parts), **arrays)


def _batch(name: str, seed: int, first: int, count: int) -> Coverage:
    return campaigns(shipped(name), count, seed, first)


def coverage(name: str, count: int, seed: int = 0, jobs: int = 2, size: int = 25) -> Coverage:
    """Campaigns of a shipped plan in several processes; the result does not depend on their number."""
    starts = range(0, count, size)
    with ProcessPoolExecutor(jobs) as pool:
        found = [pool.submit(_batch, name, seed, k, min(size, count - k)) for k in starts]
        return joined(f.result() for f in found)
