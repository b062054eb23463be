"""Where effects on what sensors read enter: what an observation equation does not feel has no place.

Which parts of the entry a sensor feels follows from its equation, by derivatives at ordinary places: a plane has no
shift along itself, a distance no rotation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.site_collector import Named, SiteCollector
from pkmcal_cli.effects import FRAME_PARTS, WIDTHS
from pkmcal_cli.mechanism.topology import Index
from pkmcal_cli.model.effect_sites import EffectSite
from pkmcal_cli.model.observed import PlacedSensor
from pkmcal_cli.sensors import Variable, derivatives
from pkmcal_cli.units.dimensions import ANGLE

OTHER = "to"
"""Kind of the offsets of the other ends of distances, zero without effects."""
_FELT = 1e-9
_ORDINARY = {
    "place": np.array([0.31, 0.52, 0.73]), "other": np.array([-0.41, 0.19, 0.11]), "rotation": np.array([0.2, 0.3, 0.4])
}  # fmt: skip
"""Observed values (m, rad) at which nothing is zero by chance."""


def instruments(c: SiteCollector) -> Named:
    """Sensors with what effects displace of them."""
    for sensor in c.sensors:
        parts = [(at, column) for at, column in _felt(c, sensor)]
        if parts:
            matrix = np.zeros((len(parts), WIDTHS["frame"]))
            matrix[np.arange(len(parts)), [column for _, column in parts]] = 1.0
            coefficients = np.array([at for at, _ in parts])
            yield (
                sensor.name,
                (EffectSite(part=sensor.name, coefficients=coefficients, matrix=matrix, kind=_kind(sensor)),),
            )


def _kind(sensor: PlacedSensor) -> str:
    if sensor.kind.reads_coordinates:
        return "coordinates"
    return "rotary" if sensor.kind.measurand.dimension == ANGLE else "length"


def _felt(c: SiteCollector, sensor: PlacedSensor) -> Iterator[tuple[int, int]]:
    """Coefficients that its readings depend on, and the number of the entry that displaces each."""
    shifted = False
    if "motion" in sensor.known:
        for k in _moving(c, sensor, "motion"):
            shifted = shifted or k in range(*FRAME_PARTS["shift"].indices(k + 1))
            yield int(sensor.known["motion"].coefficients[k]), k
    if (OTHER, sensor.name) in c.structure.anchors:
        for k, coefficient in enumerate(c.offset(OTHER, sensor.name)[: c.axes]):
            yield int(coefficient), FRAME_PARTS["base"].start + k
    if "reading_error" in sensor.known:
        columns = {0: FRAME_PARTS["reading"].start, 1: FRAME_PARTS["scale"].start}
        always = c.structure.machine.sensors[sensor.name].reading
        scaled = always is None or always.number(c.structure.nominal) != 0
        for k in _moving(c, sensor, "reading_error"):
            if scaled if k else not shifted:  # a shift along a coordinate is the same as one of the reading
                yield int(sensor.known["reading_error"].coefficients[k]), columns[k]


def _moving(c: SiteCollector, sensor: PlacedSensor, variable: Variable) -> Index:
    """Which numbers of a variable the sensor's readings depend on, at ordinary places."""
    seen = {name: _values(c, known.observed, known.coefficients, name) for name, known in sensor.known.items()}
    by = derivatives(sensor.kind, seen, [variable])[variable][0, sensor.outputs]
    return np.nonzero(np.abs(by).max(axis=0) > _FELT)[0]


def _values(c: SiteCollector, observed: Index, coefficients: Index, name: str) -> Array:
    """Values (1, w) of a variable: its coefficients, and ordinary ones of what is observed."""
    out = np.zeros((1, len(observed)))
    out[:, coefficients >= 0] = c.reference[coefficients[coefficients >= 0]]
    if name in _ORDINARY:
        out[:, observed >= 0] = _ORDINARY[name][observed >= 0]
    return out
