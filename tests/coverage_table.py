"""What the stated uncertainties are worth: `python -m tests.coverage_table > docs/coverage.md` (about half an hour).

Options: number of campaigns (500), machines (all).
"""

from __future__ import annotations

import os
import sys

import numpy as np

from pkmcal_cli.calibration.identifiability import Directions
from pkmcal_cli.calibration.identify import identify
from tests.campaigns import Coverage, Plan, coverage, shipped

MACHINES = ("triglide", "triglide-nonredundant", "biglide", "scissors", "delta4", "hexapod7", "hangprinter")
COUNT, SEED = 500, 1

HEAD = """# Do the intervals hold the true values?

Written by `python -m tests.coverage_table > docs/coverage.md`; {count} campaigns a machine, seed {seed}.

A campaign: true parameters are drawn from the prior (normal about nominal, standard deviation range / 2), the machine
with these parameters is measured at the poses of its shipped file with noise of the declared sigma (the hangprinter at
30 poses of its own, with noise of its drives too), and calibrated. Coverage is the share of campaigns in which
`value +- 1.96 std` holds the true value; it must be 94 to 96 % on average over a machine's parameters, and 91 % for
each. `+-` beside the average is what chance makes of it in so many campaigns.

| machine | simulated by | parameters | average % | lowest % | chi-square per dof | combinations held | converged |
|---|---|---|---|---|---|---|---|
"""

HELD = """
## What is held

A combination of parameters whose standard uncertainty from the data alone, 1/s ranges, is above its prior's, 1/2 range,
is held at its nominal value and takes its prior into the others' uncertainty. The table has the root mean square of
the parameters' errors, in ranges, that is to be expected for three rules: hold above 1 range, hold above 1/2 range
(used), and a weighted mean of data and prior everywhere. The first lets a parameter become worse as more is measured.
The last is best when the true values are as the prior says, and draws well-seen parameters towards nominal when they
are not; it is not used.

| machine | held above 1 range | held above 1/2 range | data and prior |
|---|---|---|---|
"""

WITHOUT = """
Not determined, with infinite intervals, and not in the table: {names} of `{machine}`.
"""


def line(plan: Plan, found: Coverage) -> str:
    """A row of the table; percentages of the parameters that are determined."""
    some = found.determined()
    worst, inside = int(np.argmin(some.inside)), 100 * some.inside
    average = f"{inside.mean():.1f} +- {100 * some.scatter:.1f}"
    return (
        f"| {plan.name} | {plan.source} | {len(some.names)} | {average} | {inside[worst]:.1f} ({some.names[worst]}) "
        f"| {found.chi2_per_dof:.3f} | {found.held.mean():.1f} | {found.converged} of {len(found.chi2)} |"
    )


def expected_errors(found: Directions) -> tuple[float, float, float]:
    """Root mean square error of determined parameters, in ranges: hold above 1 range, above 1/2, data and prior."""
    keep = ~found.undetermined()
    with np.errstate(divide="ignore"):
        data = 1 / found.singular_values**2
    rules = (np.where(data > 1, 0.25, data), np.minimum(data, 0.25), 1 / (1 / data + 4))
    return tuple(float(np.sqrt((found.vectors.T**2 @ r)[keep].mean())) for r in rules)  # type: ignore[return-value]


def at_one_draw(plan: Plan) -> Directions:
    """Directions of a plan, at one draw from the prior (nominal values would hide what errors let see)."""
    rng = np.random.default_rng(SEED)
    return identify(plan.measured(plan.drawn(rng), rng), plan.selected).found


def main(count: int, machines: tuple[str, ...]) -> None:
    """Print the page."""
    print(HEAD.format(count=count, seed=SEED), end="")
    left_out = []
    for name in machines:
        plan, found = shipped(name), coverage(name, count, SEED, os.cpu_count() or 1)
        print(line(plan, found), flush=True)
        lost = [n for n in found.names if n not in found.determined().names]
        left_out += [WITHOUT.format(names=", ".join(lost), machine=name)] if lost else []
    print("".join(left_out), end="")
    print(HELD, end="")
    for name in machines:
        print(f"| {name} | " + " | ".join(f"{e:.3f}" for e in expected_errors(at_one_draw(shipped(name)))) + " |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else COUNT, tuple(sys.argv[2:]) or MACHINES)
