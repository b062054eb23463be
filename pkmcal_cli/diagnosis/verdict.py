"""What a diagnosis comes to, in a word."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from pkmcal_cli.diagnosis.findings import Finding
from pkmcal_cli.diagnosis.linear import Linear
from pkmcal_cli.diagnosis.noise_tests import chance_of_noise
from pkmcal_cli.diagnosis.shape_findings import ShapeFinding
from pkmcal_cli.diagnosis.unknown import Unknown

Verdict = Literal["clean", "found", "ambiguous", "unknown", "measurement_fault", "sigma_too_small", "implausible"]
_TOO_MUCH = 1e-3  # chance of a residual so large, of noise as it is stated, at which nothing is called clean


def verdict_of(
    findings: Sequence[Finding],
    shapes: Sequence[ShapeFinding],
    unknown: Sequence[Unknown],
    measurement: bool,
    last: Linear,
) -> Verdict:
    """`measurement`: rows are wrong; `last`: the problem where all that was found is fitted."""
    if unknown:
        return "unknown"
    if any(f.ambiguous for f in findings) or any(len(s.places) > 1 for s in shapes):
        return "ambiguous"
    if shapes or any(not f.hypothesis.measurement for f in findings):
        return "found"
    if findings or measurement:
        return "measurement_fault"
    return "sigma_too_small" if chance_of_noise(last) < _TOO_MUCH else "clean"
