"""What is told of displacements without a name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.diagnosis.confirm import HeldOutGain, held_out_gain
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.scoring import NamelessShape, Scored, Search
from pkmcal_cli.diagnosis.unknown import Unknown
from pkmcal_cli.effects import catalogue
from pkmcal_cli.effects.unexplained import UNEXPLAINED, FreeShape, Unexplained, place_and_axis

_SHOWN = 1e-3  # share of a parameter's standard uncertainty below which nothing is hidden in it


@dataclass(frozen=True, kw_only=True)
class ShapeFinding:
    """A displacement without a name: `shape` with values and covariance at its knots, m or rad.

    places: where it may be, itself first, with weights; hidden: standard uncertainties, SI, of parameters by what it
    may hide in them; `names`: effects of the catalogue at its place that this table cannot show, and what they need;
    `named`: the effect at its place that has most of it, and whose shape it is; guided: across a guide; rms: of the
    readings that it moves, in stated standard uncertainties; span: of the axis that the table covers.
    """

    hypothesis: Hypothesis
    shape: FreeShape
    rotary: bool
    places: tuple[tuple[str, float], ...]
    evidence: float
    rms: float
    held_out: HeldOutGain
    hidden: Mapping[str, float]
    names: tuple[tuple[str, str], ...]
    named: Hypothesis | None = None
    guided: bool = False

    @property
    def curve(self) -> Array:
        """The values (K,) at the knots."""
        assert self.shape.values is not None
        return self.shape.values

    @property
    def std(self) -> Array:
        """Standard uncertainties (K,) at the knots."""
        assert self.shape.covariance is not None
        return np.sqrt(np.diag(self.shape.covariance))

    @property
    def extremes(self) -> tuple[int, int]:
        """Knots where it is highest and lowest; across a guide, from its reference line."""
        deviation = self._levelled @ self.curve
        return int(np.argmax(deviation)), int(np.argmin(deviation))

    @property
    def height(self) -> tuple[float, float]:
        """From the lowest knot to the highest, m or rad, and the standard uncertainty of this difference.

        The level of the curve, of which data know little beside parameters, is in neither; nor is the direction of a
        guide, which is no straightness (ISO 230-1, deviations from a reference line).
        """
        assert self.shape.covariance is not None
        high, low = self.extremes
        between = self._levelled[high] - self._levelled[low]
        return float(between @ self.curve), float(np.sqrt(max(between @ self.shape.covariance @ between, 0.0)))

    @property
    def _levelled(self) -> Array:
        """Takes (K, K) the reference line of a guide off a curve at the knots; else nothing."""
        count = len(self.shape.knots)
        if not self.guided:
            return np.eye(count)
        line = np.vander(np.array(self.shape.knots), 2)
        return np.eye(count) - line @ np.linalg.pinv(line)

    @property
    def depends_on(self) -> str:
        """What it depends on, in words."""
        place, axis = place_and_axis(self.hypothesis.at)
        return "time" if axis == "time" else f"the reading of {place}"

    @property
    def unknown(self) -> Unknown:
        """The same as something unknown."""
        return Unknown(self.depends_on, float(np.exp(-max(self.evidence, 0.0))), self.rms, self.hypothesis.name)


def nameless_at(at: str) -> Hypothesis:
    """`unexplained@PLACE`, whatever its shape is."""
    return Hypothesis(effect=UNEXPLAINED, at=at, parameters=())


def shape_findings(search: Search, last: Scored) -> tuple[ShapeFinding, ...]:
    """What is told of all displacements without a name. `last`: scored at the end."""
    return tuple(_finding(search, each, last) for each in search.shapes)


def _finding(search: Search, nameless: NamelessShape, last: Scored) -> ShapeFinding:
    fit, names = search.fit, nameless.placed.parameters
    covariance = last.scale.variance * search.inflation * _covariance(last.linear, names)
    weights = fit.values[[search.problem.model.names.index(n) for n in names]]
    moved = last.linear.of(names) @ weights
    place, _ = place_and_axis(nameless.placed.at)
    hidden = {
        n: s
        for n, s in nameless.best_fit.confounded.items()
        if n in fit.selected and s > _SHOWN * fit.std[fit.selected.index(n)]
    }
    return ShapeFinding(
        hypothesis=nameless.hypothesis,
        shape=known_shape(nameless, weights, covariance),
        rotary=nameless.placed.sites[0].kind == "rotary",
        places=nameless.places,
        evidence=nameless.evidence,
        rms=float(np.sqrt((moved**2).sum() / last.linear.used)),
        held_out=held_out_gain(search, nameless.hypothesis),
        hidden=hidden,
        names=tuple(_could_be(search, nameless, place)),
        named=nameless.named,
        guided=nameless.placed.effect.enters == "guide",
    )


def _covariance(linear: Linear, names: Sequence[str]) -> Array:
    """Covariance (K, K), SI, of projected parameters; what the data do not determine is as uncertain as its range."""
    columns, prior = linear.fixed
    vectors = linear.spectrum.vectors  # (d, p), in standard deviations of the priors
    whole = vectors.T @ np.linalg.solve(columns.T @ columns + prior, vectors)
    at = [linear.projected.index(n) for n in names]
    scale = linear.scale_of(names)
    return np.asarray(whole[np.ix_(at, at)] * np.outer(scale, scale))


def known_shape(nameless: NamelessShape, weights: Array, covariance: Array) -> FreeShape:
    """The shape at its knots of weights (K,) with a covariance (K, K)."""
    effect = nameless.placed.effect
    assert isinstance(effect, Unexplained)
    factor = effect.shape.factor
    return replace(effect.shape, values=factor @ weights, covariance=factor @ covariance @ factor.T)


def _could_be(search: Search, nameless: NamelessShape, place: str) -> list[tuple[str, str]]:
    """Effects at the place of a shape that the table cannot show, and what it lacks."""
    every = catalogue()
    lacking = {
        keyword: needs
        for keyword, at, needs in search.candidates.lacking
        if at == place and every[keyword].enters == nameless.placed.effect.enters
    }
    return list(lacking.items())
