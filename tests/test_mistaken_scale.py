"""An encoder of a passive joint whose zero is unknown, so that only its scale shows a wrong sign or unit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from tests.command import run
from tests.test_limits_as_workspace import SLIDERS

ENCODER = """
extends: sliders.yaml
tool_point: tcp
parameters: {z: {nominal: 0, range: 60, unit: deg}}
sensors: {tracker: null, encoder: {kind: angle, at: B1, to: tcp, zero: z, sigma: 5 arcsec}}
"""


def seen() -> tuple[Array, Array]:
    """Readings of the drives (40, 2), mm, and of the encoder (40,), deg, of a machine that is off within its ranges."""
    rng = np.random.default_rng(0)
    q = np.stack([rng.uniform(50, 400, 40), rng.uniform(600, 790, 40)], axis=1)
    along = (400.06**2 - 399.95**2 + (q[:, 1] - q[:, 0]) ** 2) / (2 * (q[:, 1] - q[:, 0]))
    return q, np.degrees(np.arccos(along / 400.06)) + np.degrees(2.4e-5) * rng.normal(size=40)


@pytest.mark.parametrize(
    ("slip", "told"),
    [
        (lambda a: -a, "The column of encoder looks reversed in sign."),
        (np.radians, "The column of encoder looks 57.3 times too small (is it in `rad`, not `deg`?)."),
        (lambda a: a / 2, "The column of encoder looks 2 times too small."),
        (lambda a: 1.01 * a, ""),
    ],
    ids=["sign", "unit", "half", "scale"],
)
def test_a_scale_that_is_a_slip_is_told_as_one(
    slip: Callable[[Array], Array], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sliders.yaml").write_text(SLIDERS)
    Path("m.yaml").write_text(ENCODER)
    q, angle = seen()
    table = np.column_stack([q, slip(angle)])
    np.savetxt("t.csv", table, fmt="%.9f", delimiter=",", header="q1,q2,encoder", comments="")
    done = run("diagnose", "m.yaml", "t.csv")
    assert done.code == 1 and "meas_scale@encoder: Cause:" in done.err
    assert told in done.err and ("The column of" in done.err) == bool(told)
