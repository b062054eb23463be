"""What was measured once, with the part on the bench."""

from __future__ import annotations

from pkmcal_cli.sensors.sensor_kind import SensorKind
from pkmcal_cli.units.measurands import Measurand

BENCH = SensorKind(
    keyword="bench",
    title="an expression of parameters, measured once; its reading is in the machine file",
    instruments="coordinate measuring machine, gauge blocks, tape",
    needs=("of", "reading"),
    may=(),
    variables=("value",),
    measurand=Measurand.BENCH,
    equation=lambda seen: [seen["value"][:, 0]],
    unmoved=dict.fromkeys(
        ("frame", "drift", "meas_scale", "meas_zero", "meas_shear"),
        "it is measured once, on the bench: its error is its `sigma`",
    ),
)
