"""Do the intervals of every tier hold the true values? `python -m tests.tier_coverage` (hours for all 500 campaigns).

Counts are kept in docs/tier-coverage.json and added to until there are as many campaigns as asked for; `--fresh` begins
anew. `--from FILE` measures nothing and writes the table of docs/coverage.md from the counts.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.bootstrap import bootstrap_intervals
from pkmcal_cli.calibration.error_budget import error_budget
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.intervals import Intervals, linear_intervals, profile_intervals
from pkmcal_cli.calibration.prior import prior_of_ranges
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.robust import Loss, RobustFit, identify_robustly, plain_fit
from tests.campaigns import Plan, by_engine, shipped

DOCS = Path(__file__).resolve().parents[1] / "docs"
COUNTS, PAGE = DOCS / "tier-coverage.json", DOCS / "coverage.md"
MACHINES = ("scissors", "triglide", "biglide", "hangprinter")
SEED = 1
AVERAGE, LOWEST = (0.94, 0.96), 0.91
GROSS, SIZE = 0.05, (10.0, 100.0)
"""Share of values that are wrong, and by how many standard uncertainties."""
TOO_SMALL = 3.0
BLOCK = re.compile(r"(<!-- tiers -->\n).*?(<!-- end of tiers -->\n)", re.DOTALL)

Tier = Callable[[Plan, Problem, int], tuple[RobustFit, Intervals]]


def _places(plan: Plan) -> Array:
    return np.array(plan.index, dtype=np.intp)


def _squares(problem: Problem, plan: Plan) -> RobustFit:
    """As `calibrate` fits."""
    return plain_fit(problem, identify(problem, plan.selected))


def linear(plan: Plan, problem: Problem, _: int) -> tuple[RobustFit, Intervals]:
    """Value and 1.96 standard uncertainties."""
    found = _squares(problem, plan)
    return found, linear_intervals(found.fit, error_budget(found.problem, found.fit), _places(plan))


def profile(plan: Plan, problem: Problem, _: int) -> tuple[RobustFit, Intervals]:
    """Where chi-square has grown by 1.96 squared."""
    found = _squares(problem, plan)
    return found, profile_intervals(found.problem, found.fit, error_budget(found.problem, found.fit), _places(plan))


def bootstrap(plan: Plan, problem: Problem, seed: int) -> tuple[RobustFit, Intervals]:
    """Signs of the residuals of each pose."""
    found = _squares(problem, plan)
    session = np.zeros(len(problem))
    return found, bootstrap_intervals(found.problem, found.fit, _places(plan), session, seed, found.gain)


def with_ranges(plan: Plan, problem: Problem, _: int) -> tuple[RobustFit, Intervals]:
    """`--prior ranges`, linear."""
    return linear(plan, replace(problem, prior=prior_of_ranges(problem.model, plan.selected)), 0)


def small_sigma(plan: Plan, problem: Problem, _: int) -> tuple[RobustFit, Intervals]:
    """All sigmas stated three times too small, linear."""
    stated = replace(problem, sigma=problem.sigma / TOO_SMALL, drive_sigma=problem.drive_sigma / TOO_SMALL)
    return linear(plan, stated, 0)


def robust(loss: Loss) -> Tier:
    """A robust loss, linear."""

    def fit(plan: Plan, problem: Problem, _: int) -> tuple[RobustFit, Intervals]:
        found = identify_robustly(problem, identify(problem, plan.selected), loss)
        budget = error_budget(found.problem, found.fit, noise=found.fit.directions.spread)
        return found, linear_intervals(found.fit, budget, _places(plan))

    return fit


def with_gross_errors(tier: Tier) -> Tier:
    """The tier on data of which 5 % are wrong by 10 to 100 standard uncertainties."""

    def fit(plan: Plan, problem: Problem, seed: int) -> tuple[RobustFit, Intervals]:
        rng = np.random.default_rng([SEED, seed, 1])
        shape = problem.readings.shape
        wrong = (rng.random(shape) < GROSS) * rng.choice([-1.0, 1.0], shape) * rng.uniform(*SIZE, shape)
        return tier(plan, replace(problem, readings=problem.readings + wrong * problem.sigma), seed)

    return fit


TIERS: dict[str, Tier] = {
    "linear": linear,
    "bootstrap": bootstrap,
    "profile": profile,
    "prior ranges": with_ranges,
    "sigma a third": small_sigma,
    "huber": robust("huber"),
    "tukey": robust("tukey"),
    "huber, 5 % gross": with_gross_errors(robust("huber")),
    "tukey, 5 % gross": with_gross_errors(robust("tukey")),
}


@dataclass(kw_only=True)
class Counts:
    """Of campaigns: how many, converged; by parameter: interval holds the true value, has no end, is undetermined;
    sums of chi-square per degree of freedom, and of the share of parameters inside and its square."""

    names: tuple[str, ...]
    campaigns: int = 0
    converged: int = 0
    inside: list[int] = field(default_factory=list)
    endless: list[int] = field(default_factory=list)
    undetermined: list[int] = field(default_factory=list)
    chi2_per_dof: float = 0.0
    share: float = 0.0
    share2: float = 0.0

    def __post_init__(self) -> None:
        for name in ("inside", "endless", "undetermined"):
            setattr(self, name, getattr(self, name) or [0] * len(self.names))

    def add(self, found: RobustFit, intervals: Intervals, true: Array) -> None:
        """One more campaign; true (p,)."""
        low, high = intervals.low_high.T
        holds = (low <= true) & (true <= high)
        lost = np.isnan(found.fit.std)
        endless = ~lost & np.isnan(low + high)
        some = holds[~lost & ~endless]
        share = float(some.mean()) if len(some) else 0.0
        self.campaigns += 1
        self.converged += found.fit.status == "converged"
        for counted, now in ((self.inside, holds), (self.endless, endless), (self.undetermined, lost)):
            counted[:] = [c + int(n) for c, n in zip(counted, now, strict=True)]
        self.chi2_per_dof += found.fit.chi2_per_dof
        self.share += share
        self.share2 += share**2

    @property
    def kept(self) -> list[int]:
        """Parameters that were determined in every campaign and had an interval once at least."""
        full = zip(self.undetermined, self.endless, strict=True)
        return [k for k, (u, e) in enumerate(full) if u == 0 and e < self.campaigns]

    @property
    def coverage(self) -> Array:
        """Share (k,) of the intervals of the kept parameters that hold the true value."""
        return np.array([self.inside[k] / (self.campaigns - self.endless[k]) for k in self.kept])

    @property
    def scatter(self) -> float:
        """Standard deviation of the average coverage, parameters going together as they do."""
        mean = self.share / self.campaigns
        return float(np.sqrt(max(self.share2 / self.campaigns - mean**2, 0.0) / self.campaigns))

    @property
    def missing(self) -> float:
        """Share of the kept parameters' intervals that have no end."""
        return float(np.mean([self.endless[k] / self.campaigns for k in self.kept]))


@cache
def plan_of(name: str) -> Plan:
    """A shipped plan, simulated by the engine (which agrees with the independent simulators to 1e-11 m)."""
    return by_engine(shipped(name))


def measure(machine: str, tier: str, count: int, so_far: Counts | None = None) -> Counts:
    """Campaigns of a machine up to `count` of them; each has a seed of its own."""
    plan = plan_of(machine)
    counts = so_far or Counts(names=plan.selected)
    for k in range(counts.campaigns, count):
        rng = np.random.default_rng([SEED, k])
        values = plan.drawn(rng)
        found, intervals = TIERS[tier](plan, plan.measured(values, rng), k)
        counts.add(found, intervals, values[plan.index])
    return counts


# --- file and page ---------------------------------------------------------------------------------------------------


def load(file: Path) -> dict[tuple[str, str], Counts]:
    """Counts by machine and tier."""
    if not file.exists():
        return {}
    cells = json.loads(file.read_text(encoding="utf-8"))
    return {(c.pop("machine"), c.pop("tier")): Counts(**c | {"names": tuple(c["names"])}) for c in cells}


def save(file: Path, cells: dict[tuple[str, str], Counts]) -> None:
    """A line for each machine and tier, in order."""
    keys = [(m, t) for m in MACHINES for t in TIERS if (m, t) in cells]
    lines = [json.dumps({"machine": m, "tier": t} | vars(cells[m, t])) for m, t in keys]
    file.write_text("[\n" + ",\n".join(lines) + "\n]\n", encoding="utf-8")


def remark(counts: Counts) -> str:
    """What misses the aim, by more than chance makes of so few campaigns."""
    inside = counts.coverage
    room = 2 * counts.scatter if counts.campaigns < 500 else 0.0
    below = LOWEST - (3 * np.sqrt(0.95 * 0.05 / counts.campaigns) if counts.campaigns < 500 else 0.0)
    words = [] if AVERAGE[0] - room <= inside.mean() <= AVERAGE[1] + room else ["average"]
    words += ["lowest"] if inside.min() < below else []
    words += [f"{100 * counts.missing:.1f} % without an end"] if counts.missing > 0 else []
    return "misses: " + ", ".join(words) if words else ""


def line(machine: str, tier: str, counts: Counts) -> str:
    """A row of the table."""
    inside = 100 * counts.coverage
    worst = int(np.argmin(inside))
    name = counts.names[counts.kept[worst]]
    cells: list[Any] = [machine, tier, counts.campaigns, f"{inside.mean():.1f} +- {100 * counts.scatter:.1f}"]
    cells += [f"{inside[worst]:.1f} ({name})", f"{counts.chi2_per_dof / counts.campaigns:.3f}"]
    return "| " + " | ".join(str(c) for c in [*cells, remark(counts)]) + " |\n"


def table(cells: dict[tuple[str, str], Counts]) -> str:
    """The table of the page."""
    titles = ("machine", "intervals", "campaigns", "average %", "lowest %", "chi-square per dof", "")
    head = "| " + " | ".join(titles) + " |\n" + "|---" * len(titles) + "|\n"
    return head + "".join(line(m, t, cells[m, t]) for m in MACHINES for t in TIERS if (m, t) in cells)


def renewed(page: str, cells: dict[tuple[str, str], Counts]) -> str:
    """The page with its table from the counts; the section is put at its end where it has none."""
    if not BLOCK.search(page):
        page = page.rstrip("\n") + "\n\n<!-- tiers -->\n<!-- end of tiers -->\n"
    return BLOCK.sub(lambda m: m.group(1) + table(cells) + m.group(2), page)


def main() -> None:
    """Measure, and write counts and page."""
    ask = argparse.ArgumentParser(description=__doc__)
    ask.add_argument("--campaigns", type=int, default=500)
    ask.add_argument("--machines", nargs="+", choices=MACHINES, default=MACHINES)
    ask.add_argument("--tiers", nargs="+", choices=TIERS, default=tuple(TIERS))
    ask.add_argument("--fresh", action="store_true", help="forget the counts of these machines and tiers")
    ask.add_argument("--from", dest="source", type=Path, help="write the table from this file")
    given = ask.parse_args()
    cells = load(given.source or COUNTS)
    if given.source is None:
        for machine, tier in ((m, t) for m in given.machines for t in given.tiers):
            counts = None if given.fresh else cells.get((machine, tier))
            for end in range(25, given.campaigns + 25, 25):
                counts = measure(machine, tier, min(end, given.campaigns), counts)
                cells[machine, tier] = counts
                save(COUNTS, cells)
            print(line(machine, tier, cells[machine, tier]), end="", flush=True)
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8"), cells), encoding="utf-8")


if __name__ == "__main__":
    main()
