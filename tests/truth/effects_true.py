"""Undeclared effects that move the structure: drives, guides, carriages, feet, rods, joints, forces. SI units.

Each effect has its named size and, beyond it, a shape of its own (`Context.extra` times 10 to 25 %): ripple, load,
lag, lever. An effect is a function of a `Planted` and a `Context` and returns the `Shift` with its part added.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .fast_pinned import Array, Load
from .planted import Context, Planted, Shift
from .shop_shapes import curve, normalised, settling

STRUT_LAG, FOOT_LAG = 180.0, 300.0
"""s behind the logged temperature."""
WEIGHT = 9.80665
"""m/s^2, of the payload."""
PAYLOAD_CENTRE = np.array([0.015, -0.01, -0.08])
"""Centre of gravity of the payload in the platform's axes, m."""
AXES = {"x": 0, "y": 1, "z": 2}
BY_FORCE = ("windup", "clearance")
"""Effects that depend on the forces of the equilibrium without them."""

Effect = Callable[[Planted, Context, Shift], Shift]


def zero(p: Planted, c: Context, shift: Shift) -> Shift:
    """o: zero offset in m; DRIVE[s2]: in session s2 only."""
    drive, _, session = p.at.removesuffix("]").partition("[")
    acts = c.conditions.session == int(session.removeprefix("s")) if session else np.ones(len(shift.drive))
    return shift.with_drive(c.drive(drive), p.get("o") * acts)


def scale(p: Planted, c: Context, shift: Shift) -> Shift:
    """s: relative error of the set value, with a cubic part of 15 % (normalised to the travel)."""
    a = c.drive(p.at)
    cubic = 0.15 * c.half(a) * curve(c.u(a), {3: 1.0}, 0)
    return shift.with_drive(a, p.get("s") * (c.conditions.q[:, a] + c.extra * cubic))


def pitch_curve(p: Planted, c: Context, shift: Shift) -> Shift:
    """p2 to p6 in m: sum of harmonics over the travel with these Legendre coefficients, and a ripple."""
    a = c.drive(p.at)
    return shift.with_drive(a, curve(c.u(a), {k: p.get(f"p{k}") for k in range(2, 7)}, c.extra))


def pitch(p: Planted, c: Context, shift: Shift) -> Shift:
    """c, s in m: cosine and sine of the set value with `period` in m, and a second harmonic of 20 %; c2, s2: the same
    of half of the period, alone."""
    a = c.drive(p.at)
    turn = 2 * np.pi * c.conditions.q[:, a] / p.get("period")
    second = p.get("c") * np.cos(2 * turn + 0.7) + p.get("s") * np.sin(2 * turn + 0.7)
    twice = p.get("c2") * np.cos(2 * turn) + p.get("s2") * np.sin(2 * turn) + 0.2 * c.extra * second
    return shift.with_drive(a, p.get("c") * np.cos(turn) + p.get("s") * np.sin(turn) + twice)


def backlash(p: Planted, c: Context, shift: Shift) -> Shift:
    """b in m: distance between the approaches from both sides at 3 kg payload; 10 % more at 6 kg, less without."""
    a = c.drive(p.at)
    load = 1 + 0.1 * c.extra * (c.conditions.payload / 3 - 1)
    return shift.with_drive(a, -p.get("b") / 2 * load * c.conditions.direction[:, a])


def unequal_backlash(p: Planted, c: Context, shift: Shift) -> Shift:
    """b1 in m: backlash that grows along the travel, -b1 to b1, with a ripple."""
    a = c.drive(p.at)
    return shift.with_drive(a, -curve(c.u(a), {1: p.get("b1") / 2}, c.extra) * c.conditions.direction[:, a])


def windup(p: Planted, c: Context, shift: Shift) -> Shift:
    """w in m/N: lost motion by the drive's force, 20 % more at the far end of the screw, less at the near one."""
    a = c.drive(p.at)
    compliance = p.get("w") * (1 + 0.2 * c.extra * c.u(a))
    return shift.with_drive(a, -compliance * c.conditions.direction[:, a] * np.abs(c.force[:, a]))


def thermal_screw(p: Planted, c: Context, shift: Shift) -> Shift:
    """a in 1/K and o in m/K: growth of the screw from its fixed bearing, not quite even along it."""
    a = c.drive(p.at)
    uneven = c.conditions.q[:, a] + 0.15 * c.extra * c.half(a) * curve(c.u(a), {2: 1.0}, 0)
    return shift.with_drive(a, (p.get("a") * uneven + p.get("o")) * c.warmth(p.at, 0.0))


def zero_drift(p: Planted, c: Context, shift: Shift) -> Shift:
    """o1, o2 in m: exponential settling of a drive's zero over the day, and a slow harmonic of the second order."""
    u = normalised(c.conditions.time, 0.0, c.conditions.air.length)
    return shift.with_drive(c.drive(p.at), settling(u, p.get("o1"), c.extra) + curve(u, {2: p.get("o2")}, 0))


def moved_across(p: Planted, c: Context, shift: Shift, law: Callable[[Array, Array, float], Array]) -> Shift:
    """Carriages of the guide in `at` (GUIDE.AXIS) displaced by law(position, u, half travel) in m."""
    name, _, letter = p.at.partition(".")
    axis = AXES[letter]
    if axis == c.plan.along or (c.plan.planar and letter == "z"):
        raise KeyError(f"{p.at}: not an axis across the guide")
    columns, low, high = c.guide(name)
    across = shift.across.copy()
    for a in columns:
        q = c.conditions.q[:, a]
        across[:, a, axis] += law(q, normalised(q, low, high), (high - low) / 2)
    return replace(shift, across=across)


def straight(p: Planted, c: Context, shift: Shift) -> Shift:
    """n2 to n4 in m: harmonics over the used part of the guide with these Legendre coefficients, and a ripple; n0 in m:
    how far off the whole guide lies."""
    orders = {k: p.get(f"n{k}") for k in range(2, 5)}
    return moved_across(p, c, shift, lambda q, u, half: p.get("n0") + curve(u, orders, c.extra))


def guide_angle(p: Planted, c: Context, shift: Shift) -> Shift:
    """g in rad: inclination of the guide about the middle of its used part, with an S of 10 %."""
    g, extra = p.get("g"), 0.1 * c.extra
    return moved_across(p, c, shift, lambda q, u, half: g * half * (u + extra * curve(u, {3: 1.0}, 0)))


def carriage_angle(p: Planted, c: Context, shift: Shift) -> Shift:
    """a1, a2 in rad: turn of a carriage (CARRIAGE.rx, ry, rz) about its origin along the travel, and a ripple."""
    name, _, axis = p.at.partition(".")
    a = c.plan.carriage.index(name)
    if c.plan.planar and axis != "rz":
        raise KeyError(f"{p.at}: a planar carriage turns about z only")
    turn = shift.turn.copy()
    turn[:, a, AXES[axis[1]]] += curve(c.u(a), {1: p.get("a1"), 2: p.get("a2")}, c.extra)
    return replace(shift, turn=turn)


def rods_at(p: Planted, c: Context) -> list[int]:
    """The rod named in `at`, or all."""
    return list(range(len(c.plan.rods))) if p.at == "all" else [c.plan.rods.index(p.at)]


def thermal_strut(p: Planted, c: Context, shift: Shift) -> Shift:
    """a in 1/K: growth of a rod, or of all, some minutes behind the logged temperature."""
    for r in rods_at(p, c):
        shift = shift.with_rod(r, c.geometry.length[r] * p.get("a") * c.warmth(c.plan.rods[r], STRUT_LAG))
    return shift


def thermal_foot(p: Planted, c: Context, shift: Shift) -> Shift:
    """gx, gy, gz in m/K: a frame of guides moves with the temperature, minutes late."""
    columns = [a for a, frame in enumerate(c.plan.frame) if frame == p.at]
    if not columns:
        raise KeyError(f"{c.plan.name} has no frame {p.at!r}")
    way = np.array([p.get(f"g{axis}") for axis in AXES])
    foot = shift.foot.copy()
    foot[:, columns] += (c.warmth(p.at, FOOT_LAG)[:, None] * way)[:, None]
    return replace(shift, foot=foot)


def stiffness(p: Planted, c: Context, shift: Shift) -> Shift:
    """k: logarithm of true over declared stiffness, 15 % more where the screw of the rod's drive is short."""
    r = c.plan.rods.index(p.at)
    log_stiffness = shift.log_stiffness.copy()
    log_stiffness[:, r] += p.get("k") * (1 + 0.15 * c.extra * c.u(c.plan.carrier[r]))
    return replace(shift, log_stiffness=log_stiffness)


def clearance(p: Planted, c: Context, shift: Shift) -> Shift:
    """c in m: rod longer by c / 2 where it is pulled, shorter where pushed (by its tension without the clearance); the
    change of sides takes 15 % of the rod's rms force, and the joint gives 12 % of c / 2 with the force (Hertz)."""
    r = c.plan.rods.index(p.at)
    load = c.tension[:, r] / (np.sqrt((c.tension[:, r] ** 2).mean()) + 1e-9)
    side = np.tanh(load / 0.15) * (1 + 0.12 * c.extra * (np.cbrt(load**2) - 1))
    return shift.with_rod(r, p.get("c") / 2 * side)


def loose_joint(p: Planted, c: Context, shift: Shift) -> Shift:
    """c in m: the same clearance as a contact in the equilibrium itself. While the joint crosses it, the rod carries
    little; so where c / 2 is not small against the rods' elastic changes of length, the readings feel less of c."""
    if p.get("c") < 0:
        raise ValueError("a clearance is not negative")
    gap = shift.gap.copy()
    gap[c.plan.rods.index(p.at)] += p.get("c") / 2
    return replace(shift, gap=gap)


def ovality(p: Planted, c: Context, shift: Shift) -> Shift:
    """c, s in m: length by twice the rod's direction angle (planar), and 15 % by four times the angle."""
    r = c.plan.rods.index(p.at)
    a, g = c.plan.carrier[r], c.geometry
    frame = g.frame[a]
    base = g.foot[a] + frame @ g.offset[r] + c.conditions.q[:, a, None] * frame[:, c.plan.along]
    x, y = (c.conditions.poses + g.body[r] - base).T[:2]
    angle = np.arctan2(y, x)
    fourth = p.get("c") * np.cos(4 * angle + 0.5) + p.get("s") * np.sin(4 * angle + 0.5)
    twice = p.get("c") * np.cos(2 * angle) + p.get("s") * np.sin(2 * angle)
    return shift.with_rod(r, twice + 0.15 * c.extra * fourth)


def payload(p: Planted, c: Context, shift: Shift) -> Shift:
    """m: share of the payload's weight that acts, at its centre of gravity, off the TCP."""
    force = np.zeros_like(c.conditions.poses)
    force[:, 2] = -p.get("m") * WEIGHT * c.conditions.payload
    return replace(shift, loads=(*shift.loads, Load(force, c.extra * PAYLOAD_CENTRE)))


def tool_load(p: Planted, c: Context, shift: Shift) -> Shift:
    """fx, fy, fz in N at the TCP: a hose that pulls 15 % more at one side of the workspace than in the middle."""
    side = normalised(c.conditions.poses[:, 0], c.plan.lower[0], c.plan.upper[0])
    way = np.array([p.get(f"f{axis}") for axis in AXES])
    force = (1 + 0.15 * c.extra * side)[:, None] * way
    return replace(shift, loads=(*shift.loads, Load(force, np.zeros(3))))


STRUCTURE: dict[str, Effect] = {
    f.__name__: f
    for f in (
        *(zero, zero_drift, scale, pitch_curve, pitch, backlash, unequal_backlash, windup, thermal_screw),
        *(straight, guide_angle),
        *(carriage_angle, thermal_strut, thermal_foot, stiffness, clearance, loose_joint, ovality, payload, tool_load),
    )
}
