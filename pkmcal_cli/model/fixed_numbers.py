"""Numbers of a machine file that place points and parts, and that no parameter changes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.model.model import Model
from pkmcal_cli.model.parts import ModelParameter

_ELONGATION, _WHOLE = ".rest.elongation", 2  # dots of a member that is one element: others are parts of one
_ADDED = (".error.", ".tangent.")  # of what effects move, and directions: no numbers of the file
_OF_PARTS = (".at.", ".turn.")  # of frames and guides: zero where the file says nothing
_ALIKE = 1e-9  # m or rad: the same number, at several places


@dataclass(frozen=True, kw_only=True)
class FixedNumber:
    """A number (m, rad) and the places that have it, which are shifted together: `coefficients`, with signs."""

    places: tuple[str, ...]
    value: float
    angle: bool
    coefficients: tuple[tuple[int, float], ...]

    @property
    def name(self) -> str:
        """The name of the parameter that shifts it: places may have one name, as a frame and a guide in it."""
        return f"number {', '.join(str(k) for k, _ in self.coefficients)}"

    def freed(self, model: Model) -> Model:
        """The model with a parameter of any size that shifts it."""
        size, dimension = (1.0, "angle") if self.angle else (model.length, "length")
        shift = ModelParameter(
            name=self.name, nominal=0.0, range=size, bounds=(-np.inf, np.inf), unit="", dimension=dimension,
            identify=False, kind=dimension, stated=False,
        )  # fmt: skip
        table = model.topology.coefficients.shifted(self.name, self.coefficients)
        topology = replace(model.topology, coefficients=table)
        return replace(model, topology=topology, parameters=(*model.parameters, shift))


def fixed_numbers(model: Model) -> tuple[FixedNumber, ...]:
    """Coordinates of points, places of frames and guides, lengths of members; those of one size, together too."""
    table = model.topology.coefficients
    single = [
        FixedNumber(
            places=(table.labels[k].replace(_ELONGATION, ".length"),),
            value=float(table.constants[k]),
            angle=".turn." in table.labels[k],
            coefficients=((k, 1.0),),
        )
        for k in sorted(set(_constants(model)))
    ]
    alike: dict[tuple[bool, int], list[FixedNumber]] = {}
    for number in single:
        if abs(number.value) > _ALIKE:
            alike.setdefault((number.angle, round(abs(number.value) / _ALIKE)), []).append(number)
    return (*single, *(_together(numbers) for numbers in alike.values() if len(numbers) > 1))


def _together(numbers: list[FixedNumber]) -> FixedNumber:
    """Numbers of one size, with the signs that they have."""
    coefficients = tuple((k, float(np.sign(n.value))) for n in numbers for k, _ in n.coefficients)
    places = tuple(p for n in numbers for p in n.places)
    return FixedNumber(
        places=places, value=abs(numbers[0].value), angle=numbers[0].angle, coefficients=coefficients
    )


def _constants(model: Model) -> Iterator[int]:
    """Coefficients that the file gives as numbers."""
    topology = model.topology
    table, changed = topology.coefficients, {k for k, _ in topology.coefficients.formulas}
    driven = {d.coefficient for d in topology.drives}
    used = topology.offset_vectors.offset[topology.offset_vectors.offset > 0]  # 0 pads
    vectors = topology.offset_vectors.offset_coefficients[np.unique(used)]
    rest = (k for g in topology.groups for k in range(g.rest.start, g.rest.stop))
    lengths = (k for k in rest if table.labels[k].endswith(_ELONGATION) and table.labels[k].count(".") == _WHOLE)
    for k in map(int, (*vectors.ravel(), *topology.rotations.coefficients.ravel(), *lengths)):
        label = table.labels[k]
        if k < 0 or k in changed or k in driven or any(text in label for text in _ADDED):
            continue
        if table.constants[k] != 0 or not any(text in label for text in _OF_PARTS):
            yield k
