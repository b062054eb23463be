"""Forces of drives."""

from __future__ import annotations

from pkmcal_cli.sensors.base import SensorKind, as_read

FORCE = SensorKind(
    keyword="force",
    title="force or torque of a drive; `scale`: force per unit of the reading",
    instruments="motor current, load cell in a drive",
    needs=("drive",),
    may=("column", "zero", "scale", "unit"),
    sees=("force", "zero", "scale"),
    quantity="force",
    law=lambda seen: [as_read(seen["force"][:, 0], seen)],
)
