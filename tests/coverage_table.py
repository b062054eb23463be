"""What the stated uncertainties are worth: `python -m tests.coverage_table` writes the head of docs/coverage.md.

Options: number of campaigns (500), machines (all).
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from pkmcal_cli.calibration.identifiability import Directions
from pkmcal_cli.calibration.identify import identify
from tests.campaigns import Coverage, Plan, coverage, shipped

MACHINES = ("triglide", "triglide-nonredundant", "biglide", "scissors", "delta4", "hexapod7", "hangprinter")
COUNT, SEED = 500, 1
PAGE = Path(__file__).resolve().parents[1] / "docs" / "coverage.md"
NEXT = "## Where ranges and sigmas are wrong"

HEAD = """# Do the intervals contain the true values?

The whole page anew: `python -m tests.coverage_page` (hours).

Written by `python -m tests.coverage_table`; {count} campaigns per machine, seed {seed}.

In each campaign, all true parameters are drawn from the prior (normal about nominal, standard deviation range / 2),
also those that are not identified (but for the radii of the hangprinter, see below). The machine with these parameters
is measured at the poses of its shipped file with noise of the declared sigma (the hangprinter at 30 poses of its own,
and with noise on its drives), and calibrated. Coverage is the share of campaigns in which `value +- 1.96 std` contains
the true value. It must be 93 to 97 % on average over the parameters of a machine, and at least 91 % for each parameter.
`+-` after the average is its standard deviation due to chance with this number of campaigns.

| machine | simulated by | parameters | average % | lowest % | chi-square per dof | combinations held | converged |
|---|---|---|---|---|---|---|---|
"""

HELD = """
## Which combinations are held

A combination of parameters is held at its nominal value if its standard uncertainty from the data alone, 1/s ranges,
exceeds that of its prior, 1/2 range; its prior then contributes to the uncertainty of the other parameters. The table
gives the expected root mean square error of the parameters, in ranges, for three rules: hold above 1 range, hold above
1/2 range (used), and a weighted mean of data and prior throughout. With the first rule, more measurements can make a
parameter worse. The third is best if the true values follow the prior. If they do not, it pulls well-determined
parameters towards nominal, so it is not used.

| machine | held above 1 range | held above 1/2 range | data and prior |
|---|---|---|---|
"""

BENT = """
The spool radii of the hangprinter are not identified and known to 2.7 %. They are not drawn: with errors so large,
anchors move further than any linear statement reaches, and many intervals of `Dz` do not hold.

The intervals of the Scissors are too wide: 25 held parameters make nearly all of their width. What is identified is
moved by them more than by its own offsets, and from these alone is estimated how wide the ranges of lengths are.
"""

WITHOUT = """
Not determined (infinite intervals) and omitted from the table: {names} of `{machine}`.
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
    return identify(plan.measured(plan.drawn(rng), rng), plan.selected).directions


def main(count: int, machines: tuple[str, ...]) -> None:
    """Write the head of the page; what stands below, from other programs, stays."""
    parts, left_out = [HEAD.format(count=count, seed=SEED)], []
    for name in machines:
        plan, found = shipped(name), coverage(name, count, SEED, os.cpu_count() or 1)
        parts.append(line(plan, found) + "\n")
        print(parts[-1], end="", flush=True)
        lost = [n for n in found.names if n not in found.determined().names]
        left_out += [WITHOUT.format(names=", ".join(lost), machine=name)] if lost else []
    parts += [*left_out, BENT, HELD]
    for name in machines:
        errors = " | ".join(f"{e:.3f}" for e in expected_errors(at_one_draw(shipped(name))))
        parts.append(f"| {name} | {errors} |\n")
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text("".join(parts) + "\n" + page[page.index(NEXT) :], encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else COUNT, tuple(sys.argv[2:]) or MACHINES)
