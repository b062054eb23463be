"""Effects in the pipeline: displacements of their effect sites in every row, and the chain rule to their parameters.

c <- c + M d(theta), or c exp(M d(theta)) where the site scales: formulas d are analytic, so dd/dtheta comes from
complex steps, and dz/dtheta = dz/dc M dd/dtheta.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects import WIDTHS
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.effect_sites import EffectSite, PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction.inputs import Reactions, SiteInputs
from pkmcal_cli.prediction.rows import Rows

_STEP = 1e-40


@dataclass(frozen=True)
class Displacement:
    """Of one effect site: d (N, W); derivatives (N, W, P) with respect to asked parameters, numbered by `columns` (P,);
    by_reading (N, W, A) with respect to the readings of drives, None where they do not matter.
    """

    site: EffectSite
    d: Array
    by_parameter: Array
    columns: Index
    by_reading: Array | None

    def take(self, rows: slice) -> Displacement:
        """Some rows."""
        by_reading = None if self.by_reading is None else self.by_reading[rows]
        return Displacement(self.site, self.d[rows], self.by_parameter[rows], self.columns, by_reading)


@dataclass(frozen=True)
class Displacements:
    """All displacements of a table."""

    parts: tuple[Displacement, ...] = ()

    def take(self, rows: slice) -> Displacements:
        """Some rows."""
        return Displacements(tuple(d.take(rows) for d in self.parts))

    def apply(self, coefficients: Array) -> None:
        """Displace coefficients (N, S) in place."""
        for each in self.parts:
            where, moved = each.site.coefficients, each.d @ each.site.matrix.T
            before = coefficients[:, where]
            coefficients[:, where] = before * np.exp(moved) if each.site.scales else before + moved

    def chain(self, coefficients: Array, by_coefficient: Array, jacobian: Array | None, by_drive: Array) -> None:
        """Add what the effects' parameters do to `jacobian` (N, C, P'), and what readings do to `by_drive` (N, C, A).

        Afterwards `by_coefficient` (N, C, S) is that with respect to the coefficients before they are displaced.
        """
        for each in self.parts:
            where = each.site.coefficients
            by_moved = by_coefficient[..., where]
            if each.site.scales:
                by_moved = by_moved * coefficients[:, None, where]
            by_d = by_moved @ each.site.matrix  # (N, C, W)
            if jacobian is not None and len(each.columns):
                jacobian[..., each.columns] += by_d @ each.by_parameter
            if each.by_reading is not None:
                by_drive += by_d @ each.by_reading
        for each in self.parts:
            if each.site.scales:
                moved = each.d @ each.site.matrix.T
                by_coefficient[..., each.site.coefficients] *= np.exp(moved)[:, None]


def displacements(
    model: Model,
    values: Array,
    rows: Rows,
    parameters: Sequence[str],
    reactions: Reactions | None,
    known: Displacements | None = None,
) -> Displacements:
    """Compute the displacements of all effects at parameter values (P,); without `reactions` those that need none.

    known: those without `reactions`, where they have been computed.
    """
    numbers = model.by_name(values)
    parts: list[Displacement] = []
    asked = {name: k for k, name in enumerate(parameters)}
    computed = iter(() if known is None else known.parts)
    for instances in _instances(model.effects) if model.sessions else zip(model.effects):  # each by itself
        placed = instances[0]
        reactive = placed.effect.reactive
        if reactive and reactions is None:
            continue
        if not _matters(model, instances, numbers, asked):
            continue
        if (acting := _acting(model, instances, rows, numbers, asked)) is None:
            continue
        for site in placed.sites:
            if known is not None and not reactive:
                parts.append(next(computed))
            else:
                parts.append(_displacement(acting, SiteInputs(site, model, rows, placed, reactions), len(asked)))
    return Displacements(tuple(parts))


@dataclass(frozen=True)
class _Acting:
    """An effect where it acts: its numbers, which may differ from row to row, (N,), and by which it is asked.

    on (N, 1): 1 in its rows, else 0; a number where in all. asked: which of its numbers, the column of its parameter,
    and in which rows it is that parameter.
    """

    placed: PlacedEffect
    sizes: Sequence[Any]
    on: Array | float
    asked: Sequence[tuple[int, int, Array | float]]

    @property
    def moves(self) -> bool:
        """Whether anything but zeros displaces."""
        return any(size.any() if isinstance(size, np.ndarray) else size for size in self.sizes)


def _instances(effects: Sequence[PlacedEffect]) -> Iterator[Sequence[PlacedEffect]]:
    """Effects in their order; together those that are one at one place, with numbers that only sessions tell apart."""

    def site(numbered: tuple[int, PlacedEffect]) -> tuple[object, ...]:
        k, placed = numbered  # searches have several of one name
        return (placed.effect.keyword, placed.at) if placed.session and placed.effect.row_by_row else (k,)

    for _, same in groupby(enumerate(effects), site):
        yield tuple(placed for _, placed in same)


def _matters(
    model: Model, instances: Sequence[PlacedEffect], numbers: Mapping[str, float], asked: Mapping[str, int]
) -> bool:
    """Whether anything of an effect is not zero, or is asked for."""
    if any(numbers[name] or name in asked for e in instances for name in e.parameters):
        return True
    return bool(instances[0].session) and any(model.shared[name][0] in asked for name in instances[0].parameters)


def _acting(
    model: Model,
    instances: Sequence[PlacedEffect],
    rows: Rows,
    numbers: Mapping[str, float],
    asked: Mapping[str, int],
) -> _Acting | None:
    """Instances of one effect in their rows; None where they have none. A shared name asks for that of each row."""
    flags = [_rows_of(e, rows) for e in instances]
    here = [(e, on) for e, on in zip(instances, flags, strict=True) if on is True or on.any()]
    if not here:
        return None
    placed, on = here[0]
    sizes: list[Any] = [numbers[name] for name in placed.parameters]
    if len(here) > 1:
        line = np.full(len(rows), len(here))
        for k, (_, flag) in enumerate(here):
            line[np.asarray(flag)] = k
        table = np.array([[numbers[name] for name in e.parameters] for e, _ in here] + [[0.0] * len(sizes)])
        on, sizes = line < len(here), list(table[line].T)
    columns: list[tuple[int, int, Array | float]] = []
    for k, name in enumerate(placed.parameters):
        if (shared := model.shared[name][0]) in asked:
            columns.append((k, asked[shared], _factor(on)))
            continue
        columns += [(k, asked[e.parameters[k]], _factor(flag)) for e, flag in here if e.parameters[k] in asked]
    return _Acting(placed, sizes, _factor(on), columns)


def _rows_of(placed: PlacedEffect, rows: Rows) -> NDArray[np.bool_] | Literal[True]:
    """Rows (N,) in which an effect acts; True for all."""
    if not placed.acts_in:
        return True
    return np.asarray(rows.columns.get(f"session.{placed.acts_in}", np.zeros(len(rows))) > 0)


def _factor(on: NDArray[np.bool_] | bool) -> Array | float:
    """1 in some rows, else 0, (N, 1); 1 for all."""
    return float(on) if isinstance(on, bool) else on[:, None].astype(float)


def _displacement(acting: _Acting, at: SiteInputs, asked: int) -> Displacement:
    """One effect site's, of so many parameters that are asked for; only in the rows where the effect acts."""
    placed, sizes, on = acting.placed, acting.sizes, acting.on
    d = np.zeros((at.rows, WIDTHS[placed.effect.enters]))
    if acting.moves:
        d = np.asarray(_displaced(placed, at, sizes), dtype=float) * on
    by_number = {
        k: np.imag(_displaced(placed, at, [value + 1j * _STEP * (i == k) for i, value in enumerate(sizes)])) / _STEP
        for k in dict.fromkeys(k for k, _, _ in acting.asked)
    }
    by_parameter = np.zeros((*d.shape, len(acting.asked)))
    for j, (k, _, rows) in enumerate(acting.asked):
        by_parameter[..., j] = by_number[k] * rows
    columns = np.array([column for _, column, _ in acting.asked], dtype=np.intp)
    by_reading = None
    if d.any():
        by_reading = _by_reading(placed, at, sizes) * np.reshape(on, (-1, 1, 1))
        if at.reactions is not None and placed.effect.reactive:
            by_pull = _step_in(placed, replace(at, pull_step=1j * _STEP), sizes) * on
            by_parameter, columns = _with_reaction(by_parameter, columns, by_pull, at, asked)
            by_reading = by_reading + _of_reaction(by_pull, at, at.reactions.by_drive)
    return Displacement(at.site, d, by_parameter, columns, by_reading)


def _displaced(placed: PlacedEffect, at: SiteInputs, sizes: Sequence[Any]) -> Array:
    """Displacement (N, W) at sizes of the parameters that it has at its place."""
    return placed.effect.displacement(at, dict(zip(placed.numbers, sizes, strict=True)))


def _by_reading(placed: PlacedEffect, at: SiteInputs, sizes: Sequence[Any]) -> Array:
    """Derivative (N, W, A) by the reading of the effect site's own drive."""
    out = np.zeros((at.rows, WIDTHS[placed.effect.enters], len(at.model.actuators)))
    if at.drive >= 0:
        out[..., at.drive] = _step_in(placed, replace(at, step=1j * _STEP), sizes)
    return out


def _step_in(placed: PlacedEffect, stepped: SiteInputs, sizes: Sequence[Any]) -> Array:
    return np.asarray(np.imag(_displaced(placed, stepped, sizes)) / _STEP)


def _of_reaction(by_pull: Array, at: SiteInputs, by: Array | None) -> Array | float:
    """What a displacement's force (by_pull (N, W)) hands on of its derivatives (N, R, k): (N, W, k)."""
    if by is None or at.reactions is None:
        return 0.0
    return np.asarray(by_pull[..., None] * by[:, at.reactions.places.index(at.site.place), None])


def _with_reaction(
    by_parameter: Array, columns: Index, by_pull: Array, at: SiteInputs, asked: int
) -> tuple[Array, Index]:
    """Derivatives by all asked parameters, since they change the force."""
    if not asked or at.reactions is None:
        return by_parameter, columns
    out = np.zeros((*by_parameter.shape[:2], asked)) + _of_reaction(by_pull, at, at.reactions.jacobian)
    out[..., columns] += by_parameter
    return out, np.arange(asked)
