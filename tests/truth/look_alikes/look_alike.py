"""What a look-alike of a real campaign is, and what all of them have in common. SI units."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tests.truth.pinned import Array

TAILS = 8
"""Degrees of freedom of the noise: a little heavier in its tails than normal, as that of instruments is."""


@dataclass(frozen=True, kw_only=True)
class LookAlike:
    """A machine file that lacks something, what was measured, and the answer.

    `machine`: text of the file. `table`: text of the table. `causes`: patterns of the names under which each cause is
    right. `declared`: text laid over the machine that declares the causes. `fresh`: the same machine on the same day at
    other poses, measured alike. `exact`: the same without noise and rounding. `values`: what is true (SI) of
    parameters and declared causes, all that is off nominal. `bad`: rows (from 0) that are no measurements.
    """

    machine: str
    table: str
    causes: tuple[tuple[str, ...], ...]
    declared: str
    fresh: str
    exact: str
    values: Mapping[str, float]
    bad: frozenset[int] = field(default_factory=frozenset)


def noise(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Student's t with variance 1."""
    drawn: Array = rng.standard_t(TAILS, size=shape) * np.sqrt((TAILS - 2) / TAILS)
    return drawn


def counted(values: Array, count: float) -> Array:
    """Values in whole counts of an encoder, or digits of an instrument."""
    rounded: Array = np.round(values / count) * count
    return rounded


def drawn_errors(seed: int, ranges: Mapping[str, float]) -> dict[str, float]:
    """Errors of parameters, normal with half their ranges."""
    rng = np.random.default_rng([seed, 1])
    return {name: float(rng.normal()) * wide / 2 for name, wide in ranges.items()}


def warm_day(seed: int, time: Array, kelvin: float) -> Array:
    """Temperature (N,) in degC of a shop that warms by `kelvin` over the campaign, slower at its end; read to 0.1 K."""
    rng = np.random.default_rng([seed, 2])
    u = (time - time[0]) / max(float(np.ptp(time)), 1.0)
    rise = (1 - np.exp(-1.2 * u)) / (1 - np.exp(-1.2))
    felt = rng.uniform(17, 20) + kelvin * rise + 0.15 * np.sin(2 * np.pi * (3 * u + rng.uniform()))
    return counted(felt, 0.1)


def sessions(lengths: Sequence[int]) -> list[str]:
    """Names of the sessions (N,), one row each."""
    return [f"s{k + 1}" for k, length in enumerate(lengths) for _ in range(length)]


def table_text(columns: Mapping[str, Sequence[str] | Array], digits: int = 6) -> str:
    """Columns of texts, or of numbers, as CSV."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    cells = [[c if isinstance(c, str) else f"{c:.{digits}f}" for c in column] for column in columns.values()]
    writer.writerows(zip(*cells, strict=True))
    return out.getvalue()
