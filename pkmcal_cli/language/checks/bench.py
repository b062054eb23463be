"""What was measured on the bench: of the dimension of what it is of, and not far from nominal."""

from __future__ import annotations

from collections.abc import Mapping

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.binding import article
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.parts import Parameter
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_FAR = 20.0  # ranges


def check_bench(machine: Machine, parameters: Mapping[str, Parameter], source: SourceMap, faults: FaultList) -> None:
    """Checks the sensors of a machine with bound quantities and resolved parameters."""
    values = {name: p.nominal for name, p in parameters.items()}
    for name, sensor in machine.sensors.items():
        if sensor.of is None or sensor.reading is None or any(n not in values for n in sensor.of.names):
            continue
        path: Path = ("sensors", name)
        wanted = sensor.of.dimension
        for key, quantity in (("reading", sensor.reading), ("sigma", sensor.sigma.get(""))):
            if quantity is not None and quantity.dimension != wanted:
                what = f"`{sensor.of.text}` is {article(wanted)}, this is {article(quantity.dimension)}"
                faults.add(source.fault("dimension", what, (*path, key), "give it a unit"))
        reach = sum(parameters[n].range for n in sensor.of.names)
        off = abs(sensor.reading.number({}) - sensor.of.number(values)) if sensor.reading.is_constant else 0.0
        if sensor.reading.dimension == wanted and reach > 0 and off > _FAR * reach:
            what = f"`{sensor.of.text}` was measured {off / reach:.0f} ranges off its nominal value"
            faults.add(source.fault("magnitude", what, (*path, "reading"), "is the unit right?", warning=True))
