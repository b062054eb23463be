"""How firmly strains hold a pose, front by front: whether J^T J less a bound is positive definite, J their Jacobian.

J^T J couples the unknowns as the tangent does, so the same fronts serve: a strain counts in the first of the fronts
that its unknowns leave with, which touches all others. The inertia of the matrix is that of the pivots (see `tangent`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.fronts import FrontLayout, FrontSet
from pkmcal_cli.equilibrium.stability import definite
from pkmcal_cli.equilibrium.tangent import solve_rows
from pkmcal_cli.mechanism.topology import Index


@dataclass(frozen=True)
class StrainFronts:
    """Where the non-zero entries of a Jacobian lie among blocks (F, d, s + r) of the sets of fronts, one by one.

    F fronts with s unknowns and a border of r, d strains at most; places (entries,).
    """

    layout: FrontLayout
    strains: tuple[int, ...]  # d of each set
    places: Index

    @classmethod
    def of(cls, strain: Index, unknown: Index, layout: FrontLayout) -> StrainFronts:
        """For entries (strain, unknown), each once."""
        of_unknown = np.empty((2, layout.size), dtype=np.intp)  # set and front that it leaves with
        for k, fronts in enumerate(layout.sets):
            of_unknown[:, fronts.own] = np.broadcast_arrays(k, np.arange(len(fronts.own))[:, None])
        set_of = np.full(int(strain.max(initial=-1)) + 1, len(layout.sets))
        np.minimum.at(set_of, strain, of_unknown[0, unknown])
        leaving = np.nonzero(of_unknown[0, unknown] == set_of[strain])[0]
        front = np.zeros(len(set_of), dtype=np.intp)
        front[strain[leaving]] = of_unknown[1, unknown[leaving]]
        places, most, start = np.empty(len(strain), dtype=np.intp), [], 0
        for k, fronts in enumerate(layout.sets):
            columns, counted = _columns(fronts), np.nonzero(set_of == k)[0]
            counted = counted[np.argsort(front[counted], kind="stable")]
            number = np.zeros(len(set_of), dtype=np.intp)  # among the strains of its front
            number[counted] = np.arange(len(counted)) - np.searchsorted(front[counted], front[counted])
            most.append(int(number[counted].max(initial=-1)) + 1)
            column = np.full((len(columns), layout.size), -1)
            np.put_along_axis(column, columns, np.arange(columns.shape[1])[None], axis=1)
            entries = np.nonzero(set_of[strain] == k)[0]
            which, at = strain[entries], column[front[strain[entries]], unknown[entries]]
            assert at.min(initial=0) >= 0, "unknowns of one strain touch each other"
            places[entries] = start + (front[which] * most[-1] + number[which]) * columns.shape[1] + at
            start += columns.size * most[-1]
        return cls(layout, tuple(most), places)

    def exceed(self, values: Array, bound: Array) -> NDArray[np.bool_]:
        """Tell where (N,) J^T J less a bound (N,) is positive definite, of Jacobians with entries (N, entries)."""
        rows, layout, out = len(values), self.layout, np.ones(len(values), dtype=bool)
        sizes = [_columns(fronts).shape for fronts in layout.sets]
        blocks = np.zeros((rows, sum(f * d * w for (f, w), d in zip(sizes, self.strains, strict=True))))
        blocks[:, self.places] = values
        entries, nothing, start = np.zeros((rows, layout.width)), np.empty((rows, layout.size, 0)), 0
        for fronts, (count, width), most in zip(layout.sets, sizes, self.strains, strict=True):
            jacobian = blocks[:, start : start + count * most * width].reshape(rows, count, most, width)
            start += count * most * width
            s, normal = fronts.unknowns, np.swapaxes(jacobian, 2, 3) @ jacobian
            square, ahead, _ = fronts.parts_of(entries, transposed=False)
            pivot = square[:, :, :s, :s] + normal[:, :, :s, :s] - bound[:, None, None, None] * np.eye(s)
            out &= definite(pivot.reshape(-1, s, s), np.empty((rows * count, 0, s))).reshape(rows, count).all(axis=1)
            if width > s:
                ahead = ahead[:, :, :s] + normal[:, :, :s, s:]
                eliminated = solve_rows(pivot.reshape(-1, s, s), ahead.reshape(-1, s, width - s)).reshape(ahead.shape)
                passed = np.swapaxes(ahead, 2, 3) @ eliminated - normal[:, :, s:, s:]
                fronts.pass_on(fronts.summed(passed), entries, nothing, transposed=False)
        return out


def _columns(fronts: FrontSet) -> Index:
    """Unknowns (F, s + r) that strains of each front may move: its own, and its border."""
    return np.concatenate([fronts.own[:, : fronts.unknowns], fronts.border], axis=1)
