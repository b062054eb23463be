"""Campaigns with planted errors, measured by one or several instruments: machine file and tables as people write them.

Poses come from the minimum of energy (`tests.truth`), readings from closed forms in the cases. SI units; the files have
the units that their headers name.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.random import Generator

from pkmcal_cli.base.rotation import Array, exp
from tests.command import run
from tests.support import MACHINES, poses_of, truth

UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "deg": np.pi / 180, "1": 1.0,
         "": 1.0, "N": 1.0, "kN": 1e3, "kN/mm": 1e6, "arcsec": np.pi / 648000}  # fmt: skip
UM, MM = 1e-6, 1e-3
DIGITS = 6
"""Of set values, in mm."""
Cells = dict[str, Any]
"""Readings (N,) in SI by header; NaN: not measured. Texts are labels."""


@dataclass(frozen=True, kw_only=True)
class Sample:
    """What a machine with planted errors does at N rows: set values `q` (N, A), the platform's place (N, 3), rotation
    vector (N, 3) and matrix, where its drives stand (N, A) and with what force."""

    q: Array
    place: Array
    vector: Array
    turn: Array
    travel: Array
    force: Array
    values: Mapping[str, float]

    def at(self, *point: float) -> Array:
        """Place (N, 3) of a point of the platform."""
        full = np.pad(np.array(point), (0, 3 - len(point)))
        return np.asarray(self.place + self.turn @ full)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A campaign. `changes`: what the machine file says over the shipped one; `free`: parameters with planted errors,
    the others are exact and held; `measure`: readings with noise; `nuisance`: true values (SI) of what belongs to the
    instruments, by the names of the result; `held`: drives whose force is given; `poses`: of the nominal machine."""

    name: str
    machine: str
    free: tuple[str, ...]
    changes: str
    measure: Callable[[Sample, Generator], Cells]
    nuisance: Mapping[str, float] = field(default_factory=dict)
    rows: int = 40
    sessions: int = 1
    held: Mapping[str, float] = field(default_factory=dict)
    poses: Callable[[Array], Array] = lambda x: x
    bench: Callable[[Mapping[str, float], Generator], Mapping[str, Any]] = lambda values, rng: {}


def simulator(case: Case) -> Any:
    """The independent simulator of its machine."""
    return truth(case.machine)


def planted(case: Case, seed: int) -> dict[str, float]:
    """True parameters: a normal error of half the range where the case frees them."""
    machine = simulator(case)
    rng = np.random.default_rng([seed, 1])
    return {**machine.nominal, **{n: machine.nominal[n] + machine.ranges[n] / 2 * rng.normal() for n in case.free}}


def simulated(case: Case, seed: int) -> Sample:
    """The machine with planted errors at the set values of the nominal one, as they stand in the file."""
    machine = simulator(case)
    poses = case.poses(poses_of(case.machine, case.rows, seed))
    q = np.round(machine.inverse(poses) * 1e3, DIGITS) / 1e3
    return at_set_values(case, q, planted(case, seed))


def at_set_values(case: Case, q: Array, values: Mapping[str, float]) -> Sample:
    """The machine with these parameters at set values (N, A)."""
    found = simulator(case).forward(q, values, case.held)
    spatial = found.tcp.shape[1] == 6
    place = found.tcp[:, :3] if spatial else np.pad(found.tcp[:, :2], ((0, 0), (0, 1)))
    vector = found.tcp[:, 3:] if spatial else np.pad(found.tcp[:, 2:], ((0, 0), (2, 0)))
    return Sample(
        q=q, place=place, vector=vector, turn=exp(vector), travel=found.travel, force=found.drive_force, values=values
    )


def written(case: Case, sample: Sample, rng: Generator, folder: Path) -> tuple[Path, list[Path]]:
    """Machine file and one table for every session."""
    folder.mkdir(parents=True, exist_ok=True)
    cells = {f"{d} [mm]": sample.q[:, k] for k, d in enumerate(simulator(case).drives)}
    cells |= case.measure(sample, rng)  # also the reading of a drive that is not commanded
    machine = folder / "machine.yaml"
    machine.write_text(machine_text(case, case.bench(sample.values, rng)), encoding="utf-8")
    session = np.arange(case.rows) * case.sessions // case.rows
    return machine, [_table(cells, session == k, folder / f"s{k}.csv") for k in range(case.sessions)]


def machine_text(case: Case, bench: Mapping[str, Any]) -> str:
    """The shipped machine with the sensors of the case; only `free` is identified. `bench`: readings in mm."""
    changes = yaml.safe_load(case.changes)
    known = {n: {"identify": n in case.free} for n in simulator(case).nominal}
    changes["parameters"] = {**known, **changes.get("parameters", {})}
    for sensor, reading in bench.items():
        changes["sensors"][sensor]["reading"] = float(reading)
    return f"extends: {MACHINES / case.machine}.yaml\n" + str(yaml.safe_dump(changes, sort_keys=False))


def _table(cells: Cells, rows: Any, target: Path) -> Path:
    """The rows of a session; a column that was not measured at all is left out."""
    texts = {header: _texts(header, np.asarray(values)[rows]) for header, values in cells.items()}
    kept = {header: values for header, values in texts.items() if any(values)}
    with target.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerow(kept)
        csv.writer(file).writerows(zip(*kept.values(), strict=True))
    return target


def _texts(header: str, values: Array) -> list[str]:
    if values.dtype.kind in "US":
        return [str(v) for v in values]
    unit = header.partition("[")[2].rstrip("]")
    return ["" if np.isnan(v) else f"{v / UNITS[unit]:.10f}" for v in values]


def calibrated(machine: Path, tables: Sequence[Path], *options: str) -> dict[str, Any]:
    """Result of `pkmcal calibrate`."""
    done = run("calibrate", machine, *tables, "--holdout", "none", "--json", "-q", *options)
    assert done.code == 0, (done.code, done.err, done.out)
    return dict(done.json)


def recovered(case: Case, seed: int, folder: Path, *options: str) -> tuple[dict[str, Any], dict[str, float]]:
    """Result of the calibration of a campaign, and true values by name."""
    sample = simulated(case, seed)
    machine, tables = written(case, sample, np.random.default_rng([seed, *case.name.encode()]), folder)
    return calibrated(machine, tables, *options), {**sample.values, **case.nuisance}


def deviations(result: Mapping[str, Any], true: Mapping[str, float]) -> dict[str, float]:
    """Error of every determined parameter in its standard uncertainties by the data: what is held is nominal here."""
    return {
        p["name"]: (p["value"] * UNITS[p["unit"]] - true[p["name"]]) / (p["std_by_data"] * UNITS[p["unit"]])
        for p in result["parameters"]
        if p["std"] is not None
    }


def noisy(values: Any, sigma: Any, rng: Generator) -> Array:
    """Readings with normal noise of standard deviation sigma."""
    return np.asarray(values + np.asarray(sigma) * rng.normal(size=np.shape(values)))


def partners(rows: int, step: int = 1) -> Array:
    """Every second row is the other end of a span from the row `step` before."""
    return np.array([k - step if k % 2 and k >= step else -1 for k in range(rows)])


def spans(place: Array, partner: Array) -> Array:
    """Distance (N,) to the partner's place, NaN without."""
    return np.where(partner < 0, np.nan, np.linalg.norm(place - place[partner], axis=1))


def labels(partner: Array) -> dict[str, Any]:
    """Columns `id` and `to`."""
    return {
        "id": np.array([f"p{k}" for k in range(len(partner))]),
        "to": np.array([f"p{k}" if k >= 0 else "" for k in partner]),
    }
