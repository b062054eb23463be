"""The rigid pose of the non-redundant substructure, X = fgm(q_nr, xi) (Ecorchard 2010, eq. 11), and why there is none.

It is followed from the reference configuration. On a nominal machine all drives agree, and the pose is the one that all
of them hold; where the substructure passes a singular pose on the way, it is begun at the common pose instead.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.equilibrium.branch import regularity
from pkmcal_cli.equilibrium.kinematics import State, place_prescribed, point_poses, reference_state, without_stress
from pkmcal_cli.equilibrium.newton import Effort, NewtonOptions, follow, newton
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.equilibrium.strains import all_strains
from pkmcal_cli.equilibrium.system_numbers import SystemNumbers, system_numbers
from pkmcal_cli.mechanism.topology import Drive, DriveKind
from pkmcal_cli.model.freedoms import LEAST_MISFIT
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.singular_drives import substructure_holds
from pkmcal_cli.prediction.common_pose import common_pose
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.prediction.stages import BaseCoefficients, commanded_coefficients

_CLOSED, _REGULAR = 1e-9, 0.1  # sizes of the machine, and det J over that of the reference configuration
REACH = 0.01  # a rigid pose whose gaps exceed this share of the machine's size does not close
_RIGID = NewtonOptions(curved=False)


def substructure_pose(model: Model, coefficients: Array, effort: Effort) -> tuple[State, NDArray[np.int_]]:
    """Solve the rigid pose on the branch of the common pose: where redundant drives are far off, begin there."""
    state, status = rigid_pose(model, coefficients, _RIGID, effort)
    if not model.overdetermined:
        return state, status
    gone = relaxed_coefficients(model, coefficients, without_stress(state, model.released), model.redundant_drives)
    freedoms = model.freedoms
    away = np.abs((gone - coefficients)[:, freedoms.commanded] / freedoms.size).max(axis=1)
    doubt = status != RowStatus.SOLVED
    if (away[~doubt] > _CLOSED).any():
        if substructure_holds(model):
            regular = regularity(model.rigid, model.reference_mode, coefficients, state, model.length)
            doubt |= (away > _CLOSED) & ((away > LEAST_MISFIT) | (regular < _REGULAR))
        else:  # a pose of another branch may leave the redundant drives nearly where they are commanded
            doubt |= away > _CLOSED
    doubt = np.nonzero(doubt)[0]
    if not len(doubt):
        return state, status
    some = coefficients[doubt]
    pose = without_stress(common_pose(model, some).state, model.rigid)
    begin = place_prescribed(model.topology, some, pose, free=model.rigid.free)
    other, other_status = newton(model.rigid, some, begin, model.length, _RIGID, effort)
    solved = np.nonzero(other_status == RowStatus.SOLVED)[0]
    state = state.put(doubt[solved], other.take(solved))
    status[doubt[solved]] = RowStatus.SOLVED
    _check_reach(model, system_numbers(model.rigid, coefficients), state, status)
    return state, status


def rigid_pose(
    model: Model, coefficients: Array, options: NewtonOptions, effort: Effort
) -> tuple[State, NDArray[np.int_]]:
    """Solve the non-redundant substructure (Ecorchard 2010, eq. 11), from the reference configuration on."""
    system, numbers = model.rigid, system_numbers(model.rigid, coefficients)
    begin = model.reference_coefficients
    state = reference_state(model.topology, begin, len(coefficients), system.constraints)
    state, status = follow(
        system, begin, coefficients, state=state, length=model.length, options=options, effort=effort, numbers=numbers
    )
    elsewhere = regularity(system, model.reference_mode, numbers, state, model.length) < 0
    failed = np.nonzero(status != RowStatus.SOLVED)[0]
    status[elsewhere & (status == RowStatus.SOLVED)] = RowStatus.WRONG_MODE
    if len(failed):
        status[failed] = _failure(model, coefficients[failed])
    _check_reach(model, numbers, state, status)
    return state, status


def placed_tool_poses(model: Model, readings: Array) -> Array:
    """Poses (n, 6) of the tool point at which the drives that are not redundant hold it alone, at nominal parameters.

    readings (N, A): n of them have such a pose. What redundant drives read takes no part.
    """
    rows = Rows.at(readings)
    coefficients = commanded_coefficients(model, BaseCoefficients.of(model, model.nominal, rows), rows)
    state, status = rigid_pose(model, coefficients, _RIGID, Effort())
    solved, tool = np.nonzero(status == RowStatus.SOLVED)[0], model.tool
    if not len(solved):
        return np.zeros((0, 6))
    return point_poses(model.topology, coefficients[solved], state.take(solved), tool.point, tool.rotation)


def _check_reach(model: Model, numbers: SystemNumbers, state: State, status: NDArray[np.int_]) -> None:
    """Rows whose rigid pose has a gap of more than a share of the machine's size are out of reach."""
    good = np.nonzero(status == RowStatus.SOLVED)[0]
    if not len(good):
        return
    if len(good) < len(state):
        numbers, state = numbers.take(good), state.take(good)
    strains = all_strains(model.rigid, numbers, state)
    groups = model.rigid.groups
    gaps = [e * (group.elastic * group.group.gaps) for group, e in zip(groups, strains, strict=True)]
    status[good[largest_strain(gaps, len(good)) > REACH * model.length]] = RowStatus.OUT_OF_REACH


def largest_strain(strains: Iterable[Array], rows: int) -> Array:
    """Give the largest strain of each row, (N,)."""
    out = np.zeros(rows)
    for e in strains:
        out = np.maximum(out, np.abs(e).max(axis=(1, 2), initial=0.0))
    return out


def _failure(model: Model, coefficients: Array) -> NDArray[np.int_]:
    """Why rows have no rigid pose: the mechanism closes elsewhere, not at all, or is singular there."""
    system, numbers = model.rigid, system_numbers(model.rigid, coefficients)
    state = reference_state(model.topology, model.reference_coefficients, len(coefficients), system.constraints)
    free = NewtonOptions(curved=False, contraction=np.inf, iterations=60, tolerance=1e-8)
    placed = place_prescribed(model.topology, coefficients, state, free=system.free)
    state, status = newton(system, numbers, placed, model.length, free, Effort())
    _check_reach(model, numbers, state, status)
    out = np.full(len(coefficients), RowStatus.OUT_OF_REACH)
    out[status == RowStatus.SOLVED] = RowStatus.WRONG_MODE
    strains = zip(model.topology.groups, all_strains(system, numbers, state), strict=True)
    strain = largest_strain([e * ~group.springs for group, e in strains], len(coefficients))
    closed = np.isfinite(strain) & (strain < 1e-6 * model.length) & (status != RowStatus.SOLVED)
    out[closed] = RowStatus.SINGULAR
    return out


def relaxed_coefficients(model: Model, coefficients: Array, state: State, drives: Sequence[Drive]) -> Array:
    """Give coefficients at which a closed pose is (nearly) stress-free: no loads, `drives` where they have gone."""
    out, topology, system = coefficients.copy(order="K"), model.topology, model.released
    for group in topology.groups:
        out[:, group.prestress] = 0.0
    out[:, topology.force_coefficients] = 0.0
    strains = all_strains(system, coefficients, state)
    for group, strain in zip(topology.groups, strains, strict=True):
        out[:, group.rest] += (strain * group.springs).reshape(len(out), -1)
    for drive in drives:
        if drive.kind is DriveKind.TRAVEL:
            out[:, drive.coefficient] = state.translation[:, drive.target[0]]
        elif drive.kind is DriveKind.ROTATION:
            r = drive.target[0]
            turned = log(state.rotation[:, r] @ topology.rotations.reference[r].T)
            angle = turned @ topology.rotations.axis[r]
            turns = np.round((coefficients[:, drive.coefficient] - angle) / (2 * np.pi))
            out[:, drive.coefficient] = angle + 2 * np.pi * turns
        else:
            index, e, m = drive.target
            out[:, drive.coefficient] += strains[index][:, e, m]
    return out
