"""Studies of machines that an instrument measures which may stand anywhere: where the base lies is no error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import run
from tests.cross_slide import cross_slide

SLIDES = "datum: [x0, y0, turn]" + cross_slide("FRAME")
"""A cross slide that is squint, and lies within a millimetre."""


@pytest.mark.parametrize(("frame", "numbers"), [("fitted", 2), ("machine", 5)])
def test_where_a_base_lies_that_nobody_sees_is_no_error_of_the_tool_point(
    frame: str, numbers: int, tmp_path: Path
) -> None:
    """By least squares each number that is fitted leaves sigma^2 in all 80 values together: of the frame's, nothing."""
    file = tmp_path / "slides.yaml"
    file.write_text(SLIDES.replace("FRAME", frame), encoding="utf-8")
    asked = ("--within", "x=-300:300,y=-300:300", "--points", "40", "--repeat", "20", "--validation", "40", "--json")
    done = run("study", file, *asked)
    (case,) = done.json["cases"]
    assert case["n_failed"] == 0, done.err
    assert case["tool"]["mean"] == pytest.approx(5 * np.sqrt(2 * numbers / 80) * 0.9, rel=0.3)  # mean below rms, um
