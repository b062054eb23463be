"""Sigmas that are stated far too large, as in a wrong unit: a fit then holds what it could identify."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.plural import listed
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.identify import RowsFailed, identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.residual import whitened_residual
from pkmcal_cli.report.number_format import to_digits
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.workflow.computed_readings import computed_readings

_SMALL = 0.05  # chi-square for each degree of freedom, below which no sigma is stated with care
_FEWEST = 20.0  # degrees of freedom
_ROUNDS, _ENOUGH = 4, 1.1
_NOISELESS = 3e3  # times: more than any wrong unit; rounding of a simulation without noise


def overstated_sigma(problem: Problem, fit: Fit) -> dict[str, float]:
    """By channel, how many times too large its sigma is stated, as the residuals of a fit say.

    What is held for such a sigma is in the residuals too, so they are those of a fit with a smaller one.
    """
    if fit.status not in ("converged", "nothing_identifiable"):
        return {}
    factors = _factors(problem, fit)
    large = [bool(f**2 * _SMALL > 1.0) for f in factors]
    factors = np.where(large, factors, 1.0)
    for _ in range(_ROUNDS if any(large) else 0):
        smaller = replace(problem, sigma=problem.sigma / factors)
        try:
            fit = identify(smaller, fit.selected, fit.values, states=fit.after.start)
        except RowsFailed:
            break
        more = np.where(large, _factors(smaller, fit), 1.0)
        factors = factors * more
        if more.max() < _ENOUGH:
            break
    names = [c.name for c in problem.model.channels]
    return {name: float(f) for name, f, odd in zip(names, factors, large, strict=True) if odd and f < _NOISELESS}


def _factors(problem: Problem, fit: Fit) -> Array:
    """Stated noise of channels (C,) over their residuals, at least 1; 1 where there are too few."""
    white = np.where(problem.measured, whitened_residual(problem, fit.last), 0.0)
    freedom = problem.measured.sum(axis=0) * (fit.dof / max(problem.count, 1))
    ratio = freedom / np.maximum((white**2).sum(axis=0), 1e-12)
    return np.asarray(np.where(freedom < _FEWEST, 1.0, np.sqrt(np.maximum(ratio, 1.0))))


def overstated_texts(problem: Problem, measured: Measurements, factors: Mapping[str, float]) -> list[str]:
    """Such channels, in words, one for each instrument: where their sigma stands, and what to do."""
    in_table = dict(zip(measured.channels, np.asarray(np.isfinite(measured.sigma).any(axis=0)), strict=True))
    by_instrument: dict[str, list[str]] = {}
    for channel in problem.model.channels:
        if channel.name in factors:
            by_instrument.setdefault(channel.instrument, []).append(channel.name)
    texts = []
    for instrument, names in by_instrument.items():
        columns = [f"`sigma.{name}`" for name in names if in_table.get(name)]
        where = f"column {listed(columns)}" if columns else "`sigma` in the machine file"
        factor = float(np.exp(np.mean([np.log(factors[name]) for name in names])))
        residuals = f"the residuals of {instrument} ({listed(names)}) are {to_digits(factor, 2)} times smaller"
        texts.append(f"{residuals} than its stated noise: check the unit of {where}")
    return texts


@dataclass(frozen=True)
class NoiseDoubts:
    """Why readings may be no measurements, in words; by channel, how many times too large its sigma is stated."""

    commanded: tuple[str, ...]
    overstated: Mapping[str, float]


def noise_doubts(problem: Problem, fit: Fit, measured: Measurements, to: Listener) -> NoiseDoubts:
    """Warn of residuals that are far too small, after a fit."""
    computed = computed_readings(problem, fit, measured)
    for text in computed.exact:
        to.warn(f"warning: {text}")
    if computed.exact or computed.commanded:
        return NoiseDoubts(computed.commanded, {})
    overstated = overstated_sigma(problem, fit)
    for text in overstated_texts(problem, measured, overstated):
        to.warn(f"warning: {text}")
    return NoiseDoubts((), overstated)
