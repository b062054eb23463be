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
    rng, last = np.random.default_rng([seed, 11]), d + held_out
    vectors = linear.spectrum.vectors  # applied after drawing: directions are not the same everywhere
    whole, inside = _Products.none(x.shape[1]), []
    for f in np.unique(fold):
        products = _Products.of(x[fold == f], rng)
        whole = whole.plus(products)
        inside += [products.first(last).transformed(vectors)] if f >= 0 else []
    whole = whole.transformed(vectors)
    normal = whole.gram[:d, :d] + _at_least(prior, SMALL**2)
    near = np.linalg.solve(normal, np.hstack([whole.gram[:d, d:], whole.noise[:d]]))
    left = np.hstack([whole.gram[d:, d:], whole.noise[d:]]) - whole.gram[d:, :d] @ near
    return DrawnNoise(
        places=columns.places,
        information=left[:, : len(left)],
        gradient=left[:, len(left) :],
        folds=_folds(inside, whole.first(last), _at_least(prior, SMALL)),
        chance=(rng.permutation(_DRAWS) + 0.5) / _DRAWS,
    )


@dataclass(frozen=True)
class _Products:
    """Of columns of some rows with each other (q, q), and with noise (q, D); how many values these are."""

    gram: Array
    noise: Array
    count: int

    @classmethod
    def none(cls, size: int) -> _Products:
        return cls(np.zeros((size, size)), np.zeros((size, _DRAWS)), 0)

    @classmethod
    def of(cls, columns: Array, rng: np.random.Generator) -> _Products:
        """Of columns (n, q)."""
        (n, q), gram = columns.shape, columns.T @ columns
        if n < _MANY * q:
            return cls(gram, columns.T @ rng.normal(size=(n, _DRAWS)), n)
        return cls(gram, _root(gram) @ rng.normal(size=(q, _DRAWS)), n)

    def transformed(self, matrix: Array) -> _Products:
        """The first columns in other directions (d, d)."""
        d, gram, noise = len(matrix), self.gram.copy(), self.noise.copy()
        gram[:d], noise[:d] = matrix @ gram[:d], matrix @ noise[:d]
        gram[:, :d] = gram[:, :d] @ matrix.T
        return _Products(gram, noise, self.count)

    def first(self, size: int) -> _Products:
        return _Products(self.gram[:size, :size], self.noise[:size], self.count)

    def plus(self, other: _Products) -> _Products:
        return _Products(self.gram + other.gram, self.noise + other.noise, self.count + other.count)

    def minus(self, other: _Products) -> _Products:
        return _Products(self.gram - other.gram, self.noise - other.noise, self.count - other.count)


def _folds(inside: Sequence[_Products], whole: _Products, held: Array) -> Folds:
    if not inside:
        q, draws = len(whole.gram) - len(held), whole.noise.shape[1]
        none = np.zeros((0, q, q)), np.zeros((0, q, draws))
        return Folds(*none, *none, np.zeros(0))
    parts = [_fold(p, whole.minus(p), held) for p in inside]
    columns, noise, train, trained = (np.stack(arrays) for arrays in zip(*parts, strict=True))
    return Folds(columns, noise, train, trained, np.array([p.count for p in inside], dtype=float))


def _fold(inside: _Products, outside: _Products, held: Array) -> tuple[Array, Array, Array, Array]:
    """Products (d + Q) in a fold and in the others, with declared directions fitted to these."""
    d, q = len(held), len(inside.gram) - len(held)
    normal = outside.gram[:d, :d] + held
    fitted = np.linalg.solve(normal, np.hstack([outside.gram[:d, d:], outside.noise[:d]]))  # (d, Q + D)
    by_columns, by_noise = fitted[:, :q], fitted[:, q:]
    left = inside.gram[d:, :d] - by_columns.T @ inside.gram[:d, :d]  # (Q, d): test columns times the declared ones
    columns = inside.gram[d:, d:] - by_columns.T @ inside.gram[:d, d:] - left @ by_columns
    seen = inside.noise[d:] - by_columns.T @ inside.noise[:d] - left @ by_noise
    train = outside.gram[d:, d:] - outside.gram[d:, :d] @ by_columns
    trained = outside.noise[d:] - outside.gram[d:, :d] @ by_noise
    return columns, seen, train, trained


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
