"""Frames and guides: fixed to the base, carried by bodies, or beams that bend, and where carriages stand on them.

A carriage on a beam stands on a section of the beam, its *station*, which has a place and an orientation of its own;
its travel is the natural length of the beam up to there (see `spans`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.assemble import BadConfiguration
from pkmcal_cli.compiler.axes import aligned, carried, nominal_axis, tilt_of
from pkmcal_cli.compiler.coefficient_values import constant_vector, is_zero, triad_along, vector
from pkmcal_cli.compiler.coordinates import Coordinates
from pkmcal_cli.language.machine import Guide
from pkmcal_cli.language.quantities import Quantity
from pkmcal_cli.mechanism.connection_points import Point, Rail
from pkmcal_cli.mechanism.topology import GROUND


@dataclass(kw_only=True)
class Rails:
    """Frames, guides and stations by name, made on demand; `point`, `rotation`, `filed_place`: of what has a name."""

    coordinates: Coordinates
    point: Callable[[str], Point]
    rotation: Callable[[str], int]
    filed_place: Callable[[str], Array]
    frames: dict[str, tuple[Point, int]] = field(default_factory=dict)
    guides: dict[str, Rail] = field(default_factory=dict)
    stations: dict[str, Rail] = field(default_factory=dict)

    def prepare(self) -> None:
        """Frames and guides on the base."""
        machine = self.coordinates.machine
        for name, frame in machine.frames.items():
            if frame.body is None:
                self.frame(name)
        for name, guide in machine.guides.items():
            if guide.on_base or guide.frame in self.frames:
                self.guides[name] = self._guide(name, guide)

    def frame(self, name: str) -> tuple[Point, int]:
        """Origin and rotation of a frame."""
        if name not in self.frames:
            s, frame = self.coordinates, self.coordinates.machine.frames[name]
            orientation = (Quantity.constant(0.0), Quantity.constant(0.0), *frame.turn) if s.planar else frame.turn
            carrier = GROUND if frame.body is None else self.rotation(frame.body)
            origin = Point() if frame.body is None else self.point(frame.body)
            kind = "frame" if frame.body is None else "carried frame"
            rotation = carrier
            if frame.body is None or not is_zero(orientation):
                rotation = s.builder.frame(name, vector(orientation), carrier)
            if frame.body is not None:
                s.builder.filed[rotation] = s.filed_orientation(rotation)
            self.frames[name] = origin + s.anchored(kind, name, carrier, vector(frame.at), f"{name}.at"), rotation
        return self.frames[name]

    def of(self, carriage: str) -> Rail:
        """The guide under a carriage: where travel begins, or its station on a beam."""
        guide = self.coordinates.machine.bodies[carriage].guide or ""
        spec = self.coordinates.machine.guides[guide]
        if spec.beam is not None:
            if carriage not in self.stations:
                self.stations[carriage] = self._station(carriage, spec.beam)
            return self.stations[carriage]
        if guide not in self.guides:
            self.guides[guide] = self._guide(guide, spec)
        return self.guides[guide]

    def _guide(self, name: str, guide: Guide) -> Rail:
        s = self.coordinates
        if guide.body is not None:
            origin, rotation = self.point(guide.body), self.rotation(guide.body)
        else:
            origin, rotation = self.frame(guide.frame) if guide.frame else (Point(), GROUND)
        kind = "guide" if guide.on_base else "carried guide"
        origin += s.anchored(kind, name, rotation, vector(guide.at), f"{name}.at")
        slide_rotation = tilt_of(guide.along, aligned(guide.along, s.nominal, slides=True), s.nominal)
        tilt = None if slide_rotation is None else carried(slide_rotation, s.orientation(rotation))
        tilted = s.tilted(rotation, tilt, f"{name}.along")
        return Rail(origin=origin, rotation=rotation, along=self.along(name), tilted=tilted, tilt=tilt)

    def _station(self, carriage: str, beam: str) -> Rail:
        """The section of a beam on which a carriage stands; its x axis is that of the beam."""
        s, spec = self.coordinates, self.coordinates.machine.beams[beam]
        ends = [s.position(self.point(p)) for p in spec.between]
        filed = [self.filed_place(p) for p in spec.between]
        chord = filed[1] - filed[0]
        if not chord.any():
            raise BadConfiguration(beam)
        size = np.sqrt(chord @ chord) if spec.length is None else spec.length.number(s.nominal)
        travel = s.machine.bodies[carriage].at[0].number(s.nominal)
        if not 0 < travel < size:
            unit = s.machine.file_units.length
            message = f"carriage `{carriage}` is not on beam `{beam}`, which is {unit.format(size, 6)} long"
            hint = "`at` is its distance from the beam's first point: give one within the beam"
            raise BadConfiguration(carriage, message, hint)
        share = travel / size
        label = f"{carriage}.station"
        point = s.free_point(label, ends[0] + share * (ends[1] - ends[0]))
        rotation = s.new_rotation(label, self.beam_triad(beam, chord))
        return Rail(origin=point, rotation=rotation, along=np.array([1.0, 0.0, 0.0]), tilted=rotation, tilt=None)

    def beam_triad(self, beam: str, chord: Array) -> Array:
        """Triad of a beam along a chord."""
        s, spec = self.coordinates, self.coordinates.machine.beams[beam]
        up = constant_vector(spec.up, s.nominal) if not is_zero(spec.up) else None
        return triad_along(chord, np.array([0.0, 0.0, 1.0]) if s.planar else up)

    def riders(self, beam: str) -> list[str]:
        """Carriages that run on a beam, from its first point to its second."""
        machine, travel = self.coordinates.machine, self.coordinates.carriage_travel
        on = [
            n
            for n, body in machine.bodies.items()
            if body.guide is not None and machine.guides[body.guide].beam == beam
        ]
        return sorted(on, key=lambda name: self.coordinates.builder.translations[travel[name]][1])

    def along(self, guide: str) -> Array:
        """Nominal direction of travel on a guide, in the axes of what carries it."""
        return nominal_axis(self.coordinates.machine.guides[guide].along, self.coordinates.nominal)

    def at(self, carriage: str) -> Point:
        """Travel 0 of a carriage's guide, or its station, where effects on the guide move it: the rail's side."""
        rail = self.of(carriage)
        error = self.coordinates.anchors.get(("carriage", carriage))
        return rail.origin + (Point() if error is None else Point(((rail.rotation, 1.0, error),)))

    def elastic_directions(self, guide: str) -> tuple[str, ...]:
        """Directions of a guide with stiffness, in the axes of what carries it; not the travel itself."""
        stiffness = self.coordinates.machine.guides[guide].stiffness
        if stiffness is None:
            return ()
        axes = ("x", "y", "rz") if self.coordinates.planar else ("x", "y", "z", "rx", "ry", "rz")
        along = self.along(guide)
        across = [d for d in axes if d[0] == "r" or abs(along["xyz".index(d)]) < 1e-9]
        radial = stiffness.radial is not None
        return tuple(d for d in across if getattr(stiffness, d) is not None or (radial and d[0] != "r"))
