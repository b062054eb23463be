"""The functions of expressions on floats and, analytically continued, on complex numbers.

A complex argument stands for a complex step: the imaginary part carries the derivative, the real
part picks the branch. Outside a function's real domain they raise ValueError; a zero division or
overflow raises as in `math`.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

Function = Callable[..., complex]


def _on_domain(
    real: Callable[[float], float],
    analytic: Callable[[complex], complex],
    inside: Callable[[float], bool] | None = None,
) -> Callable[[complex], complex]:
    def function(z: complex) -> complex:
        if isinstance(z, complex):
            if inside is not None and not inside(z.real):
                raise ValueError("outside the domain")
            return analytic(z)
        return real(z)

    return function


def absolute(z: complex) -> complex:
    """|z| by the sign of the real part."""
    return -z if z.real < 0 else z


def smallest(*values: complex) -> complex:
    """The value with the smallest real part, the first of equals."""
    return min(values, key=_real)


def largest(*values: complex) -> complex:
    """The value with the largest real part, the first of equals."""
    return max(values, key=_real)


def hypot(*values: complex) -> complex:
    """Square root of the sum of squares."""
    if not any(isinstance(z, complex) for z in values):
        return math.hypot(*(z.real for z in values))
    size = max(abs(z.real) for z in values)
    if size == 0.0:
        return sum((absolute(z) for z in values), 0j)
    return size * cmath.sqrt(sum((z / size) ** 2 for z in values))


def arctan2(y: complex, x: complex) -> complex:
    """The angle of (x, y) in (-pi, pi], by the real parts; at the origin it has no derivative, none is returned."""
    if not (isinstance(y, complex) or isinstance(x, complex)):
        return math.atan2(y, x)
    if x.real == y.real == 0.0:
        return complex(math.atan2(y.real, x.real))
    if abs(x.real) >= abs(y.real):
        base = 0.0 if x.real > 0 else math.copysign(math.pi, y.real)
        return cmath.atan(y / x) + base
    return math.copysign(math.pi / 2, y.real) - cmath.atan(x / y)


def power(base: complex, exponent: complex) -> complex:
    """base**exponent on the real branch: a negative base takes whole exponents only."""
    if not (isinstance(base, complex) or isinstance(exponent, complex)):
        return math.pow(base, exponent)
    whole = exponent.imag == 0 and exponent.real.is_integer()
    if base.real < 0 and not whole:
        raise ValueError("negative base, broken exponent")
    return complex(base) ** exponent


def divide(a: complex, b: complex) -> complex:
    """a / b; raises ZeroDivisionError for every kind of number."""
    if b == 0:
        raise ZeroDivisionError
    return a / b


def _real(z: complex) -> float:
    return z.real


FUNCTIONS: dict[str, Function] = {
    "sqrt": _on_domain(math.sqrt, cmath.sqrt, lambda x: x >= 0),
    "sin": _on_domain(math.sin, cmath.sin),
    "cos": _on_domain(math.cos, cmath.cos),
    "tan": _on_domain(math.tan, cmath.tan),
    "asin": _on_domain(math.asin, cmath.asin, lambda x: abs(x) <= 1),
    "acos": _on_domain(math.acos, cmath.acos, lambda x: abs(x) <= 1),
    "atan": _on_domain(math.atan, cmath.atan),
    "atan2": arctan2,
    "hypot": hypot,
    "abs": absolute,
    "min": smallest,
    "max": largest,
    "exp": _on_domain(math.exp, cmath.exp),
    "log": _on_domain(math.log, cmath.log, lambda x: x > 0),
}
"""The functions that an expression may call."""

ARGUMENTS = {"atan2": (2, 2), "hypot": (1, 9), "min": (1, 9), "max": (1, 9)}
"""Least and largest count of arguments where it is not exactly one."""
