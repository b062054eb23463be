"""Forces of a pass, for effects that depend on them in the next one: two fixed passes, no iteration.

The force of a drive, and the pull in a member, is the derivative of the Lagrangian with respect to the coefficient of
its position, or minus that with respect to its natural length (Castigliano's first theorem). So its derivatives come
from a complex step in that coefficient (Squire and Trapp 1998).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.derivative import lagrangian_gradient
from pkmcal_cli.equilibrium.kinematics import geometries, offset_vectors_at
from pkmcal_cli.equilibrium.strains import group_geometry
from pkmcal_cli.model.effect_sites import EffectSite, PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.displacements import Displacements
from pkmcal_cli.prediction.forces import coefficient_force_derivatives, drive_forces, force_coefficient
from pkmcal_cli.prediction.inputs import Reactions
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.prediction.solving import Solution
from pkmcal_cli.prediction.stages import Chain


def reactions(
    model: Model,
    solution: Solution,
    effects: Sequence[PlacedEffect],
    rows: Rows,
    chain: Chain | None,
    moved: Displacements,
) -> Reactions:
    """Compute forces and chords at effect sites, with derivatives where there is a chain; nan in failed rows."""
    sites = {s.place: s for e in effects for s in e.sites}
    coefficients = [_coefficient(model, s) for s in sites.values()]
    values, chords = _values(model, solution, list(sites.values()), coefficients)
    if chain is None:
        return Reactions(tuple(sites), values, chords, None, None)
    by_coefficient = np.zeros((len(rows), len(coefficients), solution.coefficients.shape[1]))
    known = [r for r, (coefficient, _) in enumerate(coefficients) if coefficient >= 0]
    if known:
        signs = np.array([coefficients[r][1] for r in known])
        along = [coefficients[r][0] for r in known]
        by_coefficient[:, known] = signs[:, None] * coefficient_force_derivatives(model, solution, along)
    jacobian, by_drive = chain.apply(rows, solution.coefficients, by_coefficient, moved)
    return Reactions(tuple(sites), values, chords, jacobian, by_drive)


def _coefficient(model: Model, site: EffectSite) -> tuple[int, float]:
    """The coefficient whose Lagrangian derivative is the force, and its sign; -1 where the force is commanded."""
    if site.member[0] >= 0:
        group = model.topology.groups[site.member[0]]
        return group.rest.start + site.member[1] * len(group.element.strains), -1.0
    return force_coefficient(model, site.actuator)


def _values(
    model: Model, solution: Solution, sites: Sequence[EffectSite], coefficients: Sequence[tuple[int, float]]
) -> tuple[Array, dict[tuple[int, int], Array]]:
    """Forces (N, R), and unit chords (N, 3) of the straight members among the effect sites."""
    system, state = solution.system, solution.state
    gradient = lagrangian_gradient(system, solution.numbers, state, taut=solution.taut)
    forces = drive_forces(model, solution)[0]
    values = np.stack(
        [
            sign * gradient[:, coefficient] if coefficient >= 0 else forces[:, site.actuator]
            for site, (coefficient, sign) in zip(sites, coefficients, strict=True)
        ],
        axis=1,
    )
    values[solution.failed] = np.nan
    stacked = geometries(system, state, offset_vectors_at(model.topology, solution.coefficients, state))
    return values, dict(_chords(solution, stacked, sites))


def _chords(solution: Solution, stacked: Array, sites: Sequence[EffectSite]) -> Iterator[tuple[tuple[int, int], Array]]:
    for g, e in sorted({s.member for s in sites if s.member[0] >= 0 and s.straight}):
        chord = group_geometry(solution.system, g, stacked).delta[:, e]
        yield (g, e), chord / np.sqrt((chord**2).sum(axis=1, keepdims=True))


def joined_reactions(parts: Sequence[Reactions]) -> Reactions:
    """Join the reactions of consecutive chunks."""
    first = parts[0]

    def join(name: str) -> Array | None:
        pieces = [getattr(p, name) for p in parts]
        return None if pieces[0] is None else np.concatenate(pieces)

    return Reactions(
        first.places,
        np.concatenate([p.values for p in parts]),
        {m: np.concatenate([p.chords[m] for p in parts]) for m in first.chords},
        join("jacobian"),
        join("by_drive"),
    )
