"""Numbers of the machine file that may be wrong, in words and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pkmcal_cli.diagnosis.wrong_numbers import WrongNumber
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import finite, to_digits, uncertain
from pkmcal_cli.report.sentences import listed
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.unit_text import Unit

_PLACES = 3
_DIGITS = 9


class NumberText:
    """Numbers that would explain a table, each by itself, in the units of the machine file."""

    def __init__(self, numbers: Sequence[WrongNumber], units: FileUnits) -> None:
        self.numbers, self.units = numbers, units

    def suspicion(self) -> str:
        """For the end of a verdict; "" without any."""
        names = [listed(list(n.number.places), _PLACES) for n in self.numbers]
        return f"; a number in the machine file may be wrong: {', or '.join(names)}" if names else ""

    def show(self, to: Reporter) -> None:
        """What they are in the file, what they would be, and what that leaves; nothing without any."""
        if not self.numbers:
            return
        headers, rows = ("number", "in the file", "would be", "leaves, in variances of the noise"), self.numbers
        to.say()
        to.table("Numbers in the machine file that no parameter changes", headers, [*map(self._row, rows)], left=1)
        words = "Any one of them explains" if len(self.numbers) > 1 else "It explains"
        to.say(
            f"{words} the table at least as well as all that was found, with declared parameters as their ranges say. "
            "Check it in the drawing and correct it, or declare it as a parameter with a range, and calibrate again."
        )

    def _row(self, wrong: WrongNumber) -> tuple[str, ...]:
        unit = self._unit(wrong)
        nominal = f"{to_digits(unit.from_si(wrong.number.value), _DIGITS)} {unit.text}"
        value = uncertain(unit.from_si(wrong.value), wrong.std / unit.scale, unit.text)
        return listed(list(wrong.number.places), _PLACES), nominal, value, f"{wrong.chi2_per_dof:.3g}"

    def json(self) -> list[dict[str, Any]]:
        """For programs."""
        return [self._json(wrong) for wrong in self.numbers]

    def _json(self, wrong: WrongNumber) -> dict[str, Any]:
        unit = self._unit(wrong)
        return {
            "places": list(wrong.number.places),
            "nominal": finite(unit.from_si(wrong.number.value)),
            "value": finite(unit.from_si(wrong.value)),
            "std": finite(wrong.std / unit.scale),
            "unit": unit.text,
            "chi2_per_dof": finite(wrong.chi2_per_dof),
        }

    def _unit(self, wrong: WrongNumber) -> Unit:
        return self.units.angle if wrong.number.angle else self.units.length
