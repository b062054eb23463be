"""Measurements of the engine against the independent simulators and closed forms: numbers for tests and table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.commanded import forced
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Prediction, Request, Rows, predict
from pkmcal_cli.units.measurands import Measurand
from tests import structures
from tests.support import (
    UM,
    at,
    compiled,
    displacement,
    errors_of,
    model,
    overlay,
    poses_of,
    push,
    pushed,
    truth,
)
from tests.truth.gantry import NOMINAL, RANGES, Gantry
from tests.truth.machines import Hangprinter
from tests.truth.test_truth_bending import elastica

REDUNDANT = ("triglide", "biglide", "scissors", "delta4", "hexapod7")
"""Machines with redundant drives that hold position."""
ROWS = (12, 4)
"""Poses of a machine of pinned rods, and of the hexapod, whose simulator is slow."""


def elastica_error(pieces: int, turn: Array | None = None) -> float:
    """Distance of the tip from the elastica's at P L^2 / EI = 5, relative to its travel across."""
    back, over = elastica(5.0)
    found = displacement(structures.cantilever(pieces, (0, 5, 0), turn))
    tip = found[:2] if turn is None else (turn.T @ found[:3])[:2]
    return float(np.hypot(tip[0] + back, tip[1] - over) / over)


@dataclass(frozen=True)
class Comparison:
    """Engine against the independent simulator, largest over rows: TCP in um and rad, the others relative."""

    position: float
    orientation: float
    force: float
    energy: float
    linear: float  # um, of `linear` instead of `exact`


@cache
def against_truth(name: str, size: float = 1e-3, loaded: bool = True) -> Comparison:
    """Lengths off by up to `size` (m), stiffnesses and angles by their ranges, a force on the platform."""
    text, simulator = (pushed(name) if loaded else name), truth(name)
    machine = model(text)
    values, readings = errors_of(machine, size), simulator.inverse(poses_of(name, ROWS[name == "hexapod7"]))
    loads = [push(name, values)] if loaded else []
    found = at(machine, readings, Request(forces=True), **values)
    linear = at(machine, readings, Request(method="linear"), **values)
    true = simulator.forward(readings, values, loads=loads)
    lengths = [c for c, channel in enumerate(machine.channels) if channel.measurand is Measurand.POSITION]
    angles = [c for c, channel in enumerate(machine.channels) if channel.measurand is Measurand.ORIENTATION]
    return Comparison(
        float(np.abs(found.values - true.tcp[:, : found.values.shape[1]])[:, lengths].max() / UM),
        float(np.abs(found.values - true.tcp[:, : found.values.shape[1]])[:, angles].max(initial=0.0)),
        float(np.abs(found.forces - true.drive_force).max() / np.abs(true.drive_force).max()),
        float(np.abs(found.energy / true.energy - 1).max()),
        float(np.abs(linear.values - true.tcp[:, : found.values.shape[1]])[:, lengths].max() / UM),
    )


def against_force_control(name: str) -> tuple[float, float, float, float]:
    """All redundant drives under force control, lengths off by 0.3 mm: largest deviation of TCP position (um),
    TCP orientation (rad), drive travel (um), and how far the drives went from their set values (um)."""
    simulator = truth(name)
    forces = {drive: 150.0 * (-2) ** k for k, drive in enumerate(simulator.redundant)}
    machine = model(overlay(name, structures.force_controlled(forces)))
    values, readings = errors_of(machine, 3e-4), simulator.inverse(poses_of(name, ROWS[name == "hexapod7"]))
    found, true = at(machine, readings, **values).values, simulator.forward(readings, values, forces)
    given = [drive in forces for drive in simulator.drives]
    tcp = found[:, : -len(forces)] - true.tcp[:, : found.shape[1] - len(forces)]
    angular = [channel.measurand is Measurand.ORIENTATION for channel in machine.channels[: tcp.shape[1]]]
    travel = found[:, -len(forces) :] - true.travel[:, given]
    return (
        float(np.abs(tcp[:, ~np.array(angular)]).max() / UM),
        float(np.abs(tcp[:, angular]).max(initial=0.0)),
        float(np.abs(travel).max() / UM),
        float(np.abs(true.travel - readings).max() / UM),
    )


def spread_over_substructures(name: str) -> tuple[float, int]:
    """How much `exact` depends on which drives are called redundant: largest difference (mm), and choices tried.

    Every choice whose substructure is a mechanism at the drawing; 8 poses, lengths off by 0.3 mm.
    """
    simulator, found = truth(name), []
    readings = simulator.inverse(poses_of(name, 8))
    for chosen in combinations(simulator.drives, len(simulator.redundant)):
        made = compiled(overlay(name, structures.redundant(simulator.drives, chosen)))
        if made.mobility.undetermined == 0:
            found.append(at(made.model, readings, **errors_of(made.model, 3e-4)).values)
    return float(np.ptp(np.array(found), axis=0).max() * 1e3), len(found)


def hangprinter_readings(simulator: Hangprinter, places: Array) -> Array:
    """Motor angles (N, 4) in rad whose lines just reach the places (N, 3) in m."""
    p = dict(simulator.nominal)
    anchors = simulator.anchors(p)
    way = np.linalg.norm(np.asarray(places)[:, None] - anchors, axis=2) - np.linalg.norm(anchors, axis=1)
    out: Array = way / simulator.feed(p)
    return out


def hangprinter(force: float) -> str:
    """The hangprinter with its hanging mass, and a pull (N) of the upper line."""
    return overlay(
        "hangprinter",
        f"gravity: [0, 0, -9.81]\nnodes: {{tcp: {{mass: 2 kg}}}}\nactuators: {{D: {{force: {force}}}}}",
    )


@dataclass(frozen=True)
class HangprinterDeviation:
    """Largest deviations: TCP and upper line in um, tensions in N, energy relative."""

    tcp: float
    line: float
    tension: float
    energy: float


def against_hangprinter() -> HangprinterDeviation:
    """Upper line in force control, anchors off by up to 1 mm; stiffness ES over the wound length."""
    simulator, machine = Hangprinter(), model(hangprinter(40.0))
    readings = hangprinter_readings(simulator, np.array([[0, 0, 0], [0.3, 0.2, 0.5], [-0.4, 0.3, 0.8]]))
    values = {n: v for n, v in errors_of(machine, 1e-3).items() if n != "EA"}
    found = at(machine, readings, Request(forces=True), **values)
    true = simulator.forward(readings, values, {"D": 40.0})
    p = {**simulator.nominal, **values}
    # the simulator counts the stretch of the position-controlled lines only
    reach = np.linalg.norm(simulator.anchors(p)[3] - true.tcp, axis=1)
    energy = true.energy + 40.0**2 / 2 / p["EA"] * reach / (1 + 40.0 / p["EA"])
    return HangprinterDeviation(
        float(np.abs(found.values[:, :3] - true.tcp).max() / UM),
        float(np.abs((found.values[:, 3] - true.travel[:, 3]) * simulator.feed(p)[3]).max() / UM),
        float(np.abs(found.forces - true.tension).max()),
        float(np.abs(found.energy / energy - 1).max()),
    )


def readings_of(name: str) -> Array:
    """Strain-free set values for a few poses of a shipped machine."""
    if name == "hangprinter":
        return hangprinter_readings(Hangprinter(), np.array([[0, 0, 0], [0.3, 0.2, 0.5], [-0.4, 0.3, 0.8]]))
    readings: Array = truth(name).inverse(poses_of(name, 2 if name == "hexapod7" else 4))
    return readings


def strained_values(text: str, seed: int = 5) -> Array:
    """Parameters off by up to their ranges; by a tenth where that would make ropes slack."""
    machine = model(text)
    share = 0.02 if "hangprinter" in text else 1.0
    return machine.nominal + share * machine.ranges * np.random.default_rng(seed).uniform(-1, 1, len(machine.names))


ELASTIC = ("stiffness", "rotational stiffness", "coupling stiffness", "force", "modulus")
"""Dimensions whose range is a large share of the nominal value."""


@dataclass(frozen=True)
class JacobianCheck:
    """All columns (parameters, then drives) against differences of the converged model.

    deviation: largest, relative to the column's largest entry, of `worst`; `null`: columns below 1e-9 um (or
    1e-15 rad) per range (drives: per mm, per mrad), `null_size` the largest of them in um per range.
    """

    columns: int
    deviation: float
    worst: str
    null: tuple[str, ...]
    null_size: float


def _joined(machine: Model, readings: Array) -> Rows:
    """Rows at drive readings (N, A); where sensors join rows, each is joined to the next."""
    joins = any(s.kind.joins for s in machine.sensors)
    partner = (np.arange(len(readings)) + 1) % len(readings)
    return replace(Rows.at(readings), partner=partner if joins else None)


def _difference(machine: Model, start: Prediction, values: Array, readings: Array, step: float) -> Callable[..., Array]:
    """Central differences with Richardson extrapolation: error step^4; `pushed`: the drive that pushes by steps."""

    def along(way_values: Array, way_readings: Array, pushed: str) -> Array:
        sides = []
        for h in (step, -step, step / 2, -step / 2):
            rows = _joined(machine, readings + h * way_readings)
            rows = replace(rows, columns={f"push.{pushed}": np.full(len(rows), h)} if pushed else {})
            found = predict(machine, values + h * way_values, rows, start=start.start)
            assert found.solved.all()
            sides.append(found.values)
        wide, narrow = (sides[0] - sides[1]) / (2 * step), (sides[2] - sides[3]) / step
        out: Array = (4 * narrow - wide) / 3
        return out

    return along


def jacobian_check(text: str, readings: Array, values: Array | None = None) -> JacobianCheck:
    """Parameters and drives of a machine at drive readings (N, A) and parameter values (P,)."""
    machine = model(text)
    values = machine.nominal if values is None else values
    request = Request(parameters=machine.names, by_drive=True)
    start = predict(machine, values, _joined(machine, readings), request)
    assert start.solved.all() and start.jacobian is not None and start.by_drive is not None
    by_drive = start.by_drive if start.by_partner is None else start.by_drive + start.by_partner
    columns: list[tuple[str, Array, float, float, Array, Array, str]] = []
    none = np.zeros(len(machine.actuators))
    for k, p in enumerate(machine.parameters):
        soft = p.dimension in ELASTIC and p.nominal != 0
        step = 0.01 * abs(p.nominal) if soft else 0.05 * p.range
        columns.append((p.name, start.jacobian[..., k], p.range, step, np.eye(len(values))[k], none, ""))
    for a, drive in enumerate(machine.actuators):
        step = 1e-5 if drive.dimension == "length" else 1e-4
        by_reading = 0 * by_drive[..., a] if forced(machine)[a] else by_drive[..., a]
        columns.append((drive.name, by_reading, 1e-3, step, 0 * values, np.eye(len(none))[a], ""))
    for a in np.nonzero(forced(machine))[0]:
        name = machine.drive_names[a]
        columns.append((f"force of {name}", by_drive[..., a], 1e-3, 0.1, 0 * values, none, name))
    worst, null, size = (0.0, ""), [], 0.0
    for name, exact, unit, step, *ways in columns:
        found = _difference(machine, start, values, readings, step)(*ways)
        largest = float(np.abs(exact).max())
        if largest * unit < 1e-15:
            null.append(name)
            size = max(size, largest * unit / UM)
            assert np.abs(found).max() * step < 1e-14, name  # rounding of two predictions
        else:
            worst = max(worst, (float(np.abs(exact - found).max() / np.abs(found).max()), name))
    return JacobianCheck(len(columns), worst[0], worst[1], tuple(null), size)


def skewed_gantry(seed: int, rows: int = 6) -> tuple[Array, dict[str, float]]:
    """Readings (N, 3) with drives out of step by up to 0.2 mm, and parameters off by up to their ranges."""
    rng = np.random.default_rng(seed)
    readings = Gantry().inverse(rng.uniform([0.15, 0.1], [1.35, 1.6], (rows, 2)))
    readings[:, 1] += rng.uniform(-2e-4, 2e-4, rows)
    return readings, {n: v + RANGES[n] * rng.uniform(-1, 1) for n, v in NOMINAL.items()}


def against_frame(seed: int, errors: bool, pieces: int = 2, rows: int = 6) -> tuple[float, float]:
    """The gantry against its frame: largest deviation over the deflection by weight, and that deflection in um."""
    readings, values = skewed_gantry(seed, rows)
    given = values if errors else {}
    true = Gantry().forward(readings, given).tcp
    deflection = float(np.abs(true - Gantry(gravity=0.0).forward(readings, given).tcp).max())
    machine = model(overlay("gantry", f"beams: {{beam: {{pieces: {pieces}}}}}"))
    return float(np.abs(at(machine, readings, **given).values - true).max() / deflection), deflection / UM
