"""Which undeclared effects can be planted on a machine, and how large they usually are. SI units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .instrument_true import UNKNOWN
from .planted import KEPT, Planted
from .shop_plans import PLANS, Plan

UM = 1e-6
POSITIVE = ("backlash", "windup", "clearance", "payload")
"""Effects whose size is not negative."""
PERIOD = {"scissors": 0.02}
"""Pitch of the screws in m where it is not 10 mm."""
AXES = "xyz"


def across(plan: Plan) -> list[str]:
    """GUIDE.AXIS of every direction across a guide."""
    letters = [letter for n, letter in enumerate(AXES[: 2 if plan.planar else 3]) if n != plan.along]
    return [f"{guide}.{letter}" for guide in dict.fromkeys(plan.guide) for letter in letters]


def families(machine: str) -> list[tuple[str, str]]:
    """Every (keyword, at) that the simulator has, can be planted on a machine and changes its readings: nothing by
    forces where there are none."""
    plan = PLANS[machine]
    by_drive = ["zero", "scale", "pitch_curve", "pitch", "backlash", "unequal_backlash", "thermal_screw"]
    by_rod = ["thermal_strut", *(["ovality"] if plan.planar else [])]
    if plan.redundant:
        by_drive, by_rod = [*by_drive, "windup"], [*by_rod, "clearance", "stiffness"]
    found = [(keyword, drive) for keyword in by_drive for drive in plan.drives]
    found += [(keyword, rod) for keyword in by_rod for rod in plan.rods] + [("thermal_strut", "all")]
    found += [(keyword, place) for keyword in ("straight", "guide_angle") for place in across(plan)]
    turns = ["rz"] if plan.planar else ["rx", "ry", "rz"]
    found += [("carriage_angle", f"{carriage}.{axis}") for carriage in plan.carriage for axis in turns]
    if plan.planar:  # the frames of delta4 only turn
        found += [("thermal_foot", frame) for frame in dict.fromkeys(plan.frame)]
    found += [(keyword, plan.sensor) for keyword in ("frame", "meas_scale", "meas_shear", "drift", "tool_load")]
    found.append(("resetup", "s2"))
    if len(plan.freedoms) > 2:
        found.append(("tool", plan.sensor))
    if not plan.planar:
        found.append(("payload", plan.sensor))
    return found


def unknown_families(machine: str) -> list[tuple[str, str]]:
    """Every (keyword, at) of effects that are in no catalogue; their one value is `rms` in m."""
    plan = PLANS[machine]
    return [(keyword, plan.sensor) for keyword in UNKNOWN] + [("local_bump", place) for place in across(plan)]


def usual(plan: Plan, keyword: str) -> Mapping[str, float]:
    """Values of the usual size of a keyword on a machine."""
    axes = AXES[: 2 if plan.planar else 3]
    rigid = {f"t{axis}": 50 * UM for axis in axes}
    rigid |= {"rz": 50 * UM} if plan.planar else {f"r{axis}": 100 * UM for axis in axes}
    softest = min(v for n, v in plan.nominal.items() if n.startswith("k"))
    sizes: dict[str, Mapping[str, float]] = {
        "zero": {"o": 50 * UM},
        "scale": {"s": 50e-6},
        "pitch_curve": {f"p{k}": 10 * UM for k in range(2, 7)},
        "pitch": {"c": 6 * UM, "s": 6 * UM, "period": PERIOD.get(plan.name, 0.01)},
        "backlash": {"b": 20 * UM},
        "unequal_backlash": {"b1": 20 * UM},
        "windup": {"w": 0.2 / softest},
        "thermal_screw": {"a": 10e-6, "o": 2 * UM},
        "thermal_strut": {"a": 10e-6},
        "ovality": {"c": 5 * UM, "s": 5 * UM},
        "clearance": {"c": 20 * UM},
        "stiffness": {"k": 0.4},
        "straight": {f"n{k}": 15 * UM for k in range(2, 5)},
        "guide_angle": {"g": 100e-6},
        "carriage_angle": {"a1": 40e-6, "a2": 40e-6},
        "thermal_foot": {f"g{axis}": 5 * UM for axis in axes},
        "frame": rigid,
        "resetup": rigid,
        "tool": {f"t{axis}": 50 * UM for axis in axes},
        "meas_scale": {"s": 30e-6},
        "meas_shear": dict.fromkeys(["xy"] if plan.planar else ["xy", "xz", "yz"], 50e-6),
        "drift": {f"{axis}1": 15 * UM for axis in axes},
        "tool_load": {f"f{axis}": 300.0 for axis in axes},
        "payload": {"m": 1.0},
    }
    return sizes.get(keyword, {"rms": plan.sigma})


def unit(machine: str, keyword: str, at: str, seed: int) -> Planted:
    """An effect of usual size: its values are the usual ones times a random unit vector; one value keeps its size and
    gets a random sign, or none where the size is not negative. Enlarge it with `scaled`."""
    if (keyword, at) not in {*families(machine), *unknown_families(machine)}:
        raise KeyError(f"{machine} has no {keyword}@{at}")
    sizes = usual(PLANS[machine], keyword)
    rng = np.random.default_rng([seed, 4, *keyword.encode(), *at.encode()])
    names = [name for name in sizes if name not in KEPT]
    direction = rng.normal(size=len(names))
    direction /= np.linalg.norm(direction)
    if keyword in POSITIVE or "rms" in sizes:
        direction = np.abs(direction)
    drawn = dict(zip(names, map(float, direction), strict=True))
    return Planted(keyword, at, {name: value * drawn.get(name, 1.0) for name, value in sizes.items()})
