"""What sensors read at a state, and its gradient with respect to the unknowns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pkmcal_cli.base.rotation import Array, left_jacobian, log, log_jacobian, times
from pkmcal_cli.equilibrium.assembly import group_view
from pkmcal_cli.equilibrium.derivative import point_gradient, strain_gradient
from pkmcal_cli.equilibrium.given import Given, rest_values
from pkmcal_cli.equilibrium.kinematics import State, arm_vectors, input_jacobian, link_vectors, turned_arms, views
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.mechanism.topology import Drive, DriveKind, Group


class Channel(Protocol):
    """A measured quantity: a coordinate of a point or of an orientation, or the reading of a drive."""

    @property
    def quantity(self) -> str: ...
    @property
    def index(self) -> int: ...
    @property
    def component(self) -> int: ...


@dataclass(frozen=True)
class Readings:
    """Values (N, C); gradients with respect to unknowns (N, C, n + c); direct slot dependence (N, C, S) or None."""

    values: Array
    unknowns: Array | None = None
    slots: Array | None = None


def read_channels(
    system: System, slots: Array, state: State, channels: tuple[Channel, ...], gains: Array, numbers: Given | None
) -> Readings:
    """Readings of all channels; `gains` (A,) slot numbers of the drives' gains; derivatives need what slots say."""
    layout, derivatives = system.layout, numbers is not None
    arms = arm_vectors(layout, slots, state) if numbers is None else turned_arms(layout, numbers.bodies, state)
    points = link_vectors(layout, arms)[:, layout.points]
    values = np.empty((len(state), len(channels)))
    gradient = np.zeros((len(state), len(channels), system.size)) if derivatives else None
    direct = np.zeros((len(state), len(channels), slots.shape[1])) if derivatives else None
    jacobian = input_jacobian(layout, system.points, state, arms)[0] if derivatives else None
    turning = {channel.index for channel in channels if channel.quantity == "orientation"}
    turns = {r: _turned(state, r, layout.rotations.filed) for r in turning}
    for c, channel in enumerate(channels):
        if channel.quantity == "position":
            values[:, c] = points[:, channel.index, channel.component]
            if numbers is not None and gradient is not None and direct is not None and jacobian is not None:
                local = jacobian[:, channel.index, :, channel.component]
                _scatter_row(gradient[:, c], system.points.unknowns[channel.index], local)
                force = np.zeros_like(points)
                force[:, channel.index, channel.component] = 1.0
                direct[:, c] = point_gradient(system, numbers, state, force)
        elif channel.quantity == "orientation":
            turned = turns[channel.index]
            values[:, c] = turned[:, channel.component]
            if gradient is not None and direct is not None:
                row = log_jacobian(turned)[:, channel.component]  # (N, 3)
                _rotation_gradient(system, state, channel.index, row, gradient[:, c], direct[:, c])
        else:
            drive, gain = layout.drives[channel.index], int(gains[channel.index])
            part = _drive_reading(system, slots, state, drive, gain, derivatives)
            values[:, c] = part.values
            if gradient is not None and direct is not None:
                gradient[:, c], direct[:, c] = part.unknowns, part.slots
    return Readings(values, gradient, direct)


def _turned(state: State, r: int, since: Array) -> Array:
    """Rotation vector of rotation r since an orientation of all (B, 3, 3): (N, 3)."""
    return log(times(state.rotation[:, r], since[r].T))


def _scatter_row(target: Array, unknowns: Array, local: Array) -> None:
    """Add local gradients (N, L) to rows (N, n + c)."""
    for k in np.nonzero(unknowns >= 0)[0]:
        target[:, unknowns[k]] += local[:, k]


def _rotation_gradient(system: System, state: State, r: int, row: Array, gradient: Array, direct: Array) -> None:
    """Chain row . theta_r (N, 3) to the unknowns of rotation r, or to the slots that prescribe it."""
    layout = system.layout
    start, kind = int(layout.rotation_dofs[r]), layout.rotations.kind[r]
    axis = layout.rotations.axis[r]
    if start >= 0:
        entries = row if kind == 1 else (row @ axis)[:, None]
        where = system.place[start : start + entries.shape[1]]
        gradient[:, where[where >= 0]] = entries[:, where >= 0]
        slot = layout.rotations.slots[r, 0]
        if kind != 1 and slot >= 0 and where[0] < 0:
            direct[:, slot] = entries[:, 0]
    elif layout.rotations.slots[r, 0] >= 0:
        vector = _turned(state, r, layout.rotations.drawn)
        direct[:, layout.rotations.slots[r]] = (row[:, None, :] @ left_jacobian(vector))[:, 0]


def _drive_reading(
    system: System, slots: Array, state: State, drive: Drive, gain_slot: int, derivatives: bool
) -> Readings:
    """Reading = (measured position - position at reading zero - elastic travel of its own drive) / gain."""
    rows = len(state)
    gain = np.broadcast_to(slots[:, gain_slot], (rows,))
    base = slots[:, drive.slot]
    unknowns = np.zeros((rows, system.size))
    direct = np.zeros((rows, slots.shape[1]))
    if drive.kind is DriveKind.TRAVEL:
        position = state.travel[:, drive.target[0]]
        where = system.place[drive.target[0]]
        if where >= 0:
            unknowns[:, where] = 1.0
        else:
            direct[:, drive.slot] += 1.0
    elif drive.kind is DriveKind.ROTATION:
        r = drive.target[0]
        position = _turned(state, r, system.layout.rotations.drawn) @ system.layout.rotations.axis[r]
        _rotation_gradient(system, state, r, np.tile(system.layout.rotations.axis[r], (rows, 1)), unknowns, direct)
    else:
        position = _strain_position(
            system, slots, state, drive=drive, unknowns=unknowns, direct=direct, derivatives=derivatives
        )
    reading = (position - base) / gain
    if not derivatives:
        return Readings(reading)
    direct[:, drive.slot] -= 1.0
    unknowns, direct = unknowns / gain[:, None], direct / gain[:, None]
    direct[:, gain_slot] -= reading / gain
    return Readings(reading, unknowns, direct)


def _strain_position(
    system: System,
    slots: Array,
    state: State,
    drive: Drive,
    unknowns: Array,
    direct: Array,
    derivatives: bool,
) -> Array:
    """Length or displacement of the driven element less its elastic part under the drive's force, (N,)."""
    index, e, m = drive.target
    group = system.groups[index]
    arms = arm_vectors(system.layout, slots, state)
    ti, tj, delta, _ = group_view(system, index, views(system, state, arms))
    rest = rest_values(group, slots)
    strain, b = group.group.element.evaluate(delta, ti, tj, rest)
    position = strain[:, e, m] + rest[:, e, m]
    if derivatives:
        jacobian, _ = input_jacobian(system.layout, group.map, state, arms)
        local = (jacobian[:, e] @ b[:, e, m, group.inputs, None])[..., 0]
        _scatter_row(unknowns, group.map.unknowns[e], local)
        direct += strain_gradient(system, slots, state, (index, e, m))
    if group.group.rigid[e, m]:
        return position
    stiffness_slot = _own_stiffness(group.group, e, m)
    tension, stiffness = slots[:, drive.force_slot] * system.loaded, slots[:, stiffness_slot]
    if group.group.element.per_length:  # the natural length L of l = L (1 + tension / ES)
        natural = position / (1.0 + tension / stiffness)
        share = (natural / position)[:, None]
        unknowns *= share
        direct *= share
        direct[:, drive.force_slot] -= natural / (stiffness + tension) * system.loaded
        direct[:, stiffness_slot] += natural / (stiffness + tension) * tension / stiffness
        return np.asarray(natural)
    if derivatives:
        direct[:, drive.force_slot] -= 1.0 / stiffness * system.loaded
        direct[:, stiffness_slot] += tension / stiffness**2
    return np.asarray(position - tension / stiffness)


def _own_stiffness(group: Group, e: int, m: int) -> int:
    """Slot of the stiffness number of one strain that has one of its own."""
    return int(group.stiffness.start) + e * len(group.element.patterns) + m


def forced_energy(system: System, slots: Array, strains: tuple[Array, ...], drive: Drive) -> Array:
    """Energy (N,), J, of the member that a force-controlled drive strains: T^2 / (2 k), or T^2 L / (2 ES)."""
    index, e, m = drive.target
    group = system.groups[index].group
    if group.rigid[e, m] or not system.loaded:
        return np.zeros(len(slots))
    tension, stiffness = slots[:, drive.force_slot], slots[:, _own_stiffness(group, e, m)]
    energy = 0.5 * tension**2 / stiffness
    if group.element.per_length:
        length = strains[index][:, e, m] + slots[:, drive.slot]
        energy = energy * length / (1.0 + tension / stiffness)
    return np.asarray(energy)
