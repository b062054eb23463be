"""What has changed between calibrations, or what two machine files leave."""

from __future__ import annotations

import math

from pkmcal_cli.pictures.dot_list import Dot, Scale, dot_part
from pkmcal_cli.pictures.parts import composed, shown_unit, size_text
from pkmcal_cli.pictures.picture import Picture
from pkmcal_cli.pictures.titles import Titles
from pkmcal_cli.report.comparison import ComparisonReport
from pkmcal_cli.report.number_format import uncertain
from pkmcal_cli.units.unit_text import Unit

_COVERAGE = 1.96
_HALVES = 2.0  # half ranges in a range


def comparison_picture(report: ComparisonReport, titles: Titles) -> Picture:
    """Changes of the parameters that all calibrations identified, with 95 % intervals, as shares of their ranges."""
    changes, common = report.changes, report.compared.common
    scale = dict(zip(common.names, common.scale.tolist(), strict=True))
    dots = []
    for name, value, std, known in zip(changes.names, changes.values, changes.std, changes.determined, strict=True):
        unit, size = report.unit(name), _HALVES * scale[name]
        seen = math.isfinite(value) and math.isfinite(std)  # what not all determine rests on ranges, as in the table
        text = uncertain(value / unit.scale, std / unit.scale, unit.text) if seen else "undetermined"
        dots.append(Dot(name=name, value=float(value) / size if seen else math.nan,
                        text=text if known or not seen else f"{text} *",
                        half=_COVERAGE * float(std) / size, good=name not in report.named))  # fmt: skip
    part = "" if all(changes.determined) else "; *: not determined by all"
    per = " per day" if report.compared.course.rate else ""
    label = f"change{per} / range, 95 % interval (open, orange: changed{part})"
    changed = ", ".join(report.named) or "none"
    alt = f"{report.verdict()}. Changes of {len(dots)} parameters with 95 % intervals; changed: {changed}."
    return composed("comparison", titles, alt, [dot_part(dots, Scale(label=label, line=0.0))])


def machines_picture(
    machines: tuple[str, str], rms: tuple[float, float], unit: Unit, kind: str, titles: Titles
) -> Picture:
    """Held-out errors of two machine files."""
    shown = shown_unit(unit.dimension.name, max(rms), unit)
    texts = [size_text(size, unit.dimension.name) for size in rms]
    dots = [Dot(name=m, value=size / shown.scale, text=t) for m, size, t in zip(machines, rms, texts, strict=True)]
    label = f"held-out {kind} rms [{shown.text}]"
    alt = "; ".join(f"{m}: {t} held-out {kind} rms" for m, t in zip(machines, texts, strict=True))
    return composed("comparison", titles, f"{alt}.", [dot_part(dots, Scale(label=label, line=0.0))])
