"""The truth of pinned rods against itself: closed forms, derivatives, energy and reciprocity theorems, the
paper."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from . import pinned
from .machines import PINNED, Hangprinter, scissors, triglide
from .pinned import DeadForce, Drives, Rods, State
from .pinned_machine import Machine, Parameters

POSES = {
    "triglide": [[0.3, 0.2], [0.4, 0.38]],
    "triglide-nonredundant": [[0.3, 0.2], [0.4, 0.38]],
    "biglide": [[0.3, 0.2], [0.4, 0.3]],
    "scissors": [[0.1, 0.15], [-0.2, 0.2]],
    "delta4": [[0.1, 0.05, 0.3], [-0.07, 0.11, 0.4]],
}
REDUNDANT = [name for name in PINNED if name != "triglide-nonredundant"]


def planted(machine: Machine, size: float = 1.0) -> dict[str, float]:
    """Parameters with errors, sd = size * range."""
    draw = np.random.default_rng(7).normal(size=len(machine.nominal))
    return {n: v + size * d * machine.ranges[n] for (n, v), d in zip(machine.nominal.items(), draw, strict=True)}


def test_three_springs_carry_a_force_as_their_stiffness_says() -> None:
    ends = np.array([[0.3, -0.4], [-0.5, 0.0], [0.2, 0.6]])
    stiffness = np.array([1e6, 2e6, 3e6])
    length = np.hypot(*ends.T)
    rods = Rods.of(np.zeros((3, 2)), ends, [-1] * 3, length, stiffness)
    unit = ends / length[:, None]
    matrix = np.einsum("r,ri,rj->ij", stiffness, unit, unit)
    for size in (1e-2, 1e-3):
        force = size * np.array([3.0, -5.0])
        load = DeadForce(np.array([*force, 0]), np.zeros(3))
        found = pinned.minimise(rods, State.at([0, 0], []), pinned.PLANAR_POINT, [load])
        linear = np.linalg.solve(matrix, force)
        assert np.abs(found.state.position[:2] - linear).max() < 30 * np.abs(linear).max() ** 2


def test_a_hanging_rod_stretches_by_force_over_stiffness() -> None:
    rods = Rods.of([[0, 0, 0]], [[0, 0, 1]], [-1], [0.7], [1e5])
    load = DeadForce(np.array([0, 0, -250.0]), np.zeros(3))
    found = pinned.minimise(rods, State.at([0.2, 0.1, 0.2], []), pinned.SPATIAL_POINT, [load])
    assert np.allclose(found.state.position.astype(float), [0, 0, 0.3 - 2.5e-3], atol=1e-15)
    assert found.tension[0] == pytest.approx(250, rel=1e-12)


def test_a_slack_rope_pulls_nothing() -> None:
    rods = Rods.of(np.zeros((2, 3)), [[0, 0, 1], [0, 0, -1]], [-1, -1], [0.9, 1.2], [1e5, 1e5], rope=[True, True])
    load = DeadForce(np.array([0, 0, -10.0]), np.zeros(3))
    found = pinned.minimise(rods, State.at([0.01, 0, 0.1], []), pinned.SPATIAL_POINT, [load])
    assert found.tension.astype(float) == pytest.approx([10, 0], abs=1e-9)


def test_gradient_and_hessian_are_those_of_the_potential() -> None:
    rng = np.random.default_rng(1)
    rods = Rods.of(
        body=rng.normal(size=(8, 3)),
        base=3 * rng.normal(size=(8, 3)),
        drive=[0, 1, 2, -1, 0, 1, 2, -1],
        length=rng.uniform(2, 3, 8),
        stiffness=rng.uniform(1, 2, 8),
        along=rng.normal(size=(8, 3)),
        feed=rng.normal(size=8),
        tension=rng.normal(size=8),
    )
    loads = [DeadForce(rng.normal(size=3), rng.normal(size=3))]
    drives = Drives({0: 0.7}, {1: 1.3}, np.array([0.1, 0.2, 0.3]))
    state = State.at(rng.normal(size=3), rng.normal(size=3), rng.normal(size=3))
    _, gradient, hessian, _, _ = pinned.potential(rods, state, loads, drives)
    for column in range(9):
        step = np.zeros(9, pinned.WIDE)
        step[column] = 1e-5
        ahead, behind = (pinned.potential(rods, state.moved(s * step), loads, drives) for s in (1, -1))
        assert float((ahead[0] - behind[0]) / 2e-5) == pytest.approx(float(gradient[column]), abs=1e-7)
        second = (ahead[0] - 2 * pinned.potential(rods, state, loads, drives)[0] + behind[0]) / 1e-10
        assert float(second) == pytest.approx(float(hessian[column, column]), abs=1e-6)
        turned = ((ahead[1] - behind[1]) / 2e-5)[[0, 1, 2, 6, 7, 8]]
        assert np.allclose(turned.astype(float), hessian[column, [0, 1, 2, 6, 7, 8]].astype(float), atol=1e-6)


def test_rotation_vector_and_matrix_are_inverse() -> None:
    for turn in ([0.3, -0.2, 1.1], [1e-9, 2e-9, -1e-9], [0, 0, 0], [2.0, 1.0, -2.0]):
        back = pinned.rotation_vector(pinned.rotation_matrix(turn))
        assert np.allclose(back.astype(float), turn, rtol=0, atol=1e-16)


@pytest.mark.parametrize("name", PINNED)
def test_nominal_machine_goes_where_it_is_sent_without_energy(name: str) -> None:
    machine = PINNED[name]()
    weightless = replace(machine, weight=(0.0, 0.0, 0.0))
    found = weightless.forward(machine.inverse(POSES[name]))
    asked = np.pad(POSES[name], ((0, 0), (0, found.tcp.shape[1] - len(POSES[name][0]))))
    assert np.abs(found.tcp - asked).max() < 1e-15
    assert np.abs(found.energy).max() < 1e-18


@pytest.mark.parametrize("name", PINNED)
def test_work_of_a_drive_is_the_change_of_potential(name: str) -> None:
    machine = PINNED[name]()
    p, q = planted(machine), machine.inverse(POSES[name])[0]
    force = machine.forward(q, p).drive_force[0]
    for column in range(q.size):
        values = []
        for step in (1e-6, -1e-6):
            found = machine.solve(q + step * np.eye(q.size)[column], p)
            weight = np.array(machine.weight)
            values.append(found.energy - float(weight @ found.state.position))
        assert (values[0] - values[1]) / 2e-6 == pytest.approx(force[column], rel=1e-6, abs=1e-4)


@pytest.mark.parametrize("name", REDUNDANT)
def test_a_drive_held_where_its_force_left_it_gives_the_same_pose(name: str) -> None:
    machine = PINNED[name]()
    p, q = planted(machine), machine.inverse(POSES[name])
    force = {drive: 100.0 * (i + 1) for i, drive in enumerate(machine.redundant)}
    pushed = machine.forward(q, p, force)
    held = machine.forward(pushed.travel, p)
    assert np.abs(held.tcp - pushed.tcp).max() < 1e-14
    for drive, value in force.items():
        assert held.drive_force[:, machine.drives.index(drive)] == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize("name", REDUNDANT)
def test_a_stiff_drive_is_a_held_drive_and_a_soft_one_pushes_nothing(name: str) -> None:
    machine = PINNED[name]()
    p, q = planted(machine), machine.inverse(POSES[name])
    drive = machine.redundant[0]
    stiff, soft = (machine.forward(q, p, stiffness={drive: k}).tcp for k in (1e15, 1e-3))
    assert np.abs(stiff - machine.forward(q, p).tcp).max() < 1e-10
    assert np.abs(soft - machine.forward(q, p, force={drive: 0.0}).tcp).max() < 1e-10


@pytest.mark.parametrize("name", ["scissors", "delta4", "triglide"])
def test_maxwell_betti(name: str) -> None:
    machine = PINNED[name]()
    p, q = planted(machine), machine.inverse(POSES[name])[0]
    turning = len(machine.freedoms) > 2
    points = np.array([[0.05, 0.02, 0], [-0.03, 0.04, 0]]) if turning else np.zeros((2, 3))
    ways = np.array([[1.0, 0, 0], [0.3, 0.8, 0.5 if len(machine.freedoms) > 3 else 0]])

    def travel(loaded: int, read: int) -> float:
        """Movement in m along way `read` of its point by 1 N at the other."""
        place = []
        for size in (1.0, -1.0):
            load = DeadForce(size * ways[loaded], points[loaded])
            state = machine.solve(q, p, loads=[load]).state
            place.append(state.position + state.rotation @ points[read])
        return float((place[0] - place[1]) @ ways[read]) / 2

    assert travel(0, 1) == pytest.approx(travel(1, 0), rel=1e-8)


@pytest.mark.parametrize("name", ["triglide", "scissors", "delta4"])
def test_a_moved_base_moves_the_machine(name: str) -> None:
    machine = PINNED[name]()
    p, q = planted(machine), machine.inverse(POSES[name])[0]
    shift, turn = np.array([0.3, -0.2, 0.0]), pinned.rotation_matrix([0, 0, 0.8])
    rods = machine.rods(p)
    moved = replace(rods, base=shift + rods.base @ turn.T, along=rods.along @ turn.T)
    start = State.at(machine.guess(q, p), q)
    sent = State(shift + turn @ start.position, turn @ start.rotation, start.travel)
    here, there = (pinned.minimise(r, s, machine.freedoms).state for r, s in ((rods, start), (moved, sent)))
    if len(machine.freedoms) > 2:
        assert np.abs(there.rotation - turn @ here.rotation).max() < 1e-15
    assert np.abs(there.position - shift - turn @ here.position).max() < 1e-15


def condition(machine: Machine, poses: list[list[float]], ranges: Parameters) -> float:
    """Condition number of the range-scaled Jacobian of x and y, by central differences."""
    q, columns = machine.inverse(poses), []
    for name, width in ranges.items():
        sides: list[np.ndarray] = []
        for sign in (0.01, -0.01):
            sides.append(machine.forward(q, {name: machine.nominal[name] + sign * width}).tcp[:, :2].ravel())
        columns.append((sides[0] - sides[1]) / 0.02)
    return float(np.linalg.cond(np.array(columns).T))


def grid(x: tuple[float, float, int], y: tuple[float, float, int]) -> list[list[float]]:
    """Poses (n, 2) in m, end points included, y fastest."""
    return [[a, b] for a in np.linspace(*x) for b in np.linspace(*y)]


@pytest.mark.slow
def test_condition_numbers_of_the_paper_triglide() -> None:
    machine, poses = triglide(2), grid((0, 0.95, 3), (0.16, 0.39, 77))
    ranges = dict.fromkeys(("l1", "l2", "xb1r", "yb1r", "xb2r", "yb2r"), 0.0001)
    assert condition(machine, poses, ranges) == pytest.approx(60.06, abs=0.005)
    assert condition(machine, poses, {**ranges, "gamma": np.radians(1)}) == pytest.approx(3139, abs=0.5)


@pytest.mark.slow
def test_condition_number_of_the_paper_scissors() -> None:
    machine, poses = scissors(), grid((-0.203, 0.203, 10), (-0.2, 0.2, 8))
    names = ("g1", "g2", "xa1", "l3", "xa2", "ya1", "l4", "ya2", "ya4")
    assert condition(machine, poses, {n: machine.ranges[n] for n in names}) == pytest.approx(282, rel=0.01)


def test_paper_scissors_shifts_by_30_um() -> None:
    """Mean shift in x over an x-movement: d1 and d2 largest (14 to 16 um), the others far below 30 um."""
    machine = scissors()
    q = machine.inverse([[x, 0.0] for x in np.linspace(-0.2, 0.2, 9)])
    before = machine.forward(q).tcp[:, 0]
    shifts = {}
    for name, value in machine.nominal.items():
        if name[0] in "lxyd":
            shifts[name] = 1e6 * abs((machine.forward(q, {name: value + 30e-6}).tcp[:, 0] - before).mean())
    assert 14 <= round(shifts.pop("d1")) <= 16
    assert 14 <= round(shifts.pop("d2")) <= 16
    assert min(shifts.values()) > 2
    assert max(shifts.values()) < 13


def test_hangprinter_lines_balance_and_the_reading_of_the_held_line_fits() -> None:
    machine = Hangprinter()
    q = np.array([[20.0, -15.0, 3.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    p = dict(machine.nominal)
    pulled = machine.forward(q, tension={"D": 40.0})
    assert (pulled.tension > 0).all()
    way = machine.anchors(p) - pulled.tcp[:, None]
    force = (pulled.tension[..., None] * way / np.linalg.norm(way, axis=2)[..., None]).sum(1)
    assert force == pytest.approx(np.tile([0, 0, p["mass"] * 9.81], (2, 1)), abs=1e-6)
    held = machine.forward(pulled.travel)
    assert np.abs(held.tcp - pulled.tcp).max() < 1e-9
    assert held.tension[:, 3] == pytest.approx(40.0, abs=1e-5)
