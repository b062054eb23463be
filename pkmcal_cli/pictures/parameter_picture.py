"""Parameters with their uncertainties against their ranges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from pkmcal_cli.calibration.fitted_frames import frame_parameters
from pkmcal_cli.model.model import Model
from pkmcal_cli.pictures.parts import Part, composed
from pkmcal_cli.pictures.picture import AFTER, BEFORE, NOISE, Picture
from pkmcal_cli.pictures.titles import Titles, plain, shortened
from pkmcal_cli.report.number_format import uncertain
from pkmcal_cli.report.parameters import ParameterRow

if TYPE_CHECKING:
    from matplotlib.figure import SubFigure

_COVERAGE = 1.96
_MOST = 60  # parameters of one picture
_ROW, _FRAME = 0.24, 0.75  # inches, of a row and of the axis below
_NAME = 28  # characters


def parameter_picture(rows: Sequence[ParameterRow], titles: Titles, name: str = "parameters") -> Picture:
    """Identified parameters: offset from nominal in ranges, with the 95 % interval, and the value in words."""
    determined = [r for r in rows if r.std is not None]
    alt = f"{len(determined)} parameters with 95 % intervals, as shares of their ranges: "
    alt += ", ".join(f"{r.name} {uncertain(r.value, r.std, r.unit)}" for r in determined[:12])
    return composed(name, titles, f"{alt}.", [parameter_part(rows)])


def without_frames(rows: Sequence[ParameterRow], model: Model) -> list[ParameterRow]:
    """All but where instruments stand that may stand anywhere: nobody stated ranges of these."""
    frames = frame_parameters(model)
    return [r for r in rows if r.name not in frames]


def parameter_part(rows: Sequence[ParameterRow]) -> Part:
    """The same as a part of a picture; what was not selected is left out."""
    listed = [r for r in rows if r.std is not None or r.identified or r.selected]
    shown = listed[:_MOST]

    def draw(figure: SubFigure) -> None:
        ax = figure.add_subplot()
        ax.axvspan(-1, 1, color="0.93", lw=0)
        ax.axvline(0, color=NOISE, lw=0.8)
        for k, row in enumerate(shown):
            _draw_row(ax, k, row)
        ax.set_yticks(range(len(shown)), [shortened(plain(r.name), _NAME) for r in shown])
        ax.set_ylim(len(shown) - 0.4, -0.6)
        ax.grid(axis="y", visible=False)
        values = ax.secondary_yaxis("right")
        values.set_yticks(range(len(shown)), [uncertain(r.value, r.std, r.unit) if r.std is not None else "undetermined"
                                              for r in shown])  # fmt: skip
        values.tick_params(length=0)
        more = f"; {len(listed) - len(shown)} more are not shown" if len(listed) > len(shown) else ""
        interval = "95 % interval" + (" with what held parameters add" if any(r.by_held for r in shown) else "")
        ax.set_xlabel(f"(value - nominal) / range, {interval}; grey: the range; open: weakly determined{more}")

    return Part(_FRAME + _ROW * max(len(shown), 1), draw)


def _draw_row(ax: object, k: int, row: ParameterRow) -> None:
    from matplotlib.axes import Axes

    assert isinstance(ax, Axes)
    if row.std is None or not math.isfinite(row.std) or row.range <= 0:
        ax.plot(0, k, marker="x", color=BEFORE, ms=5, ls="none")
        return
    at, half = (row.value - row.nominal) / row.range, _COVERAGE * row.std / row.range
    low, high = at - half, at + half
    if row.interval is not None:
        low, high = ((end - row.nominal) / row.range for end in row.interval)
    ax.plot([low, high], [k, k], color=AFTER if row.identified else BEFORE, lw=1.6, gid=f"interval-{k}")
    face = AFTER if row.identified else "white"
    edge = AFTER if row.identified else BEFORE
    ax.plot(at, k, marker="o" if row.identified else "s", mfc=face, mec=edge, ms=5, ls="none", gid=f"value-{k}")
