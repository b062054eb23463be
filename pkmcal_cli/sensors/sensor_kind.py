"""What a sensor is: its observation equation, and the variables of the machine that the equation depends on.

A sensor is data: the keys of its entry in the machine file, the variables of its observation equation, and the
equation itself, analytic in them, so that derivatives come from complex steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

from pkmcal_cli.units.measurands import Measurand

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[Any]

Variable = Literal[
    "place",  # of the point that it sees, base axes, m
    "other",  # of the other point; of the same point in the other row where the sensor joins two rows, m
    "rotation",  # rotation vector of the body that the point belongs to, against the reference configuration, rad
    "force",  # of a drive, N or N m
    "frame",  # origin (m) and rotation vector (rad) of a frame of the machine file
    "motion",  # translation (m), rotation (rad), scale and shear of the instrument's own frame; absent: none
    "reading_error",  # shift and relative scale of the number that is read; absent: none
    "basis",  # two unit vectors across an axis: where angles begin, and where they go
    "zero",  # what is to be read at reading zero
    "scale",  # what is to be read per unit of the reading
    "value",  # of an expression of the machine file
]
WIDTHS: dict[Variable, int] = {
    "place": 3, "other": 3, "rotation": 3, "force": 1, "frame": 6, "motion": 10, "reading_error": 2, "basis": 6,
    "zero": 1, "scale": 1, "value": 1,
}  # fmt: skip
"""Numbers of each; places have three in the plane too."""

ObservationEquation = Callable[[Mapping[Any, Any]], Sequence[Any]]
"""From its variables, arrays (N, width) by name, to readings (N,) in the order of `channels`."""


@dataclass(frozen=True, kw_only=True)
class SensorKind:
    """A kind of instrument. `needs` and `may`: keys of its entry besides `kind`, `sigma` and `sigma_is`.

    `channels`: what it can read, by name; one that has no names reads one number. `normal`: what is read in space and
    in the plane when the entry does not say. `joins`: whether it joins two rows of the table. `rotates`: whether all of
    its readings depend on the rotation of the body that it is at. `unmoved`: why effects on what sensors read have no
    place at it, by their keyword.
    """

    keyword: str
    title: str
    instruments: str
    needs: tuple[str, ...]
    may: tuple[str, ...]
    variables: tuple[Variable, ...]
    measurand: Measurand
    equation: ObservationEquation
    channels: tuple[str, ...] = ("",)
    normal: tuple[str, str] = ("", "")
    joins: bool = False
    rotates: bool = False
    unmoved: Mapping[str, str] = field(default_factory=dict)

    @property
    def sees_tool(self) -> bool:
        """Whether its point is the tool: the first such point is the TCP."""
        return "place" in self.variables and "basis" not in self.variables

    @property
    def reads_coordinates(self) -> bool:
        """Whether its channels are coordinates of a point or body, each with a column of its own."""
        return self.measurand is Measurand.POSITION

    @property
    def keys(self) -> tuple[str, ...]:
        """All keys that its entry can have besides `kind`."""
        return (*self.needs, "sigma", "sigma_is", *self.may)


def read(kind: SensorKind, seen: Mapping[Any, Array]) -> Array:
    """Readings (N, channels) at values of the variables: arrays (N, width) by name, real or complex."""
    import numpy as np  # imported late: reading a machine file does not need it

    return np.stack([np.asarray(part) for part in kind.equation(seen)], axis=1)


def as_read(measured: Any, seen: Mapping[Any, Any]) -> Any:
    """The reading (N,) of what is measured (N,): measured = zero + scale * reading, but for errors of the reading."""
    reading = (measured - seen["zero"][:, 0]) / seen["scale"][:, 0]
    if "reading_error" not in seen:
        return reading
    error = seen["reading_error"]
    return (1.0 + error[:, 1]) * reading + error[:, 0]


_STEP = 1e-40


def derivatives(kind: SensorKind, seen: Mapping[Any, Array], by: Sequence[Variable]) -> dict[Variable, Array]:
    """Derivatives (N, channels, width) of the readings by some of the variables."""
    import numpy as np

    out, rows = {}, len(next(iter(seen.values())))
    for name in by:  # all steps of a variable in one call, one after the other: a call has its price
        width = seen[name].shape[1]
        stepped = {other: np.tile(x, (width, 1)) for other, x in seen.items()}
        stepped[name] = stepped[name].astype(complex)
        stepped[name][np.arange(width * rows), np.repeat(np.arange(width), rows)] += 1j * _STEP
        slopes = np.imag(read(kind, stepped)) / _STEP
        out[name] = slopes.reshape(width, rows, slopes.shape[1]).transpose(1, 2, 0)
    return out
