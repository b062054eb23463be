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

ANGLES = {
    "triglide": {"gamma": np.radians(0.02)},
    "triglide-nonredundant": {"gamma": np.radians(0.02)},
    "scissors": {"g1": 1e-4, "g2": 1e-4},
    "delta4": {f"g{i}": 1e-4 for i in DELTA4_COLUMNS},
    "gantry": {**dict.fromkeys(("al", "bl", "cl", "ar"), np.radians(0.01)), "cr": np.radians(0.002)},
}
"""Half-widths in rad of those parameters of a machine that are angles; all others but stiffnesses are lengths."""
DELTA4 = {
    **{f"R{i}": 300 * MM for i in DELTA4_COLUMNS},
    **{f"g{i}": 0.0 for i in DELTA4_COLUMNS},
    **{f"l{i}{bar}": 500 * MM for i in DELTA4_COLUMNS for bar in "ab"},
    **{f"r{i}": 60 * MM for i in DELTA4_COLUMNS},
    "k": 20 * KN_PER_MM,
}

HANGPRINTER_LINES = ("A", "B", "C", "D")
HANGPRINTER_RATIO = {"A": 20 / 255 / 2, "B": 20 / 255 / 2, "C": 20 / 255 / 2, "D": 20 / 255 / 4}
"""RotationVector of the spool per turn of the motor, over the folds of the line."""
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

UNITS = {"mm": MM, "um": 1e-6, "deg": np.pi / 180, "arcsec": np.pi / 648000, "rev": 2 * np.pi, "N": 1.0}
"""Of the files of the machines below, whose lengths are in mm unless told."""
Sigma = Mapping[str, tuple[float, str]]
"""Standard uncertainties of channels and of drives (as travel) that are not exact: a number and its unit."""

DELTA_PRINTER_TOWERS = (np.radians(210), np.radians(330), np.radians(90))
DELTA_PRINTER = {
    **scaled({"rod": 288, "radius": 136, "stop1": 0, "stop2": 0, "stop3": 0}, MM),
    "turn1": 0.0,
    "turn2": 0.0,
}
DELTA_PRINTER_UNITS = {"turn1": "deg", "turn2": "deg"}
DELTA_PRINTER_RANGES = {n: 0.5 * UNITS[DELTA_PRINTER_UNITS.get(n, "mm")] for n in DELTA_PRINTER}
DELTA_PRINTER_SIGMA: Sigma = {"probe": (0.01, "mm")}

_TURNS = ("zero1", "zero2", "elbow1", "elbow2")
FIVE_BAR = {
    **scaled({"base": 250, "crank1": 280, "crank2": 280, "rod1": 320, "rod2": 320, "ballx": 125, "bally": 380}, MM),
    **scaled(dict(zip(_TURNS, (0, 0, -90, 90), strict=True)), UNITS["deg"]),
}
FIVE_BAR_UNITS = dict.fromkeys((*_TURNS, "q1", "q2", "encoder1", "encoder2"), "deg")
FIVE_BAR_RANGES = {
    n: (2 if n.startswith("ball") else 0.5) * UNITS[FIVE_BAR_UNITS.get(n, "mm")] for n in FIVE_BAR
}  # fmt: skip
FIVE_BAR_SIGMA: Sigma = {"ballbar": (1, "um"), **dict.fromkeys(("encoder1", "encoder2", "q1", "q2"), (5, "arcsec"))}

BELT_ROUTER_BELTS = ("TL", "TR", "BL", "BR")
BELT_ROUTER_RATIO = 1 / 10
BELT_ROUTER_PULL = 60.0
"""N, of the lower belts."""
BELT_ROUTER_MASS = 8.0
BELT_ROUTER_GRAVITY = 9.4757
"""m/s^2 along -y: of a frame 15 deg off the vertical."""
BELT_ROUTER = {
    **scaled({"TLx": 0, "TLy": 2200, "TRx": 3000, "TRy": 2200, "BLx": 0, "BLy": 0, "BRx": 3000, "BRy": 0}, MM),
    **{f"zero{n}": 250 * MM for n in BELT_ROUTER_BELTS},
    "Rtop": 25 * MM,
    "Rlow": 25 * MM,
    "EA": 100e3,
}
BELT_ROUTER_UNITS = {**dict.fromkeys(BELT_ROUTER_BELTS, "rev"), "EA": "N"}
BELT_ROUTER_HELD = ("BLx", "BLy", "Rtop", "Rlow", "EA")
"""The origin (datum of the machine file), and what is not identified."""
BELT_ROUTER_RANGES = {n: (5 if n[0] == "z" else 20) * MM for n in BELT_ROUTER if n not in BELT_ROUTER_HELD}
BELT_ROUTER_SIGMA: Sigma = {"tape": (0.2, "mm"), **dict.fromkeys(BELT_ROUTER_BELTS, (0.3, "mm"))}
