"""Which parts of a machine hang together: a part that nothing joins to the base is a fault."""

from __future__ import annotations

from pkmcal_cli.language.machine import Machine

_BASE = ""


def loose_parts(machine: Machine) -> tuple[str, ...]:
    """Nodes and bodies that no chain of members, joints and guides joins to the base, by name."""
    owner = {point: name for name, body in machine.bodies.items() for point in body.points}
    links = [(name, _BASE) for name in machine.ground]
    links += [(name, _BASE) for name, body in machine.bodies.items() if body.on is not None or body.fixed]
    links += [(name, _BASE) for name, node in machine.nodes.items() if node.fixed]
    for section in (machine.beams, machine.bars, machine.ropes, machine.joints):
        for member in section.values():
            first, second = (owner.get(end, end) for end in member.between)
            links.append((first, second))
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
