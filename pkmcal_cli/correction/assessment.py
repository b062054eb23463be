"""What a corrected row rests on: how sure it is, directions that the data hardly determine, ranges never measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.commands import Correction, depends_on_sides
from pkmcal_cli.correction.free_coordinates import FreeCoordinate, free_coordinates
from pkmcal_cli.correction.strained_pose import LoadedTool
from pkmcal_cli.correction.uncertainty import KnownTo, Spread, spread
from pkmcal_cli.model.model import Model

_MOST = 0.5  # share of the variance from which on a row rests on weak directions
_MARGIN = 0.01  # of a measured range, by which set values may be outside of it: corrections are small
WEAK = "rests on a weak direction"


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """Of a correction: standard uncertainties before and after, None without any; weak (n,); outside: names by row.

    free: coordinates that set values do not hold, and that are off.
    """

    correction: Correction
    before: Spread | None
    after: Spread | None
    weak: NDArray[np.bool_]
    outside: tuple[tuple[str, ...], ...]
    free: tuple[FreeCoordinate, ...]

    @property
    def remarks(self) -> list[str]:
        """What is to be said of every row, "" for nothing."""
        every = zip(self.weak, self.outside, self.correction.turned, strict=True)
        return ["; ".join(_remarks(weak, names, turned)) for weak, names, turned in every]


def _remarks(weak: bool, outside: tuple[str, ...], turned: bool) -> list[str]:
    out = [WEAK] if weak else []
    out += [f"outside the measured range of {', '.join(outside)}"] if outside else []
    return out + (["side of approach not settled"] if turned else [])


def assessed(
    model: Model, values: Array, made: Correction, known: KnownTo | None, measured: Mapping[str, tuple[float, float]]
) -> Assessment:
    """The assessment at parameter values (P,); `known`: None where nobody knows how well; measured: ranges."""
    before = after = None
    if known is not None:
        tool = LoadedTool(model, made.aim.held)
        before = spread(tool, values, made.aim, made.before, made.aim.rows, known)
        after = spread(tool, values, made.aim, made.after, made.rows, known)
    weak = np.zeros(len(made.rows), dtype=bool) if after is None else after.weak > _MOST
    free, outside = free_coordinates(model, values, made), _outside(model, made, measured)
    return Assessment(correction=made, before=before, after=after, weak=weak, outside=outside, free=free)


def _outside(
    model: Model, made: Correction, measured: Mapping[str, tuple[float, float]]
) -> tuple[tuple[str, ...], ...]:
    """Which columns of each row are outside of what was measured; of sides, those that no row was approached from."""
    columns = {a.name: made.rows.readings[:, k] for k, a in enumerate(model.actuators)}
    columns = {n: c for n, c in columns.items() if n in measured}
    sided = depends_on_sides(model)
    for name, column in made.rows.columns.items():
        if name in measured and (sided or not name.startswith("dir.")):
            columns[name] = np.where(column == 0, np.nan, column) if name.startswith("dir.") else column
    beyond: dict[str, NDArray[np.bool_]] = {}
    for name, column in columns.items():
        low, high = measured[name]
        margin = _MARGIN * (high - low)
        beyond[name] = (column < low - margin) | (column > high + margin)
    return tuple(tuple(n for n, b in beyond.items() if b[k]) for k in range(len(made.rows)))
