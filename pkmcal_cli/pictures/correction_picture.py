"""What corrected set values bring: errors of the tool point before and after, and how far set values move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.assessment import Assessment
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.error_map import PlaneErrors, errors_in_words, map_part
from pkmcal_cli.pictures.parts import Part, brief, composed, dots, over_rows, shown_unit, thinned
from pkmcal_cli.pictures.picture import LOOKS, NOISE, Picture
from pkmcal_cli.pictures.titles import Titles
from pkmcal_cli.units.unit_text import Unit, parse_unit

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

_SHOWN = 3000  # rows


@dataclass(frozen=True)
class _Moved:
    """By how much set values (N,) of a drive were changed, SI; unit: in which the drive is set."""

    name: str
    by: Array
    unit: Unit

    @property
    def axis(self) -> tuple[str, str]:
        """What drives of one panel have in common: lengths, then angles, then a unit with a name of its own."""
        return (self.unit.text, "") if self.unit.size else ("", self.unit.dimension.name)


def correction_picture(
    model: Model, result: Assessment | None, held: Sequence[str], titles: Titles, length: Unit
) -> Picture:
    """Of the targets that have set values; held: coordinates of the targets, in the order of their columns."""
    if result is None or not len(result.correction.good):
        return composed("correction", titles, "No target has set values.", [])
    places = _places(result, held)
    parts = [map_part(p, length) for p in places]
    moved = _moved(model, result)
    axes = sorted({m.axis for m in moved}, key=lambda axis: (axis[0], axis[1] == "angle"))
    for axis in axes:
        alike = [m for m in moved if m.axis == axis]
        parts += [_moved_part(alike[k : k + len(LOOKS)]) for k in range(0, len(alike), len(LOOKS))]
    count = len(result.correction.good)
    errors = errors_in_words(places) + " " if places else ""
    return composed("correction", titles, f"{errors}Changes of set values of {count} targets.", parts)


def _places(result: Assessment, held: Sequence[str]) -> list[PlaneErrors]:
    """Targets and errors of the tool point, plane by plane; none where fewer than two coordinates are held."""
    made, good = result.correction, result.correction.good
    columns = [k for k, name in enumerate(held) if not name.startswith("r")]
    if len(columns) < 2:
        return []
    targets, before, after = (v[good][:, columns] for v in (made.aim.targets, made.before.tool, made.after.tool))
    known = np.isfinite(before).all(axis=1) & np.isfinite(after).all(axis=1)
    if not known.any():
        return []
    pairs = [(0, 1)] if len(columns) == 2 else [(0, 1), (0, 2)]
    names = [held[k] for k in columns]
    stages = (("nominal set values", before - targets), ("corrected", after - targets))
    out = []
    for pair in pairs:
        errors = tuple((n, e[known][:, list(pair)]) for n, e in stages)
        out.append(PlaneErrors("".join(names[k] for k in pair), targets[known][:, list(pair)], errors, np.nan))
    return out


def _moved(model: Model, result: Assessment) -> list[_Moved]:
    made, good = result.correction, result.correction.good
    by = (made.rows.readings - made.aim.rows.readings)[good]
    return [
        _Moved(a.name, by[:, k], parse_unit(a.unit)) for k, a in enumerate(model.actuators)
        if np.isfinite(by[:, k]).any()
    ]  # fmt: skip


def _moved_part(moved: Sequence[_Moved]) -> Part:
    largest = max(float(np.nanmax(np.abs(m.by))) for m in moved)
    name, dimension = moved[0].axis
    shown = None if name else shown_unit(dimension, largest)

    def draw(figure: SubFigure) -> None:
        ax = figure.add_subplot()
        ax.axhline(0, color=NOISE, lw=0.8)
        for (colour, marker), one in zip(LOOKS, moved, strict=False):
            rows = thinned(len(one.by), _SHOWN)
            dots(ax, rows + 1, one.by[rows] / (shown or one.unit).scale, colour, marker, brief(one.name))
        ax.set_ylabel(f"change of set value [{name if shown is None else shown.text}]")
        ax.margins(0.04, 0.1)
        over_rows(ax, "target", len(moved[0].by))
        ax.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False)

    return Part(2.4, draw)
