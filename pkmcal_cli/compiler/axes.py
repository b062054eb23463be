"""Axes of joints, guides and sensors: where they point at nominal, and how far parameters turn them from there.

What lies along an axis is built at nominal and carried by a frame; the turn is that frame's rotation vector.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from pkmcal_cli.base.rotation import Array, log
from pkmcal_cli.compiler.coefficient_values import combined, constant_vector, unit
from pkmcal_cli.language.fields import Letter
from pkmcal_cli.language.machine import End, Joint, axis_vector
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.coefficients import Formula
from pkmcal_cli.mechanism.connection_points import Number

Axis = Letter | tuple[Quantity, ...]
Vector = tuple[Number, Number, Number]
Tilts = tuple[Vector | None, Vector | None]
"""Tilts (rotation vectors, rad, zero at nominal) of the axes that the first and the second side of a joint carry."""
CONSTANT: Tilts = (None, None)
LETTERS: Final[tuple[Letter, Letter, Letter]] = ("x", "y", "z")
_PARALLEL = 1e-6  # sine of an angle
_KEPT = 32  # vectors: one for the values and one for each parameter that is stepped
Values = Mapping[str, complex]


def nominal_axis(axis: Axis, nominal: Mapping[str, float]) -> Array:
    """The unit vector (3,) along an axis at nominal parameters."""
    return unit(constant_vector(axis_vector(axis, 3), dict(nominal)))


def depends(axis: object) -> bool:
    """Whether parameters turn an axis."""
    return isinstance(axis, tuple) and any(part.names for part in axis)


def triad_of(axis: Axis, beside: Axis, nominal: Mapping[str, float]) -> tuple[Vector, Vector, Vector]:
    """Unit vectors along `axis`, across it in the plane of it and `beside`, and across both, right-handed."""
    parts = axis_vector(axis, 3), axis_vector(beside, 3)

    def column(k: int) -> Vector:
        return _vector(lambda values: _triad(parts, values)[:, k], parts, nominal)

    return column(0), column(1), column(2)


def tilt_of(axis: Axis, beside: Axis, nominal: Mapping[str, float]) -> Vector | None:
    """The turn of the triad of `axis` and `beside` from nominal to that of other parameters; None where constant.

    In the axes in which `axis` is given.
    """
    if not depends(axis) and not depends(beside):
        return None
    parts = axis_vector(axis, 3), axis_vector(beside, 3)
    reference = _triad(parts, nominal)
    return _vector(lambda values: log(_triad(parts, values) @ reference.T), parts, nominal)


def carried(vector: Vector, into: Array) -> Vector:
    """A vector in other axes, which are the rows of `into` (3, 3)."""
    x, y, z = (combined(lambda *v, row=row: sum(a * b for a, b in zip(row, v, strict=True)), *vector) for row in into)
    return x, y, z


def joint_tilts(joint: Joint | End, nominal: Mapping[str, float]) -> Tilts:
    """How far parameters turn the axes of a joint, base axes."""
    if joint.axes is not None:
        first, second = joint.axes
        return tilt_of(first, second, nominal), tilt_of(second, first, nominal)
    if joint.axis is None:
        return CONSTANT
    kind = joint.joint if isinstance(joint, End) else joint.type
    tilt = tilt_of(joint.axis, aligned(joint.axis, nominal, kind == "prismatic"), nominal)
    return tilt, tilt


def parallel(first: Axis, second: Axis, nominal: Mapping[str, float]) -> bool:
    """Whether two axes are one at nominal parameters."""
    across = np.cross(nominal_axis(first, nominal), nominal_axis(second, nominal))
    return bool(np.abs(across).max() < _PARALLEL)


def aligned(axis: Axis, nominal: Mapping[str, float], slides: bool) -> Letter:
    """The base axis near to which the triad about an axis is: z where something slides along it, else x, if it can."""
    along = nominal_axis(axis, nominal)
    if slides:
        return "z" if np.hypot(along[0], along[1]) > _PARALLEL else "x"
    return "x" if abs(along[0]) < 0.9 else "y"


def cosine(first: Axis, second: Axis, nominal: Mapping[str, float]) -> Number:
    """Cosine of the angle between two axes."""
    parts = axis_vector(first, 3), axis_vector(second, 3)
    names = _names(parts)

    def value(values: Values) -> complex:
        a, b = (unit(_at(part, values)) for part in parts)
        return complex(a @ b)

    return Formula(names, value) if names else value(nominal).real


class _LastVectors:
    """A vector (3,) that depends on axes, nan where one has no direction, at the values last asked for.

    Both sides of a joint need every component in their own axes: without this each is computed anew for each of them.
    """

    def __init__(self, function: Callable[[Values], Array], names: tuple[str, ...]) -> None:
        self._function, self._names = function, names
        self._last: dict[tuple[complex, ...], Array] = {}

    def at(self, values: Values) -> Array:
        """The vector at some values."""
        key = tuple(values[name] for name in self._names)
        if key not in self._last:
            if len(self._last) == _KEPT:
                del self._last[next(iter(self._last))]
            with np.errstate(all="ignore"):
                self._last[key] = self._function(values)
        return self._last[key]


def _vector(function: Callable[[Values], Array], parts: tuple[tuple[Quantity, ...], ...], nominal: Values) -> Vector:
    """The components of a vector (3,) that depends on axes, nan where one has no direction."""
    names = _names(parts)
    vectors = _LastVectors(function, names)

    def component(k: int) -> Number:
        def value(values: Values) -> complex:
            return complex(vectors.at(values)[k])

        return Formula(names, value) if names else value(nominal).real

    return component(0), component(1), component(2)


def _names(parts: tuple[tuple[Quantity, ...], ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for part in parts for quantity in part for name in quantity.names))


def _at(parts: tuple[Quantity, ...], values: Values) -> Array:
    """A vector (3,), complex where the values are."""
    return np.array([*(quantity.value(values) for quantity in parts), 0.0, 0.0, 0.0][:3])


def _triad(parts: tuple[tuple[Quantity, ...], ...], values: Values) -> Array:
    """Orthonormal columns: along the first vector, across it in the plane of both, across both; analytic."""
    axis, beside = (_at(part, values) for part in parts)
    first = unit(axis)
    second = unit(beside - (beside @ first) * first)
    return np.column_stack([first, second, np.cross(first, second)])
