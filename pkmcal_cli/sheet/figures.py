"""The pictures of a sheet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.pictures.diagnosis_pictures import driver_part, effect_panels, panel_in_words, waterfall_part
from pkmcal_cli.pictures.error_map import error_map, places_of
from pkmcal_cli.pictures.machine_picture import machine_picture
from pkmcal_cli.pictures.machine_shape import machine_shape
from pkmcal_cli.pictures.parameter_picture import parameter_picture, without_frames
from pkmcal_cli.pictures.parts import composed
from pkmcal_cli.pictures.residual_picture import residual_parts
from pkmcal_cli.pictures.shape_picture import shape_in_words, shape_part
from pkmcal_cli.pictures.titles import Titles, titles
from pkmcal_cli.report.improvement import ImprovementReport
from pkmcal_cli.report.parameters import ParameterRow
from pkmcal_cli.sheet.content import Figure, Section, section
from pkmcal_cli.sheet.results import Results
from pkmcal_cli.units.unit_text import parse_unit

_TRIED = 5  # rows that might be drawn, if one cannot be solved


def _titles(results: Results, subject: str) -> Titles:
    return titles(results.machine.files[0][0], subject, results.measured.files)


def drawing(results: Results) -> Section | None:
    """The machine in the row in the middle, as the control believes it to be and as it was identified."""
    problem, fit = results.calibrated.problem, results.calibrated.fit
    readings = np.nan_to_num(problem.rows.readings)
    spread = np.maximum(np.ptp(readings, axis=0), 1e-12)
    order = np.argsort((((readings - np.median(readings, axis=0)) / spread) ** 2).sum(axis=1), kind="stable")
    loaded = results.loaded.for_sessions(problem.rows.named_sessions)
    for row in order[:_TRIED]:
        shape = machine_shape(loaded, fit.values, problem.rows, int(row))
        if not isinstance(shape, str):
            row_origin = results.row_text(int(row))
            picture = machine_picture(shape, _titles(results, f"identified, {row_origin}"))
            caption = f"The machine at {row_origin}: grey as the control believes, black as identified, exaggerated."
            return section("machine", "The machine", [Figure(picture, caption)])
    return None


def maps(results: Results) -> list[Figure]:
    """Errors of positions as arrows: before and after calibration, then with the causes; without positions, what is
    left over the drives.
    """
    report, improved = results.calibrated, results.improved
    problem, calibrated = report.problem.without(report.slipped), ("calibrated", report.fit.after.residual)
    before = [] if report.started else [("as built", report.fit.before.residual)]
    pairs = [("errors before and after calibration", places_of(problem, [*before, calibrated]))]
    if improved is not None and improved.improvement.accepted:
        with_causes = ("with causes", improved.improvement.fit.after.residual)
        pairs.append(("errors with the causes", places_of(improved.improvement.problem, [calibrated, with_causes])))
    unit, caption = results.machine.file_units.length, "Measured minus predicted, on the fitted rows. Arrows of a row "
    caption += "of panels have one scale, but where a panel says otherwise."
    again = _without_bad_rows(results)
    out = [Figure(error_map(p, _titles(results, subject), unit), caption) for subject, p in pairs if p]
    if not out and (left := residual_parts(problem, report.fit)):
        words = "Residuals after calibration over the reading of each drive, on the fitted rows."
        return [Figure(composed("residuals", _titles(results, "residuals after calibration"), words, left), words)]
    return [*out[:1], *(replace(figure, caption=f"{caption}{again}") for figure in out[1:])]


def _without_bad_rows(results: Results) -> str:
    """Why figures with the causes are of fewer rows than those of the calibration."""
    named = ", ".join(results.row_text(row) for row in results.bad_rows)
    return f" Without rows that are not used ({named}), so that rms differ from those of all rows." if named else ""


def effects(results: Results) -> list[Figure]:
    """Every cause over what drives it, and every deviation without a name over its axis."""
    if results.diagnosis is None:
        return []
    figures = []
    for panel in effect_panels(results.diagnosis.diagnosis):
        name = panel.finding.hypothesis.name
        words = panel_in_words(panel)
        picture = composed(f"effect-{name}", _titles(results, name), words, [driver_part(panel)])
        figures.append(Figure(picture, f"{words} Band: 95 %."))
    for shape in results.diagnosis.diagnosis.shapes:
        name, words = shape.hypothesis.name, shape_in_words(shape)
        drawn = [shape_part(shape, results.machine.file_units)]
        figures.append(Figure(composed(name.replace(":", "-"), _titles(results, name), words, drawn), words))
    return figures


def steps(results: Results) -> Figure | None:
    """From the raw residual to noise, step by step."""
    if results.diagnosis is None:
        return None
    subject = "what is left of the residual, step by step"
    part = waterfall_part(results.diagnosis.diagnosis)
    picture = composed("steps", _titles(results, subject), f"{subject[0].upper()}{subject[1:]}.", [part])
    return Figure(picture, "Residuals, times the stated noise: root of chi-square per degree of freedom; 1 is noise.")


def identified(results: Results) -> Figure | None:
    """Identified parameters as shares of their ranges; together with the causes where there are some."""
    rows = [r for r in results.calibrated.rows if r.selected]
    if not rows:
        return None
    subject, improved = "identified parameters", results.improved
    if improved is not None and improved.improvement.accepted:
        subject += ", together with the causes"
        rows = [_as_improved(row, improved) for row in rows]
    picture = parameter_picture(without_frames(rows, results.calibrated.model), _titles(results, subject))
    return Figure(picture, "Offsets from nominal as shares of the ranges (grey band), with 95 % intervals.")


def _as_improved(row: ParameterRow, improved: ImprovementReport) -> ParameterRow:
    """A parameter as it was identified together with the causes."""
    value, std = improved.estimate(row.name)
    unit = parse_unit(row.unit)
    scaled = None if std is None else std / unit.scale
    return replace(row, value=unit.from_si(value), std=scaled, by_data=None, by_held=None, interval=None)
