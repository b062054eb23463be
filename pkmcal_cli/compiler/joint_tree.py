"""Which joints place what: one side of a joint stands on the other, which needs neither unknowns nor constraints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pkmcal_cli.compiler.connection import carriers
from pkmcal_cli.language.machine import Joint, Machine

Placed = tuple[str, int]
"""A joint, and which of its sides (0, 1) stands on the other."""


def joint_tree(machine: Machine, owner: Mapping[str, str], nominal: Mapping[str, float]) -> dict[str, Placed]:
    """By node or body: the joint that places it. `owner`: the bodies of their points; `nominal`: parameters, SI."""
    tree = _Tree(machine, owner, nominal)
    for name, joint in machine.joints.items():
        tree.choose_child(name, joint)
    return tree.placed_by


@dataclass
class _Tree:
    machine: Machine
    owner: Mapping[str, str]
    nominal: Mapping[str, float]
    placed_by: dict[str, Placed] = field(default_factory=dict)

    def choose_child(self, name: str, joint: Joint) -> None:
        """A joint without elastic translations places a node (or else a body) that nothing else places."""
        if joint.stiffness is not None and joint.type not in ("spherical", "universal", "revolute"):
            return
        translations = ("radial", "x", "y", "z")
        if joint.stiffness is not None and any(getattr(joint.stiffness, d) is not None for d in translations):
            return
        owners = [self.owner.get(end, end) for end in joint.between]
        for side in sorted((1, 0), key=lambda s: owners[s] in self.machine.bodies):
            child, parent = owners[side], owners[1 - side]
            if self._can_be_placed(child) and not self._leads_to(parent, child) and self._aligned(joint, child, parent):
                self.placed_by[child] = (name, side)
                return

    def _can_be_placed(self, name: str) -> bool:
        if name in self.placed_by:
            return False
        if name in self.machine.nodes:
            return not self.machine.nodes[name].fixed
        body = self.machine.bodies.get(name)
        return body is not None and body.guide is None and not body.fixed

    def _leads_to(self, name: str, target: str) -> bool:
        """Whether a node or body stands on another, by joints and by guides that bodies and beams carry."""
        if name == target:
            return True
        below = carriers(self.machine, name)
        if name in self.placed_by:
            joint, side = self.placed_by[name]
            below = (self.machine.joints[joint].between[1 - side],)
        return any(self._leads_to(self.owner.get(end, end), target) for end in below)

    def _aligned(self, joint: Joint, child: str, parent: str) -> bool:
        """Joints that lock rotation share the parent's triad: a body must be drawn aligned with it."""
        if joint.type not in ("fixed", "prismatic") or child not in self.machine.bodies:
            return True
        orientations = [self.machine.bodies[n].turn if n in self.machine.bodies else () for n in (child, parent)]
        return all(q.number(self.nominal) == 0.0 for angles in orientations for q in angles)
