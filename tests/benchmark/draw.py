"""Drawing of undeclared effects: plausible ones, that the campaign can show, of a wanted size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmark.setting import Setting
from tests.truth.campaigns import Planted, families, unit
from tests.truth.planted import KEPT

CLOSE = 0.95  # cosine above which two effects are alias pairs
ABSORBED = 0.01  # share of the length that must remain after projection
TRIES = 60


@dataclass(frozen=True)
class Drawn:
    """An effect to plant; `size` in minimal detectable ones; `own`: cosine of what it does with its hypothesis, and of
    its nearest `rival`."""

    planted: Planted
    size: float
    own: float
    rival: str
    cosine: float

    @property
    def name(self) -> str:
        """The hypothesis that it is."""
        return f"{self.planted.keyword}@{self.planted.at}"

    @property
    def separable(self) -> bool:
        """Whether no other hypothesis does nearly the same."""
        return self.cosine <= CLOSE


@dataclass(frozen=True)
class Wanted:
    """Which effects are drawn: sizes `low` to `high`, keywords beginning so, with or without a near rival."""

    low: float
    high: float
    keywords: tuple[str, ...] = ("",)
    separable: bool | None = None


def draw(setting: Setting, rng: np.random.Generator, wanted: Wanted) -> Drawn:
    """A keyword at random, one of its places at random, and a size, until all that is wanted is met."""
    machine, seed = setting.plain.machine, setting.plain.noise_seed[0]
    every = [f for f in families(machine) if f[0].startswith(wanted.keywords)]
    keywords = sorted({keyword for keyword, _ in every})
    for _ in range(TRIES):
        keyword = keywords[rng.integers(len(keywords))]
        places = [at for k, at in every if k == keyword]
        one = unit(machine, keyword, places[rng.integers(len(places))], seed)
        drawn = _sized(setting, one, wanted, float(rng.uniform()))
        if drawn is not None and wanted.separable in (None, drawn.separable):
            return drawn
    raise LookupError(f"{machine} {seed}: nothing to draw for {wanted}")


def draw_several(setting: Setting, rng: np.random.Generator, wanted: Wanted, count: int, least: float) -> list[Drawn]:
    """Effects of different places, each of at least the size `least` with the others projected out."""
    for _ in range(TRIES):
        drawn = [draw(setting, rng, wanted) for _ in range(count)]
        if len({d.planted.at for d in drawn}) == count and min(joint_sizes(setting, drawn)) >= least:
            return drawn
    raise LookupError(f"{setting.plain.machine} {setting.plain.noise_seed[0]}: no {count} effects")


def joint_sizes(setting: Setting, drawn: Sequence[Drawn]) -> list[float]:
    """Size of each effect with all others projected out."""
    changes = [setting.change(d.planted) for d in drawn]
    return [setting.size(c, [o for o in changes if o is not c]) for c in changes]


def _sized(setting: Setting, one: Planted, wanted: Wanted, share: float) -> Drawn | None:
    """The effect at a size between the wanted ones, or as large as is plausible; None where that is too small."""
    name = f"{one.keyword}@{one.at}"
    change = setting.change(one)
    size = setting.size(change)
    length = setting.size_raw(change)
    if size < ABSORBED * length or not setting.scores[name][1].count:
        return None
    high = min(wanted.high, size * largest(setting, one))
    if high < wanted.low:
        return None
    planted = one.scaled((wanted.low + share * (high - wanted.low)) / size)
    change = setting.change(planted)
    rival, cosine = setting.rival(change, name)
    return Drawn(planted, setting.size(change), setting.cosine(change, name), rival, cosine)


def largest(setting: Setting, one: Planted) -> float:
    """Factor at which the first value of an effect reaches the end of its plausible range."""
    model = setting.ready.candidates.model
    ranges = dict(zip(model.names, model.ranges, strict=True))
    name = f"{one.keyword}@{one.at}"
    return min(float(ranges[f"{name}.{n}"]) / abs(v) for n, v in one.values.items() if n not in KEPT and v)
