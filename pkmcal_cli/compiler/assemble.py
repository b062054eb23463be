"""The reference configuration made to close: the unstressed shape from which rest lengths and triads are taken."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler.coordinates import ReferenceConfiguration
from pkmcal_cli.elements import LoadElement
from pkmcal_cli.equilibrium.kinematics import State, advance, input_jacobian, offset_vectors_at, reference_state
from pkmcal_cli.equilibrium.links import LinkMap
from pkmcal_cli.equilibrium.mobility import StrainRows, null_space, pivots, rank, strain_rows
from pkmcal_cli.equilibrium.system import DriveState, System, build_system
from pkmcal_cli.mechanism.topology import DriveKind, Topology

_FELT = 1e-8  # a free motion moves a point if by more than this share of the machine's size per unit
_NEAR = 0.01  # a small way along the mechanism's motion, as a share of its size
_NEARLY = 1e-2  # singular values below this share of the largest are those of motions that are meant to be free
_CHEAP = 1e6  # a drive moves this much more readily than anything else when the reference configuration is assembled
_ROUNDING = 1e-15  # a step this small, in sizes of the machine or rad, is rounding


class BadConfiguration(ValueError):
    """An element cannot be where the reference configuration has it; by default because its ends lie in one point."""

    def __init__(self, element: str, message: str = "", hint: str = "give its ends different positions") -> None:
        super().__init__(message or f"the ends of `{element}` coincide in the reference configuration")
        self.element, self.hint = element, hint


@dataclass(frozen=True)
class Gap:
    """A strain (m or rad) that the assembled reference configuration still has."""

    element: str
    strain: str
    value: float
    lengthwise: bool


@dataclass(frozen=True, kw_only=True)
class Mobility:
    """What the ranks at the reference configuration say."""

    unknowns: int
    degrees_of_freedom: int
    actuators: int
    redundancy: int
    self_stress: int  # that no drive causes
    free_motions: tuple[str, ...]
    uncontrolled: tuple[str, ...]  # motions of the TCP or of loads that no drive holds
    undetermined: int  # motions that the drives not marked redundant leave free
    overdetermined: int  # drives not marked redundant that are too many
    rigid_loops: tuple[str, ...]  # elements of closed loops in which nothing yields
    nearly_free: int  # motions that hardly strain anything, as of rails that are not quite parallel
    nearby: int  # degrees of freedom near the reference configuration; another number means a special position

    @property
    def special(self) -> bool:
        """Whether the reference configuration is a special position."""
        return self.nearby != self.degrees_of_freedom

    @property
    def matched(self) -> bool:
        """Whether the drives hold everything, the others than redundant ones once."""
        return not (self.uncontrolled or self.undetermined or self.overdetermined > 0)


def all_drives(topology: Topology, state: DriveState, loaded: bool = False) -> System:
    """The system with every drive in one state."""
    return build_system(topology, (state,) * len(topology.drives), loaded)


def assemble(topology: Topology, length: float) -> tuple[State, list[Gap]]:
    """Close the reference configuration with all drives released, moving as little as possible, drives most readily.

    Raises BadDrawing.
    """
    system = all_drives(topology, DriveState.RELEASED)
    coefficients = topology.coefficients.constants[None]
    state = reference_state(topology, coefficients, 1, system.constraints)
    driven = {d.target[0] for d in topology.drives if d.kind is DriveKind.TRAVEL}
    ease = np.array([_CHEAP if int(k) in driven else 1.0 for k in system.free])
    unit = np.where(system.free < len(topology.translation_coefficients), length, 1.0)
    rows = _strains(system, coefficients, state, length)
    for _ in range(50):
        if not len(rows.values):
            break
        step = -np.linalg.lstsq(rows.jacobian * ease, rows.values, rcond=1e-13)[0] * ease
        if np.abs(step).max(initial=0.0) < _ROUNDING:
            break
        step *= min(1.0, 0.3 / max(float(np.abs(step).max(initial=0.0)), 1e-300))
        moved = _closer(system, coefficients, state, rows, step * unit, length)
        if moved is None:
            break
        state, rows = moved
    gaps = [
        Gap(element, strain, float(v) * (length if lengthwise else 1.0), bool(lengthwise))
        for (element, strain), v, lengthwise in zip(rows.names, rows.values, rows.lengthwise, strict=True)
        if abs(v) > 1e-9
    ]
    return state, sorted(gaps, key=lambda g: -abs(g.value))


def _strains(system: System, coefficients: Array, state: State, length: float) -> StrainRows:
    """Strains at a state and their gradient. Raises BadDrawing where an element has no direction."""
    rows = strain_rows(system, coefficients, state, length)
    lost = np.nonzero(~np.isfinite(rows.jacobian).all(axis=1))[0]
    if len(lost):
        raise BadConfiguration(rows.names[lost[0]][0])
    return rows


def _closer(
    system: System, coefficients: Array, state: State, rows: StrainRows, step: Array, length: float
) -> tuple[State, StrainRows] | None:
    """The state after the step (n,), halved until the strains shrink; None when they do not any more."""
    full = np.concatenate([step, np.zeros(system.constraints)])[None]
    for halvings in range(12):
        trial = advance(system, state, full * 0.5**halvings, 1.0)
        trial_rows = strain_rows(system, coefficients, trial, length)
        if trial_rows.values @ trial_rows.values < rows.values @ rows.values:
            return trial, trial_rows
    return None


def reference_configuration(topology: Topology, state: State) -> ReferenceConfiguration:
    """The assembled travels and orientations by name."""
    travels = dict(zip(topology.translation_names, state.translation[0].tolist(), strict=True))
    orientations = dict(zip(topology.rotations.names, state.rotation[0], strict=True))
    return ReferenceConfiguration(travels, orientations)


def with_springs(topology: Topology, length: float) -> Topology:
    """The topology with springs that act with loads only, if drives hold all that they would hold; else they hold.

    So a hinge that is driven may have a torsion spring, and a pendulum without a drive may hang on one.
    """
    if not any(group.springs.any() for group in topology.groups):
        return topology
    holding = replace(topology, groups=tuple(replace(g, springs=np.zeros_like(g.springs)) for g in topology.groups))
    return topology if _undetermined(topology, length) == _undetermined(holding, length) else holding


def _undetermined(topology: Topology, length: float) -> int:
    """Motions that the drives not marked redundant leave free, as filed."""
    system = build_system(topology, _substructure(topology), False)
    state = reference_state(topology, topology.coefficients.constants[None], 1, system.constraints)
    rows = _strains(system, topology.coefficients.constants[None], state, length)
    return system.unknowns - rank(rows.jacobian)


def _substructure(topology: Topology) -> tuple[DriveState, ...]:
    """Drives that are neither redundant nor in force control hold, the others are released."""
    free = (d.redundant or d.force_controlled for d in topology.drives)
    return tuple(DriveState.RELEASED if f else DriveState.ENGAGED for f in free)


def free_motions(topology: Topology, length: float) -> tuple[Array, System]:
    """Basis (n, k) of motions that nothing holds with all drives engaged, and that system. Raises BadDrawing."""
    system = all_drives(topology, DriveState.ENGAGED)
    coefficients = topology.coefficients.constants[None]
    state = reference_state(topology, coefficients, 1, system.constraints)
    return null_space(_strains(system, coefficients, state, length).jacobian), system


def coordinate_name(topology: Topology, coordinate: int) -> str:
    """What a coordinate is, in words."""
    if coordinate < len(topology.translation_coefficients):
        return f"travel of {topology.translation_names[coordinate]}"
    dofs = np.where(topology.rotations.carrier < 0, topology.rotation_dofs, -1)
    r = max(int(k) for k in np.nonzero((dofs >= 0) & (dofs <= coordinate))[0])
    return f"rotation of {topology.rotations.names[r]}"


def split_motions(
    topology: Topology, basis: Array, system: System, length: float, read: tuple[int, ...] = ()
) -> tuple[Array, Array]:
    """Of free motions (n, k): those that move nothing measured or loaded, and the others.

    `read`: rotations whose orientation is measured.
    """
    if basis.shape[1] == 0:
        return basis, basis
    coefficients = topology.coefficients.constants[None]
    state = reference_state(topology, coefficients, 1, system.constraints)
    offset_vectors = offset_vectors_at(topology, coefficients, state)
    unit = np.where(system.free < len(topology.translation_coefficients), length, 1.0)
    loads = [g.map for g in system.groups if isinstance(g.group.element, LoadElement)]
    rows = [_moved(topology, links, system, state, offset_vectors) * unit / length for links in (system.points, *loads)]
    rotated = [r for r in read if topology.rotation_dofs[r] >= 0]
    dofs = [int(topology.rotation_dofs[r]) + k for r in rotated for k in range((0, 3, 1)[topology.rotations.kind[r]])]
    places = [int(system.unknown_of[dof]) for dof in (*dofs, *topology.force_dofs)]
    rows.append(np.eye(system.unknowns)[[unknown_of for unknown_of in places if unknown_of >= 0]])
    felt = np.concatenate(rows) @ basis
    _, s, vt = np.linalg.svd(felt)
    loud = int((s > _FELT).sum())
    return basis @ vt[loud:].T, basis @ vt[:loud].T


def _moved(topology: Topology, links: LinkMap, system: System, state: State, offset_vectors: Array) -> Array:
    """How the unknowns move the points of links from the base, (3 or 2 times links, n), m per unit."""
    jacobian, _ = input_jacobian(topology, links, state, offset_vectors)
    out = np.zeros((jacobian.shape[1], system.unknowns, jacobian.shape[-1]))
    for p, where in enumerate(links.unknowns):
        np.add.at(out[p], where[where >= 0], jacobian[0, p][where >= 0])
    return np.swapaxes(out, 1, 2).reshape(-1, system.unknowns)


def near_reference(topology: Topology, length: float) -> int:
    """Degrees of freedom at a pose a little way along the mechanism's own motion."""
    system = all_drives(topology, DriveState.RELEASED)
    coefficients = topology.coefficients.constants[None]
    state = reference_state(topology, coefficients, 1, system.constraints)
    unit = np.where(system.free < len(topology.translation_coefficients), length, 1.0)
    basis = null_space(_strains(system, coefficients, state, length).jacobian)
    if basis.shape[1] == 0:
        return 0
    way = basis @ np.cos(np.arange(basis.shape[1]))  # all of them at once, none like another
    step = _NEAR * way / np.abs(way).max()
    for _ in range(30):
        full = np.concatenate([step * unit, np.zeros(system.constraints)])
        state = advance(system, state, full[None], 1.0)
        rows = _strains(system, coefficients, state, length)
        step = -np.linalg.lstsq(rows.jacobian, rows.values, rcond=1e-9)[0] if len(rows.values) else 0.0 * step
        if np.abs(step).max(initial=0.0) < 1e-14:
            break
    return system.unknowns - rank(_strains(system, coefficients, state, length).jacobian)


def mobility(topology: Topology, length: float, held: tuple[str, ...], loud: tuple[str, ...]) -> Mobility:
    """Counts by rank at the reference configuration, free motions already held."""
    coefficients = topology.coefficients.constants[None]

    def at(system: System) -> tuple[Array, np.ndarray]:  # type: ignore[type-arg]
        rows = _strains(system, coefficients, reference_state(topology, coefficients, 1, system.constraints), length)
        return rows.jacobian, rows.rigid

    released_system = all_drives(topology, DriveState.RELEASED)
    released, _ = at(released_system)
    r = rank(released)
    freedom = released.shape[1] - r
    own_stress = released.shape[0] - r
    substructure, _ = at(build_system(topology, _substructure(topology), False))
    rs = rank(substructure)
    holding = tuple(DriveState.RELEASED if d.force_controlled else DriveState.ENGAGED for d in topology.drives)
    engaged_system = build_system(topology, holding, False)  # a drive in force control opens a loop
    engaged = _strains(
        engaged_system, coefficients, reference_state(topology, coefficients, 1, engaged_system.constraints), length
    )
    return Mobility(
        unknowns=released.shape[1],
        degrees_of_freedom=freedom,
        actuators=len(topology.drives),
        redundancy=len(topology.drives) - freedom,
        self_stress=own_stress,
        free_motions=held,
        uncontrolled=loud,
        undetermined=substructure.shape[1] - rs,
        overdetermined=substructure.shape[0] - rs - own_stress,
        rigid_loops=_rigid_loops(engaged.names, engaged.jacobian[engaged.rigid], engaged.rigid),
        nearly_free=r - rank(released, _NEARLY),
        nearby=near_reference(topology, length),
    )


def _rigid_loops(names: tuple[tuple[str, str], ...], rigid_rows: Array, rigid: Array) -> tuple[str, ...]:
    """Elements in dependent constraints: a self-stress of rigid parts only."""
    if rank(rigid_rows) == len(rigid_rows):
        return ()
    loops = null_space(rigid_rows.T)
    members = np.nonzero((np.abs(loops) > 1e-6).any(axis=1))[0]
    elements = [names[k][0] for k in np.nonzero(rigid)[0]]
    return tuple(dict.fromkeys(elements[m] for m in members))


__all__ = [
    "Gap",
    "Mobility",
    "assemble",
    "coordinate_name",
    "free_motions",
    "mobility",
    "pivots",
    "reference_configuration",
    "split_motions",
]
