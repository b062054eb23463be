"""Two frames that other programs solve too (tests/fe_reference.json), as machines without drives, in N configurations.

The planar one: three pinned rods on radial springs, 8 unknowns; T moves, so every length differs. The spatial one: a
welded Gough-Stewart frame on springs, 78 unknowns, in N sizes. Each configuration has stiffnesses of its own.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.kinematics import State, place_prescribed, reference_state
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model

REFERENCE: dict[str, Any] = json.loads(
    (Path(__file__).resolve().parents[1] / "tests" / "fe_reference.json").read_text(encoding="utf-8")
)
LEGS = range(1, 7)


@dataclass(frozen=True)
class Frame:
    """A frame in N configurations: coefficients (N, S), states, the coordinates of T's displacement among the
    unknowns.
    """

    model: Model
    coefficients: Array
    state: State
    read: tuple[int, ...]

    def displacement(self, rows: slice) -> Array:
        """Displacement of T, m and rad: one step as a calibration takes it, with geometric stiffness."""
        return elastic_step(self.model.exact, self.coefficients[rows], self.state.take(rows))[:, self.read]


def elastic_step(system: System, coefficients: Array, state: State, curved: bool = True) -> Array:
    """Step of all unknowns (N, n + c): assembly and solution at a known pose, with the stress term or without."""
    now = balance(system, coefficients, state, typical_stiffness(system, coefficients), curved=curved)
    assert now.tangent is not None
    return -now.tangent.solve(now.residual[..., None])[..., 0]


def equations(system: System, coefficients: Array, state: State) -> tuple[Array, Array]:
    """Matrices and right sides of the same step."""
    now = balance(system, coefficients, state, typical_stiffness(system, coefficients))
    assert now.tangent is not None
    return np.ascontiguousarray(now.tangent.dense()), now.residual[..., None]


PLANAR = """
units: {length: mm, angle: deg, force: N}
space: planar
gravity: [0, -9.81]
parameters:
  "l{i}": {each: {i: [1, 2, 3], l: [300, 300, 600]}, nominal: "{l}", range: 1}
  "m{i}": {each: {i: [1, 2, 3], m: [0.942, 0.942, 1.884]}, nominal: "{m}", range: 0.01, unit: kg}
ground: {B1: [100, 125], B2: [100, 425], B3: [150, 275 + sqrt(600**2 - (359.8076211353316 - 150)**2)]}
nodes:
  T: [359.8076211353316, 275]
  E1: [100, 125]
  E2: [100, 425]
  E3: [150, 275 + sqrt(600**2 - (359.8076211353316 - 150)**2)]
bars:
  "rod{i}": {each: {i: [1, 2, 3]}, between: ["E{i}", T], length: "l{i}", EA: 210000*400, mass: "m{i}"}
joints:
  "spring{i}": {each: {i: [1, 2, 3]}, between: ["B{i}", "E{i}"], type: revolute, stiffness: 50000}
loads: {push: {at: T, force: [100, -200]}}
"""


def compiled(text: str) -> Model:
    """The model of a machine in YAML."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frame.yaml"
        file.write_text(text, encoding="utf-8")
        return compile_machine(read_machine(file)).model


def planar_points(count: int) -> tuple[Array, Array]:
    """Feet (3, 2) and positions of T (N, 2), m, the reference first."""
    given = REFERENCE["planar_three_rods"]["inputs"]
    centre, reach = np.array(given["T"]), given["lengths_mm"][2]
    feet = np.array([given["B1"], given["B2"], [150.0, 275.0 + np.sqrt(reach**2 - (centre[0] - 150.0) ** 2)]])
    away = np.random.default_rng(0).uniform(-60.0, 60.0, (count, 2))
    away[0] = 0.0
    return 1e-3 * feet, 1e-3 * (centre + away)


def planar_frame(count: int) -> Frame:
    """The planar frame, T at `count` places."""
    model = compiled(PLANAR)
    feet, tops = planar_points(count)
    lengths = np.sqrt(((tops[:, None] - feet) ** 2).sum(-1))
    names = model.topology.translation_names
    coefficients = coefficients_at(model, np.hstack([lengths, 7850.0 * 4e-4 * lengths]))
    state = unloaded(model, coefficients, count)
    for axis, name in enumerate(("T.x", "T.y")):
        state.translation[:, names.index(name)] = tops[:, axis]
    read = tuple(int(model.exact.unknown_of[names.index(name)]) for name in ("T.x", "T.y"))
    return Frame(model, coefficients, state, read)


def spatial_points() -> tuple[Array, Array, Array]:
    """Feet (6, 3), platform points (6, 3) and T (3,), m."""
    given = REFERENCE["spatial_gough_stewart"]["inputs"]
    centre, turn = (np.array(given["pose"][key]) for key in ("position", "rotation_vector"))
    base, top = given["base"], given["platform"]
    platform = centre + _circle(top["radius"], top["angles_deg"]) @ exp(turn).T
    return 1e-3 * _circle(base["radius"], base["angles_deg"]), 1e-3 * platform, 1e-3 * centre


def spatial_sizes(count: int) -> Array:
    """Sizes (N,) of the spatial frame, the reference first."""
    sizes = np.random.default_rng(0).uniform(0.8, 1.25, count)
    sizes[0] = 1.0
    return sizes


def spatial_frame(count: int) -> Frame:
    """The spatial frame in `count` sizes."""
    model = compiled(_spatial_text())
    sizes = spatial_sizes(count)
    coefficients = coefficients_at(model, sizes[:, None])
    state = unloaded(model, coefficients, count)
    state.translation[:] = sizes[:, None] * model.topology.translation_reference
    first = model.topology.translation_names.index("T.x")
    turn = int(model.topology.rotation_dofs[model.topology.rotations.names.index("T")])
    dofs = (first, first + 1, first + 2, turn, turn + 1, turn + 2)
    return Frame(model, coefficients, state, tuple(int(model.exact.unknown_of[dof]) for dof in dofs))


def coefficients_at(model: Model, values: Array) -> Array:
    """Coefficients (N, S) at parameter values (N, P)."""
    return np.asfortranarray([model.topology.coefficients.values(model.by_name(row)) for row in values])


def unloaded(model: Model, coefficients: Array, count: int) -> State:
    """The reference configuration without stress, `count` rows."""
    system = model.exact
    state = reference_state(model.topology, coefficients, count, system.constraints)
    return place_prescribed(model.topology, coefficients, state, free=system.free)


def _circle(radius: float, degrees: Sequence[float]) -> Array:
    angle = np.radians(degrees)
    return radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])


def _spatial_text() -> str:
    feet, platform, centre = spatial_points()
    rods, arms = (np.sqrt(((platform - other) ** 2).sum(1)) for other in (feet, centre))

    def place(point: Array, factor: str = "") -> str:
        return "[" + ", ".join(f'"{factor}{float(v)!r}"' if factor else repr(float(v)) for v in point) + "]"

    lines = [
        "units: {length: m, angle: rad, force: N}",
        "space: spatial",
        "gravity: [0, 0, -9.81]",
        "parameters: {s: {nominal: 1, range: 0.1}}",
        "ground: {" + ", ".join(f"B{i}: {place(feet[i - 1], 's*')}" for i in LEGS) + "}",
        "nodes:",
        f"  T: {place(centre)}",
        *(f"  P{i}: {place(platform[i - 1])}" for i in LEGS),
        *(f"  E{i}: {place(feet[i - 1])}" for i in LEGS),
        "materials: {steel: {E: 210 GPa, nu: 0.3, density: 7850 kg/m^3}}",
        "sections:",
        *(
            f"  {name}: {{area: {a}**2, Iy: {a}**4/12, Iz: {a}**4/12, J: 0.1406*{a}**4}}"
            for name, a in (("thin", 0.02), ("thick", 0.04))
        ),
        "beams:",
    ]
    for i in LEGS:
        for name, start, section, length in (("rod", f"E{i}", "thin", rods), ("arm", "T", "thick", arms)):
            natural = f'"s*{float(length[i - 1])!r}"'
            lines.append(
                f"  {name}{i}: {{between: [{start}, P{i}], length: {natural}, section: {section}, material: steel}}"
            )
    lines.append("joints:")
    for i in LEGS:
        springs = "{radial: 5e7, rx: 1000, ry: 1000, rz: 1000}"
        lines.append(f"  foot{i}: {{between: [B{i}, E{i}], type: fixed, stiffness: {springs}}}")
    lines.append("loads: {push: {at: T, force: [100, -200, -300], moment: [10, -20, 30]}}")
    return "\n".join(lines)
