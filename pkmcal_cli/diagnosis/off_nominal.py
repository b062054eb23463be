"""How far a calibration puts declared parameters off nominal."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.diagnosis.first_fit import OUT
from pkmcal_cli.diagnosis.scoring import Search

NOWHERE = 10.0
"""Ranges off nominal, where no machine has a parameter."""


def beyond_ranges(search: Search, fit: Fit) -> dict[str, float]:
    """How far declared parameters are off nominal, the furthest first, SI; those beyond their ranges."""
    names, off, share = off_nominal(search, fit)
    order = [int(k) for k in np.argsort(-share, kind="stable") if share[k] > OUT]
    return {names[k]: float(off[k]) for k in order}


def run_off(search: Search) -> dict[str, float]:
    """Declared parameters that a calibration puts where no machine has them, the furthest first: in their ranges."""
    names, _, share = off_nominal(search, search.fit)
    order = [int(k) for k in np.argsort(-share, kind="stable") if share[k] > NOWHERE]
    return {names[k]: float(share[k]) for k in order}


def furthest(search: Search, fit: Fit) -> float:
    """Largest offset of a declared parameter, in its range."""
    return float(off_nominal(search, fit)[2].max(initial=0.0))


def off_nominal(search: Search, fit: Fit) -> tuple[tuple[str, ...], Array, Array]:
    """Declared parameters (k,) that are fitted, and how far they are off nominal: SI, and in their ranges."""
    model = search.problem.model
    names = tuple(n for n in search.declared if n in fit.selected)
    index = [model.names.index(n) for n in names]
    off = fit.values[index] - model.nominal[index]
    return names, off, np.abs(off) / model.ranges[index]
