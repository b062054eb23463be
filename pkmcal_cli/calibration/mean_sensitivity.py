"""Sensitivity of the TCP to each parameter, per range (Ecorchard 2010, eq. 20-23)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Prediction, Request, Rows, predict
from pkmcal_cli.units.measurands import Measurand


@dataclass(frozen=True)
class ParameterSensitivity:
    """Mean over the configurations of the TCP's shift (m) and turn (rad) for one range of a parameter (eq. 23)."""

    name: str
    position: float
    orientation: float
    range: float


@dataclass(frozen=True)
class Sensitivity:
    """Global indices by parameter, most influential first, and the indices of every configuration (eq. 22)."""

    parameters: tuple[ParameterSensitivity, ...]
    names: tuple[str, ...]
    position: Array  # (N, P)
    orientation: Array  # (N, P)
    prediction: Prediction


def sensitivity(model: Model, values: Array, rows: Rows, selected: tuple[str, ...]) -> Sensitivity:
    """Sensitivities at parameter values (P,) over configurations; strained ones where the rows strain the machine."""
    full = tcp_model(model)
    prediction = predict(full, values, rows, Request(parameters=selected))
    jacobian = prediction.jacobian
    assert jacobian is not None
    solved = prediction.solved
    ranges = np.array([model.parameters[model.names.index(n)].range for n in selected])
    scaled = jacobian[solved] * ranges
    rotating = np.array([c.measurand is Measurand.ORIENTATION for c in full.channels])
    position = np.sqrt((scaled[:, ~rotating] ** 2).sum(axis=1))
    orientation = np.sqrt((scaled[:, rotating] ** 2).sum(axis=1))
    by_parameter = [
        ParameterSensitivity(n, float(p), float(o), float(r))
        for n, p, o, r in zip(selected, position.mean(axis=0), orientation.mean(axis=0), ranges, strict=True)
    ]
    ranked = sorted(by_parameter, key=lambda s: (-s.position, -s.orientation, s.name))
    return Sensitivity(tuple(ranked), selected, position, orientation, prediction)
