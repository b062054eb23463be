"""The parts of a sheet, in the order of the questions of whoever reads it."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping

from pkmcal_cli.calibration.errors_before_after import ErrorFigures
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.effects import catalogue
from pkmcal_cli.report.diagnosis import OVERWHELMING
from pkmcal_cli.report.figures import figure_unit, kind_label
from pkmcal_cli.report.number_format import nominal_number, readable
from pkmcal_cli.report.sentences import cause_effect_action, command, listed
from pkmcal_cli.sheet.acceptance import Acceptance
from pkmcal_cli.sheet.causes import causes
from pkmcal_cli.sheet.content import Block, Section, Sheet, Table, Text, section
from pkmcal_cli.sheet.figures import drawing, identified, maps, steps
from pkmcal_cli.sheet.measured_region import measured_region
from pkmcal_cli.sheet.recorder import Recorder
from pkmcal_cli.sheet.results import Results
from pkmcal_cli.sheet.verdict import verdict

_IDENTIFIED = ("-p", "params.yaml")
_STANDS_FOR = (
    " An identified value stands for the errors of parameters that are not identified as well, and its uncertainty "
    "includes them; so it may be wider than the range. At the tool most of that cancels."
)
_ABSORBED = (
    "Absorbed by: these identified parameters take up most of such an effect, so that it hardly shows in the measured "
    "region. Beyond it, or under other loads, it may."
)
_FILES = (
    "`improve` writes improved.yaml and improved.params.yaml. TARGETS.csv lists the poses that are wanted, one a row, "
    "in columns as the measurements have them{circumstances}. Run the set values of commands.csv instead of those that "
    "the control computes."
)
_ALONE = "off by itself, by more than any cause explains; not used"
_AGAIN = "Command the same set values from the same side; the new reading replaces the row in the table."
_AFTER = (
    "AFTER.csv: columns as the measurements have them; in those of the drives the set values that were run, in the "
    "others what was read."
)
_ERROR = "Error"  # title of the table that the sheet has in a form of its own


def sheet(results: Results, figures: Acceptance | None) -> Sheet:
    """The whole sheet."""
    parts = [
        drawing(results),
        errors(results),
        causes(results),
        parameters(results),
        verification(results),
        None if figures is None else figures.section(),
        not_seen(results),
        next_steps(results),
        alone(results),
        provenance(results),
    ]
    files = ", ".join(os.path.basename(f) for f in results.measured.files)
    created = str(results.head["created"])[:10]
    return Sheet(
        machine=_name(results),
        subtitle=f"Machine file {_name(results)}; measurements {files}; sheet of {created}",
        verdict=verdict(results),
        warnings=results.simulated,
        sections=tuple(part for part in parts if part is not None),
        footer=f"{results.head['program']}, {results.head['created']}. Standard uncertainties in brackets apply to "
        "the last digits; U are expanded uncertainties (k = 2). Intervals hold for the measured region.",
    )


def _name(results: Results) -> str:
    return os.path.basename(results.machine.files[0][0])


def errors(results: Results) -> Section | None:
    """Errors as built, calibrated, with effects, after correction."""
    report = results.calibrated
    rows = [*_figures(results, "as built (nominal parameters)", "fitted rows", report.before)]
    rows += _figures(results, "calibrated", "fitted rows", report.after)
    held = report.held_out
    remark = f"Held-out error: not available ({held})." if isinstance(held, str) else f"Held out: {held.scheme}."
    if results.improved is not None:
        improvement = results.improved.improvement
        rows += _figures(results, "calibrated", "held out", improvement.before.report)
        if improvement.accepted:
            names = ", ".join(h.name for h in improvement.accepted)
            rows += _figures(results, f"calibrated with {names}", "held out", improvement.after.report)
        remark = f"Held out: {improvement.rotations} parts of the table in turn, each predicted by a calibration and a "
        remark += "search for causes in the other rows. Position errors are distances in space, or in the plane; the "
        remark += "instrument's own noise is in all of them."
    elif not isinstance(held, str):
        rows += _figures(results, "calibrated", "held out", held.after)
    table = Table("", ("state", "on", "error", "rms", "largest"), tuple(rows), left=3)
    region = measured_region(report.problem, results.machine.file_units)
    notes = [Text(remark, "note"), Text(region, "note")] if region else [Text(remark, "note")]
    return section("errors", "Errors before and after", [table, *notes, *maps(results), steps(results)])


def _figures(results: Results, state: str, on: str, figures: Mapping[str, ErrorFigures]) -> list[tuple[str, ...]]:
    out: list[tuple[str, ...]] = []
    for kind, f in figures.items():
        unit = figure_unit(results.machine, f)
        sizes = readable(f.rms, unit), readable(f.largest, unit)
        out.append((state, on, kind_label(results.calibrated.model, kind), *sizes))
    return out


def parameters(results: Results) -> Section | None:
    """What was identified, together with the causes where there are some."""
    together = _with_causes(results)
    blocks: list[Block | None] = [together, identified(results), *([] if together else _calibrated(results))]
    note = "Range: what was known of a dimension before, two standard deviations about nominal. Numbers in brackets: "
    note += "standard uncertainty of the last digits; twice that for 95 %."
    if together and results.improved is not None and results.improved.improvement.budget.held:
        note += _STANDS_FOR
    return section("parameters", "Identified parameters", [*blocks, Text(note, "note")])


def alone(results: Results) -> Section | None:
    """The calibration without the causes, where it is not that of the machine."""
    if _with_causes(results) is None:
        return None
    text = "Not for use: without the causes, the parameters take up part of them. What it says is missing is what the "
    text += "causes above explain; it is here so that nothing is hidden, and asks for nothing more to be done."
    if results.bad_rows:
        text += " All rows are in it, also those that the search for causes does not use."
    return section("alone", "Appendix: calibration without the causes", [Text(text, "warning"), *_calibrated(results)])


def _calibrated(results: Results) -> list[Block]:
    """What `calibrate` shows, but for its table of errors."""
    recorder = Recorder()
    results.calibrated.show(recorder)
    return [b for b in recorder.blocks if not (isinstance(b, Table) and b.title == _ERROR)]


def _with_causes(results: Results) -> Table | None:
    """Parameters as identified with the effects that the search added; None where it added none."""
    report = results.improved
    if report is None or not report.improvement.accepted:
        return None
    declared = {row.name: row for row in results.calibrated.rows}
    rows = []
    weights = {n for shape in report.improvement.whole.shapes for n in shape.hypothesis.parameters}  # of curves above
    for name in (n for n in report.improvement.fit.selected if n not in weights):
        row = declared.get(name)
        known = ("-", "") if row is None else (nominal_number(row.nominal, row.range), row.spread)
        estimate = report.estimate_text(name) if report.estimate(name)[1] is not None else "undetermined"
        rows.append((name, known[0], estimate, known[1]))
    return Table("Identified together with the causes", ("name", "nominal", "identified", "range"), tuple(rows))


def verification(results: Results) -> Section | None:
    """The second table against what was identified."""
    if results.verified is None:
        return None
    recorder = Recorder()
    results.verified.show(recorder)
    return section("verification", "Measured after correction", recorder.blocks)


def not_seen(results: Results) -> Section | None:
    """What these data could not have shown."""
    report = results.diagnosis
    if report is None:
        return section("not-seen", "What could not be seen", [Text(f"No search: {results.not_searched}.")])
    recorder = Recorder()
    if not report.diagnosis.findings:
        report.show_seen(recorder)
    report.show_unseen(recorder)
    blocks: list[Block] = list(recorder.blocks) or [Text("Every effect of the catalogue would have been seen.")]
    if any(seen.absorbed_by for seen in report.diagnosis.invisible):
        blocks.append(Text(_ABSORBED, "note"))
    return section("not-seen", "What could not be seen", blocks)


def next_steps(results: Results) -> Section | None:
    """What to correct, and what to measure next."""
    report, blocks = results.diagnosis, list[Block]()
    machine, table = results.machine.files[0][0], results.measured.files
    if results.bad_rows:
        again = ", ".join(results.row_text(row) for row in results.bad_rows)
        blocks.append(Text(f"Measure again: {again} ({_ALONE}). {_AGAIN}"))
    if report is not None and report.diagnosis.findings:
        rows = []
        for f in report.diagnosis.findings:
            h = f.hypothesis
            rows.append((h.name, report.size(f), _action(h, report.size(f))))
        blocks.append(Table("Corrections", ("cause", "size", "action"), tuple(rows), words=("action",)))
    with_causes = results.verified is None and report is not None and bool(report.diagnosis.findings)
    if with_causes:
        text = "Repair a cause, or let set values account for it, not both; after a repair, measure again. Set values:"
        blocks += [Text(text)]
        blocks += [Text(command("improve", machine, *table, *results.fit_words, "-o", "improved.yaml"), "command")]
        blocks += [Text("pkmcal correct improved.yaml TARGETS.csv -p improved.params.yaml -o commands.csv", "command")]
        blocks += [Text(_FILES.format(circumstances=_circumstances(results)), "note")]
    elif results.verified is None:
        blocks += [Text("Set values that account for the identified parameters:"), _identification(results)]
        blocks += [Text(command("correct", machine, "TARGETS.csv", *_IDENTIFIED, "-o", "commands.csv"), "command")]
    blocks += _next_measurement(results)
    return section("next", "Corrections and next measurement", blocks)


def _circumstances(results: Results) -> str:
    """Columns of the measurements on which what was identified may depend."""
    columns = list(results.measured.covariates)
    return f", with those of {listed(columns, 6)} as they will be (else at their reference)" if columns else ""


def _identification(results: Results) -> Text:
    """The command that writes the identified parameters."""
    files = (results.machine.files[0][0], *results.measured.files)
    return Text(command("calibrate", *files, *results.fit_words, "-o", _IDENTIFIED[1]), "command")


def _action(hypothesis: Hypothesis, size: str) -> str:
    """What is to be done about a cause."""
    if hypothesis.effect == RELEASE:
        return f"Identify it: --select auto,{hypothesis.at}"
    return cause_effect_action(catalogue()[hypothesis.effect], hypothesis.at, size)[2]


def _next_measurement(results: Results) -> list[Block]:
    """Which points would tell most."""
    report, machine = results.diagnosis, results.machine.files[0][0]
    ambiguous = [] if report is None else [f for f in report.diagnosis.findings if f.ambiguous]
    if report is not None and ambiguous:
        sentences = [s for f in ambiguous for s in report.to_separate(f)]
        return [Text("Several causes explain the data alike."), *(Text(s) for s in sentences)]
    if results.verified is None:
        text = "After correction, measure again and hand over the sheet with both tables:"
        limit = () if results.tolerance is None else ("--tolerance", f"{results.length_text(results.tolerance[0])}")
        files = (*results.measured.files, "--after", "AFTER.csv")
        report_again = Text(command("report", machine, *files, *results.fit_words, *limit), "command")
        return [*_more_surely(results), Text(text), report_again, Text(_AFTER, "note")]
    text = "To find out later whether the machine has changed, measure some of these points again, and compare:"
    compared = Text(command("check", machine, "LATER.csv", *_IDENTIFIED), "command")
    return [Text(text), _identification(results), compared]


def _more_surely(results: Results) -> list[Block]:
    """Points that tell causes from the next best, where that is not beyond doubt."""
    findings = [] if results.diagnosis is None else results.diagnosis.diagnosis.findings
    near = [(f, f.runner_up) for f in findings if f.runner_up is not None and f.runner_up.log_odds < OVERWHELMING]
    blocks: list[Block] = []
    for finding, other in near:
        pair = f"{finding.hypothesis.name},{other.hypothesis.name}"
        aim = command("plan", results.machine.files[0][0], *results.measured.files[-1:], "--aim", f"separate:{pair}")
        blocks += [Text(f"Points that tell {pair.replace(',', ' from ')} more surely:"), Text(aim, "command")]
    return blocks


def provenance(results: Results) -> Section | None:
    """Where all of this comes from."""
    head = results.head
    rows = [("program", str(head["program"])), ("date", str(head["created"]))]
    rows += [(name, str(head[name])) for name in ("python", "numpy", "scipy")]
    rows += [("arguments", shlex.join(str(a) for a in head["arguments"]))]
    blocks: list[Block] = [Table("", ("", ""), tuple(rows), left=2)]
    files = tuple((name, digest) for name, digest in head["inputs"].items())
    blocks.append(Table("Files that were read", ("file", "sha256"), files, left=2))
    blocks += [Text(note, "note") for note in results.notes if note not in results.simulated]
    return section("provenance", "Provenance", blocks)
