"""What was measured on the bench: of the dimension of what it is of, and not far from nominal."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from pkmcal_cli.base.errors import FaultList
from pkmcal_cli.language.binding import article
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.parts import Parameter
from pkmcal_cli.units.dimensions import LENGTH
from pkmcal_cli.yaml_source.tree import Path, SourceMap

_FAR = 20.0  # ranges


def check_bench(
    machine: Machine,
    parameters: Mapping[str, Parameter],
    slipped: Collection[Path],
    source: SourceMap,
    faults: FaultList,
) -> None:
    """Checks the sensors of a machine with bound quantities and resolved parameters; not those at `slipped` paths."""
    values = {name: p.nominal for name, p in parameters.items()}
    for name, sensor in machine.sensors.items():
        if sensor.of is None or sensor.reading is None or any(n not in values for n in sensor.of.names):
            continue
        path: Path = ("sensors", name)
        if any(at[:2] == path for at in slipped):
            continue
        expected = sensor.of.dimension
        sigma = sensor.sigma.get("")
        for key, quantity in (("reading", sensor.reading), ("sigma", None if sigma is None else sigma.constant)):
            if quantity is not None and quantity.dimension != expected:
                message = f"`{sensor.of.text}` is {article(expected)}, but this is {article(quantity.dimension)}"
                faults.add(source.fault("dimension", message, (*path, key), "add the unit"))
        if sigma is not None and sigma.per_length is not None and expected != LENGTH:
            message = f"`{sensor.of.text}` is {article(expected)}; its `sigma` cannot grow with length"
            faults.add(source.fault("dimension", message, (*path, "sigma"), "give a constant"))
        reach = sum(parameters[n].range for n in sensor.of.names)
        off = abs(sensor.reading.number({}) - sensor.of.number(values)) if sensor.reading.is_constant else 0.0
        if sensor.reading.dimension == expected and reach > 0 and off > _FAR * reach:
            message = f"the reading of `{sensor.of.text}` differs from nominal by {off / reach:.0f} times its range"
            faults.add(source.fault("magnitude", message, (*path, "reading"), "check the unit", warning=True))
