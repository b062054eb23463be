"""Sensitivity of the TCP to each parameter, per range or stated size (Ecorchard 2010, eq. 20-23, figures 16-18)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Method, Prediction, Request, Rows
from pkmcal_cli.prediction.differences import predict_with_derivatives
from pkmcal_cli.units.measurands import Measurand

NO_SHIFT = 1e-12
"""Shift, m or rad, below which there is none but rounding."""


@dataclass(frozen=True)
class ParameterSensitivity:
    """Mean over the configurations of the TCP's shift (m) and rotation (rad) for one size of a parameter (eq. 23)."""

    name: str
    position: float
    orientation: float
    size: float


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """Global indices by parameter, most influential first; shifts (N, C, P) of the TCP's coordinates, m or rad.

    Rows that are not solved are nan in `shifts`.
    """

    parameters: tuple[ParameterSensitivity, ...]
    names: tuple[str, ...]
    coordinates: tuple[str, ...]
    shifts: Array
    prediction: Prediction

    def along(self, coordinate: str) -> tuple[Array, Array]:
        """Mean and largest (by size) shift (P,) of one coordinate, in the order of `names`."""
        shifts = self.shifts[self.prediction.solved, self.coordinates.index(coordinate)]
        largest = np.take_along_axis(shifts, np.abs(shifts).argmax(axis=0)[None], axis=0)[0]
        return shifts.mean(axis=0), largest


def sensitivity(
    model: Model, values: Array, rows: Rows, sizes: Mapping[str, float], method: Method = "exact"
) -> Sensitivity:
    """Sensitivities to parameters by sizes, SI, at values (P,), over configurations, strained where rows strain."""
    full = tcp_model(model)
    request = Request(method=method, parameters=tuple(sizes))
    prediction = predict_with_derivatives(full, values, rows, request)
    assert prediction.jacobian is not None
    scaled = prediction.jacobian * np.array(list(sizes.values()))
    rotating = np.array([c.measurand is Measurand.ORIENTATION for c in full.channels])
    solved = scaled[prediction.solved]
    position = np.sqrt((solved[:, ~rotating] ** 2).sum(axis=1)).mean(axis=0)
    orientation = np.sqrt((solved[:, rotating] ** 2).sum(axis=1)).mean(axis=0)
    by_parameter = [
        ParameterSensitivity(n, float(p), float(o), float(size))
        for (n, size), p, o in zip(sizes.items(), position, orientation, strict=True)
    ]
    order = sorted(by_parameter, key=lambda s: (-ranked(s.position), -ranked(s.orientation), s.name))
    names = tuple(c.name for c in full.channels)
    return Sensitivity(
        parameters=tuple(order), names=tuple(sizes), coordinates=names, shifts=scaled, prediction=prediction
    )


def ranked(shift: float) -> float:
    """Size by which shifts (m or rad) are ranked: rounding errors decide nothing."""
    return 0.0 if abs(shift) < NO_SHIFT else float(f"{abs(shift):.9g}")
