"""Machines whose carriages are held by springs: the page's example, and one in space that also tilts."""

SLIDERS = """
    units: {length: mm, angle: deg, force: N}
    space: planar
    ranges: {length: 0.1 mm}
    parameters: {l1: 400, l2: 400, l3: {nominal: 700, range: 0.2}, b1: 50, b2: 50, b3: 50,
      k: {nominal: 60 kN/mm, range: 10 kN/mm, identify: false}}
    guides: {rail: {along: x, GUIDANCE}}
    bodies:
      c1: {guide: rail, at: 235, points: {B1: [0, b1]}}
      c2: {guide: rail, at: 765, points: {B2: [0, b2]}}
      c3: {guide: rail, at: 1130, points: {B3: [0, b3]}}
    nodes: {tcp: [500, 350]}
    bars:
      rod1: {between: [B1, tcp], length: l1, k: k}
      rod2: {between: [B2, tcp], length: l2, k: k}
      rod3: {between: [B3, tcp], length: l3, k: k}
    actuators:
      q1: {moves: c1}
      q2: {moves: c2}
      q3: {moves: c3, redundant: true}
    sensors: {tracker: {at: tcp, reads: [x, y], sigma: 5 um, frame: machine}}
"""
"""Three carriages on one rail (docs/machine-language.md); GUIDANCE: stiffness of the guide."""


def sliders(guidance: str = "stiffness: {y: 200 kN/mm, rz: 500 kNm/rad}", more: str = "") -> str:
    """The sliders on a guide of this stiffness (or ideal, ""), with further lines."""
    return SLIDERS.replace(", GUIDANCE", f", {guidance}" if guidance else "") + more


TOWERS = """
    units: {length: mm, angle: deg, force: N}
    space: spatial
    gravity: [0, 0, -9.81]
    ranges: {length: 0.1}
    parameters: {r: 250, b: 40, l: 500, k: {nominal: 30 kN/mm, range: 5 kN/mm, identify: false}}
    frames: {"tower{i}": {each: {i: [1, 2, 3, 4], a: [0, 90, 180, 270]}, turn: [0, 0, "{a}"]}}
    guides:
      "rail{i}": {each: {i: [1, 2, 3, 4]}, frame: "tower{i}", at: [r, 0, 0], along: z,
        stiffness: {x: 40 kN/mm, y: 30 kN/mm, rx: 60 kNm/rad, ry: 50 kNm/rad, rz: 20 kNm/rad}}
    bodies: {"c{i}": {each: {i: [1, 2, 3, 4]}, guide: "rail{i}", at: 433, points: {"C{i}": [-b, 3, 5]}}}
    nodes: {tcp: {at: [0, 0, 0], mass: 3}}
    bars: {"arm{i}": {each: {i: [1, 2, 3, 4]}, between: ["C{i}", tcp], length: l, k: k}}
    actuators:
      "q{i}": {each: {i: [1, 2, 3]}, moves: "c{i}"}
      q4: {moves: c4, redundant: true}
    sensors: {tracker: {at: tcp, reads: [x, y, z], sigma: 5 um, frame: machine}}
"""
"""A point held by four arms on carriages that yield across their towers and tilt."""
