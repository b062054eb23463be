"""What controls make of exported files, by their own rules, written anew from their documentation and source."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]
Tables = Mapping[str, tuple[Array, Array, Array]]
"""By drive: positions, what is added forward, what is added in reverse; m or deg."""


def comp_table(path: Path) -> tuple[Array, Array, Array]:
    """COMP_FILE of LinuxCNC, COMP_FILE_TYPE = 1, in mm: triplets up to the first line that is none."""
    rows = []
    for line in path.read_text().splitlines():
        words = line.split()
        try:
            rows.append([float(w) for w in words[:3]])
        except ValueError:
            break
        if len(rows[-1]) < 3:
            rows.pop()
            break
    table = np.array(rows)
    assert 0 < len(table) <= 256 and (np.diff(table[:, 0]) > 0).all()
    return table[:, 0] * 1e-3, table[:, 1] * 1e-3, table[:, 2] * 1e-3


def ssfk_table(path: Path) -> tuple[Array, Array, Array]:
    """A list of TwinCAT CNC in 0.1 um: what is added is less the deviation that the list holds."""
    values: dict[str, str] = {}
    for line in path.read_text().splitlines():
        if not line.startswith("#"):
            name, value = line.split()
            values[name] = value
    number = {k: int(v) for k, v in values.items() if k != "kopf.log_achs_name"}
    assert number["kw.ssfk.unit"] == 1 and number["kw.ssfk.interval"] > 0
    count = number["kw.ssfk.kw_nr_max"]
    at = number["kw.ssfk.kw_startpos"] + number["kw.ssfk.interval"] * np.arange(count)
    ahead = np.array([number[f"kw.ssfk.table[{i}].pos"] for i in range(count)])
    back = ahead
    if number["kw.ssfk.bilateral"]:
        back = np.array([number[f"kw.ssfk.table[{i}].neg"] for i in range(count)])
    return 1e-7 * at, -1e-7 * ahead, -1e-7 * back


def csv_tables(path: Path) -> Tables:
    """The table that docs/correct.md defines, in mm."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    rows: dict[str, list[list[float]]] = {}
    for row in csv.DictReader(lines):
        assert row["unit"] == "mm"
        rows.setdefault(row["drive"], []).append([float(row[c]) for c in ("position", "forward", "reverse")])
    tables = {name: 1e-3 * np.array(values) for name, values in rows.items()}
    return {name: (t[:, 0], t[:, 1], t[:, 2]) for name, t in tables.items()}


def tables_of(keyword: str, stem: Path, drives: Sequence[str]) -> Tables:
    """The tables of a format that was written to `stem`."""
    if keyword == "csv":
        return csv_tables(stem)
    read = comp_table if keyword == "linuxcnc" else ssfk_table
    return {d: read(stem.with_name(f"{stem.stem}.{d}{stem.suffix}")) for d in drives}


def added(tables: Tables, commanded: Mapping[str, Array]) -> Array:
    """Set values (N, A) after compensation; the side is that of the last motion, the mean of both before the first."""
    out = []
    for name, q in commanded.items():
        at, ahead, back = tables[name]
        side = np.zeros(len(q))
        for k in range(1, len(q)):
            side[k] = np.sign(q[k] - q[k - 1]) or side[k - 1]
        up, down = np.interp(q, at, ahead), np.interp(q, at, back)
        out.append(q + np.where(side > 0, up, np.where(side < 0, down, 0.5 * (up + down))))
    return np.stack(out, axis=1)


def klipper_options(path: Path) -> dict[str, dict[str, float | str]]:
    """Sections of a printer.cfg."""
    out: dict[str, dict[str, float | str]] = {}
    for line in path.read_text().splitlines():
        text = line.split("#")[0].strip()
        if head := re.fullmatch(r"\[(.+)\]", text):
            section = out.setdefault(head[1], {})
        elif text:
            name, value = text.split(":")
            section[name] = value.strip() if name == "kinematics" else float(value)
    return out


def klipper_delta(path: Path, positions: Array) -> Array:
    """Positions (N, 3) of the carriages under their switches, mm."""
    found = klipper_options(path)
    radius, out = float(found["printer"]["delta_radius"]), []
    for tower in "abc":
        about = {k: float(v) for k, v in found[f"stepper_{tower}"].items()}
        turn = np.radians(about["angle"])
        out.append(carriage(positions, radius, turn, about["arm_length"], about["position_endstop"], (0.0, 0.0)))
    return np.stack(out, axis=1)


def carriage(
    positions: Array, radius: float, turn: float, rod: float, stop: float, tilt: tuple[float, float]
) -> Array:
    """Position (N,) of a carriage of a linear delta under its switch."""
    x, y, z = positions.T
    height = np.sqrt(rod**2 - (x - radius * np.cos(turn)) ** 2 - (y - radius * np.sin(turn)) ** 2)
    return np.asarray(height + z + tilt[0] * x + tilt[1] * y - (stop + np.sqrt(rod**2 - radius**2)))


def commands(path: Path) -> dict[str, dict[str, list[float]]]:
    """Parameters of M665, M666 and M669 in a config.g."""
    out: dict[str, dict[str, list[float]]] = {}
    for line in path.read_text().splitlines():
        command, *words = line.split(";")[0].split() or [""]
        if command in ("M665", "M666", "M669"):
            out[command] = {w[0]: [float(v) for v in w[1:].split(":")] for w in words}
    return out


def reprap_delta(path: Path, positions: Array) -> Array:
    """Positions (N, 3) of the carriages under their switches, mm."""
    found = commands(path)
    size, ends = found["M665"], found["M666"]
    rods = size["L"] * 3 if len(size["L"]) == 1 else size["L"]
    tilt = (0.01 * ends["A"][0], 0.01 * ends["B"][0])
    out = []
    for k, (tower, usual) in enumerate(zip("XYZ", (210.0, 330.0, 90.0), strict=True)):
        stop = size["H"][0] + ends[tower][0]
        out.append(carriage(positions, size["R"][0], np.radians(usual + size[tower][0]), rods[k], stop, tilt))
    return np.stack(out, axis=1)


def line_ways(anchors: Array, positions: Array) -> Array:
    """Ways (N, A) of lines from where the machine is homed, the origin."""
    return np.asarray(np.linalg.norm(positions[:, None] - anchors, axis=2) - np.linalg.norm(anchors, axis=1))


def klipper_winch(path: Path, positions: Array) -> tuple[Array, Array]:
    """Ways (N, A) of the lines, mm, and turns of the motors where `rotation_distance` is there."""
    steppers = [about for name, about in klipper_options(path).items() if name.startswith("stepper_")]
    anchors = np.array([[float(about[f"anchor_{c}"]) for c in "xyz"] for about in steppers])
    per_turn = np.array([float(about.get("rotation_distance", np.nan)) for about in steppers])
    moved = line_ways(anchors, positions)
    return moved, moved / per_turn


def hangprinter(path: Path, positions: Array) -> Array:
    """Tilts (N, A) of the motors, as in HangprinterKinematics.cpp, in double precision."""
    found = commands(path)
    about = {c: np.array(v) for c, v in found["M666"].items()}
    anchors = np.array([found["M669"][c] for c in "ABCD"])
    k2 = -about["U"] * about["O"] * about["Q"]
    moved = line_ways(anchors, positions)
    of_spool = 2.0 / k2 * (np.sqrt(about["R"] ** 2 + moved * k2) - about["R"])
    return np.asarray(of_spool * about["U"] * about["H"] / about["L"] / (2.0 * np.pi))
