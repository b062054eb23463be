"""Assembly mode of a pose: the sign of the determinant of the rigid Jacobian, compared with the drawing's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from ..elements import Load
from ..layout import Index
from ..rotation import Array
from .assembly import port_triads
from .kinematics import State, arm_vectors, input_jacobian, link_vectors
from .system import System


def strain_jacobian(system: System, slots: Array, state: State, length: float) -> Array:
    """Derivative of all acting strains with respect to the unknowns, lengths relative to `length`: (N, m, n)."""
    layout = system.layout
    arms = arm_vectors(layout, slots, state)
    deltas = link_vectors(layout, arms)
    unit = np.where(system.free < len(layout.travel_slots), length, 1.0)
    blocks = []
    for group in system.groups:
        spec = group.group
        acting = group.elastic > 0
        acting[group.rigid] = True
        e, m = np.nonzero(acting)
        if isinstance(spec.element, Load) or not len(e):
            continue
        ti, tj = port_triads(system, group, state)
        rest = slots[:, spec.rest].reshape(-1, *spec.shape)
        _, b = spec.element.evaluate(deltas[:, spec.links], ti, tj, rest)
        jacobian, _ = input_jacobian(layout, group.map, state, arms)
        inputs = layout.inputs[layout.inputs < spec.element.inputs]
        local = (jacobian[:, e] @ b[:, e, m][..., inputs, None])[..., 0]  # (N, strains, L)
        block = np.zeros((len(state), len(e), system.unknowns))
        row, column = np.nonzero(group.map.unknowns[e] >= 0)
        np.add.at(block, (slice(None), row, group.map.unknowns[e][row, column]), local[:, row, column])
        blocks.append(block * unit)
    return np.concatenate(blocks, axis=1) if blocks else np.zeros((len(state), 0, system.unknowns))


def independent_strains(jacobian: Array) -> Index:
    """Strains (n,) of a Jacobian (m, n) that are independent at the drawing, by pivoted QR."""
    n = jacobian.shape[1]
    _, _, order = qr(jacobian.T, mode="economic", pivoting=True)
    return np.sort(order[:n])


def left_mode(
    system: System, drawn: tuple[Array, State], slots: Array, state: State, length: float
) -> NDArray[np.bool_]:
    """Rows (N,) whose pose lies in another assembly mode than the drawing (slots and state, one row)."""
    home = strain_jacobian(system, *drawn, length)[0]
    if home.shape[0] < system.unknowns or system.unknowns == 0:
        return np.zeros(len(state), dtype=bool)
    rows = independent_strains(home)
    sign = np.linalg.slogdet(home[rows])[0]
    now = np.linalg.slogdet(strain_jacobian(system, slots, state, length)[:, rows])[0]
    return np.asarray(now * sign < 0)
