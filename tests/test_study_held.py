"""`pkmcal study`: what is not identified is off too, as on a real machine."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.test_study import results

SLIDE = """\
units: {length: mm, angle: deg, force: N}
space: planar
guides: {rail: {along: x}}
parameters: {z: {nominal: 0, range: 1}, h: {nominal: 100, range: 2, IS}}
bodies: {c: {guide: rail, at: 0, points: {P: [h, 0], R: [0, 0]}}}
actuators: {q: {moves: c, zero: z}}
sensors: {laser: {at: R, reads: [x], sigma: 1 um, frame: machine}}
tool_point: P
"""


@pytest.mark.parametrize(("what", "how", "off"), [
    ("identify: false", (), 1.0), ("identify: false", ("--held", "nominal"), 0.0), ("fixed: true", (), 0.0),
])  # fmt: skip
def test_what_is_not_identified_is_off_as_on_a_real_machine(
    what: str, how: tuple[str, ...], off: float, tmp_path: Path
) -> None:
    """A tool that is off by normal numbers of 1 mm (half its range) leaves the mean of their sizes, sqrt(2 / pi) mm."""
    file = tmp_path / "slide.yaml"
    file.write_text(SLIDE.replace("IS", what), encoding="utf-8")
    told = results(str(file), "--within", "x=50:500", "--points", "20", "--repeat", "60", *how)
    tool = told["cases"][0]["tool"]
    assert told["cases"][0]["n_failed"] == 0 and told["held"][0]["drawn"] == (["h"] if off else [])
    assert abs(tool["mean"] - off * 1e3 * math.sqrt(2 / math.pi)) < 4 * tool["std"] + 1.0
