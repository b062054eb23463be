"""Ropes as links: each a cable of its own, or several that one drive winds as one cable under one tension.

A cable's strain is the sum of its ropes' lengths by their weights, less its natural length: a rope of weight 2 pulls
with twice the tension.
"""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.compiler.bars import axial_stiffness, drive_stiffness
from pkmcal_cli.compiler.coefficient_values import combined, number
from pkmcal_cli.compiler.rope_path import RopePath, rope_path, shape_of
from pkmcal_cli.compiler.structure import Structure
from pkmcal_cli.compiler.weights import Weight
from pkmcal_cli.elements import (
    BarElement,
    ElasticBarElement,
    ElasticPlanarPulleyElement,
    ElasticSwivelPulleyElement,
    Element,
    PlanarPulleyElement,
    SwivelPulleyElement,
)
from pkmcal_cli.language.machine import Machine, Rope
from pkmcal_cli.mechanism.connection_points import Number

_PER_LENGTH: dict[Element, Element] = {
    BarElement(): ElasticBarElement(),
    PlanarPulleyElement(): ElasticPlanarPulleyElement(),
    SwivelPulleyElement(): ElasticSwivelPulleyElement(),
}


@dataclass(frozen=True, kw_only=True)
class Cable:
    """Ropes under one tension, with their weights; `name`: that of the element."""

    name: str
    ropes: dict[str, Rope]
    weights: dict[str, float]

    @property
    def stated(self) -> Rope:
        """The rope that states the stiffness of all, or any."""
        ropes = self.ropes.values()
        return next((rope for rope in ropes if rope.EA is not None or rope.k is not None), next(iter(ropes)))

    def paths(self, structure: Structure) -> list[RopePath]:
        """The ropes as links."""
        shape = shape_of(structure.planar, list(self.ropes.values()))
        return [rope_path(structure, rope, self.weights[name], shape) for name, rope in self.ropes.items()]


def cables(machine: Machine) -> dict[str, Cable]:
    """All cables by name, in the order of the ropes of the machine."""
    winding = {rope: a for a in machine.actuators.values() for rope in a.winds or ()}
    out: dict[str, Cable] = {}
    for name, rope in machine.ropes.items():
        drive = winding.get(name)
        if drive is None or drive.winds is None:
            out[name] = Cable(name=name, ropes={name: rope}, weights={name: 1.0})
        else:
            ropes = {n: machine.ropes[n] for n in drive.winds}
            weights = {n: weight.number({}) for n, weight in drive.winds.items()}
            out.setdefault(drive.target, Cable(name=drive.target, ropes=ropes, weights=weights))
    return out


def stated_length(structure: Structure, cable: Cable) -> Number:
    """Unstressed length: of each rope the file's, else the reference configuration's."""
    parts: list[Number] = []
    for path, (name, rope) in zip(cable.paths(structure), cable.ropes.items(), strict=True):
        weight = cable.weights[name]
        if rope.length is not None:
            parts.append(combined(lambda l, w=weight: w * l, rope.length))
        else:
            parts.append(weight * float(path.lengths.sum()))
    return combined(lambda *p: sum(p), *parts)


def add_ropes(structure: Structure, wound_lengths: dict[str, Number]) -> list[Weight]:
    """All ropes; `wound_lengths`: rest lengths that drives set. Returns their lumped masses."""
    weights: list[Weight] = []
    springs = drive_stiffness(structure)
    for name, cable in cables(structure.machine).items():
        paths = cable.paths(structure)
        length = wound_lengths[name] if name in wound_lengths else stated_length(structure, cable)
        per_length, stiffness = axial_stiffness(cable.stated, length, springs.get(name))
        shape = paths[0].shape
        links = [link for path in paths for link in path.links]
        structure.builder.rope(
            _PER_LENGTH[shape] if per_length else shape, name, links, rest=length, stiffness=stiffness
        )
        for rope, path in zip(cable.ropes, paths, strict=True):
            weights += _hanging(structure, rope, path)
    return weights


def _hanging(structure: Structure, name: str, path: RopePath) -> list[Weight]:
    """A rope's mass at its points, by length."""
    if path.rope.mass is None:
        return []
    mass = number(path.rope.mass)
    return [
        Weight(
            name=f"{name}.{visit}",
            connection=structure.connection(point),
            mass=combined(lambda m, s=share: s * m, mass),
        )
        for visit, (point, share) in enumerate(zip(path.rope.between, path.shares.tolist(), strict=True))
    ]
