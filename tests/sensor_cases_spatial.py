"""Campaigns on delta4, one instrument each. Radii of the platform's joints and the fourth column's turn are known."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from pkmcal_cli.base.rotation import Array, exp
from tests.sensor_campaigns import UM, Case, Cells, Sample, noisy

ARMS = tuple(f"l{i}{side}" for i in (1, 2, 3, 4) for side in "ab")
MACHINE = ("R1", "R2", "R3", "R4", "g1", "g2", "g3", *ARMS)
ORIGIN, TURN = np.array([1.31, -2.84, 0.71]), np.array([0.21, -0.13, 2.12])
BED = {"bz": -0.5613, "ba": 0.0113, "bb": -0.0177}
BALL = np.array([0.0313, -0.2987, -0.9021])
ZERO = 0.3613
"""Of the encoder at the arm's joint, rad."""


def pose(sensor: str) -> dict[str, float]:
    """True pose of an instrument's frame."""
    names = zip(("tx", "ty", "tz", "rx", "ry", "rz"), (*ORIGIN, *TURN), strict=True)
    return {f"frame@{sensor}.{k}": float(v) for k, v in names}


def seen(place: Array) -> Array:
    """Coordinates (N, 3) in the frame of the instrument."""
    return np.asarray(ORIGIN + place @ exp(TURN).T)


def three_reflectors(sample: Sample, rng: Generator) -> Cells:
    points = {n: sample.at(*p) for n, p in (("P1a", (0.06, 0.04)), ("P3b", (-0.06, 0.04)), ("P2a", (-0.04, 0.06)))}
    return {
        f"{name}.{c} [m]": noisy(seen(place)[:, k], 5 * UM, rng)
        for name, place in points.items()
        for k, c in enumerate("xyz")
    }


def far_tracker(sample: Sample, rng: Generator) -> Cells:
    """3 um and 6 um/m of the distance; x and y of every row correlated by 0.6, y and z by -0.3."""
    place = seen(sample.place)
    sigma = np.hypot(3 * UM, 6 * UM * np.linalg.norm(place, axis=1))[:, None]
    mixing = np.linalg.cholesky(np.array([[1, 0.6, 0], [0.6, 1, -0.3], [0, -0.3, 1]]))
    read = place + sigma * rng.normal(size=place.shape) @ mixing.T
    return {f"{c} [mm]": read[:, k] for k, c in enumerate("xyz")}


def pose_in_space(sample: Sample, rng: Generator) -> Cells:
    """Also a rotation vector; sigma 5 um, 20 urad."""
    place = {f"{c} [mm]": noisy(sample.place[:, k], 5 * UM, rng) for k, c in enumerate("xyz")}
    return place | {f"r{c} [mrad]": noisy(sample.vector[:, k], 20e-6, rng) for k, c in enumerate("xyz")}


def level(sample: Sample, rng: Generator) -> Cells:
    return {f"r{c} [urad]": noisy(sample.vector[:, k], 5e-6, rng) for k, c in enumerate("xy")}


def over_bed(sample: Sample, *tip: float) -> Array:
    """Coordinates (N, 3) in the frame of the bed."""
    bed = exp(np.array([BED["ba"], BED["bb"], 0.0]))
    return np.asarray((sample.at(*tip) - [0.0, 0.0, BED["bz"]]) @ bed)


def probe(sample: Sample, rng: Generator) -> Cells:
    return {"probe [um]": noisy(over_bed(sample, 0.005, 0.006, -0.07)[:, 2], 2 * UM, rng)}


def straightedge(sample: Sample, rng: Generator) -> Cells:
    off = over_bed(sample, 0.0, 0.0, -0.05)
    return {"edge.y [mm]": noisy(off[:, 1], 3 * UM, rng), "edge.z [mm]": noisy(off[:, 2], 3 * UM, rng)}


def ballbar(sample: Sample, rng: Generator) -> Array:
    return noisy(np.linalg.norm(sample.at(0.005, 0.006, -0.07) - BALL, axis=1), UM, rng)


def arm_angle(sample: Sample) -> Array:
    """Of arm 2a about its carriage's y, from z towards x."""
    v = sample.values
    column = exp(np.array([0.0, 0.0, v["g2"] + np.pi / 2]))
    line = sample.at(-0.04, v["r2"]) @ column - [v["R2"], 0.04, 0.0] - np.outer(sample.travel[:, 1], [0, 0, 1])
    return np.asarray(np.arctan2(line[:, 0], line[:, 2]))


NO_TRACKER = "tracker: null"
SPATIAL: tuple[Case, ...] = (
    Case(
        name="tracker_three_reflectors_in_unknown_frame",
        machine="delta4",
        free=MACHINE,
        changes="sensors: {tracker: {at: [P1a, P3b, P2a], frame: fitted, sigma: 5 um}}",
        measure=three_reflectors,
        nuisance=pose("tracker"),
        rows=20,
    ),
    Case(
        name="tracker_noise_grows_and_is_correlated",
        machine="delta4",
        free=MACHINE,
        changes="""sensors: {tracker: {frame: fitted, sigma: 3 um, sigma_per_length: 6 um/m,
        correlation: {x_y: 0.6, y_z: -0.3}}}""",
        measure=far_tracker,
        nuisance=pose("tracker"),
        rows=40,
    ),
    Case(
        name="only_z",
        machine="delta4",
        free=ARMS,
        changes="sensors: {tracker: {reads: [z], sigma: 2 um}}",
        measure=lambda s, rng: {"z [mm]": noisy(s.place[:, 2], 2 * UM, rng)},
        rows=40,
    ),
    Case(
        name="full_pose_in_space",
        machine="delta4",
        free=MACHINE,
        changes="""sensors: {tracker: {reads: [x, y, z, rx, ry, rz], sigma: {position: 5 um, orientation: 20 urad}}}""",
        measure=pose_in_space,
        rows=20,
    ),
    Case(
        name="level",
        machine="delta4",
        free=ARMS,
        changes="sensors: {tracker: {reads: [rx, ry], sigma: 5 urad}}",
        measure=level,
        rows=30,
    ),
    Case(
        name="probe_on_an_unknown_bed",
        machine="delta4",
        free=ARMS,
        changes=f"""{{parameters: {{bz: {{nominal: -560, range: 3}}, ba: {{nominal: 0, range: 0.03, unit: rad}},
        bb: {{nominal: 0, range: 0.03, unit: rad}}}}, frames: {{bed: {{at: [0, 0, bz], turn: [ba, bb, 0]}}}},
        sensors: {{{NO_TRACKER},
        probe: {{kind: touch, at: platform, offset: [5, 6, -70], surface: bed, sigma: 2 um}}}}}}""",
        measure=probe,
        nuisance=BED,
        rows=60,
    ),
    Case(
        name="line_touched",
        machine="delta4",
        free=ARMS,
        changes=f"""{{frames:
          {{bed: {{at: [0, 0, {BED["bz"] * 1e3}], turn: ["{BED["ba"]} rad", "{BED["bb"]} rad", 0]}}}},
        sensors: {{{NO_TRACKER},
        edge: {{kind: touch, at: platform, offset: [0, 0, -50], surface: bed, reads: ["y", z], sigma: 3 um}}}}}}""",
        measure=lambda s, rng: {k.replace("edge.", ""): v for k, v in straightedge(s, rng).items()},
        rows=40,
    ),
    Case(
        name="ballbar_unknown_ball_in_space",
        machine="delta4",
        free=ARMS,
        changes=f"""{{parameters: {{bx: {{nominal: 30, range: 3}}, by: {{nominal: -300, range: 3}},
        bz: {{nominal: -900, range: 5}}}}, ground: {{ball: [bx, by, bz]}},
        sensors: {{{NO_TRACKER},
        ballbar: {{kind: distance, at: platform, offset: [5, 6, -70], to: ball, sigma: 1 um}}}}}}""",
        measure=lambda s, rng: {"ballbar [mm]": ballbar(s, rng)},
        nuisance={"bx": BALL[0], "by": BALL[1], "bz": BALL[2]},
        rows=60,
    ),
    Case(
        name="angle_of_an_arm_with_unknown_zero",
        machine="delta4",
        free=ARMS,
        changes=f"""{{parameters: {{e0: {{nominal: 20, range: 2}}}},
        sensors: {{{NO_TRACKER},
        encoder: {{kind: angle, at: C2a, to: P2a, axis: "y", zero: e0, sigma: 2 arcsec}}}}}}""",
        measure=lambda s, rng: {"encoder [deg]": noisy(arm_angle(s), 2 * np.pi / 648000, rng) - ZERO},
        nuisance={"e0": ZERO},
        rows=60,
    ),
)
