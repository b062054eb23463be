"""A planar frame of three welded beams on springs and a node on two pinned bars: 14 unknowns, in N sizes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array

from .frames import Frame, coefficients_at, compiled, spatial_sizes, unloaded

_POINTS = {
    "B1": (0.1, 0.125), "B2": (0.1, 0.425), "B3": (0.55, 0.9), "T": (0.36, 0.275), "Q": (0.2, 0.8),
}  # fmt: skip
_AREA, _SIDE, _TIE = 4e-4, 0.02, 2e7  # m^2, m, N
_TIES = ("E2", "E3")


def _place(name: str) -> Array:
    return np.array(_POINTS[name.replace("E", "B")])


def _length(start: str, end: str) -> str:
    return f'"s*{float(np.linalg.norm(_place(end) - _place(start)))!r}"'


def _text() -> str:
    def point(name: str, factor: str = "") -> str:
        return "[" + ", ".join(f'"{factor}{v!r}"' if factor else repr(v) for v in _place(name).tolist()) + "]"

    lines = [
        "units: {length: m, angle: rad, force: N}",
        "space: planar",
        "parameters: {s: {nominal: 1, range: 0.1}}",
        "ground: {" + ", ".join(f"B{i}: {point(f'B{i}', 's*')}" for i in (1, 2, 3)) + "}",
        "nodes:",
        *(f"  {name}: {point(name)}" for name in ("T", "E1", "E2", "E3", "Q")),
        "materials: {steel: {E: 210 GPa, nu: 0.3, density: 7850 kg/m^3}}",
        f"sections: {{bar: {{area: {_AREA}, Iz: {_SIDE}**4/12}}}}",
        "beams:",
        *(
            f"  rod{i}: {{between: [E{i}, T], length: {_length(f'E{i}', 'T')}, section: bar, material: steel}}"
            for i in (1, 2, 3)
        ),
        "bars:",
        *(f"  tie{e}: {{between: [{e}, Q], length: {_length(e, 'Q')}, EA: {_TIE}}}" for e in _TIES),
        "joints:",
        *(
            f"  foot{i}: {{between: [B{i}, E{i}], type: fixed, stiffness: {{radial: 5e7, rz: 1000}}}}"
            for i in (1, 2, 3)
        ),
        "loads: {push: {at: T, force: [100, -200], moment: 10}, pull: {at: Q, force: [50, -20]}}",
    ]
    return "\n".join(lines)


def beam_frame(count: int) -> Frame:
    """The frame in `count` sizes."""
    model = compiled(_text())
    sizes = spatial_sizes(count)
    coefficients = coefficients_at(model, sizes[:, None])
    state = unloaded(model, coefficients, count)
    state.translation[:] = sizes[:, None] * model.topology.translation_reference
    names = model.topology.translation_names
    dofs = (names.index("T.x"), names.index("T.y"), _rotation(model.topology))
    return Frame(model, coefficients, state, tuple(int(model.exact.unknown_of[dof]) for dof in dofs))


def _rotation(topology: Any) -> int:
    return int(topology.rotation_dofs[topology.rotations.names.index("T")])


def beams_elsewhere(
    ops: Any, count: int, solve: Callable[[Any, str], list[float]]
) -> Callable[[str, int], list[list[float]]]:
    """The same in OpenSees: displacements of T (N, 3), m and rad."""
    order = ("T", "E1", "E2", "E3", "B1", "B2", "B3", "Q")
    places = (spatial_sizes(count)[:, None, None] * np.array([_place(name) for name in order])).tolist()

    section, springs = (_AREA, 210e9, _SIDE**4 / 12), ("-mat", 1, 1, 2, "-dir", 1, 2, 6)

    def configuration(solver: str, row: int) -> list[float]:
        ops.wipe()
        ops.model("basic", "-ndm", 2, "-ndf", 3)
        for number, place in enumerate(places[row], start=1):
            ops.node(number, *place)
        ops.uniaxialMaterial("Elastic", 1, 5e7)
        ops.uniaxialMaterial("Elastic", 2, 1000.0)
        ops.uniaxialMaterial("Elastic", 3, _TIE)
        ops.geomTransf("Linear", 1)
        for k in range(3):
            ops.element("elasticBeamColumn", 1 + k, 2 + k, 1, *section, 1)
            ops.fix(5 + k, 1, 1, 1)
            ops.element("zeroLength", 4 + k, 5 + k, 2 + k, *springs)
        ops.fix(8, 0, 0, 1)
        for k, name in enumerate(_TIES):
            ops.element("Truss", 7 + k, order.index(name) + 1, 8, 1.0, 3)
        ops.timeSeries("Linear", 1)
        ops.pattern("Plain", 1, 1)
        ops.load(1, 100.0, -200.0, 10.0)
        ops.load(8, 50.0, -20.0, 0.0)
        return solve(ops, solver)

    return lambda solver, rows: [configuration(solver, row) for row in range(rows)]
