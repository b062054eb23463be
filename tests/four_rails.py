"""A plate on four rods with carriages on four rails along x, by its few lines; a ball bar at balls on the table.

The drives' readings say where the carriages are along their rails, so a shift of rails and balls together is not seen:
`h1` and `z1`, or any other height and zero, are its datum.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array

Truth = dict[str, Array]
MACHINE = """\
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.1}
parameters:
  "l{i}": {each: {i: [1, 2, 3, 4]}, nominal: 620}
  "z{i}": {each: {i: [1, 2, 3, 4]}, nominal: 0, range: 0.5}
  "h{i}": {each: {i: [1, 2, 3, 4], v: [0, 0, 1000, 1000]}, nominal: "{v}"}
  cx: {nominal: 500, range: 130, per: session}
  cy: {nominal: 500, range: 130, per: session}
  tx: {nominal: 30, range: 0.1}
  ty: {nominal: -20, range: 0.1}
  k: {nominal: 20 kN/mm, range: 5 kN/mm, identify: false}
datum: [h1, z1]
guides: {"rail{i}": {each: {i: [1, 2, 3, 4]}, at: [0, "h{i}"], along: x}}
bodies:
  "c{i}": {each: {i: [1, 2, 3, 4], a: [877, 123, 123, 877]}, guide: "rail{i}", at: "{a}", points: {"C{i}": [0, 0]}}
  platform: {at: [500, 500], points: {P1: [-60, -60], P2: [60, -60], P3: [60, 60], P4: [-60, 60], T: [tx, ty]}}
bars: {"rod{i}": {each: {i: [1, 2, 3, 4]}, between: ["C{i}", "P{i}"], length: "l{i}", k: k}}
ground: {ball: [cx, cy]}
actuators:
  "q{i}": {each: {i: [1, 2, 3]}, moves: "c{i}", zero: "z{i}", limits: [-250, 1250]}
  q4: {moves: c4, zero: z4, redundant: true, limits: [-250, 1250]}
sensors:
  ballbar: {kind: distance, at: T, to: ball, sigma: 1 um}
tool_point: T
"""
CORNERS = np.array([[-60, -60], [60, -60], [60, 60], [-60, 60.0]])
SIDES = np.array([1, -1, -1, 1.0])
BALLS = np.array([[500, 500], [440, 480], [560, 520.0]])
NOMINAL: Truth = {
    "l": np.full(4, 620.0),
    "z": np.zeros(4),
    "h": np.array([0, 0, 1000, 1000.0]),
    "t": np.array([30, -20.0]),
}
SIGMAS = {"l": 0.05, "z": 0.25, "h": 0.05, "t": 0.05}
"""Half the ranges, mm."""


def drawn(rng: np.random.Generator, times: float = 1.0) -> Truth:
    """A true machine and its balls, mm, as its ranges say, or so many times as far off; none of its parameters is where
    the file has it."""
    sigmas = {name: times * sigma for name, sigma in SIGMAS.items()}
    truth = {name: NOMINAL[name] + sigma * rng.normal(size=NOMINAL[name].shape) for name, sigma in sigmas.items()}
    return truth | {"balls": BALLS + rng.normal(size=BALLS.shape)}


def relative_to(truth: Truth, rail: int) -> Truth:
    """The same machine, moved until this rail and its drive's zero are where the file has them."""
    shift = np.array([truth["z"][rail] - NOMINAL["z"][rail], truth["h"][rail] - NOMINAL["h"][rail]])
    moved = {"z": truth["z"] - shift[0], "h": truth["h"] - shift[1], "balls": truth["balls"] - shift}
    return truth | moved


def named(truth: Truth, files: list[str]) -> dict[str, float]:
    """Its numbers by the names of the file, whose sessions are those of tables."""
    out = {f"{name}{i + 1}": float(truth[name][i]) for name in "lzh" for i in range(4)}
    balls = zip(files, truth["balls"].tolist(), strict=True)
    places = {f"c{axis}[{Path(f).stem}]": place[a] for f, place in balls for a, axis in enumerate("xy")}
    return out | places | {"tx": float(truth["t"][0]), "ty": float(truth["t"][1])}


def _turned(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def _readings(place: Array, angle: float) -> Array:
    """Of the drives (4,) with the nominal machine's tool at a place (2,)."""
    corners = place - _turned(angle) @ NOMINAL["t"] + CORNERS @ _turned(angle).T
    return np.round(corners[:, 0] + SIDES * np.sqrt(NOMINAL["l"] ** 2 - (corners[:, 1] - NOMINAL["h"]) ** 2), 3)


def _tool(truth: Truth, readings: Array, guess: Array) -> Array:
    """Place (2,) of the tool: where rods, all as stiff, are strained least; guess (3,): of the plate."""
    carriages, x = np.stack([readings + truth["z"], truth["h"]], axis=1), guess.copy()

    def strains(x: Array) -> Array:
        return np.asarray(np.hypot(*(x[:2] + CORNERS @ _turned(x[2]).T - carriages).T) - truth["l"])

    for _ in range(30):
        small = np.diag([1e-4, 1e-4, 1e-6])
        slopes = np.stack([(strains(x + d) - strains(x - d)) / (2 * d.sum()) for d in small], axis=1)
        step = np.linalg.lstsq(slopes, -strains(x), rcond=None)[0]
        x = x + step
        if np.abs(step).max() < 1e-10:
            break
    return np.asarray(x[:2] + _turned(x[2]) @ truth["t"])


def measure(
    truth: Truth,
    rng: np.random.Generator,
    folder: Path,
    rows: int = 40,
    bar: float = 0.0,
    *,
    sigma: float = 1e-3,
    turn: float = 12.0,
) -> list[str]:
    """Tables b1.csv ..., one for each ball; `bar`: by how much longer the ball bar is than it says, mm; the plate turns
    by up to `turn`, degrees; sigma: of the ball bar, mm."""
    files = []
    for k, (nominal, ball) in enumerate(zip(BALLS, truth["balls"], strict=True), start=1):
        lines = ["q1 [mm],q2 [mm],q3 [mm],q4 [mm],ballbar [mm]"]
        for phase in rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(rows) / rows:
            place = nominal + 100 * np.array([np.cos(phase), np.sin(phase)])
            angle = np.radians(rng.uniform(-turn, turn))
            readings = _readings(place, angle)
            tool = _tool(truth, readings, np.append(place - _turned(angle) @ NOMINAL["t"], angle))
            length = np.hypot(*(tool - ball)) + sigma * rng.normal() - bar
            lines.append(",".join(f"{v:.3f}" for v in readings) + f",{length:.4f}")
        files.append(str(folder / f"b{k}.csv"))
        Path(files[-1]).write_text("\n".join([*lines, ""]), encoding="utf-8")
    return files
