"""Structures and machines in YAML for the tests: frames of other programs, cantilevers, machines of every kind."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pkmcal_cli.base.rotation import Array, exp

REFERENCE: dict[str, Any] = json.loads((Path(__file__).parent / "fe_reference.json").read_text(encoding="utf-8"))

PLANAR_FRAME = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    gravity: [0, -9.81]
    ground:
      B1: [100, 125]
      B2: [100, 425]
      B3: [150, 275 + sqrt(600**2 - (359.8076211353316 - 150)**2)]
    nodes: {T: [359.8076211353316, 275], E1: [100, 125], E2: [100, 425], E3: [150, 837]}
    materials: {steel: {E: 210000, density: 7.85e-6}}
    sections: {square: {area: 20*20, Iz: 20**4/12}}
    beams:
      "rod{i}": {each: {i: [1, 2, 3], l: [300, 300, 600]}, between: ["E{i}", T], ends: [fixed, revolute],
                 length: "{l}", section: square, material: steel}
    joints:
      "spring{i}": {each: {i: [1, 2, 3]}, between: ["B{i}", "E{i}"], type: revolute, stiffness: 50000}
    loads: {push: {at: T, force: [100, -200]}}
    sensors: {probe: {kind: tcp, at: T, reads: [x, y], sigma: 1 um, frame: machine}}
    """


def point(values: Sequence[float] | Array) -> str:
    """A point or vector as YAML."""
    return "[" + ", ".join(repr(float(v)) for v in values) + "]"


def spatial_frame() -> str:
    """The welded Gough-Stewart frame of fe_reference.json."""
    given = REFERENCE["spatial_gough_stewart"]["inputs"]

    def circle(radius: float, degrees: Sequence[float]) -> Array:
        angle = np.radians(degrees)
        return radius * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])

    centre, turn = (np.array(given["pose"][key]) for key in ("position", "rotation_vector"))
    base = circle(given["base"]["radius"], given["base"]["angles_deg"])
    top = centre + circle(given["platform"]["radius"], given["platform"]["angles_deg"]) @ exp(turn).T
    legs = range(1, 7)
    lines = [
        "units: {length: mm, angle: rad, force: N}",
        "space: spatial",
        "gravity: [0, 0, -9.81]",
        "ground: {" + ", ".join(f"B{i}: {point(base[i - 1])}" for i in legs) + "}",
        "nodes:",
        f"  T: {point(centre)}",
        *(f"  P{i}: {point(top[i - 1])}" for i in legs),
        *(f"  E{i}: {point(base[i - 1])}" for i in legs),
        "materials: {steel: {E: 210000, nu: 0.3, density: 7.85e-6}}",
        "sections:",
        *(
            f"  {name}: {{area: {a}**2, Iy: {a}**4/12, Iz: {a}**4/12, J: 0.1406*{a}**4}}"
            for name, a in (("thin", 20), ("thick", 40))
        ),
        "beams:",
        '  "rod{i}": {each: {i: [1, 2, 3, 4, 5, 6]}, between: ["E{i}", "P{i}"], section: thin, material: steel}',
        '  "arm{i}": {each: {i: [1, 2, 3, 4, 5, 6]}, between: [T, "P{i}"], section: thick, material: steel}',
        "joints:",
        '  "foot{i}": {each: {i: [1, 2, 3, 4, 5, 6]}, between: ["B{i}", "E{i}"], type: fixed,',
        "    stiffness: {radial: 50000, rx: 1e6, ry: 1e6, rz: 1e6}}",
        "loads: {push: {at: T, force: [100, -200, -300], moment: [10000, -20000, 30000]}}",
        "sensors:",
        "  probe: {kind: tcp, at: T, reads: [x, y, z, rx, ry, rz],",
        "    sigma: {position: 1 um, orientation: 1 urad}, frame: machine}",
    ]
    return "\n".join(lines)


def cantilever(
    pieces: int,
    force: Sequence[float],
    turn: Array | None = None,
    ei: float = 1.0,
    ea: float | None = None,
    gj: float = 1.0,
    more: str = "",
) -> str:
    """A beam of length 1 m along x, clamped at the origin, dead force (N) at its tip; SI.

    In the plane, or in space turned by a rotation matrix. Without `ea` it does not stretch. `more`: further keys
    of the beam.
    """
    planar = turn is None
    size = 2 if turn is None else 3
    matrix = np.eye(3) if turn is None else turn
    stiffness = f"EI: {ei!r}" + ("" if planar else f", GJ: {gj!r}") + ("" if ea is None else f", EA: {ea!r}")
    return f"""
    units: {{length: m, angle: rad, force: N}}
    space: {"planar" if planar else "spatial"}
    nodes: {{root: {{at: {point(np.zeros(size))}, fixed: true}}, tip: {point((matrix @ [1, 0, 0])[:size])}}}
    beams: {{beam: {{between: [root, tip], {stiffness}, pieces: {pieces}{more}}}}}
    loads: {{push: {{at: tip, force: {point((matrix @ np.array(force, dtype=float))[:size])}}}}}
    sensors: {{probe: {{kind: tcp, at: tip, reads: {"[x, y, rz]" if planar else "[x, y, z, rx, ry, rz]"},
      sigma: {{position: 1 um, orientation: 1 urad}}, frame: machine}}}}
    """


def force_controlled(drives: dict[str, float]) -> str:
    """Overlay that puts drives under force control, force in N."""
    entries = (f"{name}: {{control: force, force: {force} N}}" for name, force in drives.items())
    return "actuators: {" + ", ".join(entries) + "}"


def redundant(all_drives: Sequence[str], chosen: Sequence[str]) -> str:
    """Overlay that marks the chosen drives as redundant, and no others."""
    entries = (f"{name}: {{redundant: {str(name in chosen).lower()}}}" for name in all_drives)
    return "actuators: {" + ", ".join(entries) + "}"
