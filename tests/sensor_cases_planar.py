"""Campaigns on the Scissors, one instrument each (with what else it takes to determine the machine)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.random import Generator

from pkmcal_cli.base.rotation import Array
from tests.sensor_campaigns import MM, UM, Case, Cells, Sample, at_set_values, labels, noisy, partners, simulator, spans

LENGTHS = ("l3", "l4", "xa1", "xa2", "ya1", "ya2", "ya4")
NINE = (*LENGTHS, "g1", "g2")
GRID = np.array([0.31, -0.84]), 2.3
MOVED = np.array([-1.27, 0.42]), -0.9
BALL = np.array([0.1021, -0.7487])
TRUE_BALL = {"bx": BALL[0], "by": BALL[1]}
BALLBAR = "{kind: distance, at: platform, offset: [30, -50], to: ball, sigma: 1 um}"
DECLARED_BALL = "bx: {nominal: 100, range: 5}, by: {nominal: -750, range: 5}"
ANGLE_ZERO, FACTOR, BIAS = 0.0212, 119.1, -41.0


def seen_from(place: Array, origin: Array, angle: float) -> Array:
    """Coordinates (N, 2) in an instrument's frame whose pose is that of the machine seen from the instrument."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(origin + place[:, :2] @ np.array([[c, s], [-s, c]]))


def frame(session: str = "") -> dict[str, float]:
    """True pose of the grid encoder."""
    origin, angle = MOVED if session == "[s1]" else GRID
    return {f"frame@grid.{k}{session}": v for k, v in (("tx", origin[0]), ("ty", origin[1]), ("rz", angle))}


def grid(sample: Sample, rng: Generator, name: str = "", sigma: float = 0.5 * UM) -> Cells:
    """The grid encoder in the machine's axes."""
    return {f"{name}{c} [mm]": noisy(sample.place[:, k], sigma, rng) for k, c in enumerate("xy")}


def in_frame(sample: Sample, rng: Generator) -> Cells:
    read = noisy(seen_from(sample.place, *GRID), 0.5 * UM, rng)
    return {"x [um]": read[:, 0], "y [m]": read[:, 1]}


def in_two_frames(sample: Sample, rng: Generator) -> Cells:
    first = (np.arange(len(sample.q)) * 2 < len(sample.q))[:, None]
    read = np.where(first, seen_from(sample.place, *GRID), seen_from(sample.place, *MOVED))
    return {f"{c} [mm]": noisy(read[:, k], 0.5 * UM, rng) for k, c in enumerate("xy")}


def full_pose(sample: Sample, rng: Generator) -> Cells:
    return grid(sample, rng) | {"rz [arcsec]": noisy(sample.vector[:, 2], 2e-6, rng)}


def to_ball(sample: Sample) -> Array:
    return np.asarray(np.linalg.norm(sample.at(0.03, -0.05)[:, :2] - BALL, axis=1))


def wire(sample: Sample, rng: Generator, zeros: Any) -> Array:
    """To a hook at (-300, -900) mm, 2.9 per mille short."""
    far = np.linalg.norm(sample.place[:, :2] - [-0.3, -0.9], axis=1)
    return np.asarray((noisy(far, 5 * UM, rng) - zeros) / 1.0029)


def zeros_of_sessions(sample: Sample) -> Array:
    return np.where(np.arange(len(sample.q)) * 2 < len(sample.q), 1.7e-3, -2.2e-3)


def calipers(sample: Sample, rng: Generator) -> Cells:
    partner = partners(len(sample.q), 5)
    return {**labels(partner), "calipers [mm]": noisy(spans(sample.at(0.03, -0.05), partner), 5 * UM, rng)}


def on_plane(sample: Sample, height: float, angle: float) -> Array:
    """Height of the probe's tip over a plane through (0, height), turned by an angle."""
    tip = sample.at(0.03, -0.05)[:, :2] - [0.0, height]
    return np.asarray(tip @ [-np.sin(angle), np.cos(angle)])


def rod_angle(sample: Sample) -> Array:
    """Direction of rod 1 in the axes of its carriage."""
    v, g = sample.values, sample.values["g1"]
    turn = np.array([[np.cos(g), -np.sin(g)], [np.sin(g), np.cos(g)]])
    b1 = [-v["d1"], 0.0] + np.column_stack([np.full(len(sample.q), v["xb1"]), v["yb1"] + sample.q[:, 0]]) @ turn.T
    line = (sample.at(-v["xa1"], v["ya1"])[:, :2] - b1) @ turn
    return np.asarray(np.arctan2(line[:, 1], line[:, 0]))


def current(sample: Sample, rng: Generator) -> Array:
    return noisy((sample.force[:, 1] - BIAS) / FACTOR, 0.05, rng)


def touched(sample: Sample, rng: Generator) -> Cells:
    """The machine is sent down until the probe clicks: 5 um off; its readings are 0."""
    off, asked = 5 * UM * rng.normal(size=len(sample.q)), sample.place[:, :2]
    case = next(c for c in PLANAR if c.name == "probe_clicks")
    for _ in range(3):
        asked = asked + np.outer(off - on_plane(sample, -0.1, 0.02), [0.0, 1.0])
        sample = at_set_values(case, np.round(simulator(case).inverse(asked), 9), sample.values)
    assert np.abs(on_plane(sample, -0.1, 0.02) - off).max() < 0.05 * UM
    return {f"q{k + 1} [mm]": sample.q[:, k] for k in range(4)} | {"probe [mm]": np.zeros(len(sample.q))}


PLANAR: tuple[Case, ...] = (
    Case(
        name="grid_in_unknown_frame",
        machine="scissors",
        free=NINE,
        changes="sensors: {grid: {frame: fitted}}",
        measure=in_frame,
        nuisance=frame(),
    ),
    Case(
        name="grid_moved_between_sessions",
        machine="scissors",
        free=NINE,
        changes="sensors: {grid: {frame: fitted per session}}",
        measure=in_two_frames,
        nuisance=frame("[s0]") | frame("[s1]"),
        sessions=2,
        rows=50,
    ),
    Case(
        name="only_x",
        machine="scissors",
        free=NINE,
        changes="sensors: {grid: {reads: [x]}}",
        measure=lambda s, rng: {"x [mm]": noisy(s.place[:, 0], 0.5 * UM, rng)},
    ),
    Case(
        name="full_pose_in_the_plane",
        machine="scissors",
        free=(*NINE, "xa3", "ya3"),
        changes="sensors: {grid: {reads: [x, y, rz], sigma: {position: 0.5 um, orientation: 2 urad}}}",
        measure=full_pose,
    ),
    Case(
        name="ballbar_known_ball",
        machine="scissors",
        free=LENGTHS,
        changes=f"""{{ground: {{ball: [{BALL[0] * 1e3}, {BALL[1] * 1e3}]}},
        sensors: {{grid: null, ballbar: {BALLBAR}}}}}""",
        measure=lambda s, rng: {"ballbar [mm]": noisy(to_ball(s), UM, rng)},
        rows=60,
    ),
    Case(
        name="ballbar_unknown_ball",
        machine="scissors",
        free=LENGTHS,
        changes=f"""{{parameters: {{{DECLARED_BALL}}}, ground: {{ball: [bx, by]}},
        sensors: {{grid: null, ballbar: {BALLBAR}}}}}""",
        measure=lambda s, rng: {"ballbar [um]": noisy(to_ball(s), UM, rng)},
        nuisance=TRUE_BALL,
        rows=60,
    ),
    Case(
        name="wire_zero_and_scale_unknown",
        machine="scissors",
        free=LENGTHS,
        changes="""{parameters: {w0: {nominal: 0, range: 5}, ws: {nominal: 1, range: 0.01, unit: "1"}},
        ground: {hook: [-300, -900]},
        sensors: {grid: null, wire: {kind: distance, at: platform, to: hook, zero: w0, scale: ws, sigma: 5 um}}}""",
        measure=lambda s, rng: {"wire [mm]": wire(s, rng, 1.7e-3)},
        nuisance={"w0": 1.7e-3, "ws": 1.0029},
        rows=60,
    ),
    Case(
        name="wire_zero_per_session",
        machine="scissors",
        free=LENGTHS,
        changes="""{parameters: {w0: {nominal: 0, range: 5, per: session}}, ground: {hook: [-300, -900]},
        sensors: {grid: null, wire: {kind: distance, at: platform, to: hook, zero: w0, scale: 1.0029, sigma: 5 um}}}""",
        measure=lambda s, rng: {"wire [mm]": wire(s, rng, zeros_of_sessions(s))},
        nuisance={"w0[s0]": 1.7e-3, "w0[s1]": -2.2e-3},
        rows=60,
        sessions=2,
    ),
    Case(
        name="calipers",
        machine="scissors",
        free=NINE,
        changes="{sensors: {grid: null, calipers: {kind: span, at: platform, offset: [30, -50], sigma: 5 um}}}",
        measure=calipers,
        rows=100,
    ),
    Case(
        name="probe_on_a_known_plane",
        machine="scissors",
        free=LENGTHS,
        changes="""{frames: {bed: {at: [0, -100], turn: 0.02}},
        sensors: {grid: null, probe: {kind: touch, at: platform, offset: [30, -50], surface: bed, sigma: 2 um}}}""",
        measure=lambda s, rng: {"probe [mm]": noisy(on_plane(s, -0.1, 0.02), 2 * UM, rng)},
        rows=60,
    ),
    Case(
        name="probe_clicks",
        machine="scissors",
        free=("l3", "l4", "xa1", "ya1"),
        changes="""{frames: {bed: {at: [0, -100], turn: 0.02}},
        sensors: {grid: null, probe: {kind: touch, at: platform, offset: [30, -50], surface: bed, sigma: 5 um}}}""",
        measure=touched,
        rows=30,
        poses=lambda x: np.column_stack([x[:, 0], -0.05 + 0.02 * x[:, 0]]),
    ),
    Case(
        name="probe_on_an_unknown_plane",
        machine="scissors",
        free=LENGTHS,
        changes="""{parameters: {h: {nominal: -100, range: 2}, t: {nominal: 0.02, range: 0.01}},
        frames: {bed: {at: [0, h], turn: t}},
        sensors: {grid: null, probe: {kind: touch, at: platform, offset: [30, -50], surface: bed, sigma: 2 um}}}""",
        measure=lambda s, rng: {"probe [mm]": noisy(on_plane(s, -0.1008, 0.0243), 2 * UM, rng)},
        nuisance={"h": -0.1008, "t": 0.0243},
        rows=60,
    ),
    Case(
        name="angle_of_a_rod_with_unknown_zero",
        machine="scissors",
        free=("l3", "l4", "xa1", "xa2", "ya1", "ya2"),
        changes="""{parameters: {e0: {nominal: 0, range: 0.05}},
        sensors: {grid: null, encoder: {kind: angle, at: B1, to: A1, zero: e0, unit: deg, sigma: 2 urad}}}""",
        measure=lambda s, rng: {"encoder [deg]": noisy(rod_angle(s), 2e-6, rng) - ANGLE_ZERO},
        nuisance={"e0": ANGLE_ZERO},
        rows=60,
    ),
    Case(
        name="motor_current_with_unknown_factor",
        machine="scissors",
        free=NINE,
        changes="""{parameters: {kt: {nominal: 120, range: 5, unit: N}, i0: {nominal: 0, range: 100, unit: N}},
        sensors: {current: {kind: force, drive: q2, unit: "1", scale: kt, zero: i0, sigma: 0.05}}}""",
        measure=lambda s, rng: grid(s, rng, "grid.") | {"current": current(s, rng)},
        nuisance={"kt": FACTOR, "i0": BIAS},
    ),
    Case(
        name="a_passive_drive_reads",
        machine="scissors",
        free=LENGTHS,
        changes="""{actuators: {q2: {control: passive, sigma: 1 um}, q3: {control: passive, sigma: 1 um}},
        sensors: {grid: null}}""",
        measure=lambda s, rng: {f"q{k + 1} [mm]": noisy(s.travel[:, k], UM, rng) for k in (1, 2)},
        held={"q2": 0.0, "q3": 0.0},
        rows=60,
    ),
    Case(
        name="lengths_on_the_bench",
        machine="scissors",
        free=(*LENGTHS, "l1", "l2"),
        changes="""{sensors: {rod3: {kind: bench, of: l3, reading: 950, sigma: 10 um},
        pair: {kind: bench, of: l1 - l2, reading: 0, sigma: 3 um}}}""",
        measure=grid,
        bench=lambda v, rng: {
            "rod3": noisy(np.array(v["l3"]), 10 * UM, rng) / MM,
            "pair": noisy(np.array(v["l1"] - v["l2"]), 3 * UM, rng) / MM,
        },
    ),
)
