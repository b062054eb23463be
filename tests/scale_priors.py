"""What is to be expected of intervals when scales are estimated from few numbers: `python -m tests.scale_priors`.

Writes two tables of docs/coverage.md, by integrals alone: of an offset of which nothing is known but the ranges, beside
n others of its kind that are known exactly; of a parameter that data determine, with the variance of noise estimated.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy import stats

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.instruments import WORTH

PAGE = Path(__file__).resolve().parents[1] / "docs" / "coverage.md"
LOG_TAU = np.linspace(-6.0, 8.0, 701)
FACTORS, COUNTS = (1.0, 1.5, 2.0, 3.0), (0, 1, 3, 6, 20)
ROWS, NOISE = (8, 20, 60, 200), ((1.5, "1.5 times too small"), (1.0, "right"), (0.5, "twice too large"))
PLANE, DETERMINED = 2, 6  # readings a row and parameters of the Triglide without redundancy
DRAWS = 100
Prior = Callable[[Array], Array]


def log_normal(factor: float) -> Prior:
    """Logarithm of the density of log tau about 0, its standard deviation that of a factor."""
    return lambda log_tau: -0.5 * (log_tau / np.log(factor)) ** 2


def chi_square(freedom: float) -> Prior:
    """The same of tau^2 = freedom / chi-square."""
    return lambda log_tau: -freedom * log_tau - 0.5 * freedom * np.exp(-2.0 * log_tau)


PRIORS = {
    "within a factor of 1.5": log_normal(1.5),
    "within a factor of 2 (used)": log_normal(2.0),
    "within a factor of 3": log_normal(3.0),
    "inverse chi-square, 2 degrees of freedom": chi_square(2.0),
    "the same, 1 degree of freedom": chi_square(1.0),
}


def half_width(prior: Prior, count: int, squares: float) -> float:
    """Within which the posterior has 95 % of another offset, given the sum of squares of `count` known ones."""
    log_weight = prior(LOG_TAU) - count * LOG_TAU - 0.5 * squares * np.exp(-2.0 * LOG_TAU)
    weight = np.exp(log_weight - log_weight.max())
    low, high = 0.0, 1e3
    for _ in range(40):
        middle = 0.5 * (low + high)
        inside = float(weight @ (2.0 * stats.norm.cdf(middle / np.exp(LOG_TAU)) - 1.0)) / float(weight.sum())
        low, high = (middle, high) if inside < 0.95 else (low, middle)
    return high


def held(prior: Prior, count: int, factors: tuple[float, ...] = FACTORS) -> list[float]:
    """Share of intervals that hold an offset whose kind is factors times as wide as stated, in percent."""
    drawn = stats.chi2.ppf((np.arange(DRAWS) + 0.5) / DRAWS, count) if count else np.zeros(1)
    return [
        100.0 * float(np.mean([2.0 * stats.norm.cdf(half_width(prior, count, f**2 * c) / f) - 1.0 for c in drawn]))
        for f in factors
    ]


def determined(rows: int, factor: float) -> float:
    """Share of intervals that hold a parameter that noise alone spoils, `factor` times what is stated, in percent."""
    worth, dof = WORTH["stated"], PLANE * rows - DETERMINED
    drawn = stats.chi2.ppf((np.arange(DRAWS) + 0.5) / DRAWS, dof)
    deviation = np.sqrt((worth + factor**2 * drawn) / (worth + dof))
    return 100.0 * float(np.mean(2.0 * stats.norm.cdf(stats.t.ppf(0.975, worth + dof) * deviation / factor) - 1.0))


def tables() -> dict[str, list[str]]:
    """The tables by name, as lines."""
    shares = {(name, n): held(prior, n) for name, prior in PRIORS.items() for n in COUNTS}
    head = [
        "| prior of the factor | " + " | ".join(f"{n} known" for n in COUNTS) + " |",
        "|---" * (len(COUNTS) + 1) + "|",
    ]
    of_ranges = [
        f"| {name} | " + " | ".join(", ".join(f"{s:.0f}" for s in shares[name, n]) for n in COUNTS) + " |"
        for name in PRIORS
    ]
    noise = ["| rows | " + " | ".join(f"sigma {word}" for _, word in NOISE) + " |", "|---" * (len(NOISE) + 1) + "|"]
    noise += [f"| {n} | " + " | ".join(f"{determined(n, f):.1f}" for f, _ in NOISE) + " |" for n in ROWS]
    return {"scales of ranges": [*head, *of_ranges], "scales of noise": noise}


def main() -> None:
    """Write both."""
    made_of = tables()
    page = PAGE.read_text(encoding="utf-8")
    for name, lines in made_of.items():
        block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end of {name} -->\n)", re.DOTALL)
        made = "".join(f"{line}\n" for line in lines)
        page = block.sub(lambda m, made=made: f"{m[1]}{made}{m[2]}", page)  # type: ignore[misc]
        print(made)
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
