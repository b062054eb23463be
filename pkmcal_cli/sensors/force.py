"""Forces of drives."""

from __future__ import annotations

from pkmcal_cli.sensors.sensor_kind import SensorKind, as_read
from pkmcal_cli.units.measurands import Measurand

FORCE = SensorKind(
    keyword="force",
    title="force or torque of a drive; `scale`: force per unit of the reading",
    instruments="motor current, load cell in a drive",
    needs=("drive",),
    may=("column", "zero", "scale", "unit"),
    variables=("force", "zero", "scale"),
    measurand=Measurand.FORCE,
    equation=lambda seen: [as_read(seen["force"][:, 0], seen)],
    unmoved={
        "frame": "a force is the same wherever the instrument stands",
        "drift": "its errors are its `zero` and `scale`: make them parameters",
        "meas_scale": "its errors are its `zero` and `scale`: make them parameters",
        "meas_zero": "its errors are its `zero` and `scale`: make them parameters",
        "meas_shear": "only an instrument with axes of its own (`tcp`) can have axes that are not square",
    },
)
