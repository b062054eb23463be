"""Noise of many campaigns at once, as the scores of hypotheses and rows held out see it: products with columns.

These are normal with the normal matrices of columns as covariances, whatever the number of rows; so they are drawn
where rows are many, and noise itself where they are few.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear

SMALL = 1e-6  # prior of what is not held, as in the confirmation
_DRAWS = 500
_ROUNDING = 1e-12  # of the largest eigenvalue; and of a column in standard uncertainties, squared
_MANY = 4  # values for each column, from which on products are drawn, not noise


@dataclass(frozen=True)
class Columns:
    """Columns (n, Q) of hypotheses by which they are judged, each once, and the places of each hypothesis in them."""

    values: Array
    places: Mapping[Hypothesis, NDArray[np.intp]]

    @classmethod
    def of(cls, linear: Linear, hypotheses: Sequence[Hypothesis]) -> Columns:
        """Of some hypotheses; parts and groups share theirs."""
        known: dict[tuple[str, tuple[str, ...]], int] = {}
        columns, places = [np.zeros((len(linear.residual), 0))], {}
        for h in hypotheses:
            new = [j for j, name in enumerate(h.parameters) if (name, h.free) not in known]
            if new:
                columns.append(linear.tested(h)[:, new])
                known |= {(h.parameters[j], h.free): len(known) + i for i, j in enumerate(new)}
            places[h] = np.array([known[name, h.free] for name in h.parameters], dtype=np.intp)
        return cls(np.hstack(columns), places)


@dataclass(frozen=True)
class Folds:
    """Products in each of F folds, of Q columns and D draws of noise.

    columns (F, Q, Q), noise (F, Q, D): what is left of columns in a fold once declared parameters are fitted to the
    others, times that of columns and noise; train (F, Q, Q), trained (F, Q, D): the same of the other rows. values
    (F,): how many.
    """

    columns: Array
    noise: Array
    train: Array
    trained: Array
    values: Array


@dataclass(frozen=True, kw_only=True)
class DrawnNoise:
    """Products of columns (n, q), declared parameters projected out: with each other (q, q), with noise (q, D).

    The columns are those of `hypotheses` by their places, then those `besides`. chance (D,): that an estimate of the
    noise is smaller. folds: of the first columns, those of hypotheses that are confirmed by them.
    """

    places: Mapping[Hypothesis, NDArray[np.intp]]
    information: Array
    gradient: Array
    folds: Folds
    chance: Array


def drawn_noise(linear: Linear, columns: Columns, held_out: int, besides: Array, fold: Array, seed: int) -> DrawnNoise:
    """Draws for columns of hypotheses, of which the first are judged by rows held out, and columns (n, b) besides.

    fold (n,) of each value, -1: in none.
    """
    prior = linear.fixed[1]
    declared = [linear.of(linear.projected), *([] if linear.extra is None else [linear.extra])]
    x, d = np.hstack([*declared, columns.values, besides]), len(prior)
    x[:, (x**2).sum(axis=0) < _ROUNDING] = 0.0  # what moves nothing, and is not even the same everywhere
    rng = np.random.default_rng([seed, 11])
    size, last = len(linear.projected), d + held_out
    transform = np.eye(x.shape[1])  # parameters to directions, after drawing: these are not the same everywhere
    transform[:size, :size] = linear.spectrum.vectors
    whole, score = np.zeros((x.shape[1], x.shape[1])), np.zeros((x.shape[1], _DRAWS))
    grams, noises, count = [], [], []
    for f in np.unique(fold):
        part = x[fold == f]
        gram, noise = part.T @ part, _noise(part, rng)
        whole, score = whole + gram, score + noise
        if f >= 0:
            t = transform[:last, :last]
            grams.append(t @ gram[:last, :last] @ t.T)
            noises.append(t @ noise[:last])
            count.append(len(part))
    whole, score = transform @ whole @ transform.T, transform @ score
    normal = whole[:d, :d] + _at_least(prior, SMALL**2)
    near = np.linalg.solve(normal, np.hstack([whole[:d, d:], score[:d]]))
    left = np.hstack([whole[d:, d:], score[d:]]) - whole[d:, :d] @ near
    q, held = len(left), _at_least(prior, SMALL)
    products = zip(grams, noises, strict=True)
    parts = [_fold(g, n, whole[:last, :last] - g, score[:last] - n, held) for g, n in products]
    folds = Folds(*(np.stack(arrays) for arrays in zip(*parts, strict=True)), np.array(count, dtype=float))
    return DrawnNoise(
        places=columns.places, information=left[:, :q], gradient=left[:, q:], folds=folds, chance=rng.random(_DRAWS)
    )


def _noise(columns: Array, rng: np.random.Generator) -> Array:
    """Products (q, D) of columns (n, q) with noise."""
    if len(columns) < _MANY * columns.shape[1]:
        return columns.T @ rng.normal(size=(len(columns), _DRAWS))
    return _root(columns.T @ columns) @ rng.normal(size=(columns.shape[1], _DRAWS))


def _fold(gram: Array, noise: Array, train: Array, trained: Array, held: Array) -> tuple[Array, Array, Array, Array]:
    """Products in a fold (d + Q, d + Q), (d + Q, D), and in the others, with declared directions fitted to these."""
    d = len(held)
    normal = train[:d, :d] + held
    fitted = np.linalg.solve(normal, np.hstack([train[:d, d:], trained[:d]]))  # (d, Q + D)
    q = gram.shape[0] - d
    by_columns, by_noise = fitted[:, :q], fitted[:, q:]
    outside = gram[d:, :d] - by_columns.T @ gram[:d, :d]  # (Q, d): test columns times the declared ones
    columns = gram[d:, d:] - by_columns.T @ gram[:d, d:] - outside @ by_columns
    seen = noise[d:] - by_columns.T @ noise[:d] - outside @ by_noise
    left = train[d:, d:] - train[d:, :d] @ by_columns
    score = trained[d:] - train[d:, :d] @ by_noise
    return columns, seen, left, score


def _at_least(prior: Array, least: float) -> Array:
    """A precision (d, d) with a diagonal that is nowhere less."""
    out = prior.copy()
    np.fill_diagonal(out, np.maximum(np.diag(prior), least))
    return out


def _root(gram: Array) -> Array:
    """A root (q, q) of a matrix that is the same under any library, unlike one by eigenvectors."""
    size = np.sqrt(np.where(np.diag(gram) > 0, np.diag(gram), 1.0))
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    some = values > _ROUNDING * values.max(initial=0.0)
    return np.asarray(size[:, None] * ((vectors[:, some] * np.sqrt(values[some])) @ vectors[:, some].T))
