"""Parameters that act nowhere by structure: neither the balance of forces nor a reading contains them."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.derivative import adjoint_derivative
from pkmcal_cli.equilibrium.given import given
from pkmcal_cli.equilibrium.kinematics import advance, drawn_state
from pkmcal_cli.equilibrium.readings import read_channels
from pkmcal_cli.model.model import Model, tcp_model

_MOVE = 1e-2  # coordinates are thrown off by this share of the machine's size, so that everything is strained


def idle_parameters(model: Model) -> tuple[str, ...]:
    """Names of parameters without influence on the forces of a strained machine, on its TCP, drives' laws or sensors.

    A stiffness that nothing strains at present is not idle.
    """
    felt = _slot_influence(model)
    effects = {name for effect in model.effects for name in effect.parameters}  # act where their places are
    names = [name for name in model.names if name not in effects]
    chain = model.layout.slots.jacobian(model.by_name(model.nominal + 0.1 * model.ranges), names)
    return tuple(n for n, column in zip(names, chain.T, strict=True) if not felt[column != 0].any())


def _slot_influence(model: Model) -> Array:
    """Whether each slot (S,) enters the balance of forces or a TCP coordinate at a machine out of balance."""
    system, layout = model.exact, model.layout
    slots = model.drawn_slots.copy()  # at reading 0 of its drive a member may have no length
    for group in layout.groups:
        slots[:, group.prestress] += 1.5 + 0.5 * _scattered(group.prestress.stop - group.prestress.start)
    state = drawn_state(layout, slots, 1, system.constraints)
    step = _scattered(system.size, 1.0) * _MOVE * min(model.length, 1.0)
    state = advance(system, state, step[None], 1.0)
    adjoint = _scattered(system.size, 2.0)[None, None]
    numbers = given(system, slots)
    change = np.abs(adjoint_derivative(system, numbers, state, None, adjoint, 1.0)).max(axis=(0, 1))
    gains = np.array([a.gain_slot for a in model.actuators], dtype=np.intp)
    seen = tuple(v for v in (*tcp_model(model).views, *model.views) if v.quantity != "force")
    readings = read_channels(system, slots, state, seen, gains, numbers)
    assert readings.slots is not None
    felt = (change > 0) | (np.abs(readings.slots).max(axis=(0, 1), initial=0.0) > 0)
    felt[gains] = True  # a gain scales its drive's commands
    for sensor in model.sensors:
        for given_ in sensor.given.values():
            felt[given_.slots[given_.slots >= 0]] = True
    return np.asarray(felt)


def _scattered(n: int, phase: float = 0.0) -> Array:
    """n numbers between -1 and 1 without order, none of them zero; the same on every machine (and at no cost)."""
    return np.asarray(np.sin(12.9898 * np.arange(1, n + 1) + phase))
