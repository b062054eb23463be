"""The two frames in OpenSees (package openseespy), the model rebuilt for every configuration; optional.

Its best case: coordinates prepared beforehand as plain lists, trusses in the plane, one transformation in space,
linear algorithm, each of its direct solvers tried and the fastest taken.
"""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array

from .beam_frame import beams_elsewhere
from .frames import LEGS, planar_points, spatial_points, spatial_sizes

SOLVERS = ("BandSPD", "ProfileSPD", "BandGeneral", "FullGeneral", "UmfPack")
Solve = Callable[[str, int], list[list[float]]]


def load() -> Any | None:
    """The module, or None where it is not installed; its wheel's own libraries are loaded first."""
    for name in ("openseespylinux", "openseespywin", "openseespymac"):
        spec = importlib.util.find_spec(name)
        for folder in (spec.submodule_search_locations or []) if spec else []:
            for pattern in ("libquadmath*", "libgfortran*", "libblas*", "liblapack*"):
                for file in sorted((Path(folder) / "lib").glob(pattern)):
                    ctypes.CDLL(str(file), ctypes.RTLD_GLOBAL)
    try:
        return importlib.import_module("openseespy.opensees")
    except (ImportError, RuntimeError):
        return None


def planar(ops: Any, count: int) -> Solve:
    """Solver of the planar frame's first configurations: displacements of T (N, 2), m."""
    feet, tops = planar_points(count)
    lengths = np.sqrt(((tops[:, None] - feet) ** 2).sum(-1))
    halves = (0.5 * 7850 * 4e-4 * 9.81 * lengths).tolist()
    places, fixed = tops.tolist(), feet.tolist()

    planar_springs = ("-mat", 1, 1, "-dir", 1, 2)

    def configuration(solver: str, row: int) -> list[float]:
        _begin(ops, 2)
        ops.uniaxialMaterial("Elastic", 1, 5e7)
        ops.uniaxialMaterial("Elastic", 2, 210e9)
        ops.node(1, *places[row])
        for k in range(3):
            ops.node(2 + k, *fixed[k])
            ops.node(5 + k, *fixed[k])
            ops.fix(5 + k, 1, 1)
            ops.element("zeroLength", 1 + k, *(5 + k, 2 + k), *planar_springs)
            ops.element("Truss", 4 + k, 2 + k, 1, 4e-4, 2)
        _load_pattern(ops)
        weights = halves[row]
        ops.load(1, 100.0, -200.0 - sum(weights))
        for k in range(3):
            ops.load(2 + k, 0.0, -weights[k])
        return _solve(ops, solver)

    return lambda solver, rows: [configuration(solver, row) for row in range(rows)]


def spatial(ops: Any, count: int) -> Solve:
    """Solver of the spatial frame's first configurations: displacements of T (N, 6), m and rad."""
    feet, platform, centre = spatial_points()
    points = np.vstack([centre, platform, feet])  # T, P1 ... P6, B1 ... B6
    scaled = (spatial_sizes(count)[:, None, None] * points).tolist()
    halves = _half_weights(points, spatial_sizes(count)).tolist()
    members = [(1 + i, 7 + i, 1) for i in LEGS] + [(1, 1 + i, 2) for i in LEGS]

    spatial_springs = ("-mat", 1, 1, 1, 2, 2, 2, "-dir", 1, 2, 3, 4, 5, 6)

    def configuration(solver: str, row: int) -> list[float]:
        _begin(ops, 3)
        for number, place in enumerate(scaled[row], start=1):
            ops.node(number, *place)
        ops.uniaxialMaterial("Elastic", 1, 5e7)
        ops.uniaxialMaterial("Elastic", 2, 1000.0)
        ops.geomTransf("Linear", 1, 0.31, 0.52, 0.79)
        for section, a in ((1, 0.02), (2, 0.04)):
            bending = (a**4 / 12, a**4 / 12)
            torsion = (210e9 / 2.6, 0.1406 * a**4)
            ops.section("Elastic", section, 210e9, a * a, *bending, *torsion)
        for tag, (start, end, section) in enumerate(members, start=1):
            ops.element("elasticBeamColumn", tag, start, end, section, 1)
        for k, place in enumerate(scaled[row][7:]):
            ops.node(20 + k, *place)
            ops.fix(20 + k, *[1] * 6)
            ops.element("zeroLength", 20 + k, *(20 + k, 8 + k), *spatial_springs)
        _load_pattern(ops)
        for number, weight in enumerate(halves[row], start=1):
            force, moment = (0.0, 0.0, -weight), (0.0, 0.0, 0.0)
            if number == 1:
                force, moment = (100.0, -200.0, -300.0 - weight), (10.0, -20.0, 30.0)
            ops.load(number, *force, *moment)
        return _solve(ops, solver)

    return lambda solver, rows: [configuration(solver, row) for row in range(rows)]


def beams(ops: Any, count: int) -> Solve:
    """Solver of the planar frame of beams: displacements of T (N, 3), m and rad."""
    return beams_elsewhere(ops, count, _solve)


def _half_weights(points: Array, sizes: Array) -> Array:
    """Weight on each node (N, 13), N: half of each member's at either end."""
    out = np.zeros(13)
    for i in LEGS:
        for start, end, a in ((6 + i, i, 0.02), (0, i, 0.04)):
            length = float(np.sqrt(((points[start] - points[end]) ** 2).sum()))
            out[[start, end]] += 0.5 * 7850 * a * a * 9.81 * length
    return sizes[:, None] * out


def _begin(ops: Any, dimensions: int) -> None:
    ops.wipe()
    ops.model("basic", "-ndm", dimensions, "-ndf", {2: 2, 3: 6}[dimensions])


def _load_pattern(ops: Any) -> None:
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)


def _solve(ops: Any, solver: str) -> list[float]:
    ops.constraints("Plain")
    ops.numberer("Plain" if solver == "FullGeneral" else "RCM")
    ops.system(solver)
    ops.algorithm("Linear")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static", "-noWarnings")
    if ops.analyze(1) != 0:
        raise RuntimeError(f"no solution with {solver}")
    return list(ops.nodeDisp(1))
