"""True readings of a machine with undeclared effects: its equilibria, then the instrument. SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import dimensions as dim
from .effects_true import BY_FORCE, STRUCTURE
from .fast_pinned import Array, Balance, Load, Problem, rotations, solve
from .instrument_true import INSTRUMENT, UNKNOWN, local_bump, unknown
from .nameless_true import NAMELESS
from .planted import Context, Planted, Shift, Travel
from .shop_conditions import Conditions
from .shop_plans import Geometry, Plan

BUMP = 10e-6
"""Height in m of the bump that tells how the readings feel one."""


@dataclass(frozen=True)
class Found:
    """N rows: `readings` (N, C) in m, platform position (N, 3) in m and `rotation` (N, 3, 3), `tension` (N, R) in N,
    `force` (N, A) in N of the drives towards greater travel."""

    readings: Array
    position: Array
    rotation: Array
    tension: Array
    force: Array


def structure(c: Context, planted: Sequence[Planted], bumps: Mapping[str, float]) -> Shift:
    """Sum of the effects in the structure; `bumps`: heights in m by place."""
    shift = Shift.none(len(c.conditions.q), len(c.plan.drives), len(c.plan.rods))
    for effect in planted:
        if effect.keyword in STRUCTURE | NAMELESS:
            shift = (STRUCTURE | NAMELESS)[effect.keyword](effect, c, shift)
        elif effect.keyword == "local_bump":
            shift = local_bump(effect, c, shift, bumps[effect.at])
    return shift


def balance(c: Context, shift: Shift) -> tuple[Balance, Array]:
    """Equilibria and drive forces (N, A) in N."""
    plan, g = c.plan, c.geometry
    carrier = list(plan.carrier)
    local = shift.across.copy()
    local[:, :, plan.along] += c.conditions.q + shift.drive
    joint = local[:, carrier] + np.einsum("nrij,rj->nri", rotations(shift.turn[:, carrier]), g.offset)
    base = (g.foot + shift.foot)[:, carrier] + np.einsum("rij,nrj->nri", g.frame[carrier], joint)
    loads = shift.loads
    if plan.mass:
        weight = np.tile([0.0, 0.0, -plan.mass * dim.GRAVITY], (len(base), 1))
        loads = (Load(weight, np.zeros(3)), *loads)
    problem = Problem(
        body=g.body,
        base=base,
        length=g.length + shift.length,
        stiffness=g.stiffness * np.exp(shift.log_stiffness),
        gap=shift.gap,
        loads=loads,
        freedoms=plan.freedoms,
    )
    found = solve(problem, c.conditions.poses)
    along = g.frame[carrier][:, :, plan.along]
    pull = -found.tension * (found.unit * along).sum(-1)
    force = np.stack([pull[:, np.array(carrier) == a].sum(1) for a in range(len(plan.drives))], -1)
    return found, force


def measured(c: Context, planted: Sequence[Planted], bumps: Mapping[str, float], reference: Conditions) -> Found:
    """Readings with bumps of given heights; two equilibria where an effect depends on the forces without it."""
    if any(effect.keyword in BY_FORCE for effect in planted):
        rest = [effect for effect in planted if effect.keyword not in BY_FORCE]
        before, force = balance(c, structure(c, rest, bumps))
        c = replace(c, force=force, tension=before.tension)
    found, force = balance(c, structure(c, planted, bumps))
    points = found.position
    for effect in planted:
        if effect.keyword == "tool":
            points = points + found.rotation @ [effect.get(f"t{axis}") for axis in "xyz"]
    for keyword, act in INSTRUMENT.items():
        for effect in planted:
            if effect.keyword == keyword:
                points = act(effect, c, points)
    for effect in planted:
        if effect.keyword in UNKNOWN:
            points = points + unknown(effect, c, reference)
    return Found(points[:, : len(c.plan.channels)], found.position, found.rotation, found.tension, force)


def unloaded(c: Context) -> Context:
    """The same context, no forces known yet."""
    rows = len(c.conditions.q)
    return replace(c, force=np.zeros((rows, len(c.plan.drives))), tension=np.zeros((rows, len(c.plan.rods))))


def known(planted: Sequence[Planted]) -> None:
    """KeyError for a keyword that is not simulated."""
    for effect in planted:
        if effect.keyword not in {*STRUCTURE, *NAMELESS, *INSTRUMENT, *UNKNOWN, "tool", "local_bump"}:
            raise KeyError(f"no effect {effect.keyword!r}")


def truth(
    plan: Plan,
    geometry: Geometry,
    conditions: Conditions,
    planted: Sequence[Planted] = (),
    extra: float = 1.0,
    seed: int = 0,
    reference: Conditions | None = None,
) -> Found:
    """True readings of the rows. `reference`: the rows whose travel is the effects' travel, and over which the rms of
    unknown effects is counted; None: the same rows."""
    known(planted)
    reference = reference or conditions
    travel = Travel.of(reference.q)
    c = unloaded(
        Context(
            plan=plan,
            geometry=geometry,
            conditions=conditions,
            travel=travel,
            extra=extra,
            seed=seed,
            force=np.zeros(0),
            tension=np.zeros(0),
        )
    )
    bumps: dict[str, float] = {}
    bent = [effect for effect in planted if effect.keyword == "local_bump"]
    if bent:
        there = unloaded(replace(c, conditions=reference))
        plain = measured(there, [], {}, reference).readings
        for effect in bent:
            felt = measured(there, [effect], {effect.at: BUMP}, reference).readings - plain
            bumps[effect.at] = BUMP * effect.get("rms") / float(np.sqrt((felt**2).mean()))
    return measured(c, planted, bumps, reference)
