"""Machines for tests and for the verification table: read, overlaid and compiled from YAML text."""

from __future__ import annotations

import tempfile
import textwrap
from functools import lru_cache
from pathlib import Path

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler import Compiled, compile_machine
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Request, Rows, predict
from tests.truth.gantry import Gantry
from tests.truth.machines import PINNED, Hexapod7
from tests.truth.pinned import DeadForce
from tests.truth.self_measured_tables import SENSING

MACHINES = Path(__file__).resolve().parents[1] / "machines"
SHIPPED = tuple(sorted(file.stem for file in MACHINES.glob("*.yaml") if "." not in file.stem))
"""Every machine file in `machines/`, without its ending."""
UM = 1e-6


@lru_cache(maxsize=256)
def compiled(text: str) -> Compiled:
    """The machine that a YAML text describes; a shipped machine's name stands for its file."""
    if text in SHIPPED:
        return compile_machine(read_machine(MACHINES / f"{text}.yaml"))
    return compile_machine(described(text))


def described(text: str) -> Machine:
    """The machine that a YAML text describes, read."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "machine.yaml"
        file.write_text(textwrap.dedent(text), encoding="utf-8")
        return read_machine(file)


def overlay(name: str, changes: str = "") -> str:
    """YAML text of a shipped machine with changes laid over it."""
    return f"extends: {MACHINES / name}.yaml\n{textwrap.dedent(changes)}"


def model(text: str) -> Model:
    """The model of `compiled`."""
    return compiled(text).model


def at(machine: Model, readings: Array, request: Request | None = None, **values: float) -> Prediction:
    """Prediction at drive readings (N, A) with some parameters (SI) off nominal; every row must be solved."""
    given = machine.by_name(machine.nominal)
    assert values.keys() <= given.keys(), f"unknown parameters {sorted(values.keys() - given.keys())}"
    vector = np.array(list({**given, **values}.values()))
    found = predict(machine, vector, Rows.at(np.atleast_2d(readings)), request)
    assert found.solved.all(), [found.reason(int(k)) for k in np.nonzero(~found.solved)[0]]
    return found


def truth(name: str) -> object:
    """The independent simulator of a shipped machine."""
    if name in SENSING:
        return SENSING[name]
    if name == "gantry":
        return Gantry()
    return Hexapod7() if name == "hexapod7" else PINNED[name.removesuffix("-strained")]()


def poses_of(name: str, rows: int, seed: int = 0) -> Array:
    """Random poses (N, k) in the workspace of a shipped machine, as its simulator wants them."""
    low, high = _WORKSPACE[name.removesuffix("-strained")]
    out: Array = np.random.default_rng(seed).uniform(low, high, (rows, len(low)))
    return out


_TRIGLIDE = ((0.2, 0.17), (0.7, 0.38))
_WORKSPACE: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {
    "triglide": _TRIGLIDE,
    "triglide-nonredundant": _TRIGLIDE,
    "biglide": ((0.2, 0.2), (0.5, 0.35)),
    "scissors": ((-0.2, -0.2), (0.2, 0.2)),
    "delta4": ((-0.1, -0.1, -0.54), (0.1, 0.1, -0.34)),
    "hexapod7": ((-0.08, -0.08, 0.42, -0.15, -0.15, -0.15), (0.08, 0.08, 0.58, 0.15, 0.15, 0.15)),
    "gantry": ((0.15, 0.1), (1.35, 1.6)),
    "belt-router": ((0.6, 0.5), (2.4, 1.7)),
    "delta-printer": ((-0.07, -0.07, 0.0), (0.07, 0.07, 0.1)),
    "five-bar": ((0.0, 0.25), (0.25, 0.5)),
}


def errors_of(machine: Model, size: float, seed: int = 0) -> dict[str, float]:
    """Parameter values off by uniform errors: lengths by up to `size` (m), the others by up to their ranges."""
    rng = np.random.default_rng(seed)
    wide = {p.name: size if p.dimension == "length" else p.range for p in machine.parameters}
    return {p.name: p.nominal + wide[p.name] * rng.uniform(-1, 1) for p in machine.parameters}


def displacement(text: str, request: Request | None = None, readings: object = ((),)) -> Array:
    """Prediction minus drawing of all channels of the machine in a YAML text, in m and rad."""
    machine = model(text)
    drawn = at(machine, readings, Request(method="rigid")).values[0]
    out: Array = at(machine, readings, request).values[0] - drawn
    return out


LOADED = {
    "scissors": ("A4", lambda p: (p["xa4"], p["ya4"], 0.0)),
    "delta4": ("P2a", lambda p: (-0.04, p["r2"], 0.0)),
    "hexapod7": ("P1", lambda p: (p["p1x"], p["p1y"], p["p1z"])),
}
"""A point of the platform that carries the test's load, and its place on the platform (m)."""
FORCE = (300.0, -500.0, 200.0)


def pushed(name: str) -> str:
    """YAML of a shipped machine with a dead force of 616 N (583 N in the plane) on its platform."""
    where = LOADED.get(name, ("tcp",))[0]
    count = 2 if model(name).topology.planar else 3
    return overlay(name, f"loads: {{push: {{at: {where}, force: [{', '.join(f'{f} N' for f in FORCE[:count])}]}}}}")


def push(name: str, values: dict[str, float]) -> DeadForce:
    """The same force for the independent simulator."""
    place = LOADED[name][1](values) if name in LOADED else (0.0, 0.0, 0.0)
    count = 2 if model(name).topology.planar else 3
    return DeadForce(np.array([*FORCE[:count], *[0.0] * (3 - count)]), np.array(place))
