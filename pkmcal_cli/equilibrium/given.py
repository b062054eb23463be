"""What slots say, in the form in which the elements need it: gathered once, used in every iteration.

Most slots are the same in all rows; what does not differ is kept with one row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.base.sparse_map import rows_last, take_rows
from pkmcal_cli.equilibrium.group_map import GroupMap
from pkmcal_cli.equilibrium.system import System
from pkmcal_cli.mechanism.topology import Index, Layout


@dataclass(frozen=True)
class GroupNumbers:
    """Numbers of one group, each with one row or N; None where nothing yields, or no prestress acts."""

    rest: Array  # (1 or N, E, m)
    stiffness: Array | None  # (1 or N, E, m, m), zero where a strain is rigid or released
    coupled: tuple[tuple[int, int], ...]  # strains k, l that any stiffness couples, k = l included
    prestress: Array | None  # (1 or N, E, m)

    def take(self, rows: Index) -> GroupNumbers:
        """Those of some rows."""
        stiffness, prestress = (None if x is None else _rows(x, rows) for x in (self.stiffness, self.prestress))
        return GroupNumbers(_rows(self.rest, rows), stiffness, self.coupled, prestress)

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
        out[:, :, [k for k in range(x.shape[2]) if k not in filled]] = 0.0
        return out


@dataclass(frozen=True)
class Given:
    """What slots say about a system."""

    bodies: Array  # (1 or N, A, 3) constant parts of the arms
    frames: Array  # (1 or N, F, 3) rotation vectors of frames
    groups: tuple[GroupNumbers, ...]
    forces: Array  # (1 or N, W) constant forces

    def take(self, rows: Index) -> Given:
        """What is given for some rows."""
        groups = tuple(g.take(rows) for g in self.groups)
        bodies, frames, forces = (_rows(x, rows) for x in (self.bodies, self.frames, self.forces))
        return Given(bodies, frames, groups, forces)


def given(system: System, slots: Array) -> Given:
    """What `slots` (1 or N, S) say about a system."""
    layout = system.layout
    groups = tuple(group_numbers(system, group, slots) for group in system.groups)
    forces = common(slots[:, layout.force_slots])
    return Given(arm_bodies(layout, slots), frame_vectors(layout, slots), groups, forces)


def frame_vectors(layout: Layout, slots: Array) -> Array:
    """Rotation vectors of frames, (1 or N, F, 3)."""
    where = layout.rotations.slots[layout.frames]
    return _shaped(common(slots[:, where.ravel()]), *where.shape)


def arm_bodies(layout: Layout, slots: Array) -> Array:
    """Constant parts of the arms in the arms' triads, (1 or N, A, 3)."""
    used = layout.offset_map.used
    same = bool((slots[:, used] == slots[:1, used]).all())
    return layout.arm_block.of(layout.offset_map(rows_last(slots[:1] if same else slots)))


def group_numbers(system: System, group: GroupMap, slots: Array) -> GroupNumbers:
    """Numbers of one group."""
    spec = group.group
    stiffness = stiffness_matrices(system, group, slots) if group.yields else None
    coupled = np.asarray(False if stiffness is None else stiffness.any(axis=(0, 1)))
    prestress = None
    if system.loaded and slots[:, spec.prestress].any():
        prestress = group.stressed * _shaped(common(slots[:, spec.prestress]), *spec.shape)
    pairs = tuple((int(k), int(l)) for k, l in np.argwhere(coupled))
    return GroupNumbers(rest_values(group, slots), stiffness, pairs, prestress)


def rest_values(group: GroupMap, slots: Array) -> Array:
    """Strains' rest values, (1 or N, E, m): natural length, commanded travel, ..."""
    return _shaped(common(slots[:, group.group.rest]), *group.group.shape)


def stiffness_matrices(system: System, group: GroupMap, slots: Array) -> Array:
    """S of every element, (1 or N, E, m, m), zero where a strain is rigid or released."""
    count, width = group.group.shape
    patterns = group.group.element.patterns
    numbers = _shaped(common(slots[:, group.group.stiffness]), count, len(patterns))
    if group.group.element.per_length:
        numbers = numbers / natural_lengths(group, rest_values(group, slots))[..., None]
    acting = group.elastic[:, :, None] * group.elastic[:, None, :]
    full: Array = np.zeros((len(numbers), count, width, width), dtype=numbers.dtype, order="F")
    used = np.asarray(numbers.any(axis=(0, 1)))  # most couplings of joints are zero
    for p, k, l in zip(*np.nonzero(patterns * used[:, None, None]), strict=True):
        full[..., k, l] += numbers[..., p] * (patterns[p, k, l] * acting[:, k, l])
    return full


def natural_lengths(group: GroupMap, rest: Array) -> Array:
    """Lengths (1 or N, E) of rest (1 or N, E, m) by which stiffness numbers are divided; 1 where nothing yields.

    The rest length of a member whose drive is released or force-controlled means nothing; it may be zero.
    """
    return np.where(group.elastic[:, 0] > 0, rest[..., 0], 1.0)


def typical_stiffness(system: System, slots: Array | Given) -> float:
    """A stiffness (N/m) that scales multipliers: the largest of the first row's, or 1 where nothing yields."""
    if isinstance(slots, Given):
        matrices = [group.stiffness[:1] for group in slots.groups if group.stiffness is not None]
    else:
        matrices = [stiffness_matrices(system, group, slots[:1]) for group in system.groups]
    return max((float(np.abs(x).max(initial=0.0)) for x in matrices), default=0.0) or 1.0


def common(x: Array) -> Array:
    """x (N, K) itself, or its first row alone where all rows are the same."""
    differ = len(x) < 2 or (x[-1] != x[0]).any() or (x != x[:1]).any()  # two rows mostly tell
    return x if differ else x[:1]


def _shaped(x: Array, *shape: int) -> Array:
    """x (N, K) as (N, *shape), the row index running fastest in memory."""
    return np.asfortranarray(x.reshape(len(x), *shape))


def _rows(x: Array, rows: Index) -> Array:
    return x if len(x) == 1 else take_rows(x, rows)
