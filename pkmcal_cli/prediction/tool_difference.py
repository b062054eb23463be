"""How far the predicted tool point moves at the same set values, when a machine is known otherwise, is computed here.

The distance is |x_2 - x_1|, the angle |log(R_1^T R_2)| of the rotation from the one to the other.
"""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array, exp, log
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction.pipeline import predict
from pkmcal_cli.prediction.rows import Rows
from pkmcal_cli.units.measurands import Measurand


def tool_difference(before: tuple[Model, Array], after: tuple[Model, Array], rows: Rows) -> tuple[Array, Array]:
    """Compare the tool of two machines with values (P,): distances (N,), m, angles (N,), rad; nan where unsolved.

    Angles are nan for a tool point that has no orientation.
    """
    one, other = (predict(tcp_model(model), values, rows).values for model, values in (before, after))
    channels = tcp_model(before[0]).channels
    positions = [k for k, c in enumerate(channels) if c.measurand is Measurand.POSITION]
    angles = [k for k, c in enumerate(channels) if c.measurand is Measurand.ORIENTATION]
    distance = np.linalg.norm(other[:, positions] - one[:, positions], axis=1)
    if not angles:
        return distance, np.full(len(distance), np.nan)
    if len(angles) == 1:
        return distance, np.abs(np.remainder(other[:, angles[0]] - one[:, angles[0]] + np.pi, 2 * np.pi) - np.pi)
    rotations = exp(np.nan_to_num(one[:, angles])), exp(np.nan_to_num(other[:, angles]))
    between = log(np.swapaxes(rotations[0], 1, 2) @ rotations[1])
    return distance, np.where(np.isnan(distance), np.nan, np.linalg.norm(between, axis=1))
