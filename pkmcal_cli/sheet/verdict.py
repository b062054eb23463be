"""The verdict of a sheet: one word, and the sentence that a customer remembers."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.fitted_frames import stands_anywhere
from pkmcal_cli.calibration.point_errors import Judged, partly_measured
from pkmcal_cli.report.sentences import PARTLY, STANDS_ANYWHERE, listed
from pkmcal_cli.report.verification import VerificationReport
from pkmcal_cli.sheet.content import Verdict, Word
from pkmcal_cli.sheet.results import Results

_COMMANDS = (
    "The rows after correction are compared with what the identified parameters predict for the set values in the "
    "table: the machine meets its targets as well as this only if these set values were corrected (`correct`)."
)
_ALL = 99.9  # % of a tolerance: an instrument as uncertain as it leaves nothing
_MOST_ROWS = 4  # that are named
_NUMBERS = ("no", "one", "two", "three", "four", "five", "six")
_BY_TOLERANCE: dict[str, Word] = {"pass": "PASS", "fail": "FAIL", "undecided": "UNDECIDED"}
_BY_DIAGNOSIS: dict[str, Word] = {"clean": "CLEAN", "found": "FOUND", "ambiguous": "FOUND"}


def verdict(results: Results) -> Verdict:
    """By the tolerance (ISO 14253-1) where there is one, else by the second table, else by what the search found."""
    if not results.calibrated.usable:
        first, *reasons = results.calibrated.verdict().splitlines()
        return Verdict("IMPLAUSIBLE", first.removeprefix("IMPLAUSIBLE, "), tuple(reasons))  # the word stands first
    judged = results.judged
    if judged is None:
        return Verdict(_word(results), "; ".join([_error(results), *_causes(results)]), tuple(_lines(results)))
    word, worst, doubtful = _BY_TOLERANCE[judged.verdict], _worst(results, judged), _doubtful(results, judged)
    if word == "PASS" and doubtful:
        word, worst = "UNDECIDED", f"{worst}, but {count(doubtful, 'point')} may be further off"
    lines = [_judged_error(results, judged), _share(results, judged), *_not_judged(results), *_lines(results)]
    return Verdict(word, "; ".join([worst, *_causes(results)]), tuple(lines))


def _doubtful(results: Results, judged: Judged) -> int:
    """How many points are not judged that might not pass: not predicted, or off by more than the tolerance leaves."""
    if results.verified is not None:
        return len(results.verified.verification.failed)
    most = judged.tolerance - float(np.max(judged.points.expanded, initial=0.0))
    return sum(not size <= most for size in results.not_judged.values())


def _word(results: Results) -> Word:
    if results.verified is not None:
        return "CONFIRMED" if results.verified.ok else "CHANGED"
    report = results.diagnosis
    return "DONE" if report is None else _BY_DIAGNOSIS.get(report.diagnosis.verdict, "UNKNOWN")


def _worst(results: Results, judged: Judged) -> str:
    """The largest error beside the tolerance."""
    k, unit = judged.points.worst, results.length_unit
    if k is None:
        return "no point was measured"
    error, u = (unit.from_si(float(x[k])) for x in (judged.points.errors, judged.points.expanded))
    limit = f"{unit.from_si(judged.tolerance):.6g} {unit.text}"
    if judged.verdict == "undecided":
        return f"{error:.3g} {unit.text} with U = {u:.2g} {unit.text} against {limit}"
    sign = ">" if error > unit.from_si(judged.tolerance) else "<="
    return f"{error:.3g} {unit.text} {sign} {limit}"


def _error(results: Results) -> str:
    """The error that remains after calibration, or after correction, where no tolerance judges it."""
    if results.verified is not None:
        return _after(results, results.verified)
    points, _ = results.before
    if not len(points.errors):
        kind, figures = next(iter(results.calibrated.after.items()))
        unit = results.machine.file_units.length if figures.dimension == "length" else None
        size = f"{figures.rms:.3g}" if unit is None else f"{unit.from_si(figures.rms):.3g} {unit.text}"
        return f"{kind} errors of {size} rms after calibration"
    unit = results.length_unit
    rms = float(np.sqrt((points.errors**2).mean()))
    return f"position errors of {unit.from_si(rms):.3g} {unit.text} rms after calibration"


def _after(results: Results, verified: VerificationReport) -> str:
    """What the second table says: the error that it leaves, and whether the identified parameters predict it."""
    v = verified.verification
    agrees = "as" if v.compatible else "not as"
    agreement = f"{agrees} the identified parameters predict (p {v.p_value:.2g})"
    points = v.points
    if not len(points.errors):
        return f"rows measured after correction are {agreement}"
    rms = results.length_text(float(np.sqrt((points.errors**2).mean())))
    return f"position errors of {rms} rms on {count(len(v.problem), 'row')} measured after correction, {agreement}"


def _causes(results: Results) -> list[str]:
    """How many causes were found, and what is expected once they are corrected."""
    report = results.diagnosis
    if report is None or results.improved is None:
        return []
    diagnosis, n = report.diagnosis, len(report.diagnosis.findings)
    if diagnosis.verdict == "clean":
        return ["no further cause found"]
    out = []
    if n:
        number = _NUMBERS[n] if n < len(_NUMBERS) else str(n)
        doubt = " (one of several that explain the data alike)" if diagnosis.verdict == "ambiguous" else ""
        out.append(f"{number} {'cause' if n == 1 else 'causes'} found{doubt}")
    if diagnosis.unknown:
        depends = listed(list(dict.fromkeys(u.depends_on for u in diagnosis.unknown)), 2)
        out.append(f"an unknown cause remains that depends on {depends}")
    if results.verified is None and (expected := _expected(results, n)):
        out.append(expected)
    return out


def _expected(results: Results, n: int) -> str:
    """The error on rows that took no part, with what was found corrected: the largest beside a tolerance, else rms."""
    points, improved = results.expected, results.improved
    if points is None or improved is None or not len(points.errors):
        return ""
    number = len(improved.improvement.accepted)
    each = "it" if number == 1 else "both" if number == 2 else f"all {number}"
    each = each if number == n else f"{number} of them"
    size = points.errors.max() if results.tolerance is not None else np.sqrt((points.errors**2).mean())
    unit, kind = results.length_unit, "" if results.tolerance is not None else " rms"
    return f"with {each} corrected {unit.from_si(float(size)):.3g} {unit.text}{kind} expected"


def _share(results: Results, judged: Judged) -> str:
    """Of how many points, on which rows, and what part of the verdict is the instrument's."""
    unit, points, limit = results.length_unit, judged.points, judged.tolerance
    parts = [(judged.passed, "pass"), (judged.failed, "fail"), (judged.undecided, "undecided")]
    sums = ", ".join(f"{int(part.sum())} {word}" for part, word in parts)
    which = "the table measured after correction" if results.verified is not None else results.before[1]
    if results.verified is None and results.improved is not None:
        turns = results.improved.improvement.rotations
        which += f" ({turns} parts of the table in turn, each predicted by a calibration and a search in the others)"
    u = unit.from_si(float(np.max(points.expanded, initial=0.0)))
    share = 100 * u / unit.from_si(limit)
    problem = results.all_rows if results.verified is None else results.verified.verification.problem
    room = unit.from_si(limit) - u
    passes = f"a {judged.noun} passes up to {room:.3g} {unit.text},"
    passes = passes if share < _ALL else f"no {judged.noun} can pass, one"
    partly = partly_measured(problem, points.rows)
    in_part = f" {PARTLY.format(points=count(partly, 'point'))}" if partly else ""
    return (
        f"ISO 14253-1, {count(len(points.rows), judged.noun)} of {which}: {sums}.{in_part} "
        f"Instrument: U = {u:.2g} {unit.text} (k = 2), {float(f'{share:.2g}'):g} % of the tolerance: {passes} fails "
        f"beyond {unit.from_si(limit) + u:.3g} {unit.text}; "
        f"the machine passes if every {judged.noun} does."
    )


def _not_judged(results: Results) -> list[str]:
    """Rows that the verdict is not about: off by themselves, or not predicted."""
    if results.verified is not None or not results.not_judged:
        return []
    off = {row: f", {results.length_text(size)} off" for row, size in results.not_judged.items() if np.isfinite(size)}
    bad = [row for row in results.not_judged if row in results.bad_rows]
    lines, others = [], [results.row_text(row) for row in results.not_judged if row not in bad]
    if bad:
        named = listed([f"{results.row_text(row)}{off.get(row, '')}" for row in bad], _MOST_ROWS)
        it, these = ("it", "this pose") if len(bad) == 1 else ("them", "these poses")
        lines.append(
            f"Not judged: {named}, by more than any cause explains (a slip of the measurement, or in its columns?), "
            "from what the machine with all that was found predicts. "
            f"The verdict is without {it}: measure {these} again."
        )
    if others:
        lines.append(f"Not judged, as the identified parameters do not predict them: {listed(others, _MOST_ROWS)}.")
    return lines


def _judged_error(results: Results, judged: Judged) -> str:
    """What the error is an error of, and where it is largest."""
    state = "the machine after correction" if results.verified is not None else "the machine as calibrated"
    if results.diagnosis is not None and results.diagnosis.diagnosis.findings and results.verified is None:
        state += ", its causes not corrected"
    k = judged.points.worst
    where = "" if k is None else f", largest at {results.row_origin(int(judged.points.rows[k]))}"
    built = results.calibrated.before.get("position")
    old = "" if built is None else f" As built (nominal dimensions): {results.length_text(built.largest)} at most."
    if results.verified is None:
        old += " The verdict is of a control that uses the identified parameters, or corrected set values."
    return f"Judged: {judged.error} errors of {state}{where}.{old}"


def _lines(results: Results) -> list[str]:
    """What makes the verdict provisional."""
    lines = []
    report = results.diagnosis
    if results.verified is not None:
        lines.append(_COMMANDS)
    if stands_anywhere(results.calibrated.problem):
        lines.append(STANDS_ANYWHERE)
    if results.not_searched:
        lines.append(f"Causes were not searched: {results.not_searched}.")
    if report is not None and any(f.provisional for f in report.diagnosis.findings):
        names = listed([f.hypothesis.name for f in report.diagnosis.findings if f.provisional], 3)
        lines.append(f"Provisional: {names}.")
    if report is not None:
        lines += [f"Provisional: {reading.text}." for reading in report.suspected_readings]
    if results.improved is not None and results.improved.improvement.accepted and results.expected is None:
        lines.append("Rows used neither for fitting nor for selection do not confirm what was found.")
    if results.verified is not None and not results.verified.verification.compatible:
        lines.append("The second table does not agree with the identified parameters: something has changed.")
    return lines
