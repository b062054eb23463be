"""Every regular pose of machines whose redundancy removes singularities, whichever drive is called redundant."""

from __future__ import annotations

from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Method, Request, Rows, predict
from tests.in_ci import in_ci
from tests.truth.redundant import DEG, MACHINES, Redundant

IDS = [m.name for m in MACHINES]
METHODS: tuple[Method, ...] = ("exact", "rigid", "linear")


def name_of(value: object) -> str:
    return str(getattr(value, "name", value))


SLIGHT, FULL = 10 * DEG, 25 * DEG


@cache
def model(machine: Redundant, redundant: int, folder: Path) -> Model:
    file = folder / f"{machine.name.replace(' ', '-')}-{redundant}.yaml"
    file.write_text(machine.text(redundant), encoding="utf-8")
    return load_machine(str(file)).model


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("redundant")


def closed(machine: Redundant, count: int, seed: int, turn: float = np.inf) -> tuple[Array, Array]:
    """Poses that all drives reach, and their readings."""
    poses = machine.sampled(np.random.default_rng(seed), 2 * count, turn)
    readings = machine.readings(poses)
    reached = np.isfinite(readings).all(axis=1)
    return poses[reached][:count], readings[reached][:count]


def turns(machine: Redundant) -> list[float]:
    """Ranges of rotation to be shown apart."""
    return [SLIGHT, FULL] if len(machine.home) > machine.translations else [np.inf]


def strained(machine: Redundant, count: int, seed: int, turn: float) -> tuple[Array, Array]:
    """Readings of drives that disagree by 0.2 mm or mrad, and the poses of least energy by a general minimiser."""
    poses, readings = closed(machine, count, seed, turn)
    readings = readings + np.random.default_rng(seed + 1).normal(0, 2e-4, readings.shape)
    return readings, np.array([machine.minimum(p, q) for p, q in zip(poses, readings, strict=True)])


def against_minimum(machine: Redundant, count: int, seed: int, folder: Path) -> None:
    """All poses are solved and are the minimiser's, with every drive called redundant."""
    for turn in turns(machine):
        readings, true = strained(machine, count, seed, turn)
        every = []
        for redundant in range(1, machine.drives + 1):
            m = model(machine, redundant, folder)
            found = predict(m, m.nominal, Rows.at(readings))
            assert found.solved.all()
            every.append(found.values)
            assert np.abs(found.values - true).max() < 2e-8  # the minimiser's own
        assert np.ptp(every, axis=0).max() < 1e-11


@pytest.mark.parametrize(
    ("machine", "redundant", "method"),
    in_ci(
        [
            "four cranks-1-exact", "four cranks-4-rigid", "four legs-1-linear", "four legs-4-exact",
            *(f"{name}-{k}-{how}" for name in ("seven legs", "delta") for k in (1, 4) for how in METHODS),
        ],
        product(MACHINES, [1, 4], METHODS),
        name_of,
    ),
)  # fmt: skip
def test_compatible_readings_give_their_pose(machine: Redundant, redundant: int, method: Method, folder: Path) -> None:
    """On the nominal machine all drives agree: no method returns another pose, or none."""
    m = model(machine, redundant, folder)
    for turn in turns(machine):
        poses, readings = closed(machine, 100, 1, turn)
        found = predict(m, m.nominal, Rows.at(readings), Request(method=method))
        assert found.solved.all()
        assert np.abs(found.values - poses).max() < (2e-9 if method == "rigid" else 1e-10)


@pytest.mark.parametrize("machine", in_ci(["seven legs", "delta"], MACHINES, name_of))
def test_strained_machines_are_where_their_energy_is_least(machine: Redundant, folder: Path) -> None:
    against_minimum(machine, 100, 3, folder)


@pytest.mark.slow
@pytest.mark.parametrize("machine", MACHINES, ids=IDS)
def test_strained_machines_in_a_thousand_poses(machine: Redundant, folder: Path) -> None:
    against_minimum(machine, 1000, 7, folder)


@pytest.mark.parametrize("machine", in_ci(["four legs", "seven legs", "delta"], MACHINES, name_of))
def test_the_order_of_rows_does_not_matter(machine: Redundant, folder: Path) -> None:
    """Backwards, alone, and started from what was found."""
    m = model(machine, 1, folder)
    readings, _ = strained(machine, 20, 11, np.inf)
    found = predict(m, m.nominal, Rows.at(readings))
    back = predict(m, m.nominal, Rows.at(readings[::-1])).values[::-1]
    alone = np.concatenate([predict(m, m.nominal, Rows.at(row[None])).values for row in readings])
    warm = predict(m, m.nominal, Rows.at(readings), start=found.start).values
    for other in (back, alone, warm):
        assert np.abs(other - found.values).max() < 1e-12


@pytest.mark.parametrize(
    ("machine", "redundant"),
    in_ci(
        ["four cranks-2", *(f"delta-{k}" for k in (1, 2, 3, 4))],
        product([MACHINES[1], MACHINES[3]], [1, 2, 3, 4]),
        name_of,
    ),
)
def test_linear_is_one_step_from_the_rigid_pose(machine: Redundant, redundant: int, folder: Path) -> None:
    """By differences of the closed form: dX = -(J^T S J)^-1 J^T S e where three drives meet (Ecorchard 2010, eq. 19).

    Exact equilibrium differs from it by the stress term and by the change of J, which are seen.
    """
    poses, readings = closed(machine, 20, 5, 2 * DEG)
    readings = readings + np.random.default_rng(6).normal(0, 5e-4, readings.shape)
    m = model(machine, redundant, folder)
    found = predict(m, m.nominal, Rows.at(readings), Request(method="linear"))
    exact = predict(m, m.nominal, Rows.at(readings))
    kept, largest = [k for k in range(machine.drives) if k != redundant - 1], 0.0
    for pose, q, got in zip(poses, readings, found.values, strict=True):
        x = pose.copy()
        for _ in range(20):  # the rigid pose of three drives
            x -= np.linalg.solve(_slopes(machine, x, q)[kept], machine.bars(x[None], q[None])[0][kept])
        if np.abs(x - pose).max() > 1e-2:
            continue  # next to a singular pose of these three
        e = machine.bars(x[None], q[None])[0]
        step = np.linalg.lstsq(_slopes(machine, x, q), e, rcond=None)[0]
        assert np.abs(got - (x - step)).max() < 1e-10
        largest = max(largest, float(np.abs(step).max()))
    assert largest > 1e-4
    assert np.nanmax(np.abs(found.values - exact.values)) > 1e-7


def _slopes(machine: Redundant, x: Array, q: Array) -> Array:
    """Derivative of the bars' strains (A, c) by the pose, from differences of fourth order."""

    def strain(h: Array) -> Array:
        return machine.bars((x + h)[None], q[None])[0]

    step = 1e-3 * np.eye(len(x))
    return np.stack([(8 * (strain(h) - strain(-h)) - strain(2 * h) + strain(-2 * h)) / 12e-3 for h in step], axis=1)
