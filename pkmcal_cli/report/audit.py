"""Values that are off by more than noise: how far, how much they pull, what changes if they stay."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.robust import Doubtful, RobustFit
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import readable
from pkmcal_cli.units.unit_text import parse_unit

_SHOWN = 12
_MANY = 0.1  # share of rows that are far off, above which they are no accidents
_GROSS = 6.0  # standard uncertainties from which on a robust loss is worth a word


class Audit:
    """The doubtful values of a fit, with their places in the files."""

    def __init__(self, model: Model, robust: RobustFit, row_origin: Callable[[int], RowOrigin]) -> None:
        self.model, self.robust, self.row_origin, self.loss = model, robust, row_origin, robust.loss

    def show(self, to: Reporter, named: int = 0) -> None:
        """A table for people; nothing where nothing is doubtful. named: rows that had a word before."""
        robust = self.loss != "squares"
        worst = [d for d in self.robust.doubtful if robust or abs(d.deviation) > _GROSS]
        if not worst:
            return
        title = "Outliers" + (" (down-weighted)" if robust else "")
        head = ("row", "channel", "deviation", "in std", "weight", "leverage", "change if kept")
        to.table(title, head, [self._row(d) for d in worst[:_SHOWN]], left=2, folded=("change if kept",))
        for d in worst[:_SHOWN]:
            _, channel, off, deviation, *_ = self._row(d)
            to.mark(f"outlier: {channel} is off by {off} ({deviation} std)", self.row_origin(d.row).location, "warning")
        if len(worst) > _SHOWN:
            to.say(f"... and {len(worst) - _SHOWN} more (--json lists all)")
        if not robust and len(worst) >= named:
            to.warn(f"warning: {self._advice(len(worst))}")

    def _advice(self, rows: int) -> str:
        """What to do about so many rows that are far off."""
        every = len(self.robust.problem)
        if rows > max(_MANY * every, 2.0):
            return f"{rows} of {every} rows are far off: what the model lacks looks like that too (`pkmcal diagnose`)"
        return f"{count(rows, 'gross outlier')}: `--loss tukey` down-weights outliers"

    def _row(self, d: Doubtful) -> tuple[str, ...]:
        channel = self.model.channels[d.channel]
        unit = parse_unit(channel.unit)
        off = readable(d.off, unit)
        name, size = d.moved
        changes = f"{name} by {size:+.2g} std" if name else ""
        weight = f"{d.weight:.2g}"
        return self._where(d), channel.name, off, f"{d.deviation:+.1f}", weight, f"{d.leverage:.2f}", changes

    def _where(self, d: Doubtful) -> str:
        """The row; what was measured once stands in the machine file."""
        once = self.model.channels[d.channel].measurand.once
        return self.model.name if once else str(self.row_origin(d.row))

    def json(self) -> list[dict[str, Any]]:
        """All doubtful values, worst first."""
        out = []
        for d in self.robust.doubtful:
            row_origin, channel = self.row_origin(d.row), self.model.channels[d.channel]
            if channel.measurand.once:
                row_origin = RowOrigin(self.model.name, 0, "")
            unit = parse_unit(channel.unit)
            out.append(
                {
                    "file": row_origin.file,
                    "line": row_origin.line or None,
                    "id": row_origin.id or None,
                    "channel": channel.name,
                    "off": d.off / unit.scale,
                    "unit": unit.text,
                    "deviation": d.deviation,
                    "weight": d.weight,
                    "leverage": d.leverage,
                    "moves": d.moved[0] or None,
                    "by_std": float(np.float64(d.moved[1])),
                }
            )
        return out
