"""Parameters of a machine file as the model has them."""

from __future__ import annotations

import math

from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.model.parts import ModelParameter

_ZERO = "zero"


def model_parameters(machine: Machine) -> tuple[ModelParameter, ...]:
    """All declared parameters, SI."""
    zeros = _zeros(machine)
    return tuple(
        ModelParameter(
            name=name,
            nominal=p.nominal,
            range=p.range,
            bounds=p.bounds if p.bounds is not None else (-math.inf, math.inf),
            unit=p.unit,
            dimension=p.dimension.name,
            identify=p.identify and not p.fixed,
            per_session=p.per == "session",
            kind=_ZERO if name in zeros else p.dimension.name,
            fixed=p.fixed,
        )
        for name, p in machine.parameters.items()
    )


def _zeros(machine: Machine) -> set[str]:
    """Parameters by which the zeros of drives and instruments are given."""
    zeros = [part.zero for parts in (machine.actuators, machine.sensors) for part in parts.values()]
    return {name for zero in zeros if isinstance(zero, Quantity) for name in zero.names}
