"""What one length measured on the bench would bring, where positions alone leave combinations weak or not seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pkmcal_cli.calibration.identifiability import Directions, combinations, directions
from pkmcal_cli.model.model import Model

_BETTER = 0.95  # of an uncertainty: what falls less is not worth a word
_SHARE = 5.0  # a part of its range to which a length can be measured by hand


@dataclass(frozen=True)
class BenchProposal:
    """Measure `name` with standard uncertainty sigma: those of the parameters before and after, SI, inf where not seen.

    gains: (name, before, after) by the data alone, of those that become better known, the measured one first.
    """

    name: str
    sigma: float
    gains: tuple[tuple[str, float, float], ...]


def bench_proposals(model: Model, directions: Directions) -> tuple[BenchProposal, ...]:
    """One for each weak or null combination: the length of it that brings most, if it brings more than itself."""
    out: dict[str, BenchProposal] = {}
    for combination in combinations(directions):
        tried = (_proposal(model, directions, name, combination.names) for name in combination.names)
        alone = len(combination.names) == 1
        if made := [p for p in tried if p is not None and (alone or len(p.gains) > 1)]:
            best = max(made, key=lambda p: _gain(model, p))
            out.setdefault(best.name, best)
    return tuple(out.values())


def _gain(model: Model, proposal: BenchProposal) -> float:
    """By how much uncertainties fall in all, in ranges."""
    ranges = dict(zip(model.names, model.ranges, strict=True))
    return float(sum((min(b, ranges[n]) - min(a, ranges[n])) / ranges[n] for n, b, a in proposal.gains))


def _proposal(model: Model, spectrum: Directions, name: str, others: tuple[str, ...]) -> BenchProposal | None:
    k = spectrum.names.index(name)
    if model.parameters[model.names.index(name)].dimension != "length":
        return None
    sigma = _rounded(float(spectrum.ranges[k]) / _SHARE)
    row = np.zeros(len(spectrum.names))
    row[k] = 1.0 / sigma
    before = spectrum.std_of_data()
    jacobian = spectrum.singular_values[:, None] * spectrum.duals / spectrum.ranges
    after = directions(np.vstack([jacobian, row]), spectrum.names, spectrum.ranges).std_of_data()
    ordered = [name, *(n for n in others if n != name)]
    index = [spectrum.names.index(n) for n in ordered]
    gains = [(n, _finite(before[i]), _finite(after[i])) for n, i in zip(ordered, index, strict=True)]
    return BenchProposal(name, sigma, (gains[0], *(g for g in gains[1:] if g[2] < _BETTER * g[1])))


def _finite(value: float) -> float:
    return math.inf if math.isnan(value) else float(value)


def _rounded(value: float) -> float:
    """To one digit: 1, 2 or 5."""
    power = 10.0 ** math.floor(math.log10(value))
    return min((1.0, 2.0, 5.0, 10.0), key=lambda m: abs(m * power - value)) * power
