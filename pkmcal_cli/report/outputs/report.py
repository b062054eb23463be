"""What `report --json` writes."""

from __future__ import annotations

from pkmcal_cli.report.outputs.check import CHECK
from pkmcal_cli.report.outputs.keys import Output

_FIGURES = """
errors.{}.KIND.rms number?: {}, in `unit`
errors.{}.KIND.max number?: largest
errors.{}.KIND.criterion number?: sum of squares over all rows, `unit`^2
errors.{}.KIND.unit text:
errors.{}.KIND.count integer: number of points or readings
"""


def _figures(state: str, words: str) -> str:
    name = state.rstrip("?")
    return _FIGURES.format(state, words, *[name] * 4).strip()


_VERIFICATION = CHECK.text.partition("\n---\n")[2].strip()
_AFTER = _VERIFICATION.replace("verification~", "after?", 1).replace("verification", "after")

REPORT = Output(
    "report",
    f"""
verdict pass|fail|undecided|confirmed|changed|clean|found|unknown|implausible|done: with a tolerance `pass`, `fail` or
    `undecided` (ISO 14253-1; `undecided` too if a row that is not judged may be further off); else with `--after`
    `confirmed` or `changed` (the identified parameters predict these rows, or do not); else `clean`, `found`,
    `unknown` by the search for causes, `done` without one; `implausible`: the calibration should not be believed
file text: the page
headline text: the verdict in a sentence
lines[] text: what it rests on
tolerance?.value number?: of `--tolerance`, in `unit`; `tolerance` is null without
tolerance.unit text:
tolerance.verdict pass|fail|undecided: `pass`, `fail` or `undecided`
tolerance.n_pass integer: number of points
tolerance.n_fail integer:
tolerance.n_undecided integer:
tolerance.largest?.file text?: the point that is furthest off; its row, of the table after correction, else null
tolerance.largest.line integer?:
tolerance.largest.id text?:
tolerance.largest.error number: its distance from the predicted point, in `unit`
tolerance.largest.expanded_uncertainty number: of the instrument (k = 2)
not_judged[].file text: rows that the verdict by a tolerance is not about: left out by the search or by a robust loss,
    or not predicted
not_judged[].line integer:
not_judged[].id text?:
not_judged[].error number?: how far it is off with all that was found, in the tolerance's `unit`; null if not predicted
{_figures("as_built", "with nominal parameters, fitted rows")}
{_figures("calibrated", "calibrated, fitted rows")}
{_figures("held_out?", "calibrated, held-out rows; null without")}
{_figures("with_causes?", "with the causes, on rows used neither for fitting nor for selection; null without")}
diagnosis text?: verdict of `diagnose`; null without a search
causes[].effect text: a cause, as in `diagnose`
causes[].at text: its place
causes[].size text: in words
causes[].accepted flag: whether the expected error counts it as corrected
causes[].provisional flag: whether it is provisional
provenance.seed integer: of the search
provenance.status text: how the calibration ended
---
{_AFTER}
---
acceptance?.state as built|after correction: whose repeats and circles these are (`predicted`:
    always as built); `acceptance` is null without positions
acceptance.unit text: of deviations
acceptance.at_unit text: of places
acceptance.axes[].axis text: a coordinate with enough repeats for ISO 230-2
acceptance.axes[].at.AXIS number: the other coordinates
acceptance.axes[].targets integer: number of targets
acceptance.axes[].approaches integer: fewest approaches of a side of a target
acceptance.axes[].A number: accuracy
acceptance.axes[].R number: repeatability
acceptance.axes[].E number: systematic deviation
acceptance.axes[].M number: mean deviation
acceptance.axes[].B number: reversal
acceptance.poses[].at.AXIS number: a pose with enough cycles for ISO 9283
acceptance.poses[].cycles integer:
acceptance.poses[].AP number: accuracy
acceptance.poses[].RP number: repeatability
acceptance.circle?.circular number: range of the radii of a circle: G of ISO 230-4 at a feed; null without a circle
acceptance.circle.largest number: largest radial deviation
acceptance.circle.smallest number: smallest
acceptance.circle.radius number: radius commanded, in `at_unit`
acceptance.circle.feed number?: of `--circle-feed`, mm/min; null: at rest
acceptance.predicted[].axis text: a coordinate along which the identified model predicts the machine as built, commanded
    by the nominal parameters; none where there are repeats
acceptance.predicted[].at.AXIS number: the other coordinates
acceptance.predicted[].E number: systematic deviation
acceptance.predicted[].M number: mean deviation
acceptance.predicted[].B number: reversal
""",
)
