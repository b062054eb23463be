"""Effects on a crank and on a weight on a wire, in closed form: how large each is, where it acts, which way it points.

Those that the independent simulator does not have, nor `test_effects.py` by hand.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects import catalogue
from pkmcal_cli.prediction import Rows, predict
from tests.support import model
from tests.test_effects import BY_HAND
from tests.truth.families_true import families
from tests.truth.shop_plans import PLANS

ANGLE = np.radians([0.0, 30.0, 115.0, -70.0])
RISE = np.array([0.0, 3.0, -2.0, 8.0])  # of the temperature, K
SIDE = np.array([1.0, -1.0, 1.0, 1.0])
SPINDLE = np.radians([0.0, 90.0, 200.0, 300.0])
CRANK = """
units: {length: mm, angle: deg, force: N}
space: planar
ground: {O: [100, 50]}
bodies: {arm: {at: [100, 50], points: {tool: [400, 0]}}}
joints: {hub: {between: [O, arm], type: revolute}}
actuators: {q: {turns: arm}}
sensors: {tracker: {at: tool, reads: [x, y], sigma: 1 um, frame: machine}}
"""
WEIGHT = """
units: {length: mm, angle: deg, force: N}
space: planar
gravity: [0, -9.81]
parameters: {l: {nominal: 500, range: 1}}
ground: {A: [0, 0]}
nodes: {bob: {at: [0, -500], mass: 3}}
guides: {rail: {at: [0, -500], along: y}}
bodies: {slide: {guide: rail, at: 0, points: {P: [0, 0]}}}
joints: {pin: {between: [bob, P], type: revolute}}
bars: {wire: {between: [A, bob], length: l, EA: 20 kN}}
actuators: {t: {moves: slide, redundant: true, control: force, force: 40}}
sensors: {dial: {at: bob, reads: [y], sigma: 1 um, frame: machine}}
"""


def tip(
    error: Array | float = 0.0, tool: tuple[Array | float, Array | float] = (0.0, 0.0), growth: Array | float = 0.0
):
    """Place (4, 2) m of the crank's tool point.

    error: of the angle; tool: shift in the crank's axes; growth: share by which the base grows.
    """
    axes = np.stack([np.cos(ANGLE + error), np.sin(ANGLE + error)], axis=1)
    across = np.stack([-axes[:, 1], axes[:, 0]], axis=1)
    x, y = (np.broadcast_to(t, ANGLE.shape)[:, None] for t in (0.4 + tool[0], tool[1]))
    return np.outer(1 + np.broadcast_to(growth, ANGLE.shape), [0.1, 0.05]) + x * axes + y * across


def turned(part: Callable[[Array], Array], size: float, times: int) -> Array:
    """An error that repeats so many times a turn, less that at reading 0, which is the zero's."""
    return size * (part(times * ANGLE) - part(np.zeros(1)))


def rim(x: float, y: float) -> tuple[Array, Array]:
    """A point at (x, y) that turns with the spindle."""
    return x * np.cos(SPINDLE) - y * np.sin(SPINDLE), x * np.sin(SPINDLE) + y * np.cos(SPINDLE)


ON_THE_CRANK = {
    "gear@q: {c1: 300 urad}": tip(turned(np.cos, 300e-6, 1)),
    "gear@q: {s1: 300 urad}": tip(turned(np.sin, 300e-6, 1)),
    "gear@q: {c2: 200 urad, s2: -100 urad}": tip(turned(np.cos, 200e-6, 2) - turned(np.sin, 100e-6, 2)),
    "pitch@q: {c: 150 urad, s2: -80 urad, period: 50 deg}": tip(
        150e-6 * np.cos(7.2 * ANGLE) - 80e-6 * np.sin(14.4 * ANGLE)
    ),
    "runout@tracker: {c: 40 um, s: 15 um}": tip(tool=rim(40e-6, 15e-6)),
    "thermal_tool@tracker: {gx: 7 um/K, gy: -3 um/K}": tip(tool=(7e-6 * RISE, -3e-6 * RISE)),
    "thermal_base@all: {a: 11 um/(m*K)}": tip(growth=11e-6 * RISE),
}


@pytest.mark.parametrize("entry", ON_THE_CRANK)
def test_effects_on_a_crank(entry: str) -> None:
    built = model(CRANK + f"effects:\n  {entry}\n")
    columns = {"T": 293.15 + RISE, "spindle": SPINDLE}
    found = predict(built, built.nominal, Rows(ANGLE[:, None], np.full((4, 1), np.nan), columns))
    assert found.solved.all()
    np.testing.assert_allclose(found.values, ON_THE_CRANK[entry], rtol=0, atol=1e-11)


@pytest.mark.parametrize("drive", ["ratio: 1/20", "ratio: -1/20, unit: {count: 1/32768 rev}", "scale: 0.05"])
def test_a_gear_error_repeats_with_the_joint_not_with_its_motor(drive: str) -> None:
    """An eccentric wheel on a joint: error of the joint's angle once a turn of the joint, behind any gear."""
    built = model(CRANK.replace("{turns: arm}", f"{{turns: arm, {drive}}}") + "effects:\n  gear@q: {c1: 300 urad}\n")
    readings = ANGLE * (-20 if "-1/20" in drive else 20)
    found = predict(built, built.nominal, Rows(readings[:, None], np.full((4, 1), np.nan)))
    np.testing.assert_allclose(found.values, tip(turned(np.cos, 300e-6, 1)), rtol=0, atol=1e-11)


ON_THE_WIRE = {
    "preload@t: {f: 25 N}": (25.0, 0.0),
    "force_scale@t: {s: 0.5}": (20.0, 0.0),
    "friction@t: {f: 15 N}": (-15.0 * SIDE, 0.0),
    "self_weight@all: {w: 0.5}": (-0.5 * 3 * 9.81, 0.0),
    "thermal_strut@wire: {a: 11 um/(m*K)}": (0.0, 11e-6 * 0.5 * RISE),
}
"""Force (N) that pushes the weight up, growth (4,) m of the wire."""


@pytest.mark.parametrize("entry", ON_THE_WIRE)
def test_effects_on_a_hanging_weight(entry: str) -> None:
    """The wire of length l is longer by l F / EA, towards -y for weight, +y where the drive pushes up."""
    places, strain = [], (3 * 9.81 - 40) / 20e3
    rows = Rows(np.full((4, 1), np.nan), np.full((4, 1), np.nan), {"T": 293.15 + RISE, "dir.t": SIDE})
    for text in (WEIGHT, WEIGHT + f"effects:\n  {entry}\n"):
        built = model(text)
        found = predict(built, built.nominal, rows)
        assert found.solved.all()
        places.append(found.values[:, 0])
    np.testing.assert_allclose(-places[0] - 0.5, strain * 0.5, rtol=1e-6)
    more, growth = ON_THE_WIRE[entry]
    moved = more * 0.5 / 20e3 - growth * (1 + strain)
    np.testing.assert_allclose(places[1] - places[0], moved, rtol=1e-5, atol=1e-12)


def test_every_effect_has_a_size_that_something_else_says() -> None:
    """The independent simulator, or a calculation by hand."""
    simulated = {keyword for machine in PLANS for keyword, _ in families(machine)}
    by_hand = {entry.partition("@")[0] for entry in (*BY_HAND, *ON_THE_CRANK, *ON_THE_WIRE)}
    elsewhere = {"buildup", "meas_zero", "sag"}  # test_buildup, test_instrument_effects, test_guide_springs
    assert set(catalogue()) == simulated | by_hand | elsewhere
