"""How large effects must be to be seen, by one test and by the whole procedure: each number, the worst direction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.detection import Detection
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.score import PLAUSIBLE, Score, minimal_detectable
from pkmcal_cli.diagnosis.trial import Procedure

_KEPT = 0.01  # share of its length below which a hypothesis is absorbed by declared parameters
_SHARE = 0.2  # of the largest, from which on a parameter is told that absorbs
_MOST = 4  # of these
_ACTS = 1e-4  # square of what a number of its plausible size moves, in standard uncertainties
_GIVES_WAY = 3.0  # ranges, from which on dimensions that are further off widen the ranges of others
_ALIKE = 1e-6  # by which what rounding tells apart is the same


@dataclass(frozen=True)
class SizeAlong:
    """Along a direction (p,) of an effect's numbers, of length 1 in standard deviations of their priors: minimal
    detectable length (one test at 0.1 %, found in 80 %), inf where none is made, and declared parameters that take it
    up.

    simulated: the length that is detected in 80 %, from simulated campaigns.
    """

    direction: Array
    mdb: float
    simulated: Callable[[], float]
    absorbed_by: tuple[str, ...]

    @cached_property
    def detected(self) -> float:
        """The length that is detected in 80 % of campaigns; inf for never."""
        return self.simulated()


@dataclass(frozen=True, kw_only=True)
class VisibleSizes:
    """What data show of a hypothesis with p parameters. scale (p,): one standard deviation of their priors, SI.

    leading: the parameter that shows most; numbers: each parameter alone that moves a reading; worst: the direction
    among these that shows least, None for a single number; tested: whether it has a direction that can be seen within
    its plausible range.
    """

    hypothesis: Hypothesis
    scale: Array
    leading: int
    numbers: dict[int, SizeAlong]
    worst: SizeAlong | None
    tested: bool

    @property
    def parameter(self) -> str:
        """The name of the leading parameter."""
        return self.hypothesis.parameters[self.leading]

    @property
    def mdb(self) -> float:
        """Its minimal detectable size, SI."""
        return self.numbers[self.leading].mdb * float(self.scale[self.leading])

    @property
    def detected(self) -> float:
        """Its size that is detected in 80 % of campaigns, SI."""
        return self.numbers[self.leading].detected * float(self.scale[self.leading])

    @property
    def plausible(self) -> float:
        """Its plausible size, SI."""
        return PLAUSIBLE * float(self.scale[self.leading])

    @property
    def absorbed_by(self) -> tuple[str, ...]:
        """Declared parameters that take it up."""
        return self.numbers[self.leading].absorbed_by


def visible_sizes(detection: Detection, procedure: Procedure) -> tuple[VisibleSizes, ...]:
    """Of all its hypotheses; noise as large as it is estimated."""
    noise, span = float(np.sqrt(procedure.scale.variance)), _span(detection.linear)
    return tuple(_sizes(detection, k, procedure, noise, span) for k in range(len(detection.hypotheses)))


def _sizes(detection: Detection, k: int, procedure: Procedure, noise: float, span: Array) -> VisibleSizes:
    hypothesis, score = detection.hypotheses[k], detection.scores[k]
    acts = score.length2 > _ACTS  # not so what is no part of the effect, or only shapes what the others do, as a lag
    acting = [j for j in range(len(acts)) if acts[j]] or [score.leading]

    def along(direction: Array) -> SizeAlong:
        mdb = noise * minimal_detectable(float(direction @ score.whole @ direction))
        absorbed = absorbing(detection.linear, hypothesis, direction)
        if not absorbed and _same(detection.linear, hypothesis, direction, span):
            follow = _followers(detection.linear, hypothesis, direction)
            absorbed = _takers(detection.linear, follow) if np.abs(follow).max() * mdb > _GIVES_WAY * PLAUSIBLE else ()
            never = bool(absorbed)  # only ranges would tell it, and those are widened
        else:
            never = bool(absorbed) and not score.count  # what is left of it would name errors of these parameters
        if never:
            return SizeAlong(direction, float("inf"), partial(float, "inf"), absorbed)
        return SizeAlong(direction, mdb, partial(_detected, detection, k, direction, procedure), absorbed)

    unit = np.eye(len(hypothesis.parameters))
    return VisibleSizes(
        hypothesis=hypothesis,
        scale=detection.linear.scale_of(hypothesis.parameters),
        leading=max(acting, key=lambda j: float(score.alone[j])),
        numbers={j: along(unit[j]) for j in acting},
        worst=along(_worst(score, acting)) if len(acting) > 1 else None,
        tested=score.count > 0 and not score.far,
    )


def _detected(detection: Detection, k: int, direction: Array, procedure: Procedure) -> float:
    return float(np.sqrt(procedure.scale.variance)) * detection.size(k, direction, procedure)


def _worst(score: Score, among: list[int]) -> Array:
    """Direction (p,) with least information among some parameters.

    Of several such the one with the largest share of a parameter, which is positive: the same under any library.
    """
    values, vectors = np.linalg.eigh(score.whole[np.ix_(among, among)])
    least = vectors[:, values <= values[0] + _ALIKE * (abs(values[0]) + 1e-3 * values[-1])]
    shares = np.einsum("pk,pk->p", least, least)
    first = int(np.nonzero(shares >= (1 - _ALIKE) * shares.max())[0][0])
    vector = np.zeros(len(score.whole))
    vector[among] = least @ least[first] / np.sqrt(shares[first])
    return np.where(np.abs(vector) > _ALIKE, vector, 0.0)


def absorbing(linear: Linear, hypothesis: Hypothesis, direction: Array) -> tuple[str, ...]:
    """Declared parameters that could move instead of an effect in a direction (p,), largest first.

    None where enough of it is left.
    """
    column, left = linear.of(hypothesis.parameters) @ direction, linear.tested(hypothesis) @ direction
    whole = float(column @ column)
    if not linear.projected or not whole > 0 or not float(left @ linear.free(left)) < _KEPT**2 * whole:
        return ()
    return _takers(linear, _followers(linear, hypothesis, direction))


def _followers(linear: Linear, hypothesis: Hypothesis, direction: Array) -> Array:
    """By how much declared parameters (p,) follow an effect in a direction (p,), in standard deviations of priors."""
    column = linear.of(hypothesis.parameters) @ direction
    return np.asarray(np.linalg.lstsq(linear.of(linear.projected), column, rcond=1e-9)[0])


def _takers(linear: Linear, follow: Array) -> tuple[str, ...]:
    """Names of those that move readings most, largest first."""
    size = np.abs(follow) * np.sqrt((linear.of(linear.projected) ** 2).sum(axis=0))
    order = np.argsort(-size)[:_MOST]
    return tuple(linear.projected[j] for j in order if size[j] > _SHARE * size.max())


def _span(linear: Linear) -> Array:
    """Orthonormal directions (n + k, r) in which declared parameters move the values and what else is known of them."""
    known = np.zeros((0, len(linear.names))) if linear.known is None else linear.known[1]
    columns = np.vstack([linear.columns, known])[:, [linear.names.index(n) for n in linear.projected]]
    vectors, size, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(vectors[:, size > _ALIKE * size.max(initial=0.0)])


def _same(linear: Linear, hypothesis: Hypothesis, direction: Array, span: Array) -> bool:
    """Whether declared parameters move just as an effect in a direction (p,), however far off they would be."""
    column, left = linear.of(hypothesis.parameters) @ direction, linear.tested(hypothesis) @ direction
    left = np.append(left, np.zeros(len(span) - len(left)))
    rest, whole = left - span @ (span.T @ left), float(column @ column)
    return span.shape[1] > 0 and whole > 0 and float(rest @ rest) < _ALIKE**2 * whole
