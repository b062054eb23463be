"""Which parts of a machine hang together: a part that nothing joins to the base is a fault."""

from __future__ import annotations

from itertools import pairwise

from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.sections import sections_with

_BASE = ""


def carriers(machine: Machine, body: str) -> tuple[str, ...]:
    """What carries the guide on which a body runs: a body, the ends of a beam, the base; nothing without a guide."""
    ridden = machine.bodies[body].guide if body in machine.bodies else None
    if ridden is None:
        return ()
    guide = machine.guides[ridden]
    if guide.beam is not None:
        return machine.beams[guide.beam].between
    frame = None if guide.frame is None else machine.frames[guide.frame].body
    return (guide.body or frame or _BASE,)


def unconnected_parts(machine: Machine) -> tuple[str, ...]:
    """Nodes and bodies that no chain of members, joints and guides joins to the base, by name."""
    owner = {point: name for name, body in machine.bodies.items() for point in body.points}
    links = [(name, _BASE) for name in machine.ground]
    links += [(name, _BASE) for name, body in machine.bodies.items() if body.fixed]
    links += [(name, owner.get(c, c)) for name in machine.bodies for c in carriers(machine, name)]
    links += [(name, _BASE) for name, node in machine.nodes.items() if node.fixed]
    for section in sections_with("between"):
        for member in getattr(machine, section).values():
            links += pairwise(owner.get(point, point) for point in member.between)
    reached = _reached(links)
    return tuple(name for name in [*machine.bodies, *machine.nodes] if name not in reached)


def _reached(links: list[tuple[str, str]]) -> set[str]:
    """Everything joined to the base."""
    neighbours: dict[str, set[str]] = {}
    for a, b in links:
        neighbours.setdefault(a, set()).add(b)
        neighbours.setdefault(b, set()).add(a)
    reached, waiting = {_BASE}, [_BASE]
    while waiting:
        for name in neighbours.get(waiting.pop(), set()) - reached:
            reached.add(name)
            waiting.append(name)
    return reached
