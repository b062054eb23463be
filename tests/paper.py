"""The numbers of Ecorchard, Neugebauer, Maurine (2010) that need no calibration, measured with the engine."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.prediction import Request
from tests.support import UM, at, model, truth

COMMON = ("l1", "l2", "xb1r", "yb1r", "xb2r", "yb2r")
"""Parameters of both Triglides."""
NINE = ("g1", "g2", "xa1", "l3", "xa2", "ya1", "l4", "ya2", "ya4")
"""Parameters that the paper identified on the Scissors."""
RATIOS = {"l1": 1.10, "l2": 1.39, "xb1r": 1.05, "yb1r": 1.19, "xb2r": 1.30, "yb2r": 1.58}
"""Sensitivities of the common parameters, non-redundant over redundant Triglide."""
LENGTH, ANGLE, GAMMA, STIFFNESS = 1e-4, 1e-4, np.radians(1.0), 1e6
"""Ranges: 0.1 mm; 1e-4 rad; 1 deg; 1000 N/mm, SI."""


def grid(x: tuple[float, float, int], y: tuple[float, float, int]) -> Array:
    """Poses (N, 2) in m of a grid in mm with its end points, y fastest."""
    return np.array([[a, b] for a in np.linspace(*x) for b in np.linspace(*y)]) * 1e-3


TRIGLIDE_GRID = grid((0, 950, 3), (160, 390, 77))
SCISSORS_GRID = grid((-203, 203, 10), (-200, 200, 8))


def scaled_jacobian(name: str, poses: Array, ranges: dict[str, float], offsets: Sequence[float] = ()) -> Array:
    """Js of eq. 21, (N, 2, P), at the set values of the nominal machine plus `offsets` (m) on the drives."""
    readings = truth(name).inverse(poses)
    readings = readings + (np.array(offsets) if len(offsets) else 0.0)
    jacobian = at(model(name), readings, Request(parameters=tuple(ranges))).jacobian
    return np.asarray(jacobian * np.array(list(ranges.values())))


def condition(name: str, poses: Array, ranges: dict[str, float]) -> float:
    """Condition number of the stacked Js."""
    jacobian = scaled_jacobian(name, poses, ranges)
    return float(np.linalg.cond(jacobian.reshape(-1, jacobian.shape[-1])))


def sensitivity(jacobian: Array) -> Array:
    """Eq. 22 and 23: mean over the poses of the norm of the position rows, (P,), in m per range."""
    out: Array = np.sqrt((jacobian**2).sum(1)).mean(0)
    return out


def triglide_conditions() -> tuple[float, float]:
    """Non-redundant Triglide on the 3 x 77 grid, without and with gamma."""
    ranges = dict.fromkeys(COMMON, LENGTH)
    name = "triglide-nonredundant"
    return condition(name, TRIGLIDE_GRID, ranges), condition(name, TRIGLIDE_GRID, {**ranges, "gamma": GAMMA})


def triglide_ratios() -> dict[str, float]:
    """How much more influence a parameter has without the redundant leg; equal axial stiffness of all legs."""
    ranges = dict.fromkeys(COMMON, LENGTH)
    without, with_leg = (
        sensitivity(scaled_jacobian(n, TRIGLIDE_GRID, ranges)) for n in ("triglide-nonredundant", "triglide")
    )
    return dict(zip(COMMON, (without / with_leg).tolist(), strict=True))


def triglide_stiffness(offset: float) -> dict[str, float]:
    """Largest influence of k1 to k3 over the grid in um per range, with `offset` (m) on the redundant drive."""
    ranges = dict.fromkeys(("k1", "k2", "k3"), STIFFNESS)
    jacobian = scaled_jacobian("triglide", TRIGLIDE_GRID, ranges, (0.0, 0.0, offset))
    return dict(zip(ranges, (np.abs(jacobian).max((0, 1)) / UM).tolist(), strict=True))


def triglide_gamma(x: float = 0.3, y: float = 0.275) -> float:
    """Way of the TCP in mm for 1 deg of gamma, first order, at a place (m)."""
    return float(sensitivity(scaled_jacobian("triglide", np.array([[x, y]]), {"gamma": GAMMA}))[0] * 1e3)


def scissors_condition() -> float:
    """The paper's nine parameters, 80 points, x and y measured."""
    ranges = {name: ANGLE if name in ("g1", "g2") else LENGTH for name in NINE}
    return condition("scissors", SCISSORS_GRID, ranges)


@cache
def scissors_shifts() -> dict[str, tuple[float, float, float]]:
    """Figure 17: shift in x (um), mean over an x-movement of +-200 mm, for 30 um (1e-5 rad) on each parameter.

    Elastic model (`exact`), rigid model, independent simulator.
    """
    machine, simulator = model("scissors"), truth("scissors")
    readings = simulator.inverse([[x, 0.0] for x in np.linspace(-0.2, 0.2, 9)])
    rigid = Request(method="rigid")
    start = (at(machine, readings).values, at(machine, readings, rigid).values, simulator.forward(readings).tcp)
    out = {}
    for name, value in machine.by_name(machine.nominal).items():
        if name.startswith("k"):
            continue
        moved = {name: value + (1e-5 if name.startswith("g") else 30 * UM)}
        after = (
            at(machine, readings, None, **moved).values,
            at(machine, readings, rigid, **moved).values,
            simulator.forward(readings, moved).tcp,
        )
        elastic, stiff, true = ((b[:, 0] - a[:, 0]).mean() / UM for a, b in zip(start, after, strict=True))
        out[name] = (float(elastic), float(stiff), float(true))
    return out


def scissors_deviations() -> tuple[float, float]:
    """Mean over the parameters of |model - truth| / |truth| of figure 17's shifts: elastic, rigid."""
    shifts = np.array(list(scissors_shifts().values()))
    elastic, rigid, true = shifts.T
    return float(np.mean(np.abs(elastic / true - 1))), float(np.mean(np.abs(rigid / true - 1)))


def scissors_stiffness() -> dict[str, float]:
    """Figure 18: q1 - 50 um, q4 + 50 um, 10 kN/mm more on each rod; largest shift (um) over the x-movement."""
    machine = model("scissors")
    readings = truth("scissors").inverse([[x, 0.0] for x in np.linspace(-0.2, 0.2, 9)])
    readings = readings + np.array([-50, 0, 0, 50]) * UM
    start, nominal = at(machine, readings).values, machine.by_name(machine.nominal)
    return {
        f"k{i}": float(
            np.abs(at(machine, readings, None, **{f"k{i}": nominal[f"k{i}"] + 1e7}).values - start).max() / UM
        )
        for i in range(1, 6)
    }
