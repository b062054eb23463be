"""The tests and their cases: what is planted where, how it is measured. A case follows from test and number alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tests.benchmark.draw import Drawn, Wanted, draw, draw_several
from tests.benchmark.setting import Setting
from tests.truth.campaigns import MACHINES, Campaign, Planted, Scenario, campaign, unit, unknown_families

SURE = 1.5
"""Size in minimal detectable ones above which a single effect must be named."""
LEVELS = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0)
"""Sizes of the power curve."""
PER_LEVEL = 16


@dataclass(frozen=True, kw_only=True)
class Case:
    """One campaign to diagnose. `drawn`: effects of the catalogue; `unknown`: one that is in none, and its size."""

    test: str
    number: int
    machine: str
    seed: int
    scenario: Scenario
    drawn: tuple[Drawn, ...] = ()
    unknown: Planted | None = None
    size: float = 0.0

    @property
    def planted(self) -> list[Planted]:
        """All that is planted."""
        return [d.planted for d in self.drawn] + ([] if self.unknown is None else [self.unknown])

    def measured(self, stream: int = 0) -> Campaign:
        """The campaign; another stream is a hold-out on the same day."""
        return campaign(self.machine, self.planted, self.seed, scenario=replace(self.scenario, stream=stream))


Maker = Callable[[str, int, str, int, np.random.Generator], Case]


def nothing(scenario: Scenario) -> Maker:
    """Nothing is missing."""
    return lambda test, number, machine, seed, rng: Case(
        test=test, number=number, machine=machine, seed=seed, scenario=scenario
    )


def one(wanted: Wanted, omit: tuple[str, ...] = ()) -> Maker:
    """One effect; `omit`: columns that the table lacks."""

    def make(test: str, number: int, machine: str, seed: int, rng: np.random.Generator) -> Case:
        drawn = draw(Setting.of(machine, seed), rng, wanted)
        return Case(test=test, number=number, machine=machine, seed=seed, scenario=Scenario(omit=omit), drawn=(drawn,))

    return make


def several(count: int) -> Maker:
    """Some effects at once."""

    def make(test: str, number: int, machine: str, seed: int, rng: np.random.Generator) -> Case:
        drawn = draw_several(Setting.of(machine, seed), rng, Wanted(2, 8, separable=True), count, SURE)
        return Case(test=test, number=number, machine=machine, seed=seed, scenario=Scenario(), drawn=tuple(drawn))

    return make


def power(test: str, number: int, machine: str, seed: int, rng: np.random.Generator) -> Case:
    """One effect of a size of the power curve."""
    level = LEVELS[number % len(LEVELS)]
    drawn = draw(Setting.of(machine, seed), rng, Wanted(level, level, separable=True))
    return Case(test=test, number=number, machine=machine, seed=seed, scenario=Scenario(), drawn=(drawn,), size=level)


def bad_rows(test: str, number: int, machine: str, seed: int, rng: np.random.Generator) -> Case:
    """Rows with gross errors, 1 or 2 %."""
    return Case(
        test=test, number=number, machine=machine, seed=seed, scenario=Scenario(outliers=float(rng.uniform(0.01, 0.02)))
    )


def outside(low: float, high: float) -> Maker:
    """An effect that is in no catalogue; its size is its rms over the stated noise."""

    def make(test: str, number: int, machine: str, seed: int, rng: np.random.Generator) -> Case:
        every = unknown_families(machine)
        keywords = sorted({keyword for keyword, _ in every})
        keyword = keywords[number // len(MACHINES) % len(keywords)]
        places = [at for k, at in every if k == keyword]
        size = float(rng.uniform(low, high))
        planted = unit(machine, keyword, places[rng.integers(len(places))], seed).scaled(size)
        return Case(
            test=test, number=number, machine=machine, seed=seed, scenario=Scenario(), unknown=planted, size=size
        )

    return make


THERMAL, REVERSAL = ("thermal_",), ("backlash", "unequal_backlash", "windup")
TESTS: dict[str, tuple[int, Maker]] = {
    "nothing": (300, nothing(Scenario())),
    "single": (400, one(Wanted(1, 8))),
    "two": (100, several(2)),
    "three": (50, several(3)),
    "rows": (60, bad_rows),
    "unknown": (100, outside(1, 6)),
    "small_unknown": (60, outside(0.2, 1)),
    "no_temperature": (50, one(Wanted(2, 8, THERMAL), ("T",))),
    "no_direction": (50, one(Wanted(2, 8, REVERSAL), ("dir.*",))),
    "sigma": (400, nothing(Scenario(sigma_factor=1.25))),
    "t4": (200, nothing(Scenario(noise="t4"))),
    "ar1": (100, nothing(Scenario(noise="ar1"))),
    "alias": (40, one(Wanted(1.5, 8, separable=False))),
    "power": (PER_LEVEL * len(LEVELS), power),
}
"""Number of cases and how to make one, by name of the test."""


def case(test: str, number: int) -> Case:
    """A case by its number; the machines take turns."""
    rng = np.random.default_rng([*test.encode(), number])
    seed = int(rng.integers(1_000_000))
    return TESTS[test][1](test, number, MACHINES[number % len(MACHINES)], seed, rng)
