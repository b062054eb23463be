"""How far ropes are from the kink between taut and slack, and how that depends on parameters and drive readings.

At the kink a row's readings have two derivatives. So near it no linear interval holds, which asks for the elongation of
every rope, slack ones too, with its derivatives: de/dc = e_c - l^T g_c with K^T l = e_u (see `equilibrium.derivative`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.branch import strain_jacobian
from pkmcal_cli.equilibrium.derivative import adjoint_derivative, strain_gradient
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.prediction.displacements import Displacements
from pkmcal_cli.prediction.rows import RopeStrains, Rows
from pkmcal_cli.prediction.solving import Solution
from pkmcal_cli.prediction.stages import Chain


def rope_strains(solution: Solution, rows: Rows, chain: Chain, moved: Displacements) -> RopeStrains:
    """Compute the strains of all elastic ropes in solved rows."""
    system, numbers, state = solution.system, solution.numbers, solution.state
    scale = typical_stiffness(system, numbers)
    balanced = balance(system, numbers, state, scale)
    assert balanced.tangent is not None
    by_unknowns = strain_jacobian(system, solution.coefficients, state, 1.0)
    ropes, values, lines, direct = _ropes(system), [], [], []
    for g, e, line in ropes:
        group, rest = numbers.groups[g], system.groups[g].group.rest.start + e
        assert group.stiffness is not None
        shift = 0.0 if group.prestress is None else group.prestress[:, e, 0] / group.stiffness[:, e, 0, 0]
        values.append(balanced.strains[g][:, e, 0] + shift)
        lines.append(by_unknowns[:, line])
        direct.append(strain_gradient(system, numbers, state, (g, e, 0)))
        direct[-1][:, rest] -= 1.0
    gradient = np.zeros((len(state), len(ropes), system.size))
    gradient[:, :, : system.unknowns] = np.stack(lines, axis=1)
    adjoint = balanced.tangent.solve_transposed(np.swapaxes(gradient, 1, 2))
    adjoint = np.nan_to_num(np.swapaxes(adjoint, 1, 2))
    slopes = np.stack(direct, axis=1) - adjoint_derivative(system, numbers, state, adjoint, scale)
    jacobian, by_drive = chain.apply(rows, solution.coefficients, slopes, moved)
    assert jacobian is not None
    return RopeStrains(np.stack(values, axis=1), jacobian, by_drive)


def joined_rope_strains(parts: Sequence[RopeStrains]) -> RopeStrains:
    """Join the rope strains of consecutive chunks."""
    names = ("values", "jacobian", "by_drive")
    return RopeStrains(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def _ropes(system: System) -> list[tuple[int, int, int]]:
    """Group, element, and row in the Jacobian of all acting strains, of every elastic rope."""
    out, count = [], 0
    for g, group in enumerate(system.groups):
        acting = group.elastic > 0
        acting[group.rigid] = True
        number = count + np.cumsum(acting).reshape(acting.shape) - 1
        if group.ropes is not None:
            out += [(g, int(e), int(number[e, 0])) for e in np.nonzero(group.ropes)[0]]
        count += int(acting.sum())
    return out
