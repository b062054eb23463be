"""Measurement files of the machines that measure themselves; `tests.truth.generate` writes them.

Set values: the nominal machine, sent without strain to a set of places, rounded as in the file. A drive that is not
exact stands off what it reads by a normal error. Measurements: the machine with planted parameter errors, plus normal
noise.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from . import dimensions as dim
from .belts import BeltRouter
from .delta_printer import DeltaPrinter
from .five_bar import FiveBar
from .pinned import Array
from .self_measured import Sensing
from .sidecar import write_sidecar

SENSING: dict[str, Sensing] = {m.name: m for m in (BeltRouter(), DeltaPrinter(), FiveBar())}
DIGITS = 6


@dataclass(frozen=True, kw_only=True)
class Table:
    """A measurement file: machine, places (N, k) in m, the row (N,) to which a distance was measured (-1: none), seeds
    of the parameter errors and of the noise."""

    machine: Sensing
    places: Array
    partner: Array
    error_seed: int
    noise_seed: int
    forgotten: tuple[tuple[str, float], ...] = ()  # by how much parameters are off besides, SI
    exact: tuple[str, ...] = ()  # parameters without an error of their own

    def planted(self) -> dict[str, float]:
        """True parameters, SI: nominal plus a normal error of sd range / 2 where the machine file identifies them."""
        true = dict(self.machine.nominal)
        for name, wide in self.machine.ranges.items():
            draw = np.random.default_rng([self.error_seed, *name.encode()]).normal()
            true[name] += draw * wide / 2 if name not in self.exact else 0.0
        for name, off in self.forgotten:
            true[name] += off
        return true

    @cached_property
    def noise(self) -> Array:
        """Normal numbers (N, drives + channels)."""
        width = len(self.machine.drives) + len(self.machine.channels)
        return np.random.default_rng(self.noise_seed).normal(size=(len(self.places), width))

    def set_values(self) -> Array:
        """What the drives (N, drives) read, SI, rounded as in the file."""
        unit = np.array([dim.UNITS[self.machine.unit(d)] for d in self.machine.drives])
        rounded: Array = np.round(self.machine.inverse(self.places) / unit, DIGITS) * unit
        return rounded

    def positions(self) -> Array:
        """Where the drives (N, drives) are, SI."""
        moved: Array = self.set_values() + self.drive_sigma() * self.noise[:, : len(self.machine.drives)]
        return moved

    def drive_sigma(self) -> Array:
        """Standard uncertainty (drives,) of the readings of drives, SI."""
        machine = self.machine
        out: Array = np.array([machine.si_sigma(d) for d in machine.drives]) / machine.gains(machine.nominal)
        return out

    def channel_sigma(self) -> Array:
        """Standard uncertainty (channels,) of the readings, SI."""
        drives = dict(zip(self.machine.drives, self.drive_sigma(), strict=True))
        return np.array([drives.get(c, self.machine.si_sigma(c)) for c in self.machine.channels])

    def true_readings(self) -> Array:
        """Readings (N, channels) without noise, SI; nan where nothing is measured."""
        return self.machine.read(self.positions(), self.planted(), self.partner)

    def readings(self) -> Array:
        """Readings (N, channels) with noise, SI."""
        noisy: Array = self.true_readings() + self.channel_sigma() * self.noise[:, len(self.machine.drives) :]
        return noisy


def belt_places() -> tuple[Array, Array]:
    """40 places across the work area; then 12 marks of a ring, each measured to the fifth after it."""
    x, y = np.meshgrid(np.linspace(450, 2550, 8), np.linspace(500, 1750, 5))
    turn = np.arange(12) * np.pi / 6
    ring = np.column_stack([1500 + 1050 * np.cos(turn), 1100 + 650 * np.sin(turn)])
    places = np.vstack([np.column_stack([x.ravel(), y.ravel()]), ring]) * dim.MM
    return places, np.concatenate([np.full(40, -1), 40 + (np.arange(12) + 5) % 12])


def circle(x: float, y: float, radius: float, count: int, first: float = 0.0) -> Array:
    """Places (count, 2) on a circle, in m from mm; the first at an angle in deg."""
    turn = np.radians(first) + 2 * np.pi * np.arange(count) / count
    out: Array = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)]) * dim.MM
    return out


def bed_places() -> Array:
    """Eleven places (11, 3) on the bed: centre, six at 100 mm on and opposite the towers, four at 55 mm."""
    flat = np.vstack([np.zeros((1, 2)), circle(0, 0, 100, 6, 90), circle(0, 0, 55, 4, 45)])
    return np.column_stack([flat, np.zeros(len(flat))])


def tables() -> dict[str, Table]:
    """All files by the machine's name."""
    belts, partner = belt_places()
    bars = np.vstack([circle(125, 380, 100, 20), circle(125, 380, 150, 20, 9)])
    places = {"delta-printer": bed_places(), "five-bar": bars, "belt-router": belts}
    joined = {"belt-router": partner}
    return {
        name: Table(
            machine=SENSING[name],
            places=where,
            partner=joined.get(name, np.full(len(where), -1)),
            error_seed=107 + k,
            noise_seed=207 + k,
        )
        for k, (name, where) in enumerate(places.items())
    }


def provenance(table: Table) -> Mapping[str, Any]:
    """What the sidecar says."""
    machine = table.machine
    planted = {
        name: {"value": float(value / dim.UNITS[machine.unit(name)]), "unit": machine.unit(name)}
        for name, value in table.planted().items()
    }
    return {
        "data": f"{machine.name}.csv",
        "kind": "simulated",
        "generator": "python -m tests.truth.generate",
        "method": machine.method + "; independent of the engine, no code in common",
        "control": machine.control,
        "seed": {"errors": table.error_seed, "noise": table.noise_seed},
        "rows": len(table.places),
        "noise": {
            "distribution": "normal; of drives as travel",
            "standard_deviation": {name: f"{number:g} {unit}" for name, (number, unit) in machine.sigma.items()},
        },
        "planted": {
            "distribution": "nominal + normal error, standard deviation = range / 2",
            "parameters": planted,
        },
    }


def cells(table: Table) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the file; a drive whose reading is measured stands in its column as measured."""
    machine, partner = table.machine, np.asarray(table.partner)
    names = dict.fromkeys((*machine.drives, *machine.channels))
    values = dict(zip(machine.drives, table.set_values().T, strict=True))
    values |= dict(zip(machine.channels, table.readings().T, strict=True))
    joins = bool((partner >= 0).any())
    header = ["id", *(f"{n} [{machine.unit(n)}]" for n in names), *(["to"] if joins else [])]
    rows = []
    for k, other in enumerate(partner):
        numbers = [values[n][k] / dim.UNITS[machine.unit(n)] for n in names]
        texts = ["" if np.isnan(x) else f"{x:.{DIGITS}f}" for x in numbers]
        rows.append([str(k + 1), *texts, *([str(other + 1) if other >= 0 else ""] if joins else [])])
    return header, rows


def write(table: Table, folder: Path) -> None:
    """Writes NAME.csv and its sidecar."""
    name = table.machine.name
    header, rows = cells(table)
    with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(header)
        out.writerows(rows)
    write_sidecar(folder / f"{name}.csv", provenance(table))
