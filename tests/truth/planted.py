"""What a planted effect is, what it may depend on, and what it adds up in. SI units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from .fast_pinned import Array, Load
from .shop_conditions import REFERENCE, Conditions
from .shop_plans import Geometry, Plan
from .shop_shapes import normalised

KEPT = ("period",)
"""Values that are no sizes and are not scaled."""


@dataclass(frozen=True)
class Planted:
    """An undeclared effect: keyword, place as in the machine file, values in SI."""

    keyword: str
    at: str
    values: Mapping[str, float]

    def scaled(self, factor: float) -> Planted:
        """The same effect, `factor` times as large."""
        return replace(self, values={n: v if n in KEPT else v * factor for n, v in self.values.items()})

    def get(self, name: str) -> float:
        """A value, 0 where it is not given."""
        return float(self.values.get(name, 0.0))


@dataclass(frozen=True)
class Travel:
    """Range of travel of each drive, (A,) in m."""

    low: Array
    high: Array

    @classmethod
    def of(cls, q: Array) -> Travel:
        """The range in a table (N, A)."""
        return cls(q.min(0), q.max(0))


@dataclass(frozen=True, kw_only=True)
class Context:
    """What effects may depend on. `force` (N, A) of the drives and `tension` (N, R) of the rods in N: in the
    equilibrium without the effects that depend on them; `seed`: of what is drawn inside an effect."""

    plan: Plan
    geometry: Geometry
    conditions: Conditions
    travel: Travel
    extra: float
    seed: int
    force: Array
    tension: Array

    def drive(self, name: str) -> int:
        """Column of a drive."""
        return self.plan.drives.index(name)

    def u(self, column: int) -> Array:
        """Travel (N,) of a drive in [-1, 1]."""
        return normalised(self.conditions.q[:, column], self.travel.low[column], self.travel.high[column])

    def half(self, column: int) -> float:
        """Half the travel of a drive in m."""
        return float(self.travel.high[column] - self.travel.low[column]) / 2

    def guide(self, name: str) -> tuple[list[int], float, float]:
        """Drives on a guide, and where its used part begins and ends in m."""
        columns = [a for a, guide in enumerate(self.plan.guide) if guide == name]
        if not columns:
            raise KeyError(f"{self.plan.name} has no guide {name!r}")
        return columns, float(self.travel.low[columns].min()), float(self.travel.high[columns].max())

    def warmth(self, place: str, lag: float) -> Array:
        """Temperature (N,) in K above the reference: of the part's own thermometer, or of the air, late by `lag` s."""
        logged = self.conditions
        if place in logged.part:
            return logged.part[place] - REFERENCE
        if lag * self.extra == 0:
            return logged.temperature - REFERENCE
        return logged.air.at(logged.time, lag * self.extra) - REFERENCE


@dataclass(frozen=True, kw_only=True)
class Shift:
    """What N rows of a machine with A drives and R rods are off by: `drive` (N, A) m; `across` (N, A, 3) m and `turn`
    (N, A, 3) rad of the carriages in the axes of their guide's frame; `foot` (N, A, 3) m in base axes; `length` (N, R)
    m; `log_stiffness` (N, R); half clearance `gap` (R,) m; loads."""

    drive: Array
    across: Array
    turn: Array
    foot: Array
    length: Array
    log_stiffness: Array
    gap: Array
    loads: tuple[Load, ...] = ()

    @classmethod
    def none(cls, rows: int, drives: int, rods: int) -> Shift:
        """No effect at all."""
        vectors = (rows, drives, 3)
        return cls(
            drive=np.zeros((rows, drives)),
            across=np.zeros(vectors),
            turn=np.zeros(vectors),
            foot=np.zeros(vectors),
            length=np.zeros((rows, rods)),
            log_stiffness=np.zeros((rows, rods)),
            gap=np.zeros(rods),
        )

    def with_drive(self, column: int, error: Array) -> Shift:
        """A drive's error (N,) in m added."""
        drive = self.drive.copy()
        drive[:, column] += error
        return replace(self, drive=drive)

    def with_rod(self, column: int, length: Array) -> Shift:
        """A rod's growth (N,) in m added."""
        total = self.length.copy()
        total[:, column] += length
        return replace(self, length=total)
