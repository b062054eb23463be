"""What is wrong with stiffness blocks: directions that are free there, couplings that leave no energy minimum."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from pkmcal_cli.base.errors import Fault
from pkmcal_cli.compiler.coefficient_values import constant_vector, unit
from pkmcal_cli.compiler.joints import joint_rows
from pkmcal_cli.elements import JOINTS
from pkmcal_cli.language.fields import PLANAR, SPATIAL
from pkmcal_cli.language.machine import Guide, Machine, Stiffness, axis_vector
from pkmcal_cli.yaml_source.tree import Path

_TRANSLATIONS = ("x", "y", "z")


def stiffness_faults(machine: Machine) -> list[Fault]:
    """Faults of all stiffness blocks of joints, ends of beams and guides."""
    every = list(_blocks(machine))
    return [
        *chain.from_iterable(_skew_guide(machine, name, guide) for name, guide in machine.guides.items()),
        *chain.from_iterable(_free_directions(machine, *block) for block in every),
        *chain.from_iterable(_indefinite(machine, path, stiffness) for path, stiffness, _, _ in every),
    ]


def _blocks(machine: Machine) -> Iterator[tuple[Path, Stiffness, str, tuple[str, ...]]]:
    """Every stiffness block: its place, what it belongs to in words, and the directions that it can have."""
    planar = machine.space == "planar"
    for name, joint in machine.joints.items():
        if joint.stiffness is not None:
            drive = JOINTS[joint.type].drive
            rows = (*joint_rows(joint.type, planar), *((drive,) if drive else ()))
            yield ("joints", name, "stiffness"), joint.stiffness, f"a {joint.type} joint", rows
    for name, beam in machine.beams.items():
        for side, end in enumerate(beam.ends):
            if end.stiffness is not None:
                path: Path = ("beams", name, "ends", side, "stiffness")
                yield path, end.stiffness, f"a {end.joint} end", joint_rows(end.joint, planar)
    for name, guide in machine.guides.items():
        if guide.stiffness is not None and (travel := _travel(machine, guide)) is not None:
            rows = tuple(d for d in (PLANAR if planar else SPATIAL) if d != travel)
            yield ("guides", name, "stiffness"), guide.stiffness, f"travel on guide `{name}`", rows


def _travel(machine: Machine, guide: Guide) -> str | None:
    """The axis of its frame that a guide runs along; None where it is skew."""
    along = unit(constant_vector(axis_vector(guide.along, 3), machine.nominal_values()))
    directions = [d for d, c in zip(_TRANSLATIONS, along, strict=True) if abs(c) > 1e-9]
    return directions[0] if len(directions) == 1 else None


def _skew_guide(machine: Machine, name: str, guide: Guide) -> list[Fault]:
    if guide.stiffness is None or _travel(machine, guide) is not None:
        return []
    message = f"guide `{name}` has a stiffness but is not parallel to an axis of its frame"
    hint = "use `along: x`, and turn the frame: `frames: {NAME: {turn: ...}}`"
    return [machine.source.fault("stiffness", message, ("guides", name, "along"), hint)]


def _free_directions(
    machine: Machine, path: Path, stiffness: Stiffness, owner: str, rows: tuple[str, ...]
) -> list[Fault]:
    """Directions that are free: a stiffness there would do nothing."""
    known = PLANAR if machine.space == "planar" else SPATIAL
    hint = f"delete it; possible directions: {', '.join(f'`{r}`' for r in rows)}"
    return [
        machine.source.fault(
            "stiffness", f"{owner} is free in `{key}`: a stiffness there has no effect", (*path, key), hint, at_key=True
        )
        for key in known
        if getattr(stiffness, key) is not None and key not in rows
    ]


def _indefinite(machine: Machine, path: Path, stiffness: Stiffness) -> list[Fault]:
    """A block whose energy is not positive in every direction, at nominal parameters."""
    nominal = machine.nominal_values()
    by_direction = {d: getattr(stiffness, d) or (stiffness.radial if d in _TRANSLATIONS else None) for d in SPATIAL}
    size = {d: q.number(nominal) ** 0.5 for d, q in by_direction.items() if q is not None}
    block = np.eye(len(size))
    couplings = []
    for i, a in enumerate(size):
        for k, b in list(enumerate(size))[i + 1 :]:
            if (value := getattr(stiffness, f"{a}_{b}")) is not None:
                block[i, k] = block[k, i] = value.number(nominal) / (size[a] * size[b])
                couplings.append(f"{a}_{b}")
    if not couplings or np.linalg.eigvalsh(block)[0] > 1e-12:
        return []
    message = f"this stiffness is not positive definite: coupling too large ({', '.join(f'`{c}`' for c in couplings)})"
    first, second = couplings[0].split("_")
    limit = f"|`{couplings[0]}`| < sqrt(`{first}` * `{second}`)"
    hint = f"keep every coupling below the geometric mean of its two stiffnesses: {limit}"
    return [machine.source.fault("stiffness", message, path, hint, at_key=True)]
