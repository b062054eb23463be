"""Parameters that act nowhere by structure: neither the balance of forces nor a reading contains them."""

from __future__ import annotations

import numpy as np

from .calibration.sensitivity import tcp_model
from .equilibrium.derivative import adjoint_derivative
from .equilibrium.kinematics import advance, drawn_state
from .equilibrium.readings import read_channels
from .model import Model
from .rotation import Array

_MOVE = 1e-2  # coordinates are thrown off by this share of the machine's size, so that everything is strained


def idle_parameters(model: Model) -> tuple[str, ...]:
    """Names of parameters without influence on the forces of a strained machine, on its TCP or on its drives' law.

    A stiffness that nothing strains at present is not idle.
    """
    felt = _slot_influence(model)
    chain = model.layout.slots.jacobian(model.by_name(model.nominal + 0.1 * model.ranges), model.names)
    return tuple(n for n, column in zip(model.names, chain.T, strict=True) if not felt[column != 0].any())


def _slot_influence(model: Model) -> Array:
    """Whether each slot (S,) enters the balance of forces or a TCP coordinate at a machine out of balance."""
    system, layout = model.exact, model.layout
    generator = np.random.default_rng(1)
    slots = layout.slots.constants[None].copy()
    for group in layout.groups:
        slots[:, group.prestress] += generator.uniform(1, 2, group.prestress.stop - group.prestress.start)
    state = drawn_state(layout, slots, 1, system.constraints)
    step = generator.normal(size=(1, system.size)) * _MOVE * min(model.length, 1.0)
    state = advance(system, state, step, 1.0)
    adjoint = generator.normal(size=(1, 2, system.size))
    change = np.abs(adjoint_derivative(system, slots, state, None, adjoint, 1.0)).max(axis=(0, 1))
    gains = np.array([a.gain_slot for a in model.actuators], dtype=np.intp)
    readings = read_channels(system, slots, state, tcp_model(model).channels, gains, True)
    assert readings.slots is not None
    felt = (change > 0) | (np.abs(readings.slots).max(axis=(0, 1), initial=0.0) > 0)
    felt[gains] = True  # a gain scales its drive's commands
    return np.asarray(felt)
