"""What is known of parameters before a measurement, as further equations of a fit."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.held_datum import HeldDatum
from pkmcal_cli.calibration.identifiability import WEAK, Directions
from pkmcal_cli.model.model import Model

_LEAST = 1e-12  # of the largest eigenvalue of a matrix of correlations


@dataclass(frozen=True)
class Prior:
    """Combinations of parameters that are known with standard uncertainty 1: rows (k, p), SI, of `names` about centre.

    centre (p,): values of the parameters, SI. stated: those of which an earlier calibration says so, not ranges, which
    are guesses and may turn out to be wider.
    """

    names: tuple[str, ...]
    rows: Array
    centre: Array
    stated: tuple[str, ...] = ()

    def errors(self, model: Model, values: Array) -> Array:
        """Known less given (k,), in standard uncertainties, at parameter values (P,)."""
        index = [model.names.index(n) for n in self.names]
        return np.asarray(self.rows @ (self.centre - values[index]))

    def columns(self, parameters: tuple[str, ...]) -> Array:
        """Derivatives (k, p') of what is known by some parameters."""
        out = np.zeros((len(self.rows), len(parameters)))
        for k, name in enumerate(parameters):
            if name in self.names:
                out[:, k] = self.rows[:, self.names.index(name)]
        return out

    @property
    def without_ranges(self) -> Prior | None:
        """What is stated, None for nothing."""
        return self.without(set(self.names) - set(self.stated))

    def without(self, left_out: Collection[str]) -> Prior | None:
        """What is known of the others, which nothing joins to those left out; None for nothing."""
        kept = np.array([n not in left_out for n in self.names])
        if not kept.any():
            return None
        rows = self.rows[(self.rows[:, kept] != 0.0).any(axis=1)]
        names, stated = ([n for n in some if n not in left_out] for some in (self.names, self.stated))
        return Prior(tuple(names), rows[:, kept], self.centre[kept], tuple(stated))

    def relative_to(self, datum: HeldDatum, model: Model, values: Array) -> Prior:
        """What is known of the others relative to a datum that is known here, and held at parameter values (P,)."""
        others = tuple(n for n in self.names if n not in datum.held)
        of_others, of_datum = ([self.names.index(n) for n in some] for some in (others, datum.held))
        moves, held = datum.of(others), values[[model.names.index(n) for n in datum.held]]
        free = null_space((self.rows[:, of_datum] - self.rows[:, of_others] @ moves).T).T  # whatever the datum truly is
        centre = self.centre[of_others] + moves @ (self.centre[of_datum] - held)
        return Prior(others, free @ self.rows[:, of_others], centre, tuple(n for n in self.stated if n in others))


def joined(one: Prior, other: Prior) -> Prior:
    """What is known by both, of different parameters."""
    rows = np.zeros((len(one.rows) + len(other.rows), len(one.names) + len(other.names)))
    rows[: len(one.rows), : len(one.names)] = one.rows
    rows[len(one.rows) :, len(one.names) :] = other.rows
    return Prior((*one.names, *other.names), rows, np.append(one.centre, other.centre), (*one.stated, *other.stated))


def prior_of_covariance(names: tuple[str, ...], covariance: Array, centre: Array) -> Prior:
    """Parameters about a centre (p,) with a covariance (p, p), SI, which may be singular to rounding."""
    std = np.sqrt(np.diag(covariance))
    value, vector = np.linalg.eigh(covariance / np.outer(std, std))
    floor = _LEAST * value.max(initial=1.0)
    return Prior(names, (vector / np.sqrt(np.maximum(value, floor))).T / std, centre, stated=names)


def prior_of_ranges(
    model: Model, names: tuple[str, ...], datum: HeldDatum | None = None, values: Array | None = None
) -> Prior:
    """Every parameter near its nominal value, with half its range as standard deviation, those of a datum too.

    What is known of the others relative to these, which are held at parameter values (P,).
    """
    every = names if datum is None else (*names, *datum.held)
    index = [model.names.index(n) for n in every]
    prior = Prior(every, np.diag(2.0 / model.ranges[index]), model.nominal[index])
    return prior if datum is None or values is None else prior.relative_to(datum, model, values)


def prior_of_held(directions: Directions, centre: Array) -> Prior:
    """Held directions stay about a centre (p,) as their ranges say."""
    return Prior(directions.names, WEAK * directions.duals[directions.held] / directions.ranges, centre)
