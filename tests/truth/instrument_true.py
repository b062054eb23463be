"""Undeclared effects between the TCP and the table: measuring frame, set-up, scale, drift, tool, and effects that no
catalogue knows. SI units; readings are points (N, 3), z = 0 on planar machines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .effects_true import AXES, moved_across
from .fast_pinned import Array, rotations
from .planted import Context, Planted, Shift
from .shop_conditions import Conditions
from .shop_shapes import curve, normalised, settling

Reading = Callable[[Planted, Context, Array], Array]


def rigid(p: Planted, points: Array) -> Array:
    """R p + t of tx, ty, tz in m and the rotation vector rx, ry, rz in rad."""
    turn = rotations(np.array([p.get(f"r{axis}") for axis in AXES]))
    moved: Array = points @ turn.T + [p.get(f"t{axis}") for axis in AXES]
    return moved


def frame(p: Planted, c: Context, points: Array) -> Array:
    """The measuring frame is displaced and turned."""
    return rigid(p, points)


def resetup(p: Planted, c: Context, points: Array) -> Array:
    """The measuring frame is displaced and turned in one session, `at` s1, s2, ..."""
    again = c.conditions.session == int(p.at.removeprefix("s"))
    return np.where(again[:, None], rigid(p, points), points)


def meas_scale(p: Planted, c: Context, points: Array) -> Array:
    """s: the instrument reads 1 + s times the distance from the origin."""
    return (1 + p.get("s")) * points


def meas_shear(p: Planted, c: Context, points: Array) -> Array:
    """xy, xz, yz: axes that are not square, x += xy y + xz z, y += yz z."""
    shear = np.eye(3)
    for name in ("xy", "xz", "yz"):
        shear[AXES[name[0]], AXES[name[1]]] = p.get(name)
    return points @ shear.T


def drift(p: Planted, c: Context, points: Array) -> Array:
    """x1, y1, z1 in m: exponential settling of the instrument; x2, x3, ...: slow harmonics of these orders."""
    u = normalised(c.conditions.time, 0.0, c.conditions.air.length)
    moved = points.copy()
    for name, value in p.values.items():
        order = int(name[1:])
        slow = settling(u, value, c.extra) if order == 1 else curve(u, {order: value}, 0)
        moved[:, AXES[name[0]]] += slow
    return moved


INSTRUMENT: dict[str, Reading] = {f.__name__: f for f in (frame, resetup, meas_scale, meas_shear, drift)}
"""In the order in which they act."""


# Effects that no catalogue knows --------------------------------------------------------------------------


def draws(p: Planted, c: Context) -> np.random.Generator:
    """Random numbers of an effect, the same on every day of the machine."""
    return np.random.default_rng([c.seed, 5, *p.keyword.encode(), *p.at.encode()])


def way(c: Context, rng: np.random.Generator) -> Array:
    """Random unit vector (3,) in the directions that are measured."""
    vector = np.zeros(3)
    vector[: len(c.plan.channels)] = rng.normal(size=len(c.plan.channels))
    unit: Array = vector / np.linalg.norm(vector)
    return unit


def smooth_field(p: Planted, c: Context, where: Conditions) -> Array:
    """Random field (N, 3) over the workspace: 60 plane waves, length 0.3 of the workspace."""
    rng = draws(p, c)
    lower, upper = np.array(c.plan.lower), np.array(c.plan.upper)
    place = (where.poses[:, : len(lower)] - lower) / (upper - lower)
    number, phase = rng.normal(size=(len(lower), 60)) / 0.3, rng.uniform(0, 2 * np.pi, 60)
    channels = len(c.plan.channels)
    field = np.cos(place @ number + phase) @ rng.normal(size=(60, channels))
    return np.pad(field, ((0, 0), (0, 3 - channels)))


def step_in_time(p: Planted, c: Context, where: Conditions) -> Array:
    """A jump (N, 3) of the readings at some time in the middle half of the campaign."""
    rng = draws(p, c)
    share = where.time / where.air.length > rng.uniform(0.25, 0.75)
    return share[:, None] * way(c, rng)


def oscillation_in_time(p: Planted, c: Context, where: Conditions) -> Array:
    """An oscillation (N, 3) of the readings, 6 to 30 periods in the campaign."""
    rng = draws(p, c)
    turn = 2 * np.pi * rng.uniform(6, 30) * where.time / where.air.length + rng.uniform(0, 2 * np.pi)
    return np.sin(turn)[:, None] * way(c, rng)


UNKNOWN: dict[str, Callable[[Planted, Context, Conditions], Array]] = {
    f.__name__: f for f in (smooth_field, step_in_time, oscillation_in_time)
}


def unknown(p: Planted, c: Context, reference: Conditions) -> Array:
    """The readings' error (N, 3) in m: mean 0 and rms `rms` over the measured channels of the reference rows."""
    law, channels = UNKNOWN[p.keyword], len(c.plan.channels)
    mean, raw = law(p, c, reference).mean(0), law(p, c, reference)[:, :channels]
    size = np.sqrt(((raw - mean[:channels]) ** 2).mean())
    error: Array = p.get("rms") / size * (law(p, c, c.conditions) - mean)
    return error


def local_bump(p: Planted, c: Context, shift: Shift, height: float) -> Shift:
    """A bump of `height` m on the guide in `at` (GUIDE.AXIS), half as high 2.5 % of the used travel off its middle."""
    rng = draws(p, c)
    columns, low, high = c.guide(p.at.partition(".")[0])
    middle = low + (high - low) * rng.uniform(0.1, 0.9)
    if len(columns) > 1:  # not where no carriage ever is
        a = columns[int(rng.integers(len(columns)))]
        middle = c.travel.low[a] + (c.travel.high[a] - c.travel.low[a]) * rng.uniform(0.1, 0.9)
    width = 0.05 * (high - low) / 2.355
    return moved_across(p, c, shift, lambda q, u, half: height * np.exp(-(((q - middle) / width) ** 2) / 2))
