"""Effect sites of carriages and guides: errors of straightness and angle along the travel of a drive (ISO 230-1)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pkmcal_cli.base.rotation import skew
from pkmcal_cli.compiler.site_collector import ONE, Named, SiteCollector, coefficients_at
from pkmcal_cli.model.effect_sites import EffectSite

_AXES = "xyz"


def _travelling(c: SiteCollector) -> Iterator[tuple[str, str, int]]:
    """Carriages with their guide and the drive that moves them."""
    machine = c.structure.machine
    for a, drive in enumerate(c.topology.drives):
        body = machine.actuators[drive.name].moves
        if body is not None and (guide := machine.bodies[body].guide) is not None:
            yield body, guide, a


def guides(c: SiteCollector) -> Named:
    """Places of the carriages across each guide."""
    gravity = c.gravity
    by_name: dict[str, list[EffectSite]] = {}
    for body, guide, a in _travelling(c):
        rail = c.structure.rails.of(body)
        triad = c.structure.orientation(rail.rotation)
        for k in range(c.axes):
            if abs(rail.along[k]) < 0.9:
                normal = np.eye(3)[k] - rail.along[k] * rail.along
                normal /= np.sqrt(normal @ normal)
                down = np.array([gravity @ triad @ normal, 0.0, 0.0])
                name = f"{guide}.{_AXES[k]}"
                made = EffectSite(
                    part=guide, coefficients=c.offset("carriage", body), matrix=normal[:, None], actuator=a, down=down
                )
                by_name.setdefault(name, []).append(made)
    for name, made_all in by_name.items():
        yield name, tuple(made_all)


def carriages(c: SiteCollector) -> Named:
    """Tilts of carriages: of the rail's side of the springs where they tilt, else as moves of their points.

    Not where members feel the orientation of a carriage that does not tilt.
    """
    machine = c.structure.machine
    for body, guide, a in _travelling(c):
        points = machine.bodies[body].points
        if any(d[0] == "r" for d in c.structure.rails.elastic_directions(guide)):
            yield from _tilts(c, body, a)
            continue
        if not points or _rotation_is_felt(c, body):
            continue
        coefficients = np.concatenate([c.offset("point", p) for p in points])
        offset_vectors = c.topology.coefficients.constants[coefficients].reshape(-1, 3)
        for k in [2] if c.topology.planar else range(3):
            moved = (skew(np.eye(3)[k]) @ offset_vectors.T).T.reshape(-1, 1)
            if moved.any():
                yield (
                    f"{body}.r{_AXES[k]}",
                    (EffectSite(part=body, coefficients=coefficients, matrix=moved, actuator=a),),
                )


def _tilts(c: SiteCollector, body: str, a: int) -> Named:
    """Tilts at which the springs of a carriage that tilts are at rest."""
    for _, e, group in c.places_of(f"{body}.guidance"):
        strains = group.element.strains
        for m, strain in enumerate(strains):
            if strain[0] == "r":
                coefficient = group.rest.start + e * len(strains) + m
                yield (
                    f"{body}.{strain}",
                    (EffectSite(part=body, coefficients=coefficients_at(coefficient), matrix=ONE, actuator=a),),
                )


def _rotation_is_felt(c: SiteCollector, body: str) -> bool:
    """Whether a beam or joint is fixed to the orientation of a carriage; its guide and drive look along the rail."""
    station = c.structure.rails.stations.get(body)
    travel = c.structure.carriage_travel[body]
    guiding = (f"{body}.guidance", *(f"{d.drive.name}.drive" for d in c.drives))
    return any(
        member.element.uses_triads
        and not member.element.slides
        and member.name not in guiding
        and any(
            any(t == travel for _, t, _ in connection.point.translations)
            if station is None
            else connection.rotation == station.rotation
            for link in member.links
            for connection in link.connections
        )
        for member in c.structure.builder.members
    )
