"""A machine is the same however it is written: turned, mirrored, shifted, in other units, renamed, reordered.

Predictions and their derivatives to 1e-9 of what they are; identified values to 1e-6 of their standard uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.prediction import Method, Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from pkmcal_cli.units.unit_text import parse_unit
from tests.command import clean, run
from tests.in_ci import in_ci
from tests.truth.placed_machines import Writing, plane, space

PLAIN = ["ax", "ay", "o1", "o2", "rod", "k", "plate", "slide", "rail", "link", "C", "tool", "t"]
PLAIN += [f"{kind}{i}" for kind in ("B", "P", "leg", "q") for i in range(1, 8)]
NAMES = {name: f"z_{k}" if k % 2 else f"A{k}" for k, name in enumerate(PLAIN)}
TURN = Rotation.from_rotvec([0.7, -1.1, 0.4]).as_matrix()


DRAWN = "as drawn"
FREE = ("ax", "ay", "o1", "o2", "rod", "k")
POSES = 30


def drawn(dimensions: int) -> Writing:
    return Writing(axes=np.eye(dimensions), origin=np.zeros(dimensions))


def ways(dimensions: int) -> dict[str, Writing]:
    """How else a machine can be written."""
    plain = drawn(dimensions)
    turn = TURN if dimensions == 3 else Rotation.from_rotvec([0, 0, 2.2]).as_matrix()[:2, :2]
    shift = np.array([3.0, -20.0, 7.0])[:dimensions]
    mirror = np.diag([-1.0, 1.0, 1.0])[:dimensions, :dimensions]
    return {
        "turned": replace(plain, axes=turn),
        "mirrored": replace(plain, axes=mirror),
        "shifted": replace(plain, origin=shift),
        "inches": replace(plain, length="in", force="lbf", angle="rad"),
        "metres": replace(plain, length="m", force="kN"),
        "renamed": replace(plain, names=NAMES),
        "reordered": replace(plain, backwards=True),
        "all": Writing(axes=turn @ mirror, origin=shift, length="in", force="kN", names=NAMES, backwards=True),
    }


MACHINES: dict[str, tuple[int, Callable[[Writing], str]]] = {"plane": (2, plane), "space": (3, space)}
CASES = [(name, way) for name, (d, _) in MACHINES.items() for way in ways(d)]


@cache
def model(name: str, way: str) -> Model:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "m.yaml"
        file.write_text(MACHINES[name][1](written(name, way)), encoding="utf-8")
        return load_machine(str(file)).model


def written(name: str, way: str) -> Writing:
    return drawn(MACHINES[name][0]) if way == DRAWN else ways(MACHINES[name][0])[way]


@cache
def readings(name: str) -> dict[str, Array]:
    """Readings of the drives at poses up to 60 mm and 8 deg about the reference configuration, off by up to 0.2 mm."""
    m, rng = model(name, DRAWN), np.random.default_rng(4)
    coordinates = [DIRECTIONS.index(c) for c in m.independent_coordinates]
    poses = np.full((POSES, 6), np.nan)
    reach = np.where(np.array(coordinates) < 3, 0.06, np.deg2rad(8))
    poses[:, coordinates] = m.tool.reference[coordinates] + rng.uniform(-reach, reach, (POSES, len(reach)))
    found = drive_positions(m, poses)
    assert found.reached.all()
    moved = found.readings + rng.uniform(-2e-4, 2e-4, found.readings.shape)
    return {a.name: moved[:, k] for k, a in enumerate(m.actuators)}


@cache
def predicted(name: str, way: str, method: Method) -> dict[str, Array]:
    """What a machine with errors reads, its derivatives by parameters and drives, and forces, drives in plain order."""
    m, w, at = model(name, way), written(name, way), readings(name)
    free = [w.name(n) for n in FREE]
    values = m.nominal.copy()
    for k, parameter in enumerate(free):
        place = m.names.index(parameter)
        values[place] += (0.3 - 0.1 * k) * m.ranges[place]
    own = [a.name for a in m.actuators]
    order = [own.index(w.name(drive)) for drive in at]
    table = np.zeros((POSES, len(own)))
    table[:, order] = np.column_stack(list(at.values()))
    exact = method == "exact"
    asked = Request(method=method, parameters=tuple(free) if exact else None, by_drive=exact, forces=exact)
    found = predict(m, values, Rows.at(table), asked)
    assert found.solved.all()
    if method != "exact":
        return {"values": found.values}
    assert found.jacobian is not None and found.by_drive is not None and found.forces is not None
    sloped = {"jacobian": found.jacobian, "by_drive": found.by_drive[:, :, order]}
    return {"values": found.values, **sloped, "forces": found.forces[:, order]}


def seen_from(w: Writing, quantity: Array) -> Array:
    """Readings (N, C, ...) of the machine as it is drawn, in base axes of where it is written."""
    d = len(w.axes)
    turned, sense = np.zeros((quantity.shape[1],) * 2), np.linalg.det(w.axes)
    turned[:d, :d] = w.axes
    turned[d:, d:] = sense * (w.axes if d == 3 else np.eye(1))  # rotation vectors are axial
    return np.asarray(np.einsum("ij,nj...->ni...", turned, quantity))


@pytest.mark.parametrize(
    ("name", "way", "method"),
    in_ci(
        [
            *(f"{name}-{way}-exact" for name, way in CASES),
            *(f"{name}-{way}-{how}" for name, way in CASES for how in ("linear", "rigid") if way in ("turned", "all")),
        ],
        ((*case, method) for case in CASES for method in ("exact", "linear", "rigid")),
    ),
)
def test_predictions(name: str, way: str, method: Method) -> None:
    w, expected, found = written(name, way), predicted(name, DRAWN, method), predicted(name, way, method)
    origin = np.concatenate([w.origin, np.zeros(found["values"].shape[1] - len(w.origin))])
    for key, quantity in found.items():
        true = expected[key] if key == "forces" else seen_from(w, expected[key])
        size = np.abs(expected[key]).max(axis=0 if key == "forces" else (0, 1))
        shift = origin if key == "values" else 0.0
        assert (np.abs(quantity - shift - true) <= 1e-9 * size).all(), key


@pytest.mark.parametrize(
    ("name", "way"),
    in_ci(
        ["space-shifted", "plane-inches", "plane-metres", "space-renamed", "plane-reordered"],
        product(MACHINES, ["shifted", "inches", "metres", "renamed", "reordered"]),
    ),
)
def test_calibrations(name: str, way: str, tmp_path: Path) -> None:
    """Identified values and standard uncertainties, of a table with noise, written the same way."""
    (value, std), (other, other_std) = as_drawn(name), identified(name, way, tmp_path)
    assert (np.abs(value - other) < 1e-6 * std).all()
    np.testing.assert_allclose(other_std, std, rtol=1e-6)


@cache
def as_drawn(name: str) -> tuple[Array, Array]:
    with TemporaryDirectory() as folder:
        return identified(name, DRAWN, Path(folder))


def table(name: str, way: str, folder: Path) -> Path:
    """A table of the plain machine with errors, with noise, written as the machine is."""
    w, read = written(name, way), predicted(name, DRAWN, "exact")["values"]
    read = read + 1e-6 * np.random.default_rng(8).normal(size=read.shape)
    read[:, : len(w.origin)] += w.origin
    lengths = ["x", "y", "z"][: len(w.origin)]
    columns = {w.name(k): [w.value(v, "length") for v in column] for k, column in readings(name).items()}
    for k, c in enumerate([*lengths, *(["rz"] if len(lengths) == 2 else ["rx", "ry", "rz"])]):
        columns[c] = [w.value(v, "length" if c in lengths else "angle") for v in read[:, k]]
    if w.backwards:
        columns = dict(reversed(columns.items()))
    file = folder / "t.csv"
    lines = [",".join(columns), *(",".join(row) for row in zip(*columns.values(), strict=True))]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def identified(name: str, way: str, folder: Path) -> tuple[Array, Array]:
    """Values and standard uncertainties in SI, in plain order."""
    machine, w = folder / "m.yaml", written(name, way)
    machine.write_text(MACHINES[name][1](w), encoding="utf-8")
    options = ("--select", "all", "--holdout", "none", "--json", "-q")
    done = clean(run("calibrate", machine, table(name, way, folder), *options))
    assert done.code == 0, done.err
    rows = {p["name"]: p for p in done.json["parameters"]}
    mine = [rows[w.name(n)] for n in FREE]
    size = np.array([parse_unit(p["unit"]).to_si(1.0) for p in mine])
    return np.array([p["value"] for p in mine]) * size, np.array([p["std"] for p in mine]) * size
