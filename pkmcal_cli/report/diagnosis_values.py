"""What every form of a diagnosis's report needs: units, sizes, where what is unknown is largest."""

from __future__ import annotations

from functools import cached_property, partial

import numpy as np

from pkmcal_cli.base.errors import Location
from pkmcal_cli.diagnosis.bad_rows import doubtful_readings
from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.panels import FieldMap, field_map
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.score import UNUSUAL
from pkmcal_cli.diagnosis.visible_sizes import VisibleSizes
from pkmcal_cli.effects import catalogue
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.loading.poses import origin_of
from pkmcal_cli.model.model import Model
from pkmcal_cli.report.audit import Audit
from pkmcal_cli.report.bench_text import BenchText
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.failed_rows import FailedRows
from pkmcal_cli.report.figures import unit_of
from pkmcal_cli.report.number_format import handy, readable, uncertain, unit_of_size
from pkmcal_cli.report.number_text import NumberText
from pkmcal_cli.report.sentences import listed
from pkmcal_cli.tables.measurement_set import Measurements
from pkmcal_cli.units.unit_text import Unit, parse_unit

_MOST_ROWS = 20.0  # times as many rows as the table has: more is no advice


class DiagnosisValues:
    """One diagnosis and the units that it is told in. `measured`: the table, for the places of its rows."""

    def __init__(self, machine: Machine, measured: Measurements, diagnosis: Diagnosis) -> None:
        self.machine, self.measured, self.diagnosis = machine, measured, diagnosis
        self.model: Model = diagnosis.problem.model

    @cached_property
    def field(self) -> FieldMap | None:
        return field_map(self.diagnosis)

    @property
    def shaped_model(self) -> Model:
        """The model with displacements without a name."""
        return self.diagnosis.search.problem.model

    @cached_property
    def failed(self) -> FailedRows:
        return FailedRows(self.diagnosis.failed, partial(origin_of, self.measured), len(self.measured))

    @cached_property
    def audit(self) -> Audit | None:
        """Values that a robust loss weighs down; None without one."""
        robust = self.diagnosis.weighed
        return None if robust is None else Audit(self.model, robust, partial(origin_of, self.measured))

    @cached_property
    def numbers(self) -> NumberText:
        """Numbers of the machine file that may be wrong."""
        return NumberText(self.diagnosis.wrong_numbers, self.machine.file_units)

    @property
    def bad_readings(self) -> tuple[BenchText, ...]:
        """Readings of the bench that are not used."""
        return tuple(BenchText(self.machine, self.model, r) for r in self.diagnosis.bad_readings)

    @cached_property
    def suspected_readings(self) -> tuple[BenchText, ...]:
        """Readings of the bench that are used, but may be wrong."""
        readings = doubtful_readings(self.diagnosis.search)
        return tuple(BenchText(self.machine, self.model, r) for r in readings)

    def show_readings(self, to: Reporter) -> None:
        """Readings of the bench that the table contradicts."""
        for reading in self.bad_readings:
            _doubt(to, f"bad reading: {reading.text}; not used: measure it again", reading.location)
        for reading in self.suspected_readings:
            _doubt(to, f"suspected reading: {reading.text}; still used: measure it again", reading.location)

    def show_rows(self, to: Reporter, bad: str) -> None:
        """Rows that contradict the others; bad: what becomes of those that do beyond doubt."""
        places = partial(origin_of, self.measured)
        for row in self.diagnosis.bad_rows:
            _doubt(to, f"bad row: {places(row)}: {bad}", places(row).location)
        for row, chance in self.diagnosis.suspected.items():
            words = f"{100 * chance:.1g} % chance that any row is off as much; still used; repeat this pose"
            _doubt(to, f"suspected row: {places(row)}: {words}", places(row).location)

    def show_left_out(self, to: Reporter) -> None:
        """Values that are weighed down, and rows that nothing predicts."""
        if self.audit is not None:
            self.audit.show(to)
        self.failed.show(to)

    def null(self, parameter: str) -> float:
        """Value, SI, that a parameter has where it is not identified."""
        return float(self.diagnosis.search.null[self.model.names.index(parameter)])

    def held_at(self, parameter: str) -> str:
        """The same in words: nominal, or what a parameter file says."""
        value = self.null(parameter)
        if value == self.model.nominal[self.model.names.index(parameter)]:
            return "nominal"
        return handy(value, self.unit(parameter))

    def unit(self, parameter: str) -> Unit:
        declared = self.model.parameters[self.model.names.index(parameter)]
        return parse_unit(declared.unit or "1")

    @property
    def file_units(self) -> tuple[Unit, ...]:
        """Of bare lengths and angles in the machine file."""
        return self.machine.file_units.length, self.machine.file_units.angle

    @property
    def length_unit(self) -> Unit:
        return self.machine.file_units.length

    def length(self, value: float) -> str:
        return readable(value, self.length_unit)

    @property
    def error_unit(self) -> Unit:
        """Unit of the errors that are told as one figure."""
        return unit_of(self.machine, self.model.channels[self.diagnosis.shown.channels[0]].dimension)

    def error(self, value: float) -> str:
        """One such error."""
        return readable(value, self.error_unit)

    @property
    def sigma(self) -> float:
        """Root mean square sigma of these readings, SI."""
        problem = self.diagnosis.problem
        some = list(self.diagnosis.shown.channels)
        sigma = problem.sigma[:, some][problem.measured[:, some]]
        return float(np.sqrt((sigma**2).mean())) if len(sigma) else float("nan")

    def rows_needed(self, hidden: VisibleSizes) -> int | None:
        """How many rows like those of the table would show an effect within its plausible range; None: no number."""
        ratio = hidden.mdb / hidden.plausible
        if hidden.absorbed_by or not ratio < _MOST_ROWS**0.5:
            return None
        return int(np.ceil(len(self.diagnosis.problem) * ratio**2))

    def size(self, finding: Finding) -> str:
        """The parameter that stands out most, as deviation from null; not one that is no part of the effect."""
        return self.estimate(finding, self.leading(finding))

    def estimate(self, finding: Finding, k: int) -> str:
        """A parameter of an effect; its name where there are several, its place where it is at several."""
        name = finding.hypothesis.parameters[k]
        unit = self.unit(name)
        label = "" if len(finding.hypothesis.parameters) == 1 else f"{name.rpartition('.')[2]} "
        label = label if not finding.hypothesis.members else f"{name.partition('@')[2].replace('.', ' ')} "
        if name in dict(finding.hypothesis.known):
            keyword, _, number = name.partition("@")
            words = {p.name: p.known_as for p in catalogue()[keyword].parameters}.get(number.rpartition(".")[2])
            return label + (words or handy(finding.estimate[k], unit))
        unit = unit_of_size(finding.estimate[k], unit, self.file_units)
        return label + uncertain(unit.from_si(finding.estimate[k]), finding.std[k] / unit.scale, unit.text)

    def leading(self, finding: Finding) -> int:
        """The number of an effect's parameter that stands out most."""
        names, parameters = self.model.names, finding.hypothesis.parameters
        nominal = self.model.nominal[[names.index(n) for n in parameters]]
        ratio = np.abs(np.array(finding.estimate) - nominal) / np.array(finding.std)
        ratio[[parameters.index(n) for n in finding.hypothesis.free]] = np.nan
        return int(np.nanargmax(ratio)) if np.isfinite(ratio).any() else 0

    def far(self, finding: Finding) -> bool:
        """Whether what was found as far off has a size beyond what is plausible."""
        if finding.run_away is None:
            return False
        index = [self.model.names.index(n) for n in finding.hypothesis.parameters]
        off = np.abs(np.array(finding.estimate) - self.model.nominal[index])
        return bool((off > UNUSUAL * self.model.ranges[index]).any())

    def run_away(self, finding: Finding) -> str:
        """What a calibration makes of declared parameters that take up what is far off."""
        offsets = finding.run_away
        if not offsets:
            return ""
        texts = [f"{name} {'+' if off > 0 else ''}{handy(off, self.unit(name))}" for name, off in offsets.items()]
        if not finding.absorbed:
            return f" Without it, parameters come out far off nominal: {listed(texts, 6)}."
        return (
            f" Without it, parameters come out far off nominal and explain the table as well: {listed(texts, 6)}. Only "
            "their ranges speak for the effect: check both."
        )


def _doubt(to: Reporter, text: str, where: Location | None) -> None:
    """A line on what was measured wrongly, and the same beside its place."""
    to.say(text)
    to.mark(text, where, "warning")
