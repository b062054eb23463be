"""Where an instrument stood in each of many sessions: a table with a line for each."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.model.model import Model
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import uncertain, unknown
from pkmcal_cli.report.parameters import ParameterRow


def show_session_frames(to: Reporter, model: Model, rows: Sequence[ParameterRow]) -> None:
    """Numbers of frames, of each sensor a table, with their standard uncertainties by all that is uncertain."""
    cells: dict[str, dict[str, dict[str, str]]] = {}  # by sensor, session, number
    for r in rows:
        shared, session = model.shared[r.name]
        sensor, _, number = shared.partition("@")[2].rpartition(".")
        known = r.std is not None
        text = uncertain(r.value, r.std, r.unit) if known else unknown(r.value, r.range, r.unit)
        cells.setdefault(sensor, {}).setdefault(session, {})[number] = text
    for sensor, of_sessions in cells.items():
        numbers = list(dict.fromkeys(n for line in of_sessions.values() for n in line))
        lines = [(session, *(line.get(n, "") for n in numbers)) for session, line in of_sessions.items()]
        to.table(f"Fitted frames of {sensor}", ("session", *numbers), lines)
