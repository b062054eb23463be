"""What was measured once, with the part on the bench."""

from __future__ import annotations

from pkmcal_cli.sensors.base import SensorKind

BENCH = SensorKind(
    "bench",
    "an expression of parameters, measured once by itself; its reading stands in the machine file",
    "coordinate measuring machine, gauge blocks, tape",
    ("of", "reading"),
    (),
    ("value",),
    "bench",
    lambda seen: [seen["value"][:, 0]],
)
