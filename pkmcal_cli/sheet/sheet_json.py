"""A sheet for programs."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.report.figures import figures_json
from pkmcal_cli.report.number_format import finite
from pkmcal_cli.report.verification import tolerance_json
from pkmcal_cli.sheet.acceptance import Acceptance
from pkmcal_cli.sheet.results import Results
from pkmcal_cli.sheet.verdict import verdict


def sheet_json(results: Results, figures: Acceptance | None) -> dict[str, Any]:
    """Verdict, errors before and after, causes, acceptance figures; docs/json.md says what they are."""
    judgement, report, judged = verdict(results), results.calibrated, results.judged
    improved, machine = results.improved, results.machine
    held = None if isinstance(report.held_out, str) else figures_json(machine, report.held_out.after)
    with_causes = None
    if improved is not None and improved.improvement.accepted:
        with_causes = figures_json(machine, improved.improvement.after.report)
    row_origin = None if results.verified is None else results.verified.row_origin
    return {
        "verdict": judgement.word.lower(),
        "headline": judgement.headline,
        "lines": list(judgement.lines),
        "tolerance": None if judged is None else tolerance_json(judged, results.length_unit, row_origin),
        "not_judged": [] if judged is None or results.verified is not None else _not_judged(results),
        "errors": {
            "as_built": figures_json(machine, report.before),
            "calibrated": figures_json(machine, report.after),
            "held_out": held,
            "with_causes": with_causes,
        },
        "diagnosis": None if improved is None else improved.improvement.whole.verdict,
        "causes": [] if improved is None else [_cause(results, f) for f in improved.improvement.whole.findings],
        "after": None if results.verified is None else results.verified.json(),
        "acceptance": None if figures is None else figures.json(),
    }


def _not_judged(results: Results) -> list[dict[str, Any]]:
    """Rows that the verdict is not about, each with how far it is off."""
    m, unit = results.measured, results.length_unit
    return [
        {"file": m.files[m.file_index[row]], "line": int(m.line[row]), "id": m.ids[row] or None}
        | {"error": finite(size / unit.scale)}
        for row, size in results.not_judged.items()
    ]


def _cause(results: Results, finding: Finding) -> dict[str, Any]:
    """One cause: name, size in words, whether it is corrected in what is expected, whether provisional."""
    assert results.improved is not None and results.diagnosis is not None
    return {
        "effect": finding.hypothesis.effect,
        "at": finding.hypothesis.at,
        "size": results.diagnosis.size(finding),
        "accepted": finding.hypothesis in results.improved.improvement.accepted,
        "provisional": finding.provisional,
    }
