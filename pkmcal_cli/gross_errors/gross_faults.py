"""Which gross mistake of a table explains residuals that no parameters explain: in channels, drives or rows.

Channels are compared with predictions, drives with the positions that the inverse model gives at measured poses, or
where no pose was measured by predicting again with columns changed. Where several explanations do as well, as on a
symmetric machine, the one that changes least is told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.measured_pose import measured_poses
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.gross_errors.change_row import change_row
from pkmcal_cli.gross_errors.column_faults import explain_columns
from pkmcal_cli.gross_errors.drive_columns import explain_by_prediction
from pkmcal_cli.gross_errors.drive_zeros import explain_steps, explain_zeros
from pkmcal_cli.gross_errors.force_columns import explain_forces
from pkmcal_cli.gross_errors.late_drives import explain_late_drives
from pkmcal_cli.gross_errors.mirror import brought_back, explain_frame
from pkmcal_cli.gross_errors.orientation_convention import explain_conventions
from pkmcal_cli.gross_errors.other_place import explain_place
from pkmcal_cli.gross_errors.other_reflector import explain_reflectors
from pkmcal_cli.gross_errors.permuted import permuted_rows
from pkmcal_cli.gross_errors.plausibility import EXPLAINED, Hint, misfit
from pkmcal_cli.gross_errors.reason import Reason
from pkmcal_cli.gross_errors.repeated import repeated_readings
from pkmcal_cli.gross_errors.row_names import RowNames
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.gross_errors.shifted_rows import shifted_rows
from pkmcal_cli.prediction import WarmStart
from pkmcal_cli.units.measurands import Measurand

IntArray = NDArray[np.intp]

_POSES = 20  # of these, rows for which the inverse model is asked
_ALIKE = 4.0  # explanations that leave so many times the least do as well
_PART = 0.5  # share of the misfit that hints may leave where no explanation is complete
_FEWEST = 4  # poses by which drives are judged


def gross_faults(
    problem: Problem,
    values: Array,
    parameters: Sequence[str],
    sessions: IntArray,
    row_origin: Callable[[int], str],
    names: Sequence[str] = (),
    states: WarmStart | None = None,
    sample: Sample | None = None,
) -> tuple[Hint, ...]:
    """Suspicions, at parameter values (P,); none where `parameters`, in their ranges, explain the residuals.

    sessions (N,): number of the session of each row, among `names`; row_origin: words for a row; states: of the rows,
    at these values; sample: of the whole table, where it is known. What is wrong in one session alone is looked for
    there.
    """
    table = _Table(
        problem=problem, values=values, parameters=tuple(parameters), sessions=sessions, row_origin=row_origin,
        states=states, known=sample,
    )  # fmt: skip
    whole = _suspected(table)
    numbers = np.unique(sessions)
    if len(numbers) < 2:
        return whole or _from_a_row(table)
    messages: list[Hint] = []
    for number in numbers:
        words = f"in session `{names[number]}` " if len(names) else ""
        messages += _in_part(table, np.nonzero(sessions == number)[0], words)
    same = {(h.kind, h.names) for h in messages} <= {(h.kind, h.names) for h in whole}
    return whole if same else tuple(messages)


@dataclass(frozen=True, kw_only=True)
class _Table:
    """N rows at parameter values (P,); of each row its session (N,), its place in words, and its state there."""

    problem: Problem
    values: Array
    parameters: tuple[str, ...]
    sessions: IntArray
    row_origin: Callable[[int], str]
    states: WarmStart | None
    known: Sample | None = None

    @cached_property
    def sample(self) -> Sample:
        """Rows spread over it, with what errors of the parameters cause."""
        return self.known or Sample.of(self.problem, self.values, self.parameters, self.states)

    def take(self, rows: IntArray) -> _Table:
        """Some rows (n,)."""
        states = None if self.states is None else self.states.take(rows)
        row_origin = RowNames(self.row_origin, rows)
        problem, sessions = self.problem.take(rows), self.sessions[rows]
        return replace(self, problem=problem, sessions=sessions, row_origin=row_origin, states=states, known=None)


def _in_part(table: _Table, rows: IntArray, words: str) -> list[Hint]:
    """Suspicions by some rows (n,) alone, which `words` tell."""
    return [h.of_some(rows, words) for h in _suspected(table.take(rows))]


def _from_a_row(table: _Table) -> tuple[Hint, ...]:
    """Suspicions by the rows from one on, or up to one: a cable, a unit or a setting was changed on the way."""
    first = change_row(table.sample)
    if first is None:
        return ()
    later, earlier = np.arange(first, len(table.problem)), np.arange(first)
    return (
        *_in_part(table, later, f"from {table.row_origin(first)} on: "),
        *_in_part(table, earlier, f"up to {table.row_origin(first - 1)}: "),
    )


def _suspected(table: _Table) -> tuple[Hint, ...]:
    """Suspicions by all rows of a table."""
    sample, row_origin, forces = table.sample, table.row_origin, explain_forces(table.sample)
    if any(h.before == np.inf for h in forces):
        return forces  # no row says anything else
    if conventions := explain_conventions(sample):
        return (*conventions, *forces)
    looked_at = sample.gross and not sample.few_rows_off
    chosen = _chosen([r for r in _reasons(table) if r.hints]) if looked_at else ()
    if not chosen and (sample.mostly_lost or not sample.informative.all()):  # unknown zeros explain all but the steps
        chosen = _steps(table)
    if not sample.few_rows_off:
        chosen = _unless_reflectors(chosen, explain_reflectors(sample))
    if forces:  # these have seen all columns of forces together
        read = {sample.part.model.channels[k].name for k in sample.part.model.measuring(Measurand.FORCE)}
        chosen = tuple(h for h in chosen if not read & set(h.names))
    elif sample.gross and not chosen:
        chosen = permuted_rows(sample, row_origin)
    return (*(chosen or repeated_readings(sample, row_origin)), *_steady(sample), *forces)


def _unless_reflectors(chosen: tuple[Hint, ...], reflectors: tuple[Hint, ...]) -> tuple[Hint, ...]:
    """The reflectors that are elsewhere, unless other hints than zeros of columns explain the table as well."""
    other = [h.after for h in chosen if h.kind != "offset"]
    return chosen if not reflectors or (other and max(other) <= _ALIKE * reflectors[0].after) else reflectors


def _reasons(table: _Table) -> list[Reason]:
    """Explanations of a table that is grossly off: by its channels, by shifted rows, by its drives."""
    sample, problem, values = table.sample, table.problem, table.values
    reasons = [_channels(sample, True), shifted_rows(sample, table.sessions, table.row_origin)]
    if not reasons[0].hints:
        reasons.append(_channels(sample, False))  # a wrong unit of an angle is lost when whole turns are taken off
    much = reasons[0].before > EXPLAINED or sample.mostly_lost  # no less than what an explanation may leave
    if much and not reasons[1].complete:
        reasons += _drives(table)
        unplaced = sample.of_unknown_frames or np.isinf(reasons[-1].before)  # drives cannot be judged by poses
        if unplaced and not any(r.complete and not _of_drives(problem, r) for r in reasons):
            hints, before = explain_by_prediction(sample, values, table.sessions)
            reasons += [Reason((h,), before, h.after) for h in hints]
    explained = any(r.complete and not sample.still_gross(r.hints) for r in reasons)
    return reasons if explained else [*reasons, Reason(*explain_place(sample))]


def _of_drives(problem: Problem, reason: Reason) -> bool:
    """Whether channels of an explanation are readings of drives, so that it may as well be other drives."""
    drives = {c.name for c in problem.model.channels if c.measurand is Measurand.DRIVE}
    return any(drives & set(h.names) for h in reason.hints)


def _chosen(reasons: list[Reason]) -> tuple[Hint, ...]:
    """The hints of the explanation that leaves least; of those that do as well, of that which changes least."""
    complete = [r for r in reasons if r.complete]
    if not complete:
        best = min(reasons, key=lambda r: r.after, default=None)
        return () if best is None or best.after > _PART * best.before else best.hints
    least = min(r.after for r in complete)
    good = [r for r in complete if r.after <= _ALIKE * least]
    fewest = min(len(r.hints) for r in good)
    first, *others = sorted((r.hints for r in good if len(r.hints) == fewest), key=lambda h: h[0].kind != "rotated")
    explained = {(h.kind, h.names) for h in first}
    others = [o for o in others if not explained & {(h.kind, h.names) for h in o}]
    return (*first, *(h.unmended("alternatively, ") for o in others for h in o))


def _channels(sample: Sample, rotated: bool) -> Reason:
    """What explains the measured channels; `rotated`: with turns by the shorter way."""
    names, units = _named(sample)
    readings, predicted = sample.readings, sample.predicted
    seen = sample.seen(readings, predicted) if rotated else np.where(sample.informative, readings, np.nan)
    firm = seen.copy()
    firm[:, sample.of_unknown_frames] = np.nan
    explanation = explain_columns(firm, predicted, names, units, sample.prior_rms)
    hints, corrected = list(explanation.hints), explanation.corrected
    for points, turns in zip(sample.frames, sample.turns, strict=True):
        hint, changed = explain_frame(readings, predicted, points, names, units, turns=turns, expected=sample.prior_rms)
        hints += hint
        columns = [k for p in (*points, *turns) for k in p]
        corrected[:, columns] = brought_back(changed, predicted, points, turns)[:, columns]
    return Reason(tuple(hints), *(misfit(table, predicted, seen) for table in (seen, corrected)))


def _steady(sample: Sample) -> tuple[Hint, ...]:
    """Signs and units of channels that hardly vary but are large; forces are looked at by themselves."""
    names, units = _named(sample)
    alone = np.where(sample.informative, np.nan, sample.readings)
    alone[:, sample.part.model.measuring(Measurand.FORCE)] = np.nan
    alone[:, sample.of_unknown_frames] = np.nan
    return explain_columns(alone, sample.predicted, names, units, sample.prior_rms, steady=True).hints


def _named(sample: Sample) -> tuple[list[str], list[str]]:
    channels = sample.part.model.channels
    return [c.name for c in channels], [c.unit for c in channels]


def _at_poses(table: _Table) -> tuple[IntArray, Array]:
    """Some rows (n,) of the table whose poses were measured, and what the drives should read there (n, A)."""
    sample, values = table.sample, table.values
    few = np.linspace(0, len(sample.rows) - 1, min(_POSES, len(sample.rows))).round().astype(int)
    measured = measured_poses(sample.part.take(few), values)
    if len(measured.rows) < _FEWEST:
        return np.zeros(0, dtype=np.intp), np.zeros((0, len(sample.part.model.actuators)))
    return sample.rows[few[measured.rows]], measured.drive_readings(values)


def _steps(table: _Table) -> tuple[Hint, ...]:
    """Drives whose steps have another sign or size."""
    rows, expected = _at_poses(table)
    actuators = table.problem.model.actuators
    units = [a.unit for a in actuators]
    return explain_steps(table.problem.rows.readings[rows], expected, [a.name for a in actuators], units)


def _drives(table: _Table) -> list[Reason]:
    """What explains the drives, by the positions that they have at the measured poses."""
    sample, model = table.sample, table.problem.model
    rows, expected = _at_poses(table)
    if not len(rows):
        return [Reason((), np.inf, np.inf)]
    every = sample.whole.rows.readings
    readings = every[rows]
    names, units = model.drive_names, [a.unit for a in model.actuators]
    late = explain_late_drives(
        every, expected, rows, table.sessions, row_origin=table.row_origin, names=names, units=units
    )
    explanations = [late, explain_columns(readings, expected, names, units)]
    if sample.mostly_lost and not any(e.hints for e in explanations):
        explanations.append(explain_zeros(readings, expected, names, units))
    before = misfit(readings, expected, readings)
    return [Reason(e.hints, before, misfit(e.corrected, expected, readings)) for e in explanations]
