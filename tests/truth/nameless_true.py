"""Errors of a drive or across a guide whose shape over the travel is in no catalogue. SI units.

A bump, a step, a rise like a hyperbolic tangent, a ripple of two periods: `h` is the height in m; where the shape lies
and how wide it is follow from the seed.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .effects_true import Effect, moved_across
from .fast_pinned import Array
from .planted import Context, Planted, Shift

Law = Callable[[Array, np.random.Generator], Array]


def bump(u: Array, rng: np.random.Generator) -> Array:
    """A hump whose full width at half maximum is 8 to 15 % of the travel."""
    middle, width = rng.uniform(-0.6, 0.6), rng.uniform(0.16, 0.30) / 2.355
    return np.asarray(np.exp(-(((u - middle) / width) ** 2) / 2))


def step(u: Array, rng: np.random.Generator) -> Array:
    """A jump somewhere in the middle three fifths of the travel."""
    return np.where(u > rng.uniform(-0.6, 0.6), 1.0, 0.0)


def tanh(u: Array, rng: np.random.Generator) -> Array:
    """A rise within a tenth to a fifth of the travel."""
    middle, width = rng.uniform(-0.6, 0.6), rng.uniform(0.05, 0.10)
    return np.asarray(0.5 * np.tanh((u - middle) / width))


def waves(u: Array, rng: np.random.Generator) -> Array:
    """Two or three periods over the travel."""
    return np.asarray(0.5 * np.sin(np.pi * rng.uniform(1.8, 3.0) * u + rng.uniform(0, 2 * np.pi)))


LAWS: dict[str, Law] = {f.__name__: f for f in (bump, step, tanh, waves)}


def displaced(p: Planted, c: Context, u: Array) -> Array:
    """The displacement (N,) in m at places u of the travel."""
    law = p.keyword.removeprefix("odd_")
    return np.asarray(
        p.get("h") * LAWS[law](u, np.random.default_rng([c.seed, 7, *p.keyword.encode(), *p.at.encode()]))
    )


def nameless(p: Planted, c: Context, shift: Shift) -> Shift:
    """A drive's position, or that of carriages across GUIDE.AXIS, is off by a shape over the travel."""
    if "." in p.at:
        return moved_across(p, c, shift, lambda q, u, half: displaced(p, c, u))
    a = c.drive(p.at)
    return shift.with_drive(a, displaced(p, c, c.u(a)))


NAMELESS: dict[str, Effect] = {f"odd_{law}": nameless for law in LAWS}
