"""Writes the simulated measurement files of the shipped machines: `python -m tests.truth.generate [FOLDER]`.

Set values: the nominal machine, sent without strain and weight to a set of poses, rounded to the nanometre
(as in the file). Measurements: the machine with planted parameter errors, at its minimum of energy, plus
Gaussian noise. Beside each file NAME.csv stands NAME.csv.provenance.yaml with seed, noise and planted values.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from . import dimensions as dim
from . import self_measured_tables
from .gantry import BOWED, SCALES, Bow, Gantry
from .machines import PINNED, Hexapod7
from .pinned import Array
from .pinned_machine import Machine
from .sidecar import write_sidecar

FOLDER = Path(__file__).resolve().parents[2] / "machines"
UM = 1e-6
METHOD: dict[type, str] = {
    Machine: "minimum of the potential energy of a platform on pinned rods (springs)",
    Hexapod7: "stationary point of the potential energy of legs that are chains of rigid pieces with springs",
    Gantry: "minimum of the potential energy of a frame of fine beam elements, two meshes extrapolated",
}


SCISSORS_NINE = ("g1", "g2", "xa1", "l3", "xa2", "ya1", "l4", "ya2", "ya4")
"""The parameters that the paper identifies; the only ones with planted errors, as in the machine file."""


def identified(names: list[str]) -> set[str]:
    """Parameters that the shipped machine files identify: no stiffness, not the Triglide's gamma; the paper's nine
    of the Scissors."""
    if "xa5" in names:
        return set(SCISSORS_NINE)
    return {n for n in names if not n.startswith("k") and n != "gamma"}


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """A measurement file: machine, poses (N, k) in m and rad, sd of the noise of a position in m and of an
    orientation in rad, seeds of the parameter errors and of the noise."""

    machine: Machine | Hexapod7 | Gantry
    poses: Array
    noise: float
    noise_angle: float
    error_seed: int
    noise_seed: int
    strain: Array | None = None  # (N, drives) by which drives are off the nominal set values, m
    stiffness: bool = False  # whether stiffnesses have errors too
    noise_force: float = 0.0  # N, of the drives' forces; 0: they are not measured

    def planted(self) -> dict[str, float]:
        """True parameters, SI: nominal plus a normal error of sd range / 2, the same for the same name and
        seed, for those that the machine file identifies."""
        machine, true = self.machine, dict(self.machine.nominal)
        free = identified(list(true)) | ({n for n in true if n.startswith("k")} if self.stiffness else set())
        for name, value in machine.nominal.items():
            if name not in free:
                continue
            draw = np.random.default_rng([self.error_seed, *name.encode()]).normal()
            true[name] = value + draw * machine.ranges[name] / 2
        return true

    def set_values(self) -> Array:
        """Drive positions (N, drives) in m, rounded to 1 nm."""
        return np.round(self.machine.inverse(self.poses) + (0.0 if self.strain is None else self.strain), 9)

    @cached_property
    def _true_readings(self) -> Array:
        found = self.machine.forward(self.set_values(), self.planted())
        tcp = found.tcp[:, : len(self.machine.channels)]
        return np.hstack([tcp, found.drive_force]) if self.noise_force else tcp

    def true_readings(self) -> Array:
        """Readings (N, channels) in m, rad and N without noise."""
        return self._true_readings

    @property
    def channels(self) -> tuple[str, ...]:
        """What is measured: coordinates, then forces of drives (f1, f2, ...) where these have noise."""
        forces = (f"f{k}" for k in range(1, len(self.machine.drives) + 1)) if self.noise_force else ()
        return (*self.machine.channels, *forces)

    def sigma(self, channel: str) -> float:
        """Standard deviation of a channel's noise, SI."""
        return {"r": self.noise_angle, "f": self.noise_force}.get(channel[0], self.noise)

    def readings(self) -> Array:
        """Readings (N, channels) in m, rad and N with noise."""
        true = self.true_readings()
        sigma = [self.sigma(c) for c in self.channels]
        draw = np.random.default_rng(self.noise_seed).normal(size=true.shape)
        noisy: Array = true + np.array(sigma) * draw
        return noisy


def grid(*axes: tuple[float, float, int]) -> Array:
    """Poses (N, k) of a grid with end points, from (start, stop, count) in mm, last axis fastest; in m."""
    lines = [np.linspace(start, stop, count) * dim.MM for start, stop, count in axes]
    poses: Array = np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, len(axes))
    return poses


def spread(count: int, lower: list[float], upper: list[float]) -> Array:
    """Low-discrepancy points (count, k) in a box: additive recurrence with powers of the root of
    x^(k+1) = x + 1 (Roberts 2018)."""
    k, root = len(lower), 2.0
    for _ in range(60):
        root = (1 + root) ** (1 / (k + 1))
    share = (0.5 + np.outer(np.arange(1, count + 1), root ** -np.arange(1.0, k + 1))) % 1
    poses: Array = np.array(lower) + share * (np.array(upper) - np.array(lower))
    return poses


def in_turn(rows: int, drives: int, moved: tuple[int, ...], by: float) -> Array:
    """Offsets (rows, drives), m: one drive after the other of those that are moved, forwards and backwards."""
    states = [(drive, sign) for drive in moved for sign in (1.0, -1.0)]
    out = np.zeros((rows, drives))
    for row in range(rows):
        drive, sign = states[row % len(states)]
        out[row, drive] = sign * by
    return out


def strained_scissors() -> Campaign:
    """The Scissors with its redundant drives 0.1 mm off: internal forces that let stiffnesses be seen."""
    poses = grid((-203, 203, 10), (-200, 200, 8))
    strain = in_turn(len(poses), 4, (1, 2), 0.1 * dim.MM)
    return Campaign(
        machine=PINNED["scissors"](),
        poses=poses,
        noise=0.5 * UM,
        noise_angle=0.0,
        error_seed=104,
        noise_seed=212,
        strain=strain,
        stiffness=True,
        noise_force=20.0,
    )


def campaigns() -> dict[str, Campaign]:
    """All measurement files by name."""
    machines: dict[str, Callable[[], Machine | Hexapod7 | Gantry]] = {
        **PINNED,
        "hexapod7": Hexapod7,
        "gantry": partial(Gantry, pieces=(4, 8)),
        "gantry-bow": partial(Gantry, pieces=(4, 8), bow=Bow(x=BOWED)),
    }
    workspace = grid((0, 950, 3), (160, 390, 77))
    drawn = np.array([*dim.HEXAPOD7_DRAWN, 0, 0, 0])
    reach = np.array([0.08, 0.08, 0.08, 0.15, 0.15, 0.15])
    poses = {
        "triglide": workspace,
        "triglide-nonredundant": workspace,
        "biglide": grid((160, 560, 6), (160, 340, 10)),
        "scissors": grid((-203, 203, 10), (-200, 200, 8)),
        "delta4": spread(80, [-0.12, -0.12, 0.2], [0.12, 0.12, 0.4]),
        "hexapod7": spread(80, list(drawn - reach), list(drawn + reach)),
        "gantry": grid((150, 1350, 6), (30, 1530, 12)),
        "gantry-bow": grid((150, 1350, 6), (30, 1530, 12)),
    }
    noise = dict.fromkeys(poses, 10 * UM) | {"scissors": 0.5 * UM, "hexapod7": 5 * UM}
    noise |= {"gantry": 3 * UM, "gantry-bow": 3 * UM}
    # the non-redundant Triglide is the Triglide without its third leg: the same errors, other noise
    # and the bowed gantry is the gantry; 107 to 109 and 207 to 209 are taken
    seeds = dict(zip(poses, (*range(1, 7), 10, 11), strict=True))
    error_seeds = {name: 100 + seed for name, seed in seeds.items()}
    error_seeds |= {"triglide-nonredundant": 101, "gantry-bow": 110}
    strained = {"scissors-strained": strained_scissors()}
    return strained | {
        name: Campaign(
            machine=machines[name](),
            poses=poses[name],
            noise=noise[name],
            noise_angle=10e-6 if name == "hexapod7" else 0.0,
            error_seed=error_seeds[name],
            noise_seed=200 + seed,
        )
        for name, seed in seeds.items()
    }


def in_file_units(machine: Machine | Hexapod7 | Gantry, name: str, value: float) -> dict[str, Any]:
    """A parameter's value and unit as in the machine files."""
    if name.startswith("k"):
        return {"value": float(value / dim.KN_PER_MM), "unit": "kN/mm"}
    if name in SCALES:
        return {"value": float(value), "unit": "1"}
    if name in dim.ANGLES.get(machine.name, ()):
        if machine.name == "scissors":
            return {"value": float(value), "unit": "rad"}
        return {"value": float(np.degrees(value)), "unit": "deg"}
    return {"value": float(value / dim.MM), "unit": "mm"}


def _strain(campaign: Campaign) -> str:
    """How far the set values strain the nominal machine."""
    if campaign.strain is None:
        return "strain-free"
    moved = np.nonzero(campaign.strain.any(axis=0))[0]
    names = " and ".join(campaign.machine.drives[k] for k in moved)
    return f"but {names} in turn {np.abs(campaign.strain).max() / dim.MM:g} mm off, forwards and backwards"


def provenance(name: str, campaign: Campaign) -> Mapping[str, Any]:
    """What the sidecar says."""
    machine = campaign.machine
    noise: dict[str, str] = {"position": f"{campaign.noise / UM:g} um"}
    if campaign.noise_angle:
        noise["orientation"] = f"{campaign.noise_angle / UM:g} urad"
    if campaign.noise_force:
        noise["force"] = f"{campaign.noise_force:g} N"
    planted: dict[str, Any] = {
        "distribution": "nominal + normal error, standard deviation = range / 2",
        "parameters": {n: in_file_units(machine, n, v) for n, v in campaign.planted().items()},
    }
    if isinstance(machine, Gantry) and machine.bow.x:
        outward = f"{machine.bow.x / UM:g} um"
        planted["undeclared"] = (
            f"the right rail is an arc, in its middle {outward} further outward (x) than at its ends"
        )
    return {
        "data": f"{name}.csv",
        "kind": "simulated",
        "generator": "python -m tests.truth.generate",
        "method": METHOD[type(machine)] + "; independent of the engine, no code in common",
        "control": f"all drives position-controlled; set values of the nominal machine, {_strain(campaign)}",
        "seed": {"errors": campaign.error_seed, "noise": campaign.noise_seed},
        "rows": len(campaign.poses),
        "noise": {"distribution": "normal", "standard_deviation": noise},
        "planted": planted,
    }


def write(name: str, campaign: Campaign, folder: Path) -> None:
    """Writes NAME.csv and its sidecar."""
    machine = campaign.machine
    columns = [f"{q} [mm]" for q in machine.drives]
    units = {"r": ("rad", 1.0, 9), "f": ("kN", 1e3, 6)}
    shown = [(c, *units.get(c[0], ("mm", dim.MM, 6))) for c in campaign.channels]
    several = "grid." if campaign.noise_force else ""  # of several instruments columns say which
    columns += [f"{c if c[0] == 'f' else several + c} [{unit}]" for c, unit, _, _ in shown]
    with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["id", *columns])
        rows = zip(campaign.set_values(), campaign.readings(), strict=True)
        for number, (travel, reading) in enumerate(rows, 1):
            cells = [f"{q / dim.MM:.6f}" for q in travel]
            cells += [f"{value / scale:.{digits}f}" for (*_, scale, digits), value in zip(shown, reading, strict=True)]
            out.writerow([number, *cells])
    write_sidecar(folder / f"{name}.csv", provenance(name, campaign))


def main(folder: Path = FOLDER) -> None:
    """Writes all files."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, campaign in campaigns().items():
        write(name, campaign, folder)
        print(f"{name}: {len(campaign.poses)} rows", file=sys.stderr)
    for name, table in self_measured_tables.tables().items():
        self_measured_tables.write(table, folder)
        print(f"{name}: {len(table.places)} rows", file=sys.stderr)


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:2]))
