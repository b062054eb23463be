"""What was measured once, with the part on the bench."""

from __future__ import annotations

from pkmcal_cli.sensors.base import SensorKind

BENCH = SensorKind(
    keyword="bench",
    title="an expression of parameters, measured once by itself; its reading stands in the machine file",
    instruments="coordinate measuring machine, gauge blocks, tape",
    needs=("of", "reading"),
    may=(),
    sees=("value",),
    quantity="bench",
    law=lambda seen: [seen["value"][:, 0]],
)
