"""Thermal growth of telescopic legs: in proportion to how far they are extended, against circles that intersect."""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.prediction import Request, Rows, predict
from tests.support import model

APART, OFFSETS, RISE = 1.0, np.array([0.3, 0.35]), np.array([-5.0, 0.0, 4.0, 9.0])
EXTENDED = np.array([[0.45, 0.4], [0.3, 0.6], [0.75, 0.5], [0.25, 0.3]])
"""Distance of the two joints on the base, lengths at reading 0, m; rise, K; readings (4, 2), m."""
LEGS = """
space: planar
ranges: {length: 1 mm}
parameters: {o1: 0.3, o2: 0.35}
ground: {A: [0, 0], B: [1, 0]}
nodes: {tip: [0.5, 0.6]}
bars: {leg1: {between: [A, tip]}, leg2: {between: [B, tip]}}
actuators: {q1: {drives: leg1, offset: o1, scale: SCALE}, q2: {drives: leg2, offset: o2}}
sensors: {tracker: {at: tip, reads: [x, y], sigma: 1 um, frame: machine}}
"""


def tips(lengths: Array) -> Array:
    """Where circles about the two joints meet above them, (N, 2)."""
    x = (lengths[:, 0] ** 2 - lengths[:, 1] ** 2 + APART**2) / (2 * APART)
    return np.stack([x, np.sqrt(lengths[:, 0] ** 2 - x**2)], axis=1)


def grown(readings: Array, a: float, which: slice, scale: float) -> Array:
    """The tip when legs are longer by a dT of what they measure at these readings, (N, 2)."""
    lengths = OFFSETS + readings * np.array([scale, 1.0])
    lengths[:, which] *= 1 + a * RISE[:, None]
    return tips(lengths)


@pytest.mark.parametrize("scale", [1.0, -1.0])
@pytest.mark.parametrize(("place", "which"), [("leg1", slice(0, 1)), ("leg2", slice(1, 2)), ("all", slice(0, 2))])
def test_a_leg_grows_in_proportion_to_its_extension(place: str, which: slice, scale: float) -> None:
    """Not to its length in the drawing: 0.55 to 1.05 m here, of which 0.25 m at 9 K are 26 um."""
    text = LEGS.replace("SCALE", str(scale)) + f"effects: {{thermal_strut@{place}: {{a: 11.5 um/(m*K)}}}}\n"
    built, readings = model(text), EXTENDED * np.array([scale, 1.0])
    rows = Rows(readings, np.full((4, 2), np.nan), {"T": 293.15 + RISE})
    found = predict(built, built.nominal, rows, Request(parameters=(f"thermal_strut@{place}.a",), by_drive=True))
    assert found.solved.all()
    np.testing.assert_allclose(found.values, grown(readings, 11.5e-6, which, scale), rtol=0, atol=1e-12)
    h = 1e-6
    by_size = (grown(readings, 11.5e-6 + h, which, scale) - grown(readings, 11.5e-6 - h, which, scale)) / (2 * h)
    assert found.jacobian is not None and found.by_drive is not None
    np.testing.assert_allclose(found.jacobian[..., 0], by_size, rtol=1e-6, atol=1e-8)
    for a in range(2):
        step = h * np.eye(2)[a]
        ahead, back = (grown(readings + s * step, 11.5e-6, which, scale) for s in (1, -1))
        np.testing.assert_allclose(found.by_drive[..., a], (ahead - back) / (2 * h), rtol=0, atol=1e-8)
