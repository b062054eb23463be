"""Points of a mechanism that are held at some of their coordinates, with all drives released: inverse positions."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations, islice

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.kinematics import reference_state
from pkmcal_cli.equilibrium.mobility import null_space, strain_rows
from pkmcal_cli.equilibrium.system import Aim, DriveState, System, build_system
from pkmcal_cli.mechanism.topology import Topology
from pkmcal_cli.model.tool_motion import AimedPoint, ToolMotion

_CHOICES = 500  # of drives that are tried


@dataclass(frozen=True)
class HeldPoints:
    """How points move by the mechanism's freedoms, and systems in which they are held; each made once."""

    topology: Topology
    reference_coefficients: Array  # (1, S)
    length: float  # size of the machine, m
    motions: dict[tuple[int, tuple[int, ...]], ToolMotion] = field(default_factory=dict)  # by point and engaged drives
    systems: dict[tuple[Aim, tuple[int, ...]], System] = field(default_factory=dict)  # by what is held, engaged drives

    def motion(self, aimed: AimedPoint, engaged: tuple[int, ...] = ()) -> ToolMotion:
        """How the mechanism's freedoms move a point, some drives engaged."""
        key = (aimed.point, engaged)
        if key not in self.motions:
            names = tuple(d for g in aimed.aims for d in self.topology.aims[g].element.strains)
            system = self.system(aimed, names, engaged)
            state = reference_state(self.topology, self.reference_coefficients, 1, system.constraints)
            rows = strain_rows(system, self.reference_coefficients, state, self.length).jacobian
            self.motions[key] = ToolMotion.of(names, rows[-len(names) :] @ null_space(rows[: -len(names)]))
        return self.motions[key]

    def system(self, aimed: AimedPoint, coordinates: tuple[str, ...], engaged: tuple[int, ...] = ()) -> System:
        """A point held at some of its coordinates; all drives released but those that are engaged."""
        aim = tuple((g, c) for g in aimed.aims for c in self.topology.aims[g].element.strains if c in coordinates)
        if (aim, engaged) not in self.systems:
            count = len(self.topology.drives)
            states = tuple(DriveState.ENGAGED if a in engaged else DriveState.RELEASED for a in range(count))
            self.systems[aim, engaged] = build_system(self.topology, states, False, aim)
        return self.systems[aim, engaged]

    def completing(self, aimed: AimedPoint) -> tuple[int, ...] | None:
        """Drives that move what the point does not show: once they hold, it shows all freedoms that are left.

        None of them is redundant; best are those that no other drives can stand in for. None where there are none.
        """
        motion = self.motion(aimed)
        holding = [a for a, d in enumerate(self.topology.drives) if not d.force_controlled]
        kept = [a for a in holding if not self.topology.drives[a].redundant]

        def lost(released: tuple[int, ...]) -> int:
            return self.motion(aimed, tuple(a for a in holding if a not in released)).freedoms

        completions = [
            engaged
            for engaged in islice(combinations(kept, motion.freedoms - motion.shown), _CHOICES)
            if (left := self.motion(aimed, engaged)).shown == left.freedoms == motion.shown
        ]
        return max(completions, key=lost, default=None) if len(completions) > 1 else next(iter(completions), None)
