"""Rows that cannot be predicted, as an error."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.loading.poses import failed_rows, origin_of
from pkmcal_cli.prediction import Prediction
from pkmcal_cli.tables.measurement_set import Measurements


def unsolved(measured: Measurements, prediction: Prediction) -> BadInput:
    """The error that names them."""
    lost = np.nonzero(~prediction.solved)[0]
    reasons = {int(k): prediction.reason(int(k)) for k in lost}
    return failed_rows(lambda row: origin_of(measured, row), reasons, len(measured))
