"""What `check -p` shows: normalised errors of a second table, and the verdict on a tolerance."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.fitted_frames import stands_anywhere
from pkmcal_cli.calibration.point_errors import Judged, K, partly_measured
from pkmcal_cli.calibration.verification import SIGNIFICANT, Verification
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.failed_rows import FailedRows
from pkmcal_cli.report.number_format import finite, readable, to_digits
from pkmcal_cli.report.sentences import PARTLY, STANDS_ANYWHERE
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import Unit, parse_unit

_LISTED = 20
_LENGTHS_ALONE = (
    "No positions were measured: each length is judged by itself. "
    "How far the tool point is off across it, it does not show."
)
_WITH_FRAME = "U of each point includes that the instrument's place is fitted to it as well as to the others."


class VerificationReport:
    """A verification, ready to be shown; `judged`: by a tolerance, where there is one, in its unit.

    faulty: rows without a prediction that are shown as faults of the table.
    """

    def __init__(
        self,
        verification: Verification,
        judged: Judged | None,
        unit: Unit | None,
        row_origin: Callable[[int], RowOrigin],
        faulty: Collection[int] = (),
    ) -> None:
        self.verification, self.judged, self.unit, self.row_origin = verification, judged, unit, row_origin
        self.failed = FailedRows(verification.failed, row_origin, len(verification.problem))
        self.unshown = FailedRows(
            {k: why for k, why in verification.failed.items() if k not in faulty}, row_origin, len(verification.problem)
        )
        self.normalised = verification.normalised

    @property
    def verdict(self) -> str:
        """The verdict in a sentence: on the tolerance where there is one, else on all readings."""
        v, j = self.verification, self.judged
        if not v.overdetermined:
            fitted = f": {', '.join(v.refitted)} are fitted to them" if v.refitted else ""
            return f"UNDECIDED: {count(v.problem.count, 'reading')} do not suffice{fitted}; measure more rows"
        chance = f"chi-square {v.chi2:.4g}, {count(v.dof, 'degree')} of freedom, p {v.p_value:.2g}"
        if j is None:
            return f"{'compatible' if v.compatible else 'NOT COMPATIBLE'} with the parameters: {chance}{self._lost}"
        words = {"pass": "PASS", "fail": "FAIL", "undecided": "UNDECIDED"}[j.verdict]
        assert self.unit is not None
        sums = f"{int(j.passed.sum())} pass, {int(j.failed.sum())} fail, {int(j.undecided.sum())} undecided"
        points = f"{count(len(j.points.rows), j.noun)}: {sums}{self._lost}"
        return f"{words} (ISO 14253-1, tolerance {self.unit.from_si(j.tolerance):.6g} {self.unit.text}): {points}"

    @property
    def _lost(self) -> str:
        rows = self.verification.failed
        return f"; {count(len(rows), 'row')} without a prediction" if rows else ""

    @property
    def ok(self) -> bool:
        """Whether the verdict is positive."""
        if self.judged is None:
            return self.verification.compatible
        return self.verification.overdetermined and self.judged.verdict == "pass"

    def show(self, to: Reporter) -> None:
        """For people."""
        v = self.verification
        if self.ok:
            to.say(self.verdict)
        else:
            to.fail(self.verdict, self._furthest.location)
        if self.judged is not None and not v.p_value >= SIGNIFICANT and v.dof > 0:
            to.warn(f"warning: NOT COMPATIBLE with the parameters: p {v.p_value:.2g}; something has changed")
        if self.judged is not None and self.unit is not None and self.judged.beyond_instrument:
            least = self.unit.from_si(float(self.judged.points.expanded.min()))
            limits = f"U is {least:.3g} {self.unit.text} (k = 2) or more, the tolerance"
            limits += f" {self.unit.from_si(self.judged.tolerance):.6g} {self.unit.text}"
            to.warn(f"warning: no {self.judged.noun} can pass: {limits}; a finer instrument is needed")
        partly = 0 if self.judged is None else partly_measured(v.problem, self.judged.points.rows)
        if self.judged is not None and self.judged.measurand is Measurand.DISTANCE:
            to.say(_LENGTHS_ALONE)
        if partly:
            to.say(PARTLY.format(points=count(partly, "point")))
        if v.refitted:
            to.notes([f"fitted to these rows: {', '.join(v.refitted)}"])
        if stands_anywhere(v.problem):
            to.say(STANDS_ANYWHERE)
            if self.judged is not None:
                to.say(_WITH_FRAME)
        rows = []
        for c in self._channels():
            unit = parse_unit(c["unit"])
            si = (unit.to_si(c[key]) for key in ("rms", "max", "u_predicted", "u_measured"))
            sizes = (readable(x, unit) for x in si)
            above = f"{c['n_above']} of {c['count']}"
            rows.append((c["name"], *sizes, f"{c['e_n_max']:.2f}", above))
        headers = ("reading", "rms", "max", "U predicted", "U measured", "max E_n", "E_n > 1")
        to.table("Errors, measured - predicted; U: expanded uncertainties (k = 2), rms", headers, rows)
        for text in self._worst():
            to.say(text)
        self.unshown.show(to)

    @property
    def _furthest(self) -> RowOrigin:
        """The row that is furthest off: by the tolerance where there is one, else by its normalised errors."""
        points = None if self.judged is None else self.judged.points
        if points is not None and points.worst is not None:
            return self.row_origin(int(points.rows[points.worst]))
        return self.row_origin(int(self.normalised.max(axis=1).argmax()))

    def _worst(self) -> list[str]:
        """What is furthest off: the reading where they do not agree, and the point where there is a tolerance."""
        return [*self._worst_reading(), *self._worst_point()]

    def _worst_reading(self) -> list[str]:
        v = self.verification
        if v.compatible or not v.overdetermined:
            return []
        row, k = (int(x) for x in np.unravel_index(np.argmax(self.normalised), self.normalised.shape))
        channel = v.problem.model.channels[k]
        off = readable(float(v.errors[row, k]), parse_unit(channel.unit))
        beyond = int((self.normalised > 1).sum())
        text = f"furthest off by its uncertainty: {channel.name} at {self.row_origin(row)}, by {off}"
        others = f"{count(beyond - 1, 'other reading')} beyond 1"
        if beyond < 2:
            others = "all others are within 1" if beyond else "each is within 1, but not all together"
        return [f"{text}, E_n {self.normalised[row, k]:.3g}; {others}"]

    def _worst_point(self) -> list[str]:
        j = self.judged
        if j is None or (k := j.points.worst) is None:
            return []
        unit, at = self.unit, self.row_origin(int(j.points.rows[k]))
        assert unit is not None
        e, u = (to_digits(unit.from_si(float(x[k])), 4) for x in (j.points.errors, j.points.expanded))
        known = f"U {u} {unit.text} (k = 2)" if np.isfinite(j.points.expanded[k]) else "U unknown"
        return [f"largest {j.error} error: {e} {unit.text}, {known}, at {at}"]

    def _channels(self) -> list[dict[str, Any]]:
        v, out = self.verification, []
        for k, channel in enumerate(v.problem.model.channels):
            on = v.on[:, k]
            if not on.any():
                continue
            unit = parse_unit(channel.unit)
            e, n = np.abs(v.errors[on, k]), self.normalised[on, k]
            out.append(
                {
                    "name": channel.name,
                    "rms": _rms(e) / unit.scale,
                    "max": float(e.max()) / unit.scale,
                    "u_predicted": K * _rms(v.by_model[on, k]) / unit.scale,
                    "u_measured": K * _rms(v.by_instrument[on, k]) / unit.scale,
                    "e_n_max": float(n.max()),
                    "n_above": int((n > 1).sum()),
                    "count": int(on.sum()),
                    "unit": unit.text,
                }
            )
        return out

    def json(self) -> dict[str, Any]:
        """The JSON result."""
        v = self.verification
        above = [(int(r), int(k)) for r, k in zip(*np.nonzero(self.normalised > 1), strict=True)]
        return {
            "compatible": v.compatible,
            "chi2": finite(v.chi2),
            "degrees_of_freedom": v.dof,
            "p_value": finite(v.p_value),
            "fitted": list(v.refitted),
            "channels": self._channels(),
            "above": [self._reading(r, k) for r, k in above],
            **self.failed.json(),
            "tolerance": None if self.judged is None else tolerance_json(self.judged, self.unit, self.row_origin),
        }

    def _reading(self, row: int, channel: int) -> dict[str, Any]:
        """A reading whose normalised error exceeds 1."""
        about, row_origin = self.verification.problem.model.channels[channel], self.row_origin(row)
        return {
            "file": row_origin.file,
            "line": row_origin.line,
            "id": row_origin.id or None,
            "channel": about.name,
            "error": float(self.verification.errors[row, channel]) / parse_unit(about.unit).scale,
            "unit": about.unit,
            "e_n": float(self.normalised[row, channel]),
        }


def tolerance_json(j: Judged, unit: Unit | None, row_origin: Callable[[int], RowOrigin] | None) -> dict[str, Any]:
    """A verdict on a tolerance, in its unit; row_origin: of a row, None where rows are not told."""
    assert unit is not None
    worst = j.points.worst
    there = None if worst is None or row_origin is None else row_origin(int(j.points.rows[worst]))
    return {
        "value": unit.from_si(j.tolerance),
        "unit": unit.text,
        "verdict": j.verdict,
        "n_pass": int(j.passed.sum()),
        "n_fail": int(j.failed.sum()),
        "n_undecided": int(j.undecided.sum()),
        "largest": None
        if worst is None
        else {
            "file": None if there is None else there.file,
            "line": None if there is None else there.line,
            "id": None if there is None else there.id or None,
            "error": unit.from_si(float(j.points.errors[worst])),
            "expanded_uncertainty": finite(unit.from_si(float(j.points.expanded[worst]))),
        },
    }


def _rms(values: np.ndarray[Any, Any]) -> float:
    return float(np.sqrt(np.mean(values**2)))
