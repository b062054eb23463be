"""Campaigns with several instruments at once; not every one in every row."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from pkmcal_cli.base.rotation import Array
from tests.sensor_campaigns import MM, UM, Case, Cells, Sample, labels, noisy, partners, spans
from tests.sensor_cases_planar import (
    ANGLE_ZERO,
    BALLBAR,
    BIAS,
    DECLARED_BALL,
    FACTOR,
    GRID,
    LENGTHS,
    TRUE_BALL,
    current,
    frame,
    in_two_frames,
    on_plane,
    rod_angle,
    seen_from,
    to_ball,
    zeros_of_sessions,
)
from tests.sensor_cases_planar import wire as wire_reading
from tests.sensor_cases_spatial import BALL, MACHINE, ballbar, pose, seen


def sometimes(values: Array, every: int) -> Array:
    """Only in one of some rows."""
    return np.where(np.arange(len(values)) % every == 0, values, np.nan)


def tracker_and_ballbar(sample: Sample, rng: Generator) -> Cells:
    place = seen(sample.at(0.0, 0.0, -0.05))
    read = {f"tracker.{c} [mm]": noisy(place[:, k], 8 * UM, rng) for k, c in enumerate("xyz")}
    return read | {"ballbar [mm]": sometimes(ballbar(sample, rng), 2)}


def inside_the_machine(sample: Sample, rng: Generator) -> Cells:
    """Probe, calipers, an encoder in a joint and the current of a redundant drive, in turns."""
    partner = partners(len(sample.q), 3)
    return {
        **labels(partner),
        "probe [um]": sometimes(noisy(on_plane(sample, -0.1, 0.02), 2 * UM, rng), 2),
        "calipers [mm]": noisy(spans(sample.place, partner), 5 * UM, rng),
        "pin [deg]": noisy(rod_angle(sample), 2e-6, rng) - ANGLE_ZERO,
        "amps": sometimes(current(sample, rng), 3),
    }


def other_instruments_next_day(sample: Sample, rng: Generator) -> Cells:
    """A grid plate on the first day; draw wire and ballbar on the second, the ballbar in every third row."""
    first = np.arange(len(sample.q)) * 2 < len(sample.q)
    plate = np.where(first[:, None], noisy(seen_from(sample.place, *GRID), 0.5 * UM, rng), np.nan)
    pulled, bar = wire_reading(sample, rng, 1.7e-3), noisy(to_ball(sample), UM, rng)
    return {
        "grid.x [mm]": plate[:, 0],
        "grid.y [mm]": plate[:, 1],
        "wire [mm]": np.where(first, np.nan, pulled),
        "ballbar [um]": np.where(first, np.nan, sometimes(bar, 3)),
    }


MIXED: tuple[Case, ...] = (
    Case(
        name="tracker_ballbar_and_bench",
        machine="delta4",
        free=MACHINE,
        changes="""{parameters:
          {bx: {nominal: 30, range: 3}, by: {nominal: -300, range: 3}, bz: {nominal: -900, range: 5}},
        ground: {ball: [bx, by, bz]},
        sensors: {tracker: {offset: [0, 0, -50], frame: fitted, sigma: 8 um},
        ballbar: {kind: distance, at: platform, offset: [5, 6, -70], to: ball, sigma: 1 um},
        pair: {kind: bench, of: l1a - l1b, reading: 0, sigma: 3 um},
        arm: {kind: bench, of: (l2a + l2b)/2, reading: 500, sigma: 5 um}}}""",
        measure=tracker_and_ballbar,
        nuisance=pose("tracker") | {"bx": BALL[0], "by": BALL[1], "bz": BALL[2]},
        bench=lambda v, rng: {
            "pair": noisy(v["l1a"] - v["l1b"], 3 * UM, rng) / MM,
            "arm": noisy((v["l2a"] + v["l2b"]) / 2, 5 * UM, rng) / MM,
        },
    ),
    Case(
        name="probe_calipers_joint_and_current",
        machine="scissors",
        free=LENGTHS,
        changes="""{parameters: {kt: {nominal: 120, range: 5, unit: N}, i0: {nominal: 0, range: 100, unit: N},
        e0: {nominal: 0, range: 0.05}},
        frames: {bed: {at: [0, -100], turn: 0.02}},
        sensors: {grid: null, probe: {kind: touch, at: platform, offset: [30, -50], surface: bed, sigma: 2 um},
        calipers: {kind: span, at: platform, sigma: 5 um},
        pin: {kind: angle, at: B1, to: A1, zero: e0, sigma: 2 urad, unit: deg},
        current: {kind: force, drive: q2, column: amps, unit: "1", scale: kt, zero: i0, sigma: 0.05}}}""",
        measure=inside_the_machine,
        nuisance={"kt": FACTOR, "i0": BIAS, "e0": ANGLE_ZERO},
        rows=60,
    ),
    Case(
        name="other_instruments_next_day",
        machine="scissors",
        free=LENGTHS,
        changes=f"""{{parameters:
          {{{DECLARED_BALL}, w0: {{nominal: 0, range: 5}}, ws: {{nominal: 1, range: 0.01, unit: "1"}}}},
        ground: {{ball: [bx, by], hook: [-300, -900]}},
        sensors: {{grid: {{frame: fitted}},
        wire: {{kind: distance, at: platform, to: hook, zero: w0, scale: ws, sigma: 5 um}},
        ballbar: {BALLBAR}}}}}""",
        measure=other_instruments_next_day,
        nuisance={**frame(), **TRUE_BALL, "w0": 1.7e-3, "ws": 1.0029},
        sessions=2,
        rows=70,
    ),
    Case(
        name="plate_moved_wire_newly_zeroed",
        machine="scissors",
        free=LENGTHS,
        changes="""{parameters: {w0: {nominal: 0, range: 5, per: session}},
        ground: {hook: [-300, -900]},
        sensors: {grid: {frame: fitted per session},
        wire: {kind: distance, at: platform, to: hook, zero: w0, scale: 1.0029, sigma: 5 um}}}""",
        measure=lambda s, rng: (
            {f"grid.{k}": v for k, v in in_two_frames(s, rng).items()}
            | {"wire [mm]": sometimes(wire_reading(s, rng, zeros_of_sessions(s)), 2)}
        ),
        nuisance={**frame("[s0]"), **frame("[s1]"), "w0[s0]": 1.7e-3, "w0[s1]": -2.2e-3},
        sessions=2,
        rows=50,
    ),
)
