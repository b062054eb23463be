"""What the search for causes found: each with its proof, and with what else would explain it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.report.diagnosis import DiagnosisReport
from pkmcal_cli.report.shape_text import ShapeText
from pkmcal_cli.sheet.content import Block, Section, Table, Text, section
from pkmcal_cli.sheet.figures import effects
from pkmcal_cli.sheet.recorder import Recorder
from pkmcal_cli.sheet.results import Results

_CORRELATED = 0.5  # from which on a correlation is worth a line
_MOST = 5
_POWER = 4  # of ten, from which on odds are told as such
_BASIS = (
    "Held-out rms of a cause: with and without this cause, each row predicted from the other blocks of the table. "
    "\"Times larger than the stated noise\": root of chi-square per degree of freedom, all readings together. "
    "Evidence: odds for the model with the cause against that without it, overwhelming above 20 000 : 1, clear above "
    "20 : 1."
)


def causes(results: Results) -> Section | None:
    """Verdict of the diagnosis, table of causes, a paragraph for each, correlations; nothing where none was sought."""
    report = results.diagnosis
    if report is None:
        return None
    blocks: list[Block] = [Text(line) for line in report.verdict_line().splitlines()]
    recorder = Recorder()
    report.show_causes(recorder)
    blocks += recorder.blocks
    if report.diagnosis.findings:
        blocks.append(Text(_BASIS, "note"))
    for finding in report.diagnosis.findings:
        blocks += [Text(line) for line in report.sentence(finding).splitlines()]
    alone = [f.hypothesis.name for f in report.diagnosis.findings if not f.ambiguous]
    if alone:
        others = "every other effect of the catalogue at every place, and every parameter that was held"
        text = f"Tried instead of {', '.join(alone)}: {others}; none explains the data as well."
        blocks.append(Text(f"{text}{_runners_up(report.diagnosis.findings)}", "note"))
    blocks += effects(results)
    for shape in report.diagnosis.shapes:
        blocks.append(Text(ShapeText(report.machine, report.shaped_model, shape, report.error_unit).sentence()))
    for unknown in report.diagnosis.unmodelled:
        blocks.append(Text(report.unknown_text(unknown)))
    blocks += [b for b in (_indistinguishable(report), _correlations(results)) if b is not None]
    return section("causes", "Causes", blocks)


def _runners_up(findings: Sequence[Finding]) -> str:
    """What comes next in the place of each cause, and how far behind."""
    behind = [(f.hypothesis.name, f.runner_up) for f in findings if f.runner_up is not None and not f.ambiguous]
    parts = [f"{best.hypothesis.name} in the place of {name} ({_odds(best.log_odds)})" for name, best in behind]
    return f" Next best: {', '.join(parts)}." if parts else ""


def _odds(log_odds: float) -> str:
    """Odds of so many to one."""
    power = log_odds / math.log(10.0)
    size = f"{float(f'{math.exp(log_odds):.2g}'):.6g}" if power < _POWER else f"1e{power:.0f}"
    return f"odds of {size} : 1 against it"


def _indistinguishable(report: DiagnosisReport) -> Table | None:
    """Rivals of what was found; None where each cause stands alone."""
    rows = [
        (f.hypothesis.name, r.hypothesis.name, f"{100 * r.weight:.0f} %", f"{r.cosine:.3f}")
        for f in report.diagnosis.findings
        if f.ambiguous
        for r in f.rivals[: _MOST + 1]
        if r.hypothesis != f.hypothesis
    ]
    if not rows:
        return None
    return Table("Not distinguished from", ("cause", "or", "probability", "cosine"), tuple(rows), left=2)


def _correlations(results: Results) -> Table | None:
    """Declared parameters that go along with the numbers of a cause."""
    assert results.improved is not None
    improvement = results.improved.improvement
    names, covariance = improvement.fit.selected, np.nan_to_num(improvement.fit.covariance)
    std = np.sqrt(np.diag(covariance))
    findings = {n: f for f in improvement.whole.findings for n in f.hypothesis.parameters if n in names}
    rows = []
    for name in findings:
        k = names.index(name)
        share = np.divide(covariance[k], std * std[k], out=np.zeros(len(std)), where=std * std[k] > 0)
        order = [int(j) for j in np.argsort(-np.abs(share)) if j != k and abs(share[j]) > _CORRELATED]
        rows += [(name, names[j], f"{share[j]:+.2f}") for j in order[:_MOST]]
    return Table("Correlations above 0.5", ("of", "with", "correlation"), tuple(rows), left=2) if rows else None
