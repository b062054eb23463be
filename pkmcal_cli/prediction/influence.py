"""Parameters that act nowhere by structure are found: neither the balance of forces nor a reading contains them.

A coefficient c acts where l^T dg/dc (the force terms, by the complex step of `derivative`) or dz/dc is not zero at a
machine that is strained everywhere and out of balance, with a vector l that has no zero; a parameter p by dc/dp
(structural against practical identifiability: Bellman and Astrom 1970).
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.derivative import adjoint_derivative
from pkmcal_cli.equilibrium.kinematics import advance, place_prescribed, reference_state
from pkmcal_cli.equilibrium.readings import read_quantities
from pkmcal_cli.equilibrium.system_numbers import system_numbers
from pkmcal_cli.mechanism.topology import DriveKind
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model

_MOVE = 1e-2  # coordinates are thrown off by this share of the machine's size, so that everything is strained


def idle_parameters(model: Model) -> tuple[str, ...]:
    """Name the parameters without influence on the forces of a strained machine, on its TCP, drives or sensors.

    A stiffness that nothing strains at present is not idle.
    """
    felt = _coefficient_influence(model)
    effects = {name for effect in model.effects for name in effect.parameters}  # act where their places are
    names = [name for name in model.names if name not in effects]
    chain = model.topology.coefficients.jacobian(model.by_name(model.nominal + 0.1 * model.ranges), names)
    return tuple(n for n, column in zip(names, chain.T, strict=True) if not felt[column != 0].any())


def _coefficient_influence(model: Model) -> Array:
    """Whether each coefficient (S,) enters the balance of forces or a TCP coordinate at a machine out of balance."""
    system, topology = model.exact, model.topology
    coefficients = model.reference_coefficients.copy()  # at reading 0 of its drive a member may have no length
    for group in topology.groups:
        coefficients[:, group.prestress] += 1.5 + 0.5 * _scattered(group.prestress.stop - group.prestress.start)
    travels = [d.coefficient for d in topology.drives if d.kind is DriveKind.TRAVEL]
    moved = _MOVE * min(model.length, 1.0)
    coefficients[:, travels] += moved * _scattered(len(travels), 3.0)  # at travel 0 its direction moves no carriage
    state = place_prescribed(topology, coefficients, reference_state(topology, coefficients, 1, system.constraints))
    step = moved * _scattered(system.size, 1.0)
    state = advance(system, state, step[None], 1.0)
    adjoint = _scattered(system.size, 2.0)[None, None]
    numbers = system_numbers(system, coefficients)
    change = np.abs(adjoint_derivative(system, numbers, state, adjoint, 1.0, taut=True)).max(axis=(0, 1))
    gains = np.array([a.gain_coefficient for a in model.actuators], dtype=np.intp)
    seen = tuple(v for v in (*tcp_model(model).observed, *model.observed) if not v.is_load)
    readings = read_quantities(system, coefficients, state, seen, gains, numbers)
    assert readings.coefficients is not None
    still = np.zeros((1, len(seen), system.size))
    direct = readings.coefficients - adjoint_derivative(system, numbers, state, still, 1.0, points=readings.points)
    felt = (change > 0) | (np.abs(direct).max(axis=(0, 1), initial=0.0) > 0)
    felt[gains] = True  # a gain scales its drive's commands
    for sensor in model.sensors:
        for known in sensor.known.values():
            felt[known.coefficients[known.coefficients >= 0]] = True
    return np.asarray(felt)


def _scattered(n: int, phase: float = 0.0) -> Array:
    """n numbers between -1 and 1 without order, none of them zero; the same on every machine (and at no cost)."""
    return np.asarray(np.sin(12.9898 * np.arange(1, n + 1) + phase))
