"""From quantities of the machine file to numbers or formulas of the engine."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.coefficients import Formula
from pkmcal_cli.mechanism.connection_points import Number


def number(quantity: Quantity | None, default: float = 0.0) -> Number:
    """A coefficient's value from one quantity: a float where it is constant."""
    if quantity is None:
        return default
    return quantity.number({}) if quantity.is_constant else Formula(quantity.names, quantity.value)


def combined(function: Callable[..., complex], *parts: Number | Quantity) -> Number:
    """function(parts) as one number: a float where all parts are constant; nan where it has no value."""
    values = [number(p) if isinstance(p, Quantity) else p for p in parts]
    names = tuple(dict.fromkeys(n for v in values if isinstance(v, Formula) for n in v.names))

    def safe(*at: complex) -> complex:
        try:
            return function(*at)
        except (ZeroDivisionError, OverflowError):
            return math.nan

    if not names:
        return float(np.real(safe(*values)))  # type: ignore[arg-type]
    return Formula(names, lambda p: safe(*(v.function(p) if isinstance(v, Formula) else v for v in values)))


def vector(parts: Sequence[Quantity]) -> tuple[Number, Number, Number]:
    """A point or vector as three numbers, missing ones zero."""
    values: list[Number] = [number(p) for p in parts]
    x, y, z = [*values, 0.0, 0.0, 0.0][:3]
    return x, y, z


def is_zero(parts: Sequence[Quantity]) -> bool:
    """Whether a vector is absent or a constant zero."""
    return all(p.is_constant and p.number({}) == 0.0 for p in parts)


def constant_vector(parts: Sequence[Quantity], nominal: dict[str, float]) -> Array:
    """A vector (3,) at nominal parameters."""
    values = [p.number(nominal) for p in parts]
    return np.array([*values, 0.0, 0.0, 0.0][:3])


def unit(v: Array) -> Array:
    """Unit vector along v."""
    return np.asarray(v / np.sqrt(v @ v))


def triad_along(x: Array, up: Array | None = None) -> Array:
    """Right-handed triad (columns) with x along `x`, z as near to `up` as possible."""
    x = unit(x)
    for candidate in (up, np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])):
        if candidate is not None:
            y = np.cross(candidate, x)
            if np.sqrt(y @ y) > 1e-6 * np.sqrt(candidate @ candidate):
                y = unit(y)
                return np.column_stack([x, y, np.cross(x, y)])
    raise ValueError("zero axis")


def triad_about(z: Array) -> Array:
    """Right-handed triad with z along `z` and x, y as near to the base axes as possible."""
    z = unit(z)
    near = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = unit(near - (near @ z) * z)
    return np.column_stack([x, np.cross(z, x), z])
