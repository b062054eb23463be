"""What coefficients say, in the form in which the elements need it: gathered once, used in every iteration.

The stiffness matrix of an element is S = sum_p c_p P_p (/ L): numbers c_p times constant patterns P_p, so that it is
linear in what parameters and effects can set (of beams: Przemieniecki 1968). Most coefficients are the same in all
rows; what does not differ is kept with one row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import rows_last, take_rows
from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.mechanism.topology import Index, Topology


@dataclass(frozen=True)
class GroupNumbers:
    """Numbers of one group, each with one row or N; None where nothing yields, or no prestress acts."""

    rest: Array  # (1 or N, E, m)
    sizes: Array  # (1 or N, K, p)
    stiffness: Array | None  # (1 or N, E, m, m), zero where a strain is rigid or released; times L, see `at`
    coupled: tuple[tuple[int, int], ...]  # strains k, l that any stiffness couples, k = l included
    prestress: Array | None  # (1 or N, E, m)
    group: GroupMap

    def take(self, rows: Index) -> GroupNumbers:
        """Those of some rows."""
        stiffness, prestress = (None if x is None else _rows(x, rows) for x in (self.stiffness, self.prestress))
        rest, sizes = _rows(self.rest, rows), _rows(self.sizes, rows)
        return replace(self, rest=rest, sizes=sizes, stiffness=stiffness, prestress=prestress)

    def at(self, translation: Array) -> GroupNumbers:
        """The numbers at translations (N, T), which may add to natural lengths; what has no length there is nan."""
        spec = self.group.group
        if not spec.element.slides:
            return self
        rest = rest_at(self.group, self.rest, translation)
        stiffness, prestress, length = self.stiffness, self.prestress, rest[..., 0]
        if stiffness is not None and spec.element.per_length:
            stiffness = stiffness / length[..., None, None]
        if prestress is not None:
            prestress = prestress * length[..., None] ** spec.element.load_power
        return replace(self, rest=rest, stiffness=stiffness, prestress=prestress)

    def by_length(self, e: Array) -> tuple[Array, Array]:
        """How the energy 1/2 e^T S e + s0^T e changes with the natural length L at strains (N, E, m).

        The derivative with respect to L (N, E), and that of the stress S e + s0 (N, E, m).
        """
        length = natural_lengths(self.group, self.rest)[..., None]
        by_stress: Array = np.zeros(e.shape, dtype=e.dtype, order="F")
        energy: Array = np.zeros(e.shape[:2], dtype=e.dtype, order="F")
        if self.stiffness is not None and self.group.group.element.per_length:
            by_stress -= self.stress(e) / length
            energy += 0.5 * (e * by_stress).sum(axis=2)
        if self.prestress is not None and (power := self.group.group.element.load_power):
            loads = power * self.prestress / length
            by_stress += loads
            energy += (e * loads).sum(axis=2)
        return energy, by_stress

    def twice_by_length(self, e: Array) -> Array:
        """Second derivative (N, E) of that energy with respect to the natural length."""
        length, out = natural_lengths(self.group, self.rest), 0.0
        if self.stiffness is not None and self.group.group.element.per_length:
            out = out + (e * self.stress(e)).sum(axis=2) / length**2
        if self.prestress is not None and (power := self.group.group.element.load_power):
            out = out + power * (power - 1) * (e * self.prestress).sum(axis=2) / length**2
        return np.asarray(out)

    def stress(self, x: Array) -> Array:
        """Stiffness times x (N, E, m) or (N, E, m, I), skipping what is zero in all elements."""
        out = np.empty(x.shape, dtype=x.dtype, order="F")
        assert self.stiffness is not None
        filled = set()
        for k, l in self.coupled:
            s = self.stiffness[..., k, l]
            factor = s if x.ndim == 3 else s[..., None]
            if k in filled:
                out[:, :, k] += factor * x[:, :, l]
            else:
                np.multiply(factor, x[:, :, l], out=out[:, :, k])
                filled.add(k)
        for k in range(x.shape[2]) if len(filled) < x.shape[2] else ():
            if k not in filled:
                out[:, :, k] = 0.0
        return out


@dataclass(frozen=True)
class SystemNumbers:
    """What coefficients say about a system."""

    bodies: Array  # (1 or N, A, 3) constant parts of the offset vectors
    frames: Array  # (1 or N, F, 3) rotation vectors of frames
    groups: tuple[GroupNumbers, ...]
    forces: Array  # (1 or N, W) constant forces

    def take(self, rows: Index) -> SystemNumbers:
        """What is given for some rows."""
        groups = tuple(g.take(rows) for g in self.groups)
        bodies, frames, forces = (_rows(x, rows) for x in (self.bodies, self.frames, self.forces))
        return SystemNumbers(bodies, frames, groups, forces)


def system_numbers(system: System, coefficients: Array | SystemNumbers) -> SystemNumbers:
    """Gather what `coefficients` (1 or N, S) say about a system; what is gathered already is given back."""
    if isinstance(coefficients, SystemNumbers):
        return coefficients
    topology = system.topology
    groups = tuple(group_numbers(system, group, coefficients) for group in system.groups)
    forces = common(coefficients[:, topology.force_coefficients])
    return SystemNumbers(
        constant_offset_vectors(topology, coefficients), frame_vectors(topology, coefficients), groups, forces
    )


def frame_vectors(topology: Topology, coefficients: Array) -> Array:
    """Gather the rotation vectors of frames, (1 or N, F, 3)."""
    where = topology.rotations.coefficients[topology.frames]
    return _shaped(common(coefficients[:, where.ravel()]), *where.shape)


def constant_offset_vectors(topology: Topology, coefficients: Array) -> Array:
    """Gather the constant parts of the offset vectors in their triads, (1 or N, A, 3)."""
    used = topology.offset_map.used
    same = bool((coefficients[:, used] == coefficients[:1, used]).all())
    own = rows_last(coefficients[:1] if same else coefficients)
    return topology.offset_vector_block.of(topology.offset_map(own))


def group_numbers(system: System, group: GroupMap, coefficients: Array) -> GroupNumbers:
    """Gather the numbers of one group."""
    spec = group.group
    stiffness = stiffness_matrices(system, group, coefficients) if group.yields else None
    coupled = np.asarray(False if stiffness is None else stiffness.any(axis=(0, 1)))
    prestress = None
    if system.loaded and coefficients[:, spec.prestress].any():
        prestress = group.stressed * _shaped(common(coefficients[:, spec.prestress]), *spec.shape)
    pairs = tuple((int(k), int(l)) for k, l in np.argwhere(coupled))
    return GroupNumbers(
        rest=rest_values(group, coefficients),
        sizes=link_sizes(group, coefficients),
        stiffness=stiffness,
        coupled=pairs,
        prestress=prestress,
        group=group,
    )


def rest_values(group: GroupMap, coefficients: Array) -> Array:
    """Gather the strains' rest values, (1 or N, E, m): natural length, commanded translation, ..."""
    return _shaped(common(coefficients[:, group.group.rest]), *group.group.shape)


def rest_at(group: GroupMap, rest: Array, translation: Array) -> Array:
    """Give rest values at translations (N, T), which may add to natural lengths; nan where there is no length left."""
    if not group.group.element.slides:
        return rest
    out: Array = rest + np.zeros_like(translation[:, :1, None])  # (N, E, m)
    out[..., 0] += translation @ group.group.slides
    out[..., 0][out[..., 0].real <= 0] = np.nan
    return out


def link_sizes(group: GroupMap, coefficients: Array) -> Array:
    """Gather what shapes the links besides their vectors, (1 or N, K, p)."""
    spec = group.group
    if not spec.element.sizes:
        return np.empty((1, len(spec.weights), 0))
    return _shaped(common(coefficients[:, spec.sizes]), len(spec.weights), len(spec.element.sizes))


def stiffness_matrices(system: System, group: GroupMap, coefficients: Array) -> Array:
    """Assemble S of every element, (1 or N, E, m, m), zero where a strain is rigid or released."""
    count, width = group.group.shape
    patterns = group.group.element.patterns
    numbers = _shaped(common(coefficients[:, group.group.stiffness]), count, len(patterns))
    if group.group.element.per_length and not group.group.element.slides:
        numbers = numbers / natural_lengths(group, rest_values(group, coefficients))[..., None]
    acting = group.elastic[:, :, None] * group.elastic[:, None, :]
    full: Array = np.zeros((len(numbers), count, width, width), dtype=numbers.dtype, order="F")
    used = np.asarray(numbers.any(axis=(0, 1)))  # most couplings of joints are zero
    for p, k, l in zip(*np.nonzero(patterns * used[:, None, None]), strict=True):
        full[..., k, l] += numbers[..., p] * (patterns[p, k, l] * acting[:, k, l])
    return full


def natural_lengths(group: GroupMap, rest: Array) -> Array:
    """Give lengths (1 or N, E) of rest (1 or N, E, m) that divide stiffness numbers; 1 where nothing yields.

    The rest length of a member whose drive is released or force-controlled means nothing; it may be zero.
    """
    return rest[..., 0] if group.group.element.slides else np.where(group.elastic[:, 0] > 0, rest[..., 0], 1.0)


def beyond_beams(system: System, coefficients: Array) -> NDArray[np.bool_]:
    """Tell in which rows (N,) held drives leave a span of a beam no length: a carriage beyond its end."""
    topology, out = system.topology, np.zeros(len(coefficients), dtype=bool)
    for group in system.groups:
        held = system.unknown_of[: len(topology.translation_names)] < 0
        slides = group.group.slides * held[:, None]
        spans = np.nonzero(slides.any(axis=0) & ~(group.group.slides * ~held[:, None]).any(axis=0))[0]
        if len(spans):
            translation = coefficients[:, topology.translation_coefficients] @ slides[:, spans]
            out |= (rest_values(group, coefficients)[:, spans, 0] + translation <= 0).any(axis=1)
    return out


def typical_stiffness(system: System, coefficients: Array | SystemNumbers) -> float:
    """Give a stiffness (N/m) that scales multipliers: the largest of the first row's, or 1 where nothing yields."""
    if isinstance(coefficients, SystemNumbers):
        matrices = [group.stiffness[:1] for group in coefficients.groups if group.stiffness is not None]
    else:
        matrices = [stiffness_matrices(system, group, coefficients[:1]) for group in system.groups]
    return max((float(np.abs(x).max(initial=0.0)) for x in matrices), default=0.0) or 1.0


def common(x: Array) -> Array:
    """Give x (N, K) itself, or its first row alone where all rows are the same."""
    differ = len(x) < 2 or (x[-1] != x[0]).any() or (x != x[:1]).any()  # two rows mostly tell
    return x if differ else x[:1]


def _shaped(x: Array, *shape: int) -> Array:
    """x (N, K) as (N, *shape), the row index running fastest in memory."""
    return np.asfortranarray(x.reshape(len(x), *shape))


def _rows(x: Array, rows: Index) -> Array:
    return x if len(x) == 1 else take_rows(x, rows)
