"""How large and how small a number may be: squares and products of some of them must neither overflow nor vanish."""

from __future__ import annotations

SMALLEST, LARGEST = 1e-40, 1e40
"""In SI units. An atom has 1e-30 m^3, a neutron star a modulus of 1e34 Pa."""

HINT = f"check the unit; a value must be 0, or {SMALLEST:.0e} to {LARGEST:.0e} in size, in SI units"


def beyond(value: float, small: bool = True) -> str | None:
    """What is wrong with the size of a number (SI), in words; None where it can be computed with. Not for nan.

    `small`: whether it is refused near 0 too; what comes out of an expression may be 0 but for rounding.
    """
    if abs(value) > LARGEST:
        return "too large to compute with"
    if small and 0 < abs(value) < SMALLEST:
        return "too small to compute with"
    return None
