"""Machines and tables that are odd, but may well be given to a command."""

from __future__ import annotations

BASE = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.1, angle: 1, stiffness: 1000}
parameters: {l1: 300, l2: 300, l3: 600, k1: {nominal: 50000, unit: N/mm}}
guides: {rail: {along: x}}
nodes: {tcp: [360, 275]}
bodies:
  c1: {guide: rail, at: 117, points: {B1: [0, 100]}}
  c2: {guide: rail, at: 603, points: {B2: [0, 100]}}
  c3: {guide: rail, at: 947, points: {B3: [0, 150]}}
bars:
  rod1: {between: [B1, tcp], length: l1, k: k1}
  rod2: {between: [B2, tcp], length: l2, k: k1}
  rod3: {between: [B3, tcp], length: l3, k: k1}
actuators: {q1: {moves: c1}, q2: {moves: c2}, q3: {moves: c3, redundant: true}}
sensors: {s: {kind: tcp, at: tcp, reads: [x, y], sigma: 10 um, frame: machine}}
"""

_PARAMETERS = "parameters: {l1: 300, l2: 300, l3: 600, k1: {nominal: 50000, unit: N/mm}}\n"
_SENSOR = "sensors: {s: {kind: tcp, at: tcp, reads: [x, y], sigma: 10 um, frame: machine}}\n"
_DRIVES = "actuators: {q1: {moves: c1}, q2: {moves: c2}, q3: {moves: c3, redundant: true}}\n"
_FORCED = "{moves: c3, redundant: true, control: force, sigma: 1 um"


def _with(*changes: tuple[str, str]) -> str:
    text = BASE
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text


MACHINES = {
    "base": BASE,
    "no-actuators": _with((_DRIVES, "")),
    "no-sensors": _with((_SENSOR, "")),
    "no-parameters": _with((_PARAMETERS, ""), ("length: l1, k: k1", "k: 5e4"), ("length: l2, k: k1", "k: 5e4"),
                           ("length: l3, k: k1", "k: 5e4")),
    "all-fixed": _with(("l1: 300, l2: 300, l3: 600, k1: {nominal: 50000, unit: N/mm}", ", ".join(
        f"{n}: {{nominal: {v}, identify: false}}" for n, v in (("l1", 300), ("l2", 300), ("l3", 600), ("k1", 5e4))))),
    "two-sensors": _with(("sensors: {", "sensors: {t: {at: tcp, reads: [x], sigma: 1 um, frame: machine}, ")),
    "force-needed": _with(("{moves: c3, redundant: true", _FORCED)),
    "force-constant": _with(("{moves: c3, redundant: true", _FORCED + ", force: 10")),
    "force-column": _with(("{moves: c3, redundant: true", _FORCED + ", force: {column: f3, otherwise: 10, scale: 2}")),
    "ropes": _with(("bars:", "ropes:")),
    "headers": _with(("reads: [x, y]", 'reads: {x: "X [um]", y: "Y pos"}')),
    "limits": _with(("q1: {moves: c1}", "q1: {moves: c1, limits: [0, 100]}")),
    "huge": _with(("l1: 300", "l1: 1e300")),
    "tiny-stiffness": _with(("nominal: 50000", "nominal: 1e-280")),
    "huge-stiffness": _with(("nominal: 50000", "nominal: 1e280")),
    "crank": """
units: {length: mm, angle: deg, force: N}
space: planar
ground: {o: [0, 0], p: [300, 0]}
bodies: {crank: {at: [0, 0], points: {A: [100, 0]}}}
nodes: {tcp: [100, 200]}
joints: {j: {between: [o, crank], type: revolute}}
bars: {b1: {between: [A, tcp]}, b2: {between: [p, tcp]}}
actuators: {q1: {turns: j}}
sensors: {s: {at: tcp, reads: [x], sigma: 10 um, frame: machine}}
""",
    "one-carriage": """
units: {length: mm, force: N}
space: planar
guides: {rail: {along: x}}
bodies: {c: {guide: rail, at: 0}}
actuators: {q1: {moves: c}}
sensors: {s: {at: c, reads: [x], sigma: 1 um, frame: machine}}
""",
    "nothing-moves": "space: planar\nbodies: {o: {at: [0, 0], fixed: true}}\n",
    "space": "space: planar\n",
    "empty": "",
    "list": "- a\n- b\n",
    "binary": "\x00\x01\x02PK\x03\x04",
    "text": "this is no machine\n",
    "deep": "a: " + "[" * 2000,
    "coincident": "space: planar\nground: {o: [0, 0]}\nnodes: {n: [0, 0]}\nbars: {b: {between: [o, n]}}\n",
    "unicode": _with(("rod1:", "rød1:")),
}  # fmt: skip
"""Machine files by name."""

_ROW = "116.33,603.67,946.83"

TABLES = {
    "poses": "x,y\n360,275\n370,270\n300,270\n",
    "one pose": "x,y\n360,275\n",
    "drives": "q1,q2,q3\n117,603,947\n118,602,948\n",
    "measured": f"id,q1,q2,q3,x,y\n1,{_ROW},360,275\n2,117,603,947,360.1,275.2\n3,110,603,947,360.1,275.2\n",
    "repeated": "id,q1,q2,q3,x,y\n" + f"1,{_ROW},360,275\n" * 12,
    "one row": f"q1,q2,q3,x,y\n{_ROW},360,275\n",
    "constant drives": "q1,q2,q3,x,y\n" + "".join(f"{_ROW},{360 + i / 100},{275 - i / 100}\n" for i in range(30)),
    "far": "x,y\n99999,275\n360,275\n",
    "drives far": "id,q1,q2,q3,x,y\n1,9e9,603.67,946.83,360,275\n2,117,603,947,360.1,275.2\n",
    "huge drive": f"q1,q2,q3,x,y\n1e300,603,947,360,275\n{_ROW},360.1,275.2\n",
    "huge reading": f"q1,q2,q3,x,y\n{_ROW},1e300,275\n{_ROW},360.1,275.2\n",
    "nan": f"q1,q2,q3,x,y\n{_ROW},nan,275\n",
    "infinite": f"q1,q2,q3,x,y\n{_ROW},inf,275\n",
    "no reading": f"q1,q2,q3,x,y\n{_ROW},,\n{_ROW},,\n",
    "some readings": f"q1,q2,q3,x,y\n{_ROW},,275\n{_ROW},360.2,\n",
    "a drive missing": "q1,q2,q3,x,y\n,603.67,946.83,360,275\n117,603,947,360.1,275.2\n",
    "spatial": "x,y,z\n360,275,5\n",
    "turned": "x,y,rz\n360,275,5\n",
    "half a pose": "x\n360\n",
    "header": "id,q1,q2,q3,x,y\n",
    "empty": "",
    "blank": "\n\n\n",
    "binary": "\x00\x01\x02\x03",
    "zero sigma": f"q1,q2,q3,x,y,sigma.x\n{_ROW},360,275,0\n",
    "negative sigma": f"q1,q2,q3,x,y,sigma.x\n{_ROW},360,275,-1\n",
    "unicode": f'id,q1,q2,q3,x,y\nπ✓,{_ROW},360,275\n"a,""b",117,603,947,360.1,275.2\n',
    "german": "q1;q2;q3;x;y\n116,33;603,67;946,83;360,1;275,2\n",
    "long row": f"q1,q2,q3,x,y\n{_ROW},360,275,9,9,9\n",
    "forces": f"q1,q2,q3,x,y,f3\n{_ROW},360,275,5\n{_ROW},360,275,\n",
    "yaml": BASE,
}
"""Tables by name."""
