"""Measured less predicted by the nominal machine, before any fit, as `check` says it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pkmcal_cli.base.plural import listed
from pkmcal_cli.gross_errors.nominal_misfit import NominalMisfit
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import readable
from pkmcal_cli.units.unit_text import parse_unit

_TITLE = "Measured - predicted at nominal parameters{}; expected: by ranges and noise, rms"


@dataclass(frozen=True)
class NominalMisfitReport:
    """What `check` says of a table; `row_origin`: where a row of the table stands."""

    misfit: NominalMisfit
    row_origin: Callable[[int], RowOrigin]

    def show(self, to: Reporter) -> None:
        """A table by channel; the warnings are the caller's."""
        rows = []
        for c in self._channels():
            unit = parse_unit(c["unit"])
            sizes = (readable(unit.to_si(c[key]), unit) for key in ("rms", "expected", "max"))
            rows.append((c["name"], *sizes, str(self.row_origin(c["row"]))))
        part, whole = len(self.misfit.sample.rows), len(self.misfit.sample.whole)
        title = _TITLE.format("" if part == whole else f", {part} of {whole} rows")
        if rows:
            to.table(title, ("reading", "rms", "expected", "max", "at"), rows)
        if names := self.not_compared:
            to.say(f"not compared: {listed(names)} (read in a frame that `calibrate` identifies)")

    @property
    def not_compared(self) -> list[str]:
        """Channels with readings in a frame that is fitted, where no whole points show how it lies."""
        sample = self.misfit.sample
        unknown = [k for k in sample.of_unknown_frames if not np.isfinite(self.misfit.rms[k])]
        return [sample.whole.model.channels[k].name for k in unknown if sample.part.measured[:, k].any()]

    def json(self) -> list[dict[str, Any]]:
        """By channel."""
        out = []
        for c in self._channels():
            at = self.row_origin(c.pop("row"))
            out.append({**c, "file": at.file, "line": at.line or None, "id": at.id or None})
        return out

    @property
    def warnings(self) -> list[str]:
        """Channels far off, and the constant of one drive that explains it."""
        misfit, model = self.misfit, self.misfit.sample.whole.model
        if not misfit.far.any():
            return []
        k = int(np.argmax(np.where(misfit.far, misfit.rms / misfit.expected, 0.0)))
        channel, times = model.channels[k], misfit.rms[k] / misfit.expected[k]
        text = (
            f"the readings of `{channel.name}` are {times:.3g} times farther from the nominal machine than ranges and "
            f"noise explain: {parse_unit(channel.unit).format(float(misfit.rms[k]), 3)} rms"
        )
        if misfit.constant is not None:
            drive, size = model.actuators[misfit.constant[0]], misfit.constant[1]
            amount = f"{parse_unit(drive.unit).format(abs(size), 4)} too {'much' if size > 0 else 'little'}"
            text += f". Drive `{drive.name}` explains it: it reads {amount} throughout"
        elif misfit.sample.few_rows_off:
            rows = listed([str(self.row_origin(row)) for row in misfit.rows_off], 3)
            text += f". No other rows are so far off as {rows}: check every cell there, also of the drives"
        else:
            text += ". Check signs, units and zeros of the drives and of the instrument, and the nominal values"
        return [text]

    def _channels(self) -> list[dict[str, Any]]:
        misfit, out = self.misfit, []
        for k, channel in enumerate(misfit.sample.whole.model.channels):
            if not np.isfinite(misfit.rms[k]):
                continue
            unit = parse_unit(channel.unit)
            sizes = np.abs(np.nan_to_num(misfit.residual[:, k]))
            worst = int(np.argmax(sizes))
            out.append(
                {
                    "name": channel.name,
                    "rms": unit.from_si(float(misfit.rms[k])),
                    "expected": unit.from_si(float(misfit.expected[k])),
                    "max": unit.from_si(float(sizes[worst])),
                    "row": int(misfit.sample.rows[worst]),
                    "unit": unit.text,
                }
            )
        return out
