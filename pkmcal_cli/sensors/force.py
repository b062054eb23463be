"""Forces of drives."""

from __future__ import annotations

from pkmcal_cli.sensors.base import SensorKind, as_read

FORCE = SensorKind(
    "force",
    "force or torque of a drive; `scale`: force per unit of the reading",
    "motor current, load cell in a drive",
    ("drive",),
    ("column", "zero", "scale", "unit"),
    ("force", "zero", "scale"),
    "force",
    lambda seen: [as_read(seen["force"][:, 0], seen)],
)
