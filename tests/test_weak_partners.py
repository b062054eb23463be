"""A partner in a weak direction is named by what the readings see, whatever the ranges are; fitted frames apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.identifiability import combinations, directions
from tests.command import TRIGLIDE, TRIGLIDE_DATA, run

RNG = np.random.default_rng(1)
SEEN, OTHER, OWN = (v / np.linalg.norm(v) for v in RNG.normal(size=(3, 200)))


@pytest.mark.parametrize("range_of_partner", [1.0, 1e2, 1e5])
def test_a_partner_is_named_whatever_its_range(range_of_partner: float) -> None:
    """Two parameters with the same effect but for a thousandth; the readings know both together to a millionth."""
    jacobian = 1e3 * np.column_stack([SEEN, SEEN + 1e-3 * OTHER, OWN])
    found = combinations(directions(jacobian, ("length", "partner", "free"), np.array([1.0, range_of_partner, 1.0])))
    weak = [c for c in found if c.kind == "weak"]
    assert [set(c.names) for c in weak] == [{"length", "partner"}]
    assert "length" in weak[0].text and "partner" in weak[0].text and "free" not in weak[0].text


def test_a_parameter_that_hardly_acts_has_no_partner() -> None:
    jacobian = np.column_stack([1e3 * SEEN, 1e-1 * OTHER])
    (weak,) = combinations(directions(jacobian, ("seen", "faint"), np.array([1.0, 1.0])))
    assert weak.names == ("faint",) and weak.text == "faint has hardly any effect"


def test_fitted_frames_have_a_table_of_their_own(tmp_path: Path) -> None:
    """A frame that may stand anywhere, its range that of the whole machine, is named beside what it imitates."""
    machine = tmp_path / "apart.yaml"
    machine.write_text(f"extends: {TRIGLIDE}\nsensors: {{tracker: {{frame: fitted}}}}\n")
    done = run("calibrate", machine, TRIGLIDE_DATA, "--holdout", "none")
    own, _, frames = done.err.partition("\nFitted frames\n")
    own = own.partition("\nParameters\n")[2]
    frames = frames.partition("\nundetermined")[0]
    assert "\nl1 " in own and "\nframe@tracker." not in own and frames.count("\nframe@tracker.") == 3
    weak = next(line for line in done.err.splitlines() if line.startswith("l3 "))
    assert "hardly separable from" in weak and "frame@tracker.tx" in weak
    assert "+-" not in frames  # a range of the whole machine says nothing
