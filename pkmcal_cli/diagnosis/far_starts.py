"""Where fits with causes that may be far off begin: constants, scales and signs of drives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.residual import evaluate, lost_rows
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear, linear_problem
from pkmcal_cli.diagnosis.off_nominal import NOWHERE, furthest, off_nominal
from pkmcal_cli.diagnosis.posed_sizes import posed_sizes
from pkmcal_cli.diagnosis.scoring import Search

TIMES = 25.0
"""Chi-square over its degrees of freedom, from which on far-off causes are looked for."""
_MOST = 0.25  # share of what drives are off at measured poses that a cause may leave for its size there to be taken
_FEW = 4  # rows by which a reversed sign is tried
_REVERSED = -2.0  # scale of a drive whose sign is wrong


def absorbed(search: Search) -> bool:
    """Whether a calibration leaves little, but puts a declared parameter where no machine has it."""
    return search.fit.chi2_per_dof <= TIMES and furthest(search, search.fit) > NOWHERE


@dataclass(frozen=True)
class FarStart:
    """Values (P,), SI, at which fits with a candidate begin, the squares that it leaves of the nominal machine's error,
    linearly, and the share of those by which drives are off at measured poses, None where that is not known."""

    hypothesis: Hypothesis
    values: tuple[Array, ...]
    left: float
    by_drives: float | None


def far_starts(search: Search, candidates: Sequence[Hypothesis], gross: bool) -> list[FarStart]:
    """Where fits with candidates begin: where one explains most of the nominal machine's error, or of the drives'.

    Those with few numbers first, then those that leave least of the drives' error, or where that is not known of it.
    gross: errors are left that are large beside the machine: there a sign reversed too, if it predicts anything.
    """
    nominal, out = search.start, []
    linear, left = _left_at_nominal(search, [n for h in candidates for n in h.parameters])
    posed = posed_sizes(search.problem, nominal, candidates)
    for h in candidates:
        columns = linear.of(h.parameters) / linear.scale_of(h.parameters)
        index = [search.problem.model.names.index(n) for n in h.parameters]
        near, reversed_ = nominal.copy(), nominal.copy()
        size = np.linalg.lstsq(columns, left, rcond=1e-9)[0]
        at_poses = posed.get(h)
        near[index] = size if at_poses is None or at_poses.left > _MOST else at_poses.numbers
        reversed_[index] = _REVERSED
        other = (reversed_,) if gross and h.effect == "scale" and _predicts(search, reversed_) else ()
        squares = float(((left - columns @ size) ** 2).sum())
        out.append(FarStart(h, (near, *other), squares, None if at_poses is None else at_poses.left))
    total = float((left**2).sum())
    shares = {s.hypothesis: s.left / total if s.by_drives is None else s.by_drives for s in out}
    return sorted(out, key=lambda s: (len(s.hypothesis.unknown), shares[s.hypothesis]))


def _left_at_nominal(search: Search, names: Sequence[str]) -> tuple[Linear, Array]:
    """Columns of parameters, and what the nominal machine leaves (n,), whitened.

    Where the calibration fits, linear from there: the nominal machine may be so far off that it predicts nothing.
    """
    others = dict.fromkeys(names)
    if not absorbed(search):
        linear = linear_problem(search.problem, search.start, (), list(others), None)
        return linear, linear.residual
    declared, off, _ = off_nominal(search, search.fit)
    linear = linear_problem(search.problem, search.fit.values, (), [*others, *declared], None)
    return linear, linear.residual + linear.of(declared) @ (off / linear.scale_of(declared))


def _predicts(search: Search, values: Array) -> bool:
    """Whether most of a few rows are predicted at values (P,): to look for poses that no machine reaches takes long."""
    few = search.problem.take(np.linspace(0, len(search.problem) - 1, _FEW).astype(np.intp))
    return 2 * len(lost_rows(few, evaluate(few, values, None))) < len(few)
