"""What limits of the command line are held against: errors, chi-square, uncertainties, change of the tool point."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.errors_before_after import ErrorFigures
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Rows
from pkmcal_cli.prediction.tool_difference import tool_difference
from pkmcal_cli.report.figures import figure_unit
from pkmcal_cli.units.dimensions import ANGLE, LENGTH
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow.gates import Figure, Gate, Judged


@dataclass(frozen=True, kw_only=True)
class Result:
    """A fit: errors of rows held out (or why there are none) and fitted; std, SI, by parameter, None: undetermined.

    before, after: machine and values (P,) that the fit began and ended with.
    """

    machine: Machine
    held_out: Mapping[str, ErrorFigures] | str
    fitted: Mapping[str, ErrorFigures]
    chi2_per_dof: float
    std: Mapping[str, float | None]
    before: tuple[Model, Array]
    after: tuple[Model, Array]
    rows: Rows

    def judged(self, limits: Iterable[Gate]) -> tuple[Judged, ...]:
        """Every limit with the figure that it is held against."""
        return tuple(gate.judged(self._figures(gate.figure)) for gate in limits)

    def _figures(self, name: str) -> dict[str, Sequence[Figure] | str]:
        """Those that a limit may name; only what is asked is computed."""
        figures: dict[str, Sequence[Figure] | str] = {
            "heldout": self.held_out if isinstance(self.held_out, str) else self._errors(self.held_out, "held-out"),
            "fitted": self._errors(self.fitted, "fitted"),
            "chi2": [Figure("chi-square per degree of freedom", _known(self.chi2_per_dof), parse_unit("1"))],
        }
        if name == "change":
            figures[name] = self._change()
        return figures | self._uncertainties()

    def _errors(self, kinds: Mapping[str, ErrorFigures], rows: str) -> list[Figure]:
        return [Figure(f"{k} rms of {rows} rows", f.rms, figure_unit(self.machine, f), k) for k, f in kinds.items()]

    def _uncertainties(self) -> dict[str, list[Figure]]:
        units = {p.name: parse_unit(p.unit or "1").difference for p in self.after[0].parameters}
        return {
            f"std:{name}": [Figure(f"standard uncertainty of {name}", math.inf if one is None else one, units[name])]
            for name, one in self.std.items()
        }

    def _change(self) -> list[Figure]:
        """The largest change of the tool point at the set values of the table."""
        units, changes = self.machine.file_units, tool_difference(self.before, self.after, self.rows)
        kinds = (("position", LENGTH), ("orientation", ANGLE))
        return [
            Figure(f"largest change of the tool point's {kind}", _largest(change), units.unit(dimension), kind)
            for (kind, dimension), change in zip(kinds, changes, strict=True)
        ]


def _largest(change: Array) -> float:
    known = change[~np.isnan(change)]
    return float(known.max()) if len(known) else math.inf


def _known(value: float) -> float:
    return math.inf if math.isnan(value) else value
