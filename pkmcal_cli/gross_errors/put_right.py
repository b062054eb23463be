"""A table with columns put right that are exchanged, turned in sign, or in a wrong unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pkmcal_cli.gross_errors.plausibility import Hint
from pkmcal_cli.tables.measurement_set import Measurements

_ARRAYS = (("actuators", "actuator_sigma", "actuator_names"), ("readings", "sigma", "channels"))
"""Arrays whose columns are drives or channels, their standard uncertainties, and the names of the columns."""


def put_right(measured: Measurements, hints: Sequence[Hint]) -> Measurements | None:
    """The table as hints say that it should be; None where none says so."""
    columns = [change for hint in hints for change in hint.columns]
    if not columns:
        return None
    changed: dict[str, Any] = {}
    for values, sigmas, named in _ARRAYS:
        names = getattr(measured, named)
        here = [c for c in columns if c.name in names and c.source in names]
        if not here:
            continue
        to, source = ([names.index(n) for n in each] for each in zip(*((c.name, c.source) for c in here), strict=True))
        factor, shift = np.array([c.factor for c in here]), np.array([c.shift for c in here])
        for name, scale, more in ((values, factor, shift), (sigmas, np.abs(factor), 0.0)):
            array = getattr(measured, name)
            changed[name] = np.array(array)
            changed[name][:, to] = array[:, source] * scale + more
    return replace(measured, **changed)
