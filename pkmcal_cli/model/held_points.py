"""Points of a mechanism that are held at some of their coordinates, with all drives released: inverse positions."""

from __future__ import annotations

from dataclasses import dataclass, field

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import reference_state
from pkmcal_cli.equilibrium.mobility import null_space, strain_rows
from pkmcal_cli.equilibrium.system import Aim, DriveState, System, build_system
from pkmcal_cli.mechanism.topology import Topology
from pkmcal_cli.model.tool_motion import AimedPoint, ToolMotion


@dataclass(frozen=True)
class HeldPoints:
    """How points move by the mechanism's freedoms, and systems in which they are held; each made once."""

    topology: Topology
    reference_coefficients: Array  # (1, S)
    length: float  # size of the machine, m
    motions: dict[int, ToolMotion] = field(default_factory=dict)  # by point
    systems: dict[Aim, System] = field(default_factory=dict)  # by what is held

    def motion(self, aimed: AimedPoint) -> ToolMotion:
        """How the mechanism's freedoms move a point."""
        if aimed.point not in self.motions:
            names = tuple(d for g in aimed.aims for d in self.topology.aims[g].element.strains)
            system = self.system(aimed, names)
            state = reference_state(self.topology, self.reference_coefficients, 1, system.constraints)
            rows = strain_rows(system, self.reference_coefficients, state, self.length).jacobian
            made = ToolMotion.of(names, rows[-len(names) :] @ null_space(rows[: -len(names)]))
            self.motions[aimed.point] = made
        return self.motions[aimed.point]

    def system(self, aimed: AimedPoint, coordinates: tuple[str, ...]) -> System:
        """All drives released, a point held at some of its coordinates."""
        aim = tuple((g, c) for g in aimed.aims for c in self.topology.aims[g].element.strains if c in coordinates)
        if aim not in self.systems:
            states = (DriveState.RELEASED,) * len(self.topology.drives)
            self.systems[aim] = build_system(self.topology, states, False, aim)
        return self.systems[aim]
