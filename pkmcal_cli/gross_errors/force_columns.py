"""Forces that were read, or commanded, with another sign, in another unit, or in each other's columns.

A stiff machine makes large forces of small errors of its parameters, so a force is not compared with that of the
nominal machine: what parameters within their ranges and drives within their errors explain is taken off first, to first
order. What is left is linear in the factors by which columns are wrong: least squares give all of them at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.whitening import Slopes, whiten
from pkmcal_cli.gross_errors.plausibility import BETTER, FEW, GROSS, Hint, Kind, Right, rms
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.mistaken_units import factors_of, times, unit_words
from pkmcal_cli.units.unit_text import Unit, parse_unit

_OFF = 3.0  # standard uncertainties: less is left of tables in which no column is wrong
_LITTLE, _LESS = 2.0, 0.4  # an explanation that leaves so little needs to leave no less than this share
_SURE = 5.0  # standard uncertainties from which on a factor is not 1
_FAR = 0.01  # factor of a far smaller unit
_NEAR = 0.3  # logarithm of the ratio of a factor to one that it is taken for
_SCALE = 3.0  # times: from there on, a factor that is no unit's is the column's own, as newtons per ampere
_ALIKE = 0.1  # logarithm of the ratio of factors that columns have in common
_TRACE = 1e-9  # share of a column that parameters leave of it: less is rounding


@dataclass(frozen=True)
class _Column:
    """Forces (n,) as they were read or commanded; `by_force` (n, C): how what is left grows with each.

    size: rms of what was read, in standard uncertainties; infinite of what was commanded.
    """

    name: str
    unit: Unit
    force: Array
    by_force: Array
    size: float = np.inf

    @property
    def commanded(self) -> bool:
        """Whether a drive was told to push so."""
        return self.size == np.inf

    def more(self, forces: Array) -> Array:
        """By how much (n, C) what is left grows by more force (n,)."""
        return np.asarray(self.by_force * forces[:, None])


def explain_forces(sample: Sample) -> tuple[Hint, ...]:
    """Columns of forces that, put right, explain what parameters do not: signs and units, else two that are swapped.

    `before` is infinite where commanded forces are so large that a table says nothing else.
    """
    columns = (*_readings(sample), *_commands(sample))
    if not columns:
        return ()
    left = _Left.of(sample, columns)
    if left.count >= FEW + len(columns) and left.before <= _OFF:
        return ()
    commanded = tuple(c for c in columns if c.commanded)
    if left.count < FEW + len(columns) or sample.mostly_lost:
        return _too_large(sample, commanded, np.inf)
    factors = _meant(columns, left.factors())
    nothing = [abs(f) * c.size < GROSS for f, c in zip(factors.tolist(), columns, strict=True)]
    factors[nothing] = 1.0  # a machine without forces explains none: these may be weight, or friction
    after, swapped = left.size(left.vector + left.slopes @ (factors - 1.0)), _swapped(columns, left)
    if left.explained(after) and not any(h.after < after for h in swapped):
        return tuple(_rescaled(columns, factors, left.before, after))
    return swapped or _too_large(sample, commanded, left.before)


def _too_large(sample: Sample, columns: Sequence[_Column], before: float) -> tuple[Hint, ...]:
    """Commanded forces that are right in a far smaller unit: under what they are, nothing is linear.

    before: what is left of them as they are, in standard uncertainties.
    """
    whole, values, parameters = sample.whole, sample.evaluation.values, sample.evaluation.parameters
    for factor in (f for f in factors_of(columns[0].unit) if f <= _FAR) if columns else ():
        rows = replace(whole.rows, forces=whole.rows.forces * factor)
        weaker = Sample.of(replace(whole, rows=rows), values, parameters)
        left = _Left.of(weaker, ())
        if weaker.evaluation.prediction.solved.all() and left.count and left.before <= min(GROSS, BETTER * before):
            names, words = tuple(c.name for c in columns), times(factor) + unit_words(columns[0].unit, factor)
            fall = f"parameters within their ranges leave {left.before:.2g} standard uncertainties"
            message = f"{_look(names)} {words}: {fall} when multiplied by {factor:.4g}"
            right = tuple(Right(n, n, factor) for n in names)
            return (Hint(kind="unit", names=names, message=message, before=np.inf, after=left.before, columns=right),)
    return ()


def _look(names: Sequence[str]) -> str:
    """The words "`f1`, `f2` and `f3` look"."""
    quoted = [f"`{n}`" for n in names]
    return f"{quoted[0]} looks" if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]} look"


def _meant(columns: Sequence[_Column], factors: Array) -> Array:
    """Factors (K,) that are meant: signs and those of units; of columns that are off alike the same."""
    named = [_named(c.unit, f) for c, f in zip(columns, factors.tolist(), strict=True)]
    scales = [f for f, c in zip(named, columns, strict=True) if abs(f) not in (1.0, *factors_of(c.unit))]
    alike = {f: [g for g in scales if g * f > 0 and abs(np.log(g / f)) < _ALIKE] for f in scales}
    return np.array([float(np.median(alike[f])) if f in alike else f for f in named])


def _named(unit: Unit, factor: float) -> float:
    """The sign and the unit's factor that a factor is near to; itself where it is far from 1 and near none."""
    size, sign = abs(factor), float(np.sign(factor))
    known = [f for f in (1.0, *factors_of(unit)) if abs(np.log(max(size, 1e-300) / f)) < _NEAR]
    if known:
        return sign * min(known, key=lambda f: abs(np.log(size / f)))
    return factor if max(size, 1.0 / max(size, 1e-300)) > _SCALE else sign


def _rescaled(columns: Sequence[_Column], factors: Array, before: float, after: float) -> Iterator[Hint]:
    """One hint for columns with the same factor and unit."""
    alike: dict[tuple[float, Unit], list[_Column]] = {}
    for column, factor in zip(columns, factors.tolist(), strict=True):
        if factor != 1.0:
            alike.setdefault((factor, column.unit), []).append(column)
    for (factor, unit), some in alike.items():
        names = tuple(c.name for c in some)
        size = abs(factor)
        words = [f"{times(float(f'{size:.3g}'))}{unit_words(unit, size)}"] if size != 1.0 else []
        words += ["reversed in sign"] if factor < 0 else []
        of_scale = size not in (1.0, *factors_of(unit))
        remedy = f"; is it this force? Its `scale` is to be about {size:.2g} times what it is" if of_scale else ""
        fall = f"{_fall(before, after)} when multiplied by {factor:.4g}"
        message = f"{_look(names)} {' and '.join(words)}: {fall}{remedy}"
        right = tuple(Right(n, n, factor) for n in names)
        kind: Kind = "sign" if factor == -1.0 else "unit"
        yield Hint(kind=kind, names=names, message=message, before=before, after=after, columns=right)


def _swapped(columns: Sequence[_Column], left: _Left) -> tuple[Hint, ...]:
    """Two columns that explain what is left when each has the forces of the other."""
    best: tuple[float, _Column, _Column] | None = None
    for a, b in combinations(columns, 2):
        if (a.commanded, a.unit.dimension) == (b.commanded, b.unit.dimension):
            moved = left.beyond((a.more(b.force - a.force) + b.more(a.force - b.force))[..., None])
            after = left.size(left.vector + moved[:, 0])
            best = (after, a, b) if best is None or after < best[0] else best
    if best is None or not left.explained(best[0]):
        return ()
    after, a, b = best
    message = f"`{a.name}` and `{b.name}` look swapped: {_fall(left.before, after)} when swapped back"
    right = (Right(a.name, b.name, 1.0), Right(b.name, a.name, 1.0))
    names = a.name, b.name
    return (Hint(kind="swapped", names=names, message=message, before=left.before, after=after, columns=right),)


def _fall(before: float, after: float) -> str:
    """How much less is left, in words."""
    return f"parameters within their ranges leave {after:.2g} standard uncertainties, not {before:.3g},"


def _readings(sample: Sample) -> Iterator[_Column]:
    channels = sample.part.model.channels
    for k, c in enumerate(channels):
        force = np.where(np.isfinite(sample.predicted[:, k]), sample.readings[:, k], np.nan)
        if c.measurand is Measurand.FORCE and np.isfinite(force).sum() >= FEW:
            by_force = np.tile(np.eye(len(channels))[k], (len(force), 1))
            size = rms(force / sample.part.sigma[:, k])
            yield _Column(c.name, parse_unit(c.unit), np.nan_to_num(force), by_force, size)


def _commands(sample: Sample) -> Iterator[_Column]:
    by_drive, model = sample.evaluation.prediction.by_drive, sample.part.model
    assert by_drive is not None
    for a, drive in enumerate(model.topology.drives):
        force = sample.part.rows.forces[:, a]
        if drive.force_controlled and np.isfinite(force).sum() >= FEW:
            unit = parse_unit("N" if model.topology.moves_length(drive) else "N*m")
            yield _Column(f"{drive.name}.force", unit, np.nan_to_num(force), -np.nan_to_num(by_drive[:, :, a]))


@dataclass(frozen=True)
class _Left:
    """What is left, in standard uncertainties, of readings less predictions: vector (m,), slopes (m, K) by relative
    changes of columns; count: of readings.
    """

    sample: Sample
    basis: Array  # (m, p) orthonormal, of what parameters explain
    vector: Array
    slopes: Array
    count: int

    @classmethod
    def of(cls, sample: Sample, columns: Sequence[_Column]) -> _Left:
        """Of a sample with columns of forces."""
        evaluation, ranges = sample.evaluation, {p.name: p.range for p in sample.part.model.parameters}
        jacobian = evaluation.prediction.jacobian
        assert jacobian is not None
        prior = np.array([ranges[n] for n in evaluation.parameters]).reshape(-1) / 2
        moved = _whitened(sample, jacobian * prior)
        held = np.eye(len(prior)) * (prior > 0)
        basis = np.linalg.qr(np.vstack([moved, held]))[0]
        made = cls(sample, basis, np.zeros(0), np.zeros((0, 0)), int(_known(sample).sum()))
        seen = sample.compared(sample.readings, sample.predicted) - sample.predicted
        every = np.stack([seen, *(c.more(c.force) for c in columns)], axis=2)
        rest = made.beyond(every)
        return cls(sample, basis, rest[:, 0], rest[:, 1:], made.count)

    def beyond(self, deviations: Array) -> Array:
        """What parameters do not explain (m, k) of deviations (n, C, k)."""
        white = _whitened(self.sample, deviations)
        whole = np.vstack([white, np.zeros((len(self.basis) - len(white), white.shape[1]))])
        return np.asarray(whole - self.basis @ (self.basis.T @ whole))

    def size(self, vector: Array) -> float:
        """Root mean square of what is left, by reading."""
        return float(np.sqrt((vector**2).sum() / max(self.count, 1)))

    @property
    def before(self) -> float:
        """Of the table as it stands."""
        return self.size(self.vector)

    def explained(self, after: float) -> bool:
        """Whether what is left then is far less."""
        return after <= BETTER * self.before or (after <= _LITTLE and after <= _LESS * self.before)

    def factors(self) -> Array:
        """Factors (K,) by which columns are right: 1 unless they surely are others, signs and units as they are."""
        free = np.sqrt((self.slopes**2).sum(axis=0)) > _TRACE
        factors = np.ones(len(free))
        while free.any():
            solved, std = self._solved(free)
            off = free & (np.abs(solved - 1.0) > _SURE * std)
            if (off == free).all():
                return np.where(free, solved, 1.0)
            free = off
        return factors

    def _solved(self, free: Array) -> tuple[Array, Array]:
        """Least squares factors (K,) of columns that are free, and their standard uncertainties."""
        slopes = self.slopes[:, free]
        solution = np.linalg.lstsq(slopes, -self.vector)[0]
        noise = max(self.size(self.vector + slopes @ solution), 1.0)
        factors, std = np.ones(len(free)), np.full(len(free), np.inf)
        factors[free] += solution
        std[free] = noise * np.sqrt(np.diag(np.linalg.pinv(slopes.T @ slopes)))
        return factors, std


def _known(sample: Sample) -> Array:
    """Readings (n, C) that say something."""
    known = np.isfinite(sample.readings + sample.predicted)
    known[:, sample.of_unknown_frames] = False
    return np.asarray(known & np.isfinite(sample.compared(sample.readings, sample.predicted)))


def _whitened(sample: Sample, deviations: Array) -> Array:
    """Deviations (n, C, k) in standard uncertainties of readings and drives, (n C, k); 0 where nothing was read."""
    part, prediction, known = sample.part, sample.evaluation.prediction, _known(sample)
    assert prediction.by_drive is not None
    slopes = Slopes(np.nan_to_num(prediction.by_drive), prediction.by_partner, part.rows.partner)
    out = np.zeros(deviations.shape)
    deviations = np.where(known[..., None], deviations, 0.0)
    for cluster in whiten(part.clusters, slopes, part.noise, part.reading_sigma, known):
        out[cluster.cluster] = cluster.apply(deviations)
    return out.reshape(-1, deviations.shape[2])
