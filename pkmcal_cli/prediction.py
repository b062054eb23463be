"""The one pipeline: from parameter values and drive readings to predicted measurements, with exact derivatives.

Five stages: command (drive readings to positions), geometry, stiffness, load (slots of the engine), reading. Every
stage works on arrays over rows. `simulate`, `sensitivity`, `observability` and `calibrate` are short programs over
`predict`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .equilibrium.assembly import balance, typical_stiffness
from .equilibrium.branch import left_mode
from .equilibrium.derivative import adjoint_derivative, lagrangian_gradient
from .equilibrium.kinematics import State, drawn_state, place_prescribed
from .equilibrium.newton import Effort, NewtonOptions, Slack, follow, newton, solve_rows
from .equilibrium.readings import forced_energy, read_channels
from .equilibrium.status import RowStatus
from .layout import DriveKind
from .model import Model
from .rotation import Array

Method = Literal["exact", "linear", "rigid"]
_CHUNK_BYTES = 48e6  # memory of one chunk's tangents
_REACH = 0.01  # a rigid pose whose strains exceed this share of the machine's size does not close
_ROUGH = NewtonOptions(curved=False, tolerance=1e-6)
_RIGID = NewtonOptions(curved=False)
_ELASTIC = NewtonOptions(contraction=0.9)


@dataclass(frozen=True)
class Rows:
    """Drive readings (N, A) in SI (m, rad) and forces (N, A) of force-controlled drives (nan: the machine's)."""

    readings: Array
    forces: Array

    def __len__(self) -> int:
        return len(self.readings)

    def take(self, rows: slice | NDArray[np.intp]) -> Rows:
        """Some rows."""
        return Rows(self.readings[rows], self.forces[rows])

    @classmethod
    def at(cls, readings: Array) -> Rows:
        """Rows without force columns."""
        return cls(np.asarray(readings, dtype=float), np.full(np.shape(readings), np.nan))


@dataclass(frozen=True)
class Prediction:
    """Predicted readings (N, C), nan where `status` (N,) is not SOLVED.

    jacobian: (N, C, P') with respect to the asked parameters; by_drive: (N, C, A) with respect to drive readings;
    forces: (N, A) of drives, N or N m; energy: (N,) strain energy, J; slack: names of slack ropes by row.
    """

    values: Array
    status: NDArray[np.int_]
    state: State
    jacobian: Array | None
    by_drive: Array | None
    forces: Array | None
    energy: Array | None
    slack: dict[int, str]
    steps: int

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Rows with numbers."""
        return np.asarray(self.status == RowStatus.SOLVED)

    def reason(self, row: int) -> str:
        """Why a row has no numbers."""
        status = RowStatus(int(self.status[row]))
        return f"slack: {self.slack[row]}" if status is RowStatus.SLACK else status.reason


@dataclass(frozen=True)
class Request:
    """What a prediction should bring besides the readings."""

    method: Method = "exact"
    parameters: tuple[str, ...] | None = None  # derivatives with respect to these
    by_drive: bool = False
    forces: bool = False


def predict(
    model: Model,
    values: Array,
    rows: Rows,
    request: Request | None = None,
    start: State | None = None,
    progress: Callable[[int], None] | None = None,
) -> Prediction:
    """Predicted readings of all rows at parameter values (P,), SI; `start`: states of an earlier prediction.

    Works in chunks, so memory is bounded but for the results. Rows that cannot be solved get a status, never numbers.
    """
    request = request or Request()
    parts = []
    for chunk in _chunks(model, len(rows)):
        begin = None if start is None else start.take(np.arange(chunk.start, chunk.stop))
        parts.append(_predict_chunk(model, values, rows.take(chunk), request, begin, chunk.start))
        if progress is not None:
            progress(chunk.stop - chunk.start)
    return _joined(parts)


def _chunks(model: Model, rows: int) -> Iterator[slice]:
    size = max(1, int(_CHUNK_BYTES / (8 * max(model.exact.size, 8) ** 2 * 4)))
    for first in range(0, max(rows, 1), size):
        yield slice(first, min(first + size, rows))


def stage_slots(model: Model, values: Array, rows: Rows) -> Array:
    """Command, geometry, stiffness and load stages: slots (N, S) of every row."""
    slots = np.repeat(model.layout.slots.values(model.by_name(values))[None], len(rows), axis=0)
    for a, (drive, actuator) in enumerate(zip(model.layout.drives, model.actuators, strict=True)):
        if drive.force_controlled:
            given = rows.forces[:, a]
            force = np.where(np.isnan(given), slots[:, actuator.force_slot], given)
            slots[:, drive.force_slot] += drive.force_sign * force
        else:
            slots[:, drive.slot] += slots[:, actuator.gain_slot] * rows.readings[:, a]
    return slots


def drawing_slots(model: Model) -> Array:
    """Slots (1, S) at nominal parameters with every drive at the assembled drawing."""
    readings = model.drawn_readings[None]
    slots = model.layout.slots.values(model.by_name(model.nominal))[None]
    for a, (drive, actuator) in enumerate(zip(model.layout.drives, model.actuators, strict=True)):
        slots[:, drive.slot] += slots[:, actuator.gain_slot] * readings[:, a]
    return slots


def rigid_pose(
    model: Model, slots: Array, options: NewtonOptions, effort: Effort
) -> tuple[State, NDArray[np.int_]]:
    """Pose of the non-redundant substructure (Ecorchard 2010, fgm of eq. 11), continued from the drawing."""
    system = model.rigid
    begin = drawing_slots(model)
    state = drawn_state(model.layout, begin, len(slots), system.constraints)
    drawn = state.take(np.arange(1))
    state, status, _ = follow(system, begin, slots, state, model.length, options, effort)
    elsewhere = left_mode(system, (begin, drawn), slots, state, model.length)
    failed = np.nonzero(status != RowStatus.SOLVED)[0]
    status[elsewhere & (status == RowStatus.SOLVED)] = RowStatus.WRONG_MODE
    if len(failed):
        status[failed] = _failure(model, slots[failed], begin)
    _check_reach(model, slots, state, status)
    return state, status


def _check_reach(model: Model, slots: Array, state: State, status: NDArray[np.int_]) -> None:
    """Rows whose rigid pose has a gap of more than a share of the machine's size are out of reach."""
    system = model.rigid
    good = np.nonzero(status == RowStatus.SOLVED)[0]
    if not len(good):
        return
    now = balance(system, slots[good], state.take(good), 1.0, tangent=False)
    strain = np.zeros(len(good))
    for group, e in zip(system.groups, now.strains, strict=True):
        gaps = group.elastic * group.group.element.gaps
        strain = np.maximum(strain, np.abs(e * gaps).reshape(len(good), -1).max(axis=1, initial=0.0))
    status[good[strain > _REACH * model.length]] = RowStatus.OUT_OF_REACH


def _failure(model: Model, slots: Array, begin: Array) -> NDArray[np.int_]:
    """Why rows have no rigid pose: the mechanism closes elsewhere, not at all, or is singular there."""
    system = model.rigid
    state = drawn_state(model.layout, begin, len(slots), system.constraints)
    free = NewtonOptions(curved=False, contraction=np.inf, iterations=60, tolerance=1e-8)
    placed = place_prescribed(model.layout, slots, state, free=system.free)
    state, status, _ = newton(system, slots, placed, model.length, free, Effort())
    _check_reach(model, slots, state, status)
    out = np.full(len(slots), RowStatus.OUT_OF_REACH)
    out[status == RowStatus.SOLVED] = RowStatus.WRONG_MODE
    now = balance(system, slots, state, typical_stiffness(system, slots), curved=False)
    assert now.tangent is not None
    strain = np.zeros(len(slots))
    for e in now.strains:
        strain = np.maximum(strain, np.abs(e).reshape(len(slots), -1).max(axis=1, initial=0.0))
    closed = np.isfinite(strain) & (strain < 1e-6 * model.length) & (status != RowStatus.SOLVED)
    out[closed] = RowStatus.SINGULAR
    return out


def _predict_chunk(
    model: Model, values: Array, rows: Rows, request: Request, start: State | None, offset: int
) -> Prediction:
    slots, effort = stage_slots(model, values, rows), Effort()
    if request.method == "exact":
        system = model.exact
        state, status, slack = _equilibrium(model, slots, start, effort)
    else:
        system = model.rigid
        state, status = rigid_pose(model, slots, _RIGID, effort)
        slack = None
        if request.method == "linear":
            system = model.exact
            state = _one_step(model, slots, state, status, effort)
    return _finish(model, values, rows, request, offset, system, slots, state, status, slack, effort)


def _equilibrium(
    model: Model, slots: Array, start: State | None, effort: Effort
) -> tuple[State, NDArray[np.int_], Slack | None]:
    """Elastic equilibrium, from an earlier state or from the rigid pose."""
    system = model.exact
    if start is not None:
        placed = place_prescribed(model.layout, slots, start, free=system.free)
        state, status, slack = newton(system, slots, placed, model.length, _ELASTIC, effort)
        if (status == RowStatus.SOLVED).all():
            return state, status, slack
    state, status = rigid_pose(model, slots, _ROUGH, effort)
    state = State(state.travel, state.rotation, np.zeros((len(slots), system.constraints)))
    good = np.nonzero(status == RowStatus.SOLVED)[0]
    slack = tuple(np.zeros((len(slots), g.group.shape[0]), dtype=bool) for g in system.groups)
    if len(good):
        part = state.take(good)
        relaxed = _relaxed_slots(model, slots[good], part)
        part, now, loose = follow(system, relaxed, slots[good], part, model.length, _ELASTIC, effort)
        state = state.put(good, part)
        for mine, theirs in zip(slack, loose, strict=True):
            mine[good] = theirs
            now[theirs.any(axis=1)] = RowStatus.SLACK
        status[good] = now
    return state, status, slack


def _relaxed_slots(model: Model, slots: Array, state: State) -> Array:
    """Slots at which the rigid pose is (nearly) stress-free: no loads, released drives where they have gone."""
    out = slots.copy()
    layout = model.layout
    for group in layout.groups:
        out[:, group.prestress] = 0.0
    out[:, layout.force_slots] = 0.0
    for drive in layout.drives:
        if drive.redundant and not drive.force_controlled:
            if drive.kind is DriveKind.TRAVEL:
                out[:, drive.slot] = state.travel[:, drive.target[0]]
            elif drive.kind is DriveKind.STRAIN:
                index, e, m = drive.target
                strains = balance(
                    model.released,
                    slots,
                    State(state.travel, state.rotation, np.zeros((len(slots), model.released.constraints))),
                    1.0,
                    tangent=False,
                ).strains
                out[:, drive.slot] += strains[index][:, e, m]
    return out


def _one_step(model: Model, slots: Array, state: State, status: NDArray[np.int_], effort: Effort) -> State:
    """The paper's elastic displacement: one linear step of the whole structure from the rigid pose (eq. 7, 10, 19)."""
    from .equilibrium.kinematics import advance

    system = model.exact
    placed = place_prescribed(
        model.layout,
        slots,
        State(state.travel, state.rotation, np.zeros((len(slots), system.constraints))),
        free=system.free,
    )
    scale = typical_stiffness(system, slots)
    now = balance(system, slots, placed, scale, curved=False)
    assert now.tangent is not None
    step = -solve_rows(now.tangent, now.residual[..., None])[..., 0]
    effort.add(len(slots))
    lost = ~np.isfinite(step).all(axis=1)
    status[lost & (status == RowStatus.SOLVED)] = RowStatus.SINGULAR
    step[lost] = 0.0
    return advance(system, placed, step, scale)


def _finish(
    model: Model,
    values: Array,
    rows: Rows,
    request: Request,
    offset: int,
    system: object,
    slots: Array,
    state: State,
    status: NDArray[np.int_],
    slack: Slack | None,
    effort: Effort,
) -> Prediction:
    """Reading stage, derivatives, forces."""
    from .equilibrium.system import System

    assert isinstance(system, System)
    gains = np.array([a.gain_slot for a in model.actuators], dtype=np.intp)
    wanted = request.parameters is not None or request.by_drive
    readings = read_channels(system, slots, state, model.channels, gains, wanted)
    bad = status != RowStatus.SOLVED
    readings.values[bad] = np.nan
    jacobian = by_drive = None
    if wanted:
        by_slot = _slot_jacobian(model, system, slots, state, slack, readings.unknowns, readings.slots, bad)
        jacobian, by_drive = _chain(model, values, rows, request, slots, by_slot)
    forces = energy = None
    if request.forces:
        forces, energy = _forces(model, system, slots, state, slack)
        forces[bad], energy[bad] = np.nan, np.nan
    return Prediction(
        readings.values,
        status,
        state,
        jacobian,
        by_drive,
        forces,
        energy,
        _slack_names(system, slack, offset),
        effort.steps,
    )


def _slack_names(system: object, slack: Slack | None, offset: int) -> dict[int, str]:
    from .equilibrium.system import System

    assert isinstance(system, System)
    out: dict[int, str] = {}
    for group, loose in zip(system.groups, slack or (), strict=False):
        for row in np.nonzero(loose.any(axis=1))[0]:
            names = [group.group.names[k] for k in np.nonzero(loose[row])[0]]
            out[int(row) + offset] = ", ".join(filter(None, [out.get(int(row) + offset), *names]))
    return out


def _slot_jacobian(
    model: Model,
    system: object,
    slots: Array,
    state: State,
    slack: Slack | None,
    unknowns: Array | None,
    direct: Array | None,
    bad: NDArray[np.bool_],
) -> Array:
    """d readings / d slots (N, C, S): direct part minus the adjoint one; nan in unsolved rows."""
    from .equilibrium.system import System

    assert isinstance(system, System) and unknowns is not None and direct is not None
    scale = typical_stiffness(system, slots)
    now = balance(system, slots, state, scale, slack=slack)
    assert now.tangent is not None
    adjoint = solve_rows(np.swapaxes(now.tangent, 1, 2), np.swapaxes(unknowns, 1, 2))
    adjoint = np.nan_to_num(np.swapaxes(adjoint, 1, 2))
    out = direct - adjoint_derivative(system, slots, state, slack, adjoint, scale)
    out[bad] = np.nan
    return np.asarray(out)


def _chain(
    model: Model, values: Array, rows: Rows, request: Request, slots: Array, by_slot: Array
) -> tuple[Array | None, Array | None]:
    """From slots to parameters (N, C, P') and drive readings (N, C, A); the command stage adds the gains' share."""
    by_drive = np.zeros((*by_slot.shape[:2], len(model.actuators)))
    for a, (drive, actuator) in enumerate(zip(model.layout.drives, model.actuators, strict=True)):
        if drive.force_controlled:
            undeclared = np.isnan(rows.forces[:, a])[:, None]
            by_slot[..., actuator.force_slot] += (
                undeclared * drive.force_sign * by_slot[..., drive.force_slot]
            )
        else:
            by_drive[..., a] = by_slot[..., drive.slot] * slots[:, None, actuator.gain_slot]
            by_slot[..., actuator.gain_slot] += by_slot[..., drive.slot] * rows.readings[:, None, a]
    if request.parameters is None:
        return None, by_drive
    chain = model.layout.slots.jacobian(model.by_name(values), request.parameters)
    used = np.nonzero(chain.any(axis=1))[0]
    return by_slot[..., used] @ chain[used], by_drive


def _forces(
    model: Model, system: object, slots: Array, state: State, slack: Slack | None
) -> tuple[Array, Array]:
    """Drive forces (N, A) and strain energy (N,)."""
    from .equilibrium.assembly import stiffness_matrices
    from .equilibrium.system import System

    assert isinstance(system, System)
    gradient = lagrangian_gradient(system, slots, state, slack)
    now = balance(system, slots, state, 1.0, tangent=False, slack=slack)
    energy = np.zeros(len(slots))
    for group, e in zip(system.groups, now.strains, strict=True):
        s = stiffness_matrices(system, group, slots)
        energy += 0.5 * (e * (s @ e[..., None])[..., 0]).sum(axis=(1, 2))
    forces = np.zeros((len(slots), len(model.layout.drives)))
    for a, drive in enumerate(model.layout.drives):
        if drive.force_controlled:
            forces[:, a] = drive.force_sign * slots[:, drive.force_slot]
            if drive.kind is DriveKind.STRAIN:
                energy += forced_energy(system, slots, now.strains, drive)
        elif drive.kind is DriveKind.STRAIN:
            index, member, strain = drive.target
            forces[:, a] = drive.force_sign * now.stresses[index][:, member, strain]
        else:
            forces[:, a] = gradient[:, drive.slot]
    return forces, energy


def _joined(parts: Sequence[Prediction]) -> Prediction:
    def join(name: str) -> Array | None:
        pieces = [getattr(p, name) for p in parts]
        return None if pieces[0] is None else np.concatenate(pieces)

    state = State(
        *(np.concatenate([getattr(p.state, f) for p in parts]) for f in ("travel", "rotation", "multiplier"))
    )
    slack = {row: name for p in parts for row, name in p.slack.items()}
    values, status = np.concatenate([p.values for p in parts]), np.concatenate([p.status for p in parts])
    return Prediction(
        values,
        status,
        state,
        join("jacobian"),
        join("by_drive"),
        join("forces"),
        join("energy"),
        slack,
        sum(p.steps for p in parts),
    )
