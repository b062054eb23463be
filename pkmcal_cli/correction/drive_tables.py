"""Tables over the travel of single drives: the best that corrections of each drive by its own set value alone can do.

Each table has what the drive's own effects do: its reversal is in no other. For the rest all tables are found together,
by linear least squares of the tool point's error at the targets; knots without targets near them go on straight.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.drive_effects import DriveEffects, sided_by_force
from pkmcal_cli.correction.export_case import Draft, ExportCase

MOST = 33  # knots of a table: more hardly bend
_PER_KNOT = 3  # numbers that targets state for each number of the tables, so that these do not fit the targets alone
_STIFFER = (1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e8)  # times straighter: what predicts other targets best
_FOLDS = 5  # parts of the targets
_FINE = 100  # points between knots at which an effect of a drive is fitted: a pitch may be short
_STRAIGHT, _ALIKE, _SMALL = 1e-6, 1e-4, 1e-9  # of the mean weight of a knot: bending, changes of reversal, reversal


@dataclass(frozen=True, kw_only=True)
class Digits:
    """How finely a format counts a drive's positions and corrections, SI of the reading."""

    position: float
    correction: float


@dataclass(frozen=True, kw_only=True)
class DriveTable:
    """Corrections forward (K,) and reverse (K,) that a control adds to set values of a drive at regular knots; SI."""

    low: float
    step: float
    forward: Array
    reverse: Array

    @property
    def knots(self) -> Array:
        """Set values (K,) at which corrections are given."""
        return self.low + self.step * np.arange(len(self.forward))

    def corrections(self, commanded: Array, sides: NDArray[np.int_]) -> Array:
        """Corrections (n,): between knots straight, outside of them constant; the mean where the side is unknown."""
        ahead, back = (np.interp(commanded, self.knots, t) for t in (self.forward, self.reverse))
        return np.where(sides > 0, ahead, np.where(sides < 0, back, 0.5 * (ahead + back)))

    def rounded(self, digit: float) -> DriveTable:
        """With corrections in multiples of a digit."""
        forward, reverse = (digit * np.round(t / digit) for t in (self.forward, self.reverse))
        return DriveTable(low=self.low, step=self.step, forward=forward, reverse=reverse)


def drive_tables(case: ExportCase, digits: Callable[[int], Digits]) -> list[DriveTable]:
    """A table for every drive that a control commands, in the digits of a format."""
    numbers = len(case.drives) + int(np.isin(case.drives, sided_by_force(case.model)).sum())
    determined = case.targets.size / (_PER_KNOT * numbers)
    count = int(np.clip(determined, 2, MOST))
    grids = [_grid(case.commanded[:, a], count, digits(a).position) for a in case.drives]
    tables = _fitted(case, grids)
    return [t.rounded(digits(a).correction) for a, t in zip(case.drives, tables, strict=True)]


def decimal_digits(case: ExportCase) -> Callable[[int], Digits]:
    """Digits of a format with decimal numbers in the unit of a drive: three of positions, six of corrections."""
    return lambda a: Digits(position=case.unit(a).to_si(1e-3), correction=case.unit(a).to_si(1e-6))


def decimals(case: ExportCase, drive: int, table: DriveTable) -> list[tuple[str, str, str]]:
    """Knots with their corrections forward and reverse, in these digits."""
    unit = case.unit(drive)
    rows = zip(table.knots, table.forward, table.reverse, strict=True)
    return [(f"{unit.from_si(k):.3f}", f"{unit.from_si(f):.6f}", f"{unit.from_si(r):.6f}") for k, f, r in rows]


def sent(case: ExportCase, tables: Sequence[DriveTable]) -> Array:
    """Set values (n, A) of a control that adds the corrections of its tables."""
    out, sides = case.commanded.copy(), case.sides(case.commanded)
    for k, (a, table) in enumerate(zip(case.drives, tables, strict=True)):
        out[:, a] += table.corrections(case.commanded[:, a], sides[:, k])
    return out


def drafted(
    case: ExportCase, tables: Sequence[DriveTable], texts: Callable[[Sequence[str]], Mapping[str, str]]
) -> Draft:
    """What a control with these tables sends, at the targets of the case and elsewhere."""
    return Draft(
        commands=sent(case, tables), values=case.values, texts=texts, elsewhere=lambda other: sent(other, tables)
    )


def _grid(commanded: Array, count: int, digit: float) -> tuple[float, float, int]:
    """First knot, distance and number of knots over a range of set values, in multiples of a digit."""
    low = np.floor(float(commanded.min()) / digit)
    high = max(np.ceil(float(commanded.max()) / digit), low + count - 1)
    step = np.ceil((high - low) / (count - 1))
    return float(low * digit), float(step * digit), count


def _fitted(case: ExportCase, grids: Sequence[tuple[float, float, int]]) -> list[DriveTable]:
    """What effects of the drives do, and the best for the rest."""
    effects = DriveEffects(case.model, case.values, case.made.rows)
    rest = case.corrected - case.commanded - effects.corrections(case.corrected, case.corrected_sides)
    remainders = _of_rest(case, grids, rest[:, case.drives])
    alone = [_of_effects(effects, int(a), grid) for a, grid in zip(case.drives, grids, strict=True)]
    return [_joined(*both) for both in zip(alone, remainders, strict=True)]


def _of_effects(effects: DriveEffects, drive: int, grid: tuple[float, float, int]) -> DriveTable:
    """The table that is nearest to what effects of a drive do to it along its travel."""
    low, step, count = grid
    along = low + step * np.linspace(0, count - 1, _FINE * (count - 1) + 1)
    basis = _basis(along, grid)
    normal = (basis.T @ basis).toarray()
    ahead, back = (np.linalg.solve(normal, basis.T @ effects.along(drive, along, side)) for side in (1, -1))
    return DriveTable(low=low, step=step, forward=ahead, reverse=back)


def _joined(one: DriveTable, other: DriveTable) -> DriveTable:
    """Both corrections together, on the same knots."""
    return replace(one, forward=one.forward + other.forward, reverse=one.reverse + other.reverse)


def _of_rest(case: ExportCase, grids: Sequence[tuple[float, float, int]], corrections: Array) -> list[DriveTable]:
    """Tables that are best for corrections (n, D), with two sides for drives whose reversal depends on their force."""
    sides, sided = case.sides(case.commanded), [bool(s) for s in np.isin(case.drives, sided_by_force(case.model))]
    bases = [_basis(case.commanded[:, a], grid) for a, grid in zip(case.drives, grids, strict=True)]
    bases = [sparse.hstack([b, sparse.diags(sides[:, k]) @ b]).tocsr() if sided[k] else b for k, b in enumerate(bases)]
    weights = case.weights
    design = sparse.vstack(
        [
            sparse.hstack([sparse.diags(weights[:, r, k]) @ b for k, b in enumerate(bases)])
            for r in range(weights.shape[1])
        ]
    ).tocsr()
    target = np.einsum("nrd,nd->rn", weights, corrections).ravel()
    penalties = [[_smooth(s, count, by) for s, (_, _, count) in zip(sided, grids, strict=True)] for by in _STIFFER]
    solution = _best(design, target, np.arange(len(target)) % len(case.usable) % _FOLDS, penalties)
    return _tables(solution, grids, sided)


def _best(design: sparse.csr_matrix, target: Array, fold: NDArray[np.intp], penalties: list[list[Array]]) -> Array:
    """The solution with that penalty which predicts numbers best that it was not fitted to; fold (m,): of targets."""
    normal, right = (design.T @ design).toarray(), design.T @ target
    parts = [(design[fold == k], target[fold == k]) for k in range(_FOLDS)]
    errors = np.zeros(len(penalties))
    if all(len(t) for _, t in parts):
        for part, there in parts:
            others, others_right = normal - (part.T @ part).toarray(), right - part.T @ there
            for k, blocks in enumerate(penalties):
                fitted = np.linalg.solve(others + _scaled(normal, blocks), others_right)
                errors[k] += float(np.square(part @ fitted - there).sum())
    return np.asarray(np.linalg.solve(normal + _scaled(normal, penalties[int(np.argmin(errors))]), right))


def _basis(commanded: Array, grid: tuple[float, float, int]) -> sparse.csr_matrix:
    """Shares (n, K) of the knots in what is interpolated."""
    low, step, count = grid
    at = np.clip((commanded - low) / step, 0.0, count - 1.0)
    left = np.minimum(at.astype(int), count - 2)
    rows, part = np.arange(len(commanded)), at - left
    return sparse.csr_matrix(
        (np.concatenate([1.0 - part, part]), (np.concatenate([rows, rows]), np.concatenate([left, left + 1]))),
        shape=(len(commanded), count),
    )


def _smooth(sided: bool, count: int, stiffer: float) -> Array:
    """Squares of what tables shall not do where nothing asks for it."""
    bend = np.diff(np.eye(count), 2, axis=0)
    mean = _STRAIGHT * stiffer * bend.T @ bend + _SMALL * np.eye(count)
    if not sided:
        return np.asarray(mean)
    change = np.diff(np.eye(count), axis=0)
    reversal = _ALIKE * change.T @ change + _SMALL * np.eye(count)
    zero = np.zeros((count, count))
    return np.block([[mean, zero], [zero, reversal]])


def _scaled(normal: Array, blocks: Sequence[Array]) -> Array:
    """The same for all drives, each in units of its own weight."""
    out = np.zeros_like(normal)
    at = 0
    for block in blocks:
        part = slice(at, at + len(block))
        out[part, part] = block * max(float(np.diag(normal)[part].mean()), 1e-300)
        at += len(block)
    return out


def _tables(solution: Array, grids: Sequence[tuple[float, float, int]], sided: Sequence[bool]) -> list[DriveTable]:
    out, at = [], 0
    for (low, step, count), two in zip(grids, sided, strict=True):
        mean = solution[at : at + count]
        half = solution[at + count : at + 2 * count] if two else np.zeros(count)
        out.append(DriveTable(low=low, step=step, forward=mean + half, reverse=mean - half))
        at += count * (2 if two else 1)
    return out
