"""What data can determine: singular directions of the whitened, range-scaled Jacobian, in numbers and words.

Singular values s belong to combinations of parameters in range units; 1/s is a combination's standard uncertainty
in ranges. A *null* direction is not seen: s is below 1e-10 of the largest, or the standard uncertainty would be
above 100 ranges, further than any linear statement reaches (what is null on the unstrained machine is seen again, to
second order, through the strain of small errors). A *weak* one would have a standard uncertainty above that of its
prior, half its range: to move it would make the parameters worse (docs/coverage.md). Both are held; the prior of what
is held takes part in the others' uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu, null_space

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.held_datum import mixing

NULL = 1e-10  # of the largest singular value
UNSEEN = 0.01  # whitened, per range
WEAK = 2.0  # range = 2 standard deviations of the prior
_SHOWN = 0.005  # smaller coefficients are not worth a word
PARTNER = 0.3  # share of the strongest part from which on a parameter counts as moving along
_SHARE = 1e-6  # a parameter takes part in a null direction when its component, of a largest 1, exceeds this,
_TRACE = 0.1  # and in one that is seen a little, this: smaller components add their prior to the uncertainty instead


@dataclass(frozen=True, kw_only=True)
class Directions:
    """Singular values (p,) of the scaled Jacobian and directions (p, p), rows; which are null or weak.

    `along` (p, p): see `duals`; None where directions are orthogonal, that is where no datum is held.

    `spread`: by what all variances are multiplied, ranges being those over its root: what is held depends on both.
    """

    names: tuple[str, ...]
    ranges: Array  # (p,) SI
    singular_values: Array
    vectors: Array
    null: NDArray[np.bool_]
    weak: NDArray[np.bool_]
    spread: float = 1.0
    along: Array | None = None

    @property
    def duals(self) -> Array:
        """By what the parts (p,) of an offset in directions are found, rows (p, p): orthogonal to the other ones."""
        return self.vectors if self.along is None else self.along

    @property
    def rank(self) -> int:
        """Number of directions that are not null."""
        return int((~self.null).sum())

    @property
    def condition_number(self) -> float:
        """Largest over smallest singular value; inf where the smallest is zero to rounding."""
        if not len(self.singular_values):
            return 1.0
        largest, smallest = float(self.singular_values[0]), float(self.singular_values[-1])
        return largest / smallest if smallest > NULL * largest else float("inf")

    @property
    def held(self) -> NDArray[np.bool_]:
        """Directions that a fit does not move."""
        return self.null | self.weak

    def null_vectors(self) -> Array:
        """Null directions (k, p) in sparse form, each with largest component 1."""
        exact = self.singular_values <= NULL * self.singular_values[:1]
        share_of_null = np.sqrt(self._variance(self.null) @ self.vectors**2)  # (p,) in ranges, by what is seen
        share = np.clip(share_of_null, _SHARE, _TRACE)  # what a whole range moves by less than noise does is not said
        parts = ((self.null & exact, share), (self.null & ~exact, np.full(len(share_of_null), _TRACE)))
        return np.vstack([sparse_basis(self.vectors[rows], trace) for rows, trace in parts])

    def undetermined(self) -> NDArray[np.bool_]:
        """Parameters (p,) with a share in a null direction."""
        return np.asarray((self.null_vectors() != 0.0).any(axis=0))

    def parts(self) -> Array:
        """By how much the readings move, in their noise, with each parameter's part (p, p) of a direction, rows: in a
        weak one parts cancel that are large by themselves. Ranges do not matter.
        """
        return np.asarray(np.abs(self.vectors) * np.sqrt(self.singular_values**2 @ self.duals**2))

    def covariance(self) -> Array:
        """Covariance (p, p) in SI; rows and columns of undetermined parameters are nan."""
        out = self.determined_covariance()
        lost = self.undetermined()
        out[lost, :] = np.nan
        out[:, lost] = np.nan
        return out

    def std_of_data(self) -> Array:
        """Standard uncertainties (p,), SI, by the data alone, weak directions moved too; nan where undetermined."""
        out = np.sqrt(self._variance(self.null) @ self.vectors**2) * self.ranges
        out[self.undetermined()] = np.nan
        return np.asarray(out)

    def _variance(self, without: NDArray[np.bool_]) -> Array:
        """Variances (p,) of the directions by the data, in ranges squared; 0 for some."""
        with np.errstate(divide="ignore"):
            return np.where(without, 0.0, 1.0 / self.singular_values**2)

    def determined_covariance(self, *, seen: bool = False) -> Array:
        """Covariance (p, p) in SI, right for sums of parameters that are determined: 1/s^2, the prior where held.

        seen: without directions of which the data see nothing.
        """
        variance = self.spread * np.where(self.held, WEAK**-2, self._variance(self.held))
        if seen:
            variance = np.where(self.null, 0.0, variance)
        return np.asarray((self.vectors.T * variance @ self.vectors) * np.outer(self.ranges, self.ranges))


def directions(
    jacobian: Array, names: tuple[str, ...], ranges: Array, unseen: float = UNSEEN, beside: Array | None = None
) -> Directions:
    """Directions of a whitened Jacobian (n, p), SI; zero rows are added where there are fewer rows than parameters.

    unseen: singular value below which nothing is seen; beside (p, g): by what parameters are off, in ranges, where one
    of a datum is off by its range (`HeldDatum`).
    """
    scaled = jacobian * ranges
    mixed = None if beside is None or not beside.any() else mixing(beside)
    scaled = scaled if mixed is None else scaled @ mixed[0]
    if len(scaled) > 4 * scaled.shape[1] > 0:
        scaled = np.asarray(np.linalg.qr(scaled, mode="r"))
    s, vectors = _singular(scaled)
    null = (s <= NULL * s[:1]) | (s < unseen)
    weak = ~null & (s < WEAK * (1 - 1e-9))  # what nothing but the ranges know is not weak
    spectrum = Directions(names=names, ranges=ranges, singular_values=s, vectors=vectors, null=null, weak=weak)
    return spectrum if mixed is None else replace(spectrum, vectors=vectors @ mixed[0], along=vectors @ mixed[1])


def _singular(scaled: Array) -> tuple[Array, Array]:
    """Singular values (p,) and vectors (p, p), rows, of a matrix (n, p).

    A column of zeros is a direction of its own, exactly: what has no effect takes no part in others by rounding.
    """
    p = scaled.shape[1]
    acting = scaled.any(axis=0)
    some = scaled[:, acting]
    q = some.shape[1]
    values, vectors = np.zeros(p), np.zeros((p, p))
    if q:
        padded = np.vstack([some, np.zeros((max(q - len(some), 0), q))])
        _, values[:q], vectors[:q, acting] = np.linalg.svd(padded)
    vectors[np.arange(q, p), np.flatnonzero(~acting)] = 1.0
    return values, vectors


@dataclass(frozen=True, kw_only=True)
class Combination:
    """Parameters that data cannot tell apart, and the combinations of them that are determined.

    `motions` (k, m): of the members `names`, each in units of the ranges with largest component 1, that are not seen
    (null) or barely seen (weak, k is 1). `determined`: coefficient rows in SI with respect to `names`. `hold`: k
    members; where these are held the data see the others.
    """

    kind: str  # "null" or "weak"
    names: tuple[str, ...]
    motions: Array
    determined: Array  # (d, len(names)) SI coefficients, leading one 1
    std: float  # of a weak direction in ranges, inf for null
    hold: tuple[str, ...]
    by_data: float = float("inf")  # of a weak one, what its strongest member is known to, SI,
    with_range: float = float("inf")  # and the same with what the range says

    @property
    def texts(self) -> tuple[str, ...]:
        """Every motion in words, coefficients in units of the ranges."""
        return tuple(self._motion(row) for row in self.motions)

    def _motion(self, row: Array) -> str:
        shown = _SHOWN if self.kind == "null" else 0.0  # of weak ones all that are named
        terms = [(n, c) for n, c in zip(self.names, row, strict=True) if abs(c) >= shown]
        if len(terms) == 1:
            return (
                f"{terms[0][0]} {'has no effect on these readings' if self.kind == 'null' else 'has hardly any effect'}"
            )
        parts = ", ".join(f"{n} {c:+.2f}" if abs(c) >= _SHOWN else f"{n} {c:+.1g}" for n, c in terms)
        return f"{parts} {'cannot be separated' if self.kind == 'null' else 'can hardly be separated'}"

    @property
    def text(self) -> str:
        """All in words."""
        return "; ".join(self.texts)


def combinations(spectrum: Directions) -> tuple[Combination, ...]:
    """Null directions, sparse, grouped by the parameters they share, in the order of these; then the weak ones."""
    out = []
    if spectrum.null.any():
        basis = spectrum.null_vectors()
        groups = [basis[group] for group in _connected(basis)]
        for vectors in sorted(groups, key=lambda vectors: int(vectors.any(axis=0).argmax())):  # not as rounding has it
            out.append(_null_combination(spectrum, vectors))
    for k in np.nonzero(spectrum.weak)[0]:
        vector = spectrum.vectors[k] / spectrum.vectors[k][np.argmax(np.abs(spectrum.vectors[k]))]
        parts = spectrum.parts()[k]
        members = np.nonzero((np.abs(vector) > 0.1) | (parts > PARTNER * parts.max()))[0]
        names = tuple(spectrum.names[m] for m in members)
        std = float(1.0 / spectrum.singular_values[k])
        leading = int(np.argmax(np.abs(vector)))
        size = float(np.abs(spectrum.vectors[k]).max() * spectrum.ranges[leading])
        out.append(
            Combination(
                kind="weak",
                names=names,
                motions=vector[members][None],
                determined=np.zeros((0, len(names))),
                std=std,
                hold=(spectrum.names[leading],),
                by_data=size * std * float(np.sqrt(spectrum.spread)),
                with_range=size / WEAK * float(np.sqrt(spectrum.spread)),
            )
        )
    return tuple(out)


def sparse_basis(basis: Array, trace: float | Array = _SHARE) -> Array:
    """A basis (k, p) of the same space in reduced echelon form with pivots, each row scaled to largest 1.

    Components up to `trace`, a number or (p,), are set to zero.
    """
    if not len(basis):
        return basis
    _, _, upper = lu(basis[:, _pivot_order(basis)])
    order = _pivot_order(basis)
    k = len(basis)
    reduced = np.linalg.solve(upper[:, :k], upper)
    out = np.zeros_like(basis)
    out[:, order] = reduced
    out[np.abs(out) < trace] = 0.0
    largest = np.take_along_axis(out, np.abs(out).argmax(axis=1)[:, None], axis=1)
    return np.asarray(out / largest)


def _pivot_order(basis: Array) -> NDArray[np.intp]:
    from scipy.linalg import qr

    _, _, order = qr(basis, mode="economic", pivoting=True)
    return np.asarray(order)


def _connected(basis: Array) -> list[list[int]]:
    """Rows of a sparse basis that share parameters."""
    groups: list[tuple[set[int], list[int]]] = []
    for row, vector in enumerate(basis):
        members = set(np.nonzero(vector)[0].tolist())
        joined = [g for g in groups if g[0] & members]
        rows = sorted([row, *(r for g in joined for r in g[1])])
        groups = [g for g in groups if not g[0] & members]
        groups.append((members.union(*(g[0] for g in joined)), rows))
    return [g[1] for g in groups]


def _null_combination(spectrum: Directions, basis: Array) -> Combination:
    members = np.nonzero(basis.any(axis=0))[0]
    moved = basis[:, members] * spectrum.ranges[members]  # SI motions that are not seen
    seen = null_space(moved).T  # (d, m) SI rows orthogonal to them
    if len(seen):
        scaled = sparse_basis(seen * spectrum.ranges[members]) / spectrum.ranges[members]
        lead = np.take_along_axis(
            scaled, np.argmax(np.abs(scaled) > 1e-9 / spectrum.ranges[members], axis=1)[:, None], 1
        )
        seen = scaled / lead
    names = tuple(spectrum.names[m] for m in members)
    motions = basis[:, members]
    hold = tuple(names[k] for k in sorted(_pivot_order(motions)[: len(motions)].tolist()))
    return Combination(kind="null", names=names, motions=motions, determined=seen, std=float("inf"), hold=hold)
