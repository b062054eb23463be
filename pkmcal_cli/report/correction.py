"""The result of `correct`: what corrected set values bring and cost, in words and for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.correction.assessment import Assessment
from pkmcal_cli.correction.commands import OUT_OF_REACH
from pkmcal_cli.correction.free_coordinates import FreeCoordinate
from pkmcal_cli.correction.redundancy import Choice
from pkmcal_cli.correction.uncertainty import Spread
from pkmcal_cli.loading.load_machine import Start
from pkmcal_cli.loading.targets import Targets
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.bearing import Bearing
from pkmcal_cli.report.beyond_measured import BeyondMeasured, beyond_measured
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.correction_figures import exact, largest, rms, shown
from pkmcal_cli.report.failed_rows import FailedRows, SkippedPoints
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.units.unit_text import Unit, parse_unit

_SHOWN = 20  # targets without set values that are told one by one
_COMMON = 0.5  # of the uncertainty of positions: that to each other is told below
_KINDS = (("position", "um"), ("orientation", "urad"))


@dataclass(frozen=True, kw_only=True)
class CorrectionReport:
    """One correction, ready to be shown; result: None where no target is within reach.

    file_unit: of lengths in the machine file.
    """

    model: Model
    file_unit: Unit
    start: Start
    targets: Targets
    result: Assessment | None
    choice: Choice

    @cached_property
    def lost(self) -> FailedRows:
        """Targets without set values."""
        total = len(self.targets)
        reasons = dict.fromkeys(range(total), OUT_OF_REACH) if self.result is None else self.result.correction.failed
        kind = SkippedPoints if self.targets.grid else FailedRows
        return kind(reasons, self.targets.row_origin, total)

    @property
    def ids(self) -> list[str]:
        """Names of the targets that have set values."""
        return [self.targets.row_origin(k).id or str(k + 1) for k in self._numbers]

    @property
    def _numbers(self) -> list[int]:
        """Numbers of the targets that have set values."""
        made = None if self.result is None else self.result.correction
        return [] if made is None else [int(k) for k in made.kept[made.good]]

    def show(self, to: Reporter) -> None:
        """Verdict, tables, warnings. Raises BadInput where no point of a grid has set values."""
        self._show_lost(to)
        done = f"{len(self._numbers)} of {count(len(self.targets), 'target')} corrected"
        to.say(f"{done} (redundant drives: {self.choice})" if self._redundant else done)
        if not self._numbers or self.result is None:
            return
        self._show_errors(to, self.result)
        self._bearing(self.result).show(to)
        self._show_doubts(to, self.result)
        self.loads.show(to)

    def _show_lost(self, to: Reporter) -> None:
        if self.targets.grid:
            self.lost.show(to)
            return
        rows = sorted(self.lost.reasons)
        for row in rows[:_SHOWN]:
            row_origin = self.targets.row_origin(row)
            to.fail(f"{row_origin}: {self.lost.reasons[row]}", row_origin.location)
        if rows:
            to.fail(f"not in the table (no set values): {count(len(rows), 'target')}")

    @property
    def _redundant(self) -> bool:
        return len(self.model.held_drives) > len(self.targets.held)

    # --- numbers of the targets that have set values -----------------------------------------
    def _good(self, numbers: Array) -> Array:
        assert self.result is not None
        return np.asarray(numbers[self.result.correction.good])

    def _columns(self, kind: str) -> list[int]:
        """Which coordinates are positions, or orientations."""
        return [k for k, name in enumerate(self.targets.held) if name.startswith("r") == (kind == "orientation")]

    def _error(self, result: Assessment, kind: str, after: bool) -> Array:
        """Size (n,) of the error of a kind."""
        made, columns = result.correction, self._columns(kind)
        tool = made.after.tool if after else made.before.tool
        return self._good(np.sqrt(((tool - made.aim.targets)[:, columns] ** 2).sum(axis=1)))

    def _spread(self, spread: Spread | None, kind: str) -> Array:
        """Standard uncertainty (n,) of the error of a kind, all its coordinates together."""
        if spread is None:
            return np.full(len(self._numbers), np.nan)
        return self._good(np.sqrt((spread.tool[:, self._columns(kind)] ** 2).sum(axis=1)))

    def _apart(self, spread: Spread | None) -> Array:
        """Standard uncertainty (n,) of positions to each other; nan where it is not told."""
        if spread is None:
            return np.full(len(self._numbers), np.nan)
        return self._good(np.sqrt((spread.apart[:, self._columns("position")] ** 2).sum(axis=1)))

    @cached_property
    def loads(self) -> Loads:
        """What drives and ropes bear."""
        assert self.result is not None
        made, good = self.result.correction, self.result.correction.good
        row_origin = lambda k: self.targets.row_origin(self._numbers[k])  # noqa: E731
        start = made.after.prediction.start.take(good)
        return Loads.of(self.model, self.start.values, made.rows.take(good), row_origin, start)

    def _bearing(self, result: Assessment) -> Bearing:
        return Bearing(model=self.model, result=result, redundant=self._redundant)

    def _text(self, size: float, unit: str) -> str:
        return shown(size, parse_unit(unit), file_unit=self.file_unit)

    # --- tables --------------------------------------------------------------------------------
    def _show_errors(self, to: Reporter, result: Assessment) -> None:
        rows = []
        for kind, unit in _KINDS:
            if self._columns(kind):
                errors = [self._error(result, kind, after) for after in (False, True)]
                spreads = [self._spread(s, kind) for s in (result.before, result.after)]
                figures = [
                    rms(errors[0]),
                    largest(errors[0]),
                    rms(errors[1]),
                    rms(spreads[1]),
                    largest(spreads[1]),
                ]
                rows.append((kind, *(self._text(f, unit) for f in figures)))
        head = ("error", "rms before", "max before", "rms after", "u (rms)", "u (max)")
        to.table("Predicted error of the tool point; u: standard uncertainty after", head, rows)
        apart, whole = rms(self._apart(result.after)), rms(self._spread(result.after, "position"))
        if apart < _COMMON * whole:
            each = self._text(apart, "um"), self._text(largest(self._apart(result.after)), "um")
            text = "the rest is a shift and a turn that all have in common, as of a base that the data hardly place"
            to.say(f"u of positions to each other: {each[0]} rms, {each[1]} at most; {text}")
        if result.free:
            free = ((f, _unit_of_coordinate(f)) for f in result.free)
            off = (f"{f.name} by {self._text(f.rms, u)} rms, {self._text(f.largest, u)} at most" for f, u in free)
            to.warn(f"warning: not held by the set values, and off where they are corrected: {'; '.join(off)}")
        if result.after is None:
            to.say("uncertainty: not available (no parameters with `correlations`, as `calibrate -o` writes them)")

    def _show_doubts(self, to: Reporter, result: Assessment) -> None:
        total = count(len(self._numbers), "target")
        self._bearing(result).warn(to)
        for each in self._beyond:
            each.show(to, len(self._numbers))
        if weak := [k for k in result.correction.good if result.weak[k]]:
            text = "most of the uncertainty comes from directions that the calibration hardly determines"
            to.warn(f"warning: rest on a weak direction: {len(weak)} of {total}: {text}")
        if turned := [k for k in result.correction.good if result.correction.turned[k]]:
            text = "the corrected set values turn a drive round, or come from no side (0, as in the first row); "
            text += "approach from the side in the table, or state `dir` there"
            to.warn(f"warning: side of approach not settled: {len(turned)} of {total}: {text}")
        evidence = self.start.evidence
        if evidence is not None and evidence.missing:
            left = ", ".join(self._text(v, _unit_of(kind)) for kind, v in evidence.unexplained.items())
            message = f"warning: something is missing: the calibration left {evidence.times_noise:.3g} times the noise"
            within = f"the uncertainties contain {left} for it" if left else "the uncertainties do not contain it"
            to.warn(f"{message}; {within} (`pkmcal diagnose` looks for the cause)")
        if evidence is None and self.start.inputs:
            to.notes(["the parameter file does not say what was measured (`calibrate -o` writes it now)"])

    @cached_property
    def _beyond(self) -> Sequence[BeyondMeasured]:
        """Columns with values outside of what was measured."""
        evidence = self.start.evidence
        if self.result is None or evidence is None:
            return ()
        return beyond_measured(self.model, self.result, evidence, self._place)

    def _place(self, k: int) -> str:
        """Of the k-th target with set values."""
        return str(self.targets.row_origin(self._numbers[k]))

    # --- JSON ------------------------------------------------------------------------------------
    def json(self) -> dict[str, Any]:
        """The JSON result."""
        evidence, result = self.start.evidence, self.result
        return {
            "tool_point": self.targets.tool.name,
            "coordinates": list(self.targets.coordinates),
            "held": list(self.targets.held),
            "redundant": self.choice,
            "n_targets": len(self.targets),
            "n_corrected": len(self._numbers),
            **self.lost.json(),
            "errors": {} if result is None else self._errors_json(result),
            "not_held": {} if result is None else self._free_json(result),
            **Bearing.json_of(None if result is None else self._bearing(result)),
            "weak": 0 if result is None else int(self._good(result.weak).sum()),
            "without_effect": list(self.targets.without_effect),
            "outside": {each.name: len(each.places) for each in self._beyond},
            "outside_values": {each.name: each.json() for each in self._beyond},
            "sides_not_settled": 0 if result is None else int(self._good(result.correction.turned).sum()),
            "unexplained": {} if evidence is None else _unexplained_json(evidence.unexplained),
            "times_noise": None if evidence is None else evidence.times_noise,
            "loads": None if not self._numbers else self.loads.json(),
        }

    def _errors_json(self, result: Assessment) -> dict[str, Any]:
        out: dict[str, dict[str, Any]] = {}
        for kind, unit in _KINDS:
            if self._columns(kind):
                numbers = {
                    "before": self._error(result, kind, False),
                    "after": self._error(result, kind, True),
                    "u_before": self._spread(result.before, kind),
                    "u": self._spread(result.after, kind),
                }
                if kind == "position":
                    numbers["u_apart"] = self._apart(result.after)
                scale = parse_unit(unit).scale
                figures = {n: {"rms": rms(v), "max": largest(v)} for n, v in numbers.items()}
                out[kind] = {n: {k: exact(x / scale) for k, x in f.items()} for n, f in figures.items()}
                out[kind]["unit"] = unit
        return out

    def _free_json(self, result: Assessment) -> dict[str, Any]:
        units = ((f, parse_unit(_unit_of_coordinate(f))) for f in result.free)
        return {
            f.name: {"rms": exact(f.rms / u.scale), "max": exact(f.largest / u.scale), "unit": u.text}
            for f, u in units
        }


def _unit_of_coordinate(f: FreeCoordinate) -> str:
    return "urad" if f.name.startswith("r") else "um"


def _unexplained_json(left: dict[str, float] | Any) -> dict[str, Any]:
    return {k: {"std": v / parse_unit(_unit_of(k)).scale, "unit": _unit_of(k)} for k, v in left.items()}


def _unit_of(kind: str) -> str:
    return "urad" if kind == "orientation" else "um"
