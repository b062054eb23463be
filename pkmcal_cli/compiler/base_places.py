"""The places that are fixed to the base, and what stands on them or looks at them."""

from __future__ import annotations

import numpy as np

from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.model.base import Base


def base_of(structure: Structure, supports: frozenset[tuple[str, str]], machine: Machine) -> Base:
    """Everything that is fixed to the base; `supports`: the anchors that something stands on."""
    builder = structure.builder
    inner = {name for name, guide in machine.guides.items() if not guide.on_base}
    anchors = [
        (kind, name)
        for kind, name in structure.anchors
        if kind in ("ground", "frame", "fixed") or (kind == "guide" and name not in inner)
    ]
    standing = [name for name, frame in machine.frames.items() if frame.body is None]
    rotations = [builder.rotations[structure.rails.frames[name][1]][3] for name in standing]
    carrying = {guide.frame for guide in machine.guides.values()}
    looked_at = {
        a: _looking(machine, a[1]) for a in anchors if a not in supports or (a[0] == "frame" and a[1] not in carrying)
    }
    return Base(
        places=np.array([builder.offsets[structure.anchors[a]] for a in anchors], dtype=np.intp).reshape(-1, 3),
        rotations=np.array(rotations, dtype=np.intp).reshape(-1, 3),
        only_seen_by=tuple(looked_at.get(a, ()) for a in anchors),
        rotations_only_seen_by=tuple(looked_at.get(("frame", name), ()) for name in standing),
    )


def _looking(machine: Machine, name: str) -> tuple[str, ...]:
    """Sensors that look at a ground point or frame."""
    return tuple(s for s, sensor in machine.sensors.items() if name in (sensor.to, sensor.surface))
