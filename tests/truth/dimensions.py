"""Every number of the machines, once: parameters by the names of the machine files, and half-widths of their
planted errors. SI (m, N, rad, N/m). Triglide and Scissors: Ecorchard, Neugebauer, Maurine (2010), Tables 1
and 2.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

MM = 1e-3
KN_PER_MM = 1e6
GRAVITY = 9.81
"""m/s^2, along -z (spatial machines)."""


def scaled(values: Mapping[str, float], unit: float) -> dict[str, float]:
    """Values times a unit."""
    return {name: value * unit for name, value in values.items()}


def half_widths(nominal: Mapping[str, float], angles: Mapping[str, float] | None = None) -> dict[str, float]:
    """Half-widths: 0.1 mm for lengths, the given ones (rad) for angles, 10 % for stiffnesses (k...)."""
    given = angles or {}
    return {n: given.get(n, 0.1 * v if n.startswith("k") else 0.1 * MM) for n, v in nominal.items()}


def on_circle(radius: float, degrees: float) -> tuple[float, float]:
    """Point at a radius in mm and an angle in degrees about the origin, in m."""
    angle = np.radians(degrees)
    return float(radius * MM * np.cos(angle)), float(radius * MM * np.sin(angle))


TRIGLIDE = {
    **scaled({"l1": 300, "l2": 300, "l3": 600}, MM),
    **scaled({"xb1r": 0, "yb1r": 100, "xb2r": 0, "yb2r": 100, "xb3r": 0, "yb3r": 150, "gamma": 0}, MM),
    **scaled({"k1": 50, "k2": 50, "k3": 50}, KN_PER_MM),
}

"""Leg i: rod and both joints, k_i. The guide is turned by gamma about the origin."""

BIGLIDE = {
    **scaled({"l1": 300, "l2": 300, "xb1r": 0, "yb1r": 100, "xb2r": 0, "yb2r": 100}, MM),
    **scaled({"x8": 360, "y8": 650, "l3": 300}, MM),
    **scaled({"k1": 50, "k2": 50, "k3": 20}, KN_PER_MM),
}

"""Telescopic leg 3: length l3 + q3 from (x8, y8) to the TCP."""

SCISSORS = {
    **{f"l{i}": 950 * MM for i in range(1, 6)},
    **{f"xa{i}": 520 * MM for i in range(1, 6)},
    **{f"ya{i}": (120 if i == 5 else 280) * MM for i in range(1, 6)},
    **{f"xb{i}": 310 * MM for i in range(1, 6)},
    **{f"yb{i}": 80 * MM for i in range(1, 6)},
    "d1": 1460 * MM,
    "d2": 1460 * MM,
    "g1": 0.0,
    "g2": 0.0,
    **{f"k{i}": (250 if i == 5 else 500) * KN_PER_MM for i in range(1, 6)},
}
"""Magnitudes; the signs are in planar.py. k_i: rod i with both its joints, the only elasticity."""

DELTA4_COLUMNS = (1, 2, 3, 4)
DELTA4_COLUMN_ANGLES = {i: np.radians(90.0 * (i - 1)) for i in DELTA4_COLUMNS}
DELTA4_HALF_PAIR = 40 * MM
"""Half the tangential distance of the two bars of an arm; bar a at +, bar b at -."""
DELTA4_MASS = 2.0
"""kg, at the platform's centre."""
DELTA4 = {
    **{f"R{i}": 300 * MM for i in DELTA4_COLUMNS},
    **{f"g{i}": 0.0 for i in DELTA4_COLUMNS},
    **{f"l{i}{bar}": 500 * MM for i in DELTA4_COLUMNS for bar in "ab"},
    **{f"r{i}": 60 * MM for i in DELTA4_COLUMNS},
    "k": 20 * KN_PER_MM,
}

HANGPRINTER_LINES = ("A", "B", "C", "D")
HANGPRINTER_RATIO = {"A": 20 / 255 / 2, "B": 20 / 255 / 2, "C": 20 / 255 / 2, "D": 20 / 255 / 4}
"""Turn of the spool per turn of the motor, over the folds of the line."""
HANGPRINTER = {
    **scaled({"Ax": 0, "Ay": -1600, "Az": -115, "Bx": 1300, "By": 1230, "Bz": -160}, MM),
    **scaled({"Cx": -1400, "Cy": 740, "Cz": -150, "Dx": 0, "Dy": 0, "Dz": 2355}, MM),
    "R_low": 75 * MM,
    "R_high": 75 * MM,
    "EA": 20000.0,
    "mass": 2.0,
}
"""EA in N, mass in kg; a line's stiffness is EA over its natural length."""

HEXAPOD7_LEGS = (1, 2, 3, 4, 5, 6, 7)
HEXAPOD7_DRAWN = (0.0, 0.0, 500 * MM)
"""Drawn place of the platform's origin, not turned; the TCP."""
HEXAPOD7_LOWER = 300 * MM
HEXAPOD7_MASS = 10.0
HEXAPOD7_DIAMETERS = (30 * MM, 20 * MM)
HEXAPOD7_E = 210e9
HEXAPOD7_G = 80e9
HEXAPOD7_DENSITY = 7850.0
_BASE = [(400, -45), (400, 45), (400, 75), (400, 165), (400, 195), (400, 285), (250, 240)]
_PLATFORM = [(150, -15), (150, 15), (150, 105), (150, 135), (150, 225), (150, 255), (100, 315)]
HEXAPOD7 = {
    f"{end}{i}{axis}": value
    for i, base, platform in zip(HEXAPOD7_LEGS, _BASE, _PLATFORM, strict=True)
    for end, place in (("b", base), ("p", platform))
    for axis, value in zip("xyz", (*on_circle(*place), 0.0), strict=True)
} | {f"a{i}": 200 * MM for i in HEXAPOD7_LEGS}
