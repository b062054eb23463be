"""Released drives of a closed mechanism are read, with derivatives by coefficients, those of held poses too.

The mechanism closes at g(y, c) = 0, so a reading z(y, c) has dz/dc = z_c - l^T g_c with K^T l = z_y: the adjoint of
`derivative`, for the drives' own coordinates.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.derivative import adjoint_derivative
from pkmcal_cli.equilibrium.kinematics import State
from pkmcal_cli.equilibrium.readings import ObservedQuantity, read_quantities
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.units.measurands import Measurand


def released_readings(
    system: System, coefficients: Array, state: State, numbers: SystemNumbers, drives: Index, gains: Index
) -> tuple[Array, Array]:
    """Read released drives at closed states (n, D), with derivatives by all coefficients (n, D, S).

    gains (D,): coefficients of the gains of `drives` (D,).
    """
    seen = tuple(ObservedQuantity(Measurand.DRIVE, int(a)) for a in drives)
    every = np.zeros(int(drives.max()) + 1, dtype=np.intp)
    every[drives] = gains
    readings = read_quantities(system, coefficients, state, seen, every, numbers)
    scale = typical_stiffness(system, numbers)
    tangent = balance(system, numbers, state, scale).tangent
    assert tangent is not None and readings.unknowns is not None and readings.coefficients is not None
    adjoint = tangent.solve_transposed(np.swapaxes(readings.unknowns, 1, 2))
    adjoint = np.nan_to_num(np.swapaxes(adjoint, 1, 2))
    slopes = readings.coefficients - adjoint_derivative(system, numbers, state, adjoint, scale)
    return readings.values, np.asarray(slopes)
