"""Error figures before and after, in the file's units."""

from __future__ import annotations

import math
from collections.abc import Mapping

from pkmcal_cli.calibration.errors_before_after import ErrorFigures
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.loading.kept_errors import KeptErrors
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.number_format import finite, to_digits
from pkmcal_cli.units.file_units import DIMENSIONS, NUMBER, UNITS, Unit


def figure_unit(machine: Machine, figures: ErrorFigures) -> Unit:
    """Unit of a kind's figures."""
    return unit_of(machine, figures.dimension)


def error_lines(
    machine: Machine,
    fitted: Mapping[str, ErrorFigures],
    heldout: Mapping[str, ErrorFigures] | None,
    chi2_per_dof: float,
) -> list[str]:
    """Errors as a section of a parameter file; heldout: None where nothing was held out."""
    both = ({k: (f.rms, figure_unit(machine, f)) for k, f in kinds.items()} for kinds in (fitted, heldout or {}))
    return KeptErrors(next(both), next(both), chi2_per_dof).lines()


def kind_label(model: Model, kind: str) -> str:
    """What a kind of figures is called: where redundant drives strain the machine, lengths differ by strain too."""
    return "strain" if kind == "length" and model.overdetermined else kind


def unit_of(machine: Machine, dimension: str) -> Unit:
    """The file's unit of a dimension by its name."""
    named = next((d for d in DIMENSIONS.values() if d.name == dimension), NUMBER)
    return UNITS["1"] if named == NUMBER else machine.file_units.unit(named)


def criterion_text(figures: ErrorFigures, unit: Unit) -> str:
    """Sum of squares, in the square of a unit; a dash without any."""
    value = figures.criterion / unit.scale**2
    return "-" if math.isnan(value) else f"{to_digits(value, 4)} {unit.text}^2"


def figures_json(machine: Machine, kinds: dict[str, ErrorFigures]) -> dict[str, object]:
    """By kind of instrument: rms, max, criterion, unit."""
    out: dict[str, object] = {}
    for kind, f in kinds.items():
        unit = figure_unit(machine, f)
        out[kind] = {
            "rms": finite(f.rms / unit.scale),
            "max": finite(f.largest / unit.scale),
            "criterion": finite(f.criterion / unit.scale**2),
            "unit": unit.text,
            "count": f.count,
        }
    return out
