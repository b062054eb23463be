"""What is diagnosed where nothing is missing? `python -m tests.diagnosis_level > docs/diagnosis-level.md`.

Simulated tables of four machines that lack no effect, with ranges that are too small, noise of other kinds, rounding,
and gross rows (an hour on two cores). `--share 0.1`: that share of the tables; `--only TEXT`: lines that contain it.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from tests.benchmark.setting import diagnosed
from tests.truth.campaigns import MACHINES, Campaign, Scenario, campaign

HEAD = """# What is diagnosed where nothing is missing

Written by `python -m tests.diagnosis_level > docs/diagnosis-level.md` (half an hour on two cores); do not edit.

Tables of four machines (Triglide with and without its redundant drive, Scissors, Delta with four drives), simulated
by minimisation of the energy of pinned rods, which shares nothing with the engine. Nothing is missing in the machine
file. In the first line the true errors of the declared parameters are 1, 1.5, 2 or 3 times what their ranges say.
Rates are those of `diagnose` with its usual false-alarm rate of 0.5 %.

"Sigma too small" names nothing: the residuals are larger than stated noise makes them. For rounded readings it is
true where counts are coarse: the Scissors has a stated sigma of 0.5 um, its readings are rounded to 1 um or its
drives to 0.5 to 5 um. Required: at most 1 % of the first line other than clean, 2 % of the second, 0.5 % of the third
other than clean or sigma too small, at most 2 % of the fourth a fault of the measurement, and no effect named in the
last, whose rows are all found.
"""
MICROMETRE = 1e-6
COUNTS = (0.5e-6, 1e-6, 2e-6, 5e-6)
FACTORS = (1.0, 1.5, 2.0, 3.0)
FEWEST, MOST_ROWS = 10, 200
GROSS_ROWS = 3


@dataclass(frozen=True)
class Table:
    """A campaign without any effect, and the rows that are wrong."""

    measured: Campaign
    bad: frozenset[int] = frozenset()


@dataclass(frozen=True, kw_only=True)
class Told:
    """What became of a table: its verdict, names of effects and of what is unknown, rows found, lost and good."""

    machine: str
    rows: int
    verdict: str
    names: tuple[str, ...]
    bad: int
    found: int
    lost: int
    growth: bool  # whether noise that grows is told


Maker = Callable[[str, int, np.random.Generator], Table]


def anything(machine: str, seed: int, rng: np.random.Generator) -> Table:
    """10 to 200 rows, errors up to three times what ranges say."""
    scenario = Scenario(errors=float(rng.choice(FACTORS)), sessions=int(rng.integers(1, 3)))
    return Table(campaign(machine, [], seed, rows=_rows(rng), scenario=scenario))


def heavy(machine: str, seed: int, rng: np.random.Generator) -> Table:
    """Noise with the tails of Student's t of 4 degrees of freedom."""
    return Table(campaign(machine, [], seed, rows=_rows(rng), scenario=Scenario(noise="t4", sessions=1)))


def gross(machine: str, seed: int, rng: np.random.Generator) -> Table:
    """Three rows 20 to 60 sigma off."""
    rows = int(rng.choice([12, 30, 60, 200]))
    measured = campaign(machine, [], seed, rows=rows, scenario=Scenario(sessions=1))
    bad = rng.choice(rows, GROSS_ROWS, replace=False)
    shift = rng.normal(size=(GROSS_ROWS, measured.readings.shape[1]))
    shift *= rng.uniform(20, 60, (GROSS_ROWS, 1)) / np.linalg.norm(shift, axis=1, keepdims=True)
    readings = measured.readings.copy()
    readings[bad] += shift * measured.sigma
    return Table(replace(measured, readings=readings), frozenset(int(r) for r in bad))


def rounded(machine: str, seed: int, rng: np.random.Generator) -> Table:
    """Readings in micrometres, or drives in counts of their encoders."""
    measured = campaign(machine, [], seed, rows=_rows(rng), scenario=Scenario(sessions=1))
    if rng.random() < 0.5:
        return Table(replace(measured, readings=np.round(measured.readings / MICROMETRE) * MICROMETRE))
    here = measured.conditions
    count = float(rng.choice(COUNTS))
    return Table(replace(measured, conditions=replace(here, q=np.round(here.q / count) * count)))


def growing(machine: str, seed: int, rng: np.random.Generator) -> Table:
    """Noise that grows 1 : 6 along a coordinate; its root mean square is as stated."""
    measured = campaign(machine, [], seed, rows=int(rng.choice([60, 120, 192])), scenario=Scenario(sessions=1))
    place = measured.true_readings[:, int(rng.integers(measured.readings.shape[1]))]
    share = (place - place.min()) / np.ptp(place)
    size = 1 + 5 * (share if rng.random() < 0.5 else 1 - share)
    size /= np.sqrt((size**2).mean())
    noise = (measured.readings - measured.true_readings) * size[:, None]
    return Table(replace(measured, readings=measured.true_readings + noise))


def _rows(rng: np.random.Generator) -> int:
    """So many rows, small tables as often as large ones."""
    return round(float(np.exp(rng.uniform(np.log(FEWEST), np.log(MOST_ROWS)))))


@dataclass(frozen=True)
class Line:
    """A kind of tables, and how many."""

    text: str
    count: int
    make: Maker


HEADS = (
    "tables",
    "number",
    "clean",
    "effects named",
    "unknown",
    "measurement at fault",
    "sigma too small",
    "bad rows found",
    "good rows lost",
)
LINES = (
    Line("nothing missing, ranges 1 to 3 times too small, 10 to 200 rows", 1000, anything),
    Line("noise with heavy tails (Student's t, 4 degrees of freedom), 10 to 200 rows", 400, heavy),
    Line("readings rounded to 1 um or drives to counts, 10 to 200 rows", 400, rounded),
    Line("noise that grows 1 : 6 over the workspace, 60 to 192 rows", 100, growing),
    Line("three rows 20 to 60 sigma off, 12 to 200 rows", 200, gross),
)


def told(line: int, number: int) -> Told:
    """A table of a line, diagnosed."""
    rng = np.random.default_rng([14, line, number])
    machine = MACHINES[number % len(MACHINES)]
    table = LINES[line].make(machine, int(rng.integers(1_000_000)), rng)
    d = diagnosed(table.measured, number)
    called = set(d.bad_rows)
    rows = len(table.measured.readings)
    return Told(
        machine=machine,
        rows=rows,
        verdict=d.verdict,
        names=_names(d),
        bad=len(table.bad),
        found=len(called & table.bad),
        lost=len(called - table.bad),
        growth=bool(d.noise),
    )


def _names(d: Diagnosis) -> tuple[str, ...]:
    return (
        *(f"{f.hypothesis.name}{' (provisional)' if f.provisional else ''}" for f in d.findings),
        *(f"unknown: {u.depends_on} ({u.hint})" for u in d.unknown),
    )


def one(key: tuple[int, int]) -> Told:
    """For a pool of processes."""
    return told(*key)


def lines(share: float, only: str) -> Iterator[str]:
    """The table, a line as it is ready."""
    yield HEAD
    yield f"| {' | '.join(HEADS)} |"
    yield "|---" * len(HEADS) + "|"
    with ProcessPoolExecutor() as pool:
        for k, line in enumerate(LINES):
            if only in line.text:
                count = int(np.ceil(share * line.count))
                results = list(pool.map(one, [(k, n) for n in range(count)], chunksize=4))
                yield _row(line, results)


def _row(line: Line, results: list[Told]) -> str:
    verdicts = Counter(r.verdict for r in results)
    named = verdicts["found"] + verdicts["ambiguous"]
    bad, good = sum(r.bad for r in results), sum(r.rows - r.bad for r in results)
    cells = (line.text, len(results), verdicts["clean"], named, verdicts["unknown"], verdicts["measurement_fault"],
             verdicts["sigma_too_small"], f"{sum(r.found for r in results)} of {bad}" if bad else "",
             f"{sum(r.lost for r in results)} of {good}")  # fmt: skip
    return "| " + " | ".join(str(c) for c in cells) + " |"


def main() -> None:
    """Runs and prints."""
    parser = argparse.ArgumentParser(prog="python -m tests.diagnosis_level", description=__doc__)
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    for text in lines(given.share, given.only):
        print(text, flush=True)


if __name__ == "__main__":
    main()
