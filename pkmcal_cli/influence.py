"""Parameters that act nowhere by structure: without influence even at a strained, perturbed machine."""

from __future__ import annotations

import numpy as np

from .calibration.sensitivity import tcp_model
from .model import Channel, Model
from .prediction import Request, Rows, predict

_STRAIN = 1e-3  # drives are moved by this share of the machine's size to strain it


def idle_parameters(model: Model) -> tuple[str, ...]:
    """Names of parameters that change no TCP coordinate and no free drive's reading, at a strained pose."""
    from dataclasses import replace

    full = tcp_model(model)
    forced = tuple(
        Channel(d.name, "drive", a, 0, np.nan, "m", "length")
        for a, d in enumerate(model.layout.drives)
        if d.force_controlled
    )
    full = replace(full, channels=full.channels + forced)
    generator = np.random.default_rng(1)
    values = model.nominal + 0.5 * model.ranges * generator.uniform(-1, 1, len(model.ranges))
    slots = model.layout.slots.constants
    gains = np.array([slots[a.gain_slot] for a in model.actuators])
    moves = generator.uniform(-1, 1, (4, len(gains))) * _STRAIN * model.length / gains
    prediction = predict(full, values, Rows.at(model.drawn_readings + moves), Request(parameters=model.names))
    if not prediction.solved.any() or prediction.jacobian is None:
        return ()
    influence = np.abs(prediction.jacobian[prediction.solved]).max(axis=(0, 1)) * model.ranges
    return tuple(n for n, size in zip(model.names, influence, strict=True) if size < 1e-15 * model.length)
