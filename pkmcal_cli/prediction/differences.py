"""Methods that do not end at equilibrium are differentiated by central differences; `exact` has analytic derivatives.

dz/dp = (z(p + h) - z(p - h)) / (2 h), with an error of order h^2 (Taylor's series); h is a share of the range.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.commanded import forced
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.inputs import bounds_of
from pkmcal_cli.prediction.pipeline import Receiver, predict
from pkmcal_cli.prediction.rows import Prediction, Request, Rows, WarmStart

_SHARE = 1e-3  # of a parameter's range
_TRAVEL = 1e-7  # of the machine's size, or rad: step of a drive
_FORCE = 1.0  # N or N m


def predict_with_derivatives(
    model: Model,
    values: Array,
    rows: Rows,
    request: Request,
    start: WarmStart | None = None,
    receive: Receiver | None = None,
) -> Prediction:
    """Predict with the derivatives that are asked for, by any method. Raises ValueError for joined rows.

    receive: as of `predict`, for the method `exact` only.
    """
    if request.method == "exact":
        return predict(model, values, rows, request, start, receive=receive)
    bare = replace(request, parameters=None, by_drive=False)
    here = predict(model, values, rows, bare)
    jacobian = by_drive = None
    if request.parameters is not None:
        shape = (*here.values.shape, len(request.parameters))
        jacobian = np.zeros(shape)
        for k, h, moved in _parameter_steps(model, values, rows, request.parameters):
            above, below = (predict(model, at, rows, bare).values for at in moved)
            jacobian[..., k] = (above - below) / (2 * h)
    if request.by_drive:
        if rows.partner is not None and (rows.partner >= 0).any():
            raise ValueError(f"method {request.method} has no derivatives across rows")
        by_drive = np.zeros((*here.values.shape, rows.readings.shape[1]))
        steps = _TRAVEL * np.where(_lengths(model), model.length, 1.0) / model.gains
        for a, step in enumerate(np.where(forced(model), _FORCE, steps)):
            above, below = (predict(model, values, _moved(model, rows, a, s), bare).values for s in (step, -step))
            by_drive[..., a] = (above - below) / (2 * step)
    return replace(here, jacobian=jacobian, by_drive=by_drive)


def _moved(model: Model, rows: Rows, drive: int, by: float) -> Rows:
    """Rows in which a drive is commanded another reading, or force."""
    if forced(model)[drive]:
        return replace(rows, columns={**rows.columns, f"push.{model.drive_names[drive]}": np.full(len(rows), by)})
    shift = np.zeros_like(rows.readings)
    shift[:, drive] = by
    return rows.moved(shift)


def _parameter_steps(
    model: Model, values: Array, rows: Rows, names: tuple[str, ...]
) -> Iterator[tuple[int, float, tuple[Array, Array]]]:
    """Numbers of those names that the rows let move, steps, SI, and values (P,) that much above and below."""
    bounds = bounds_of(model, rows.columns)
    for number, name in enumerate(names):
        k = model.names.index(name)
        if bounds[k, 0] == bounds[k, 1]:
            continue
        h = _SHARE * (model.parameters[k].range or max(abs(float(values[k])), 1.0))
        step = np.zeros_like(values)
        step[k] = h
        yield number, h, (values + step, values - step)


def _lengths(model: Model) -> Array:
    """Which drives (A,) move a length."""
    return np.array([model.topology.moves_length(d) for d in model.topology.drives])
