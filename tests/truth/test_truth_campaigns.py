"""The campaigns with undeclared effects: against the simulators in extended precision and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.in_ci import in_ci

from .campaigns import MACHINES, Campaign, Planted, Scenario, campaign, families, unit, unknown_families
from .fast_pinned import Array, Balance, Load, Problem, rotations, solve
from .machines import PINNED
from .pinned import DeadForce
from .shop_conditions import conditions
from .shop_plans import PLANS, set_values
from .shop_truth import Found, truth

EVERY = [(machine, *family) for machine in MACHINES for family in [*families(machine), *unknown_families(machine)]]
REDUNDANT = [machine for machine in MACHINES if PLANS[machine].redundant]
PLAIN = Scenario(extra=0.0)


def found(measured: Campaign, planted: list[Planted], extra: float = 0.0) -> Found:
    """Truth of a campaign's rows with other effects."""
    plan = PLANS[measured.machine]
    geometry = plan.geometry({**plan.nominal, **measured.parameters})
    return truth(plan, geometry, measured.conditions, planted, extra)


def moved(measured: Campaign, keyword: str, at: str, **values: float) -> Array:
    """Change of the readings (N, C) in m by an effect without its extra shape."""
    return found(measured, [Planted(keyword, at, values)]).readings - found(measured, []).readings


def rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("errors", [0.0, 1.0, 3.0])
def test_rows_at_once_are_rows_one_by_one(machine: str, errors: float) -> None:
    """Declared parameters only; then forces and drive forces too."""
    measured = campaign(machine, [], 3, 8, Scenario(errors=errors))
    slow = PINNED[machine]().forward(measured.conditions.q, measured.parameters)
    channels = len(PLANS[machine].channels)
    assert np.abs(measured.true_readings - slow.tcp[:, :channels]).max() < 1e-11
    mine = found(measured, [])
    size = 1e-7 * (1 + np.abs(slow.tension).max())
    assert np.abs(mine.tension - slow.tension).max() < size
    assert np.abs(mine.force - slow.drive_force).max() < size


@pytest.mark.parametrize("machine", MACHINES)
def test_set_values_are_those_of_the_other_simulator(machine: str) -> None:
    rows = conditions(PLANS[machine], 1, 20, Scenario())
    slow = PINNED[machine]().inverse(rows.poses[:, : len(PLANS[machine].lower)])
    assert np.abs(set_values(PLANS[machine], rows.poses) - slow).max() < 0.6e-9


@pytest.mark.parametrize("machine", MACHINES)
def test_loads_act_as_in_the_other_simulator(machine: str) -> None:
    measured = campaign(machine, [], 5, 4)
    force = np.array([200.0, -150.0, 0.0 if PLANS[machine].planar else -80.0])
    mine = moved(measured, "tool_load", PLANS[machine].sensor, fx=force[0], fy=force[1], fz=force[2])
    load = DeadForce(force, np.zeros(3))
    slow = PINNED[machine]().forward(measured.conditions.q, measured.parameters, loads=[load])
    assert np.abs(measured.true_readings + mine - slow.tcp[:, : mine.shape[1]]).max() < 1e-11


def test_payload_acts_at_its_centre_of_gravity() -> None:
    measured = campaign("delta4", [Planted("payload", "tracker", {"m": 0.9})], 5, 4, Scenario(payload=6.0))
    load = DeadForce(np.array([0, 0, -0.9 * 6 * 9.80665]), np.array([0.015, -0.01, -0.08]))
    slow = PINNED["delta4"]().forward(measured.conditions.q, measured.parameters, loads=[load])
    assert np.abs(measured.true_readings - slow.tcp[:, :3]).max() < 1e-11


@pytest.mark.parametrize(("machine", "rod", "k"), [("triglide", "rod3", "k3"), ("scissors", "rod5", "k5")])
def test_stiffness_is_the_stiffness_of_the_other_simulator(machine: str, rod: str, k: str) -> None:
    measured = campaign(machine, [Planted("stiffness", rod, {"k": 0.4})], 2, 4, PLAIN)
    changed = {**measured.parameters, k: PLANS[machine].nominal[k] * np.exp(0.4)}
    slow = PINNED[machine]().forward(measured.conditions.q, changed)
    assert np.abs(measured.true_readings - slow.tcp[:, :2]).max() < 1e-11


@pytest.mark.parametrize(
    ("machine", "keyword", "at"), in_ci({case[:2]: "-".join(case) for case in reversed(EVERY)}.values(), EVERY)
)
def test_an_effect_is_nothing_at_zero_and_grows_with_its_size(machine: str, keyword: str, at: str) -> None:
    whole = unit(machine, keyword, at, 1)
    off, small, full = (found_with(machine, [whole.scaled(size)]) for size in (0.0, 0.5, 1.0))
    plain = found_with(machine, [])
    assert np.array_equal(off, plain) or np.abs(off - plain).max() < 1e-12
    assert rms(full - plain) > 1e-8
    assert rms(full - plain - 2 * (small - plain)) < 0.12 * rms(full - plain)


def found_with(machine: str, planted: list[Planted]) -> Array:
    return campaign(machine, planted, 2, 60).true_readings


def jacobian(rows: Array, q: Array) -> Array:
    """dx/dq (N, 2, 2) of the nominal Triglide without its third leg, at poses (N, 3): rows of the inverse are
    (rod . x, rod . y) / (rod . x)."""
    base = np.stack([q, np.full_like(q, 0.1)], -1)
    rod = rows[:, None, :2] - base
    return np.linalg.inv(rod / rod[..., :1])


def test_backlash_moves_the_tcp_by_half_of_it_times_the_jacobian() -> None:
    measured = campaign("triglide-nonredundant", [], 1, 100, Scenario(errors=0.0))
    rows = measured.conditions
    step = moved(measured, "backlash", "q1", b=20e-6)
    expected = -10e-6 * rows.direction[:, :1] * jacobian(rows.poses, rows.q)[:, :, 0]
    assert np.abs(step - expected).max() < 1e-8
    assert rms(step) > 4e-6


def test_backlash_depends_on_the_payload() -> None:
    planted = [Planted("backlash", "q1", {"b": 20e-6})]
    for load, share in ((0.0, 0.9), (3.0, 1.0), (6.0, 1.1)):
        scenario = Scenario(payload=load)
        step = campaign("triglide", planted, 1, 20, scenario).true_readings
        plain = campaign("triglide", [], 1, 20, scenario).true_readings
        bare = campaign("triglide", [planted[0].scaled(share)], 1, 20, replace(scenario, payload=3.0)).true_readings
        assert np.abs(step - bare).max() < 1e-12 < np.abs(step - plain).max()


def test_thermal_growth_is_a_longer_rod() -> None:
    measured = campaign("scissors", [], 1, 12)
    step = moved(measured, "thermal_strut", "rod4", a=12e-6)
    for row, warm in enumerate(measured.conditions.temperature - 20):
        changed = {**measured.parameters, "l4": measured.parameters["l4"] * (1 + 12e-6 * warm)}
        slow = PINNED["scissors"]().forward(measured.conditions.q[row], changed).tcp[0, :2]
        assert np.abs(measured.true_readings[row] + step[row] - slow).max() < 1e-11


def test_growth_of_all_rods_lags_behind_the_air() -> None:
    """A first-order lag solves its equation: T_air = T + lag dT/dt."""
    air = conditions(PLANS["scissors"], 1, 10, Scenario()).air
    time = np.linspace(0, air.length, 50)
    rate = (air.at(time + 1, 180.0) - air.at(time - 1, 180.0)) / 2
    assert np.abs(air.at(time, 180.0) + 180 * rate - air.at(time)).max() < 1e-5
    late = rms(air.at(time, 180.0) - air.at(time)) / rms(air.at(time) - air.at(time).mean())
    assert 0.1 < late < 0.25


def test_a_part_with_its_own_thermometer_grows_with_it() -> None:
    scenario = Scenario(parts=("rod1",))
    measured = campaign("triglide-nonredundant", [], 1, 50, scenario)
    own = measured.conditions.part["rod1"]
    step = moved(measured, "thermal_strut", "rod1", a=10e-6)
    assert np.abs(own - measured.conditions.temperature).max() > 1
    warm = replace(measured.conditions, temperature=own, part={})
    assert np.array_equal(moved(replace(measured, conditions=warm), "thermal_strut", "rod1", a=10e-6), step)
    assert "T.rod1 [degC]" in measured.csv_text().splitlines()[0]


@pytest.mark.parametrize("machine", MACHINES)
def test_the_frame_is_turned_and_moved_exactly(machine: str) -> None:
    measured, sensor = campaign(machine, [], 1, 20), PLANS[machine].sensor
    values = {"tx": 1e-3, "ty": -2e-3, "rz": 0.3} | ({} if PLANS[machine].planar else {"tz": 3e-3, "rx": -0.2})
    read = measured.true_readings + moved(measured, "frame", sensor, **values)
    turn = rotations(np.array([values.get("rx", 0.0), 0.0, 0.3]))[: read.shape[1], : read.shape[1]]
    shift = np.array([1e-3, -2e-3, 3e-3])[: read.shape[1]]
    assert turn @ turn.T == pytest.approx(np.eye(len(turn)), abs=1e-15)
    assert np.abs(read - (measured.true_readings @ turn.T + shift)).max() < 1e-15


def test_instrument_effects_in_closed_form() -> None:
    measured = campaign("delta4", [], 1, 40)
    x, y, z = measured.true_readings.T
    assert moved(measured, "meas_scale", "tracker", s=1e-4) == pytest.approx(1e-4 * np.stack([x, y, z], -1), abs=1e-15)
    sheared = moved(measured, "meas_shear", "tracker", xy=1e-4, xz=2e-4, yz=3e-4)
    assert sheared == pytest.approx(np.stack([1e-4 * y + 2e-4 * z, 3e-4 * z, 0 * z], -1), abs=1e-15)
    again = moved(measured, "resetup", "s2", tx=50e-6)[:, 0]
    assert again == pytest.approx(np.where(np.arange(40) >= 20, 50e-6, 0), abs=1e-15)
    slow = moved(measured, "drift", "tracker", z1=20e-6)
    assert slow[:, :2] == pytest.approx(0, abs=1e-15) and (np.diff(slow[:, 2]) > 0).all()
    assert moved(measured, "tool", "tracker", tx=30e-6)[:, 0] == pytest.approx(30e-6, rel=1e-4)


@pytest.mark.parametrize("machine", ["triglide", "triglide-nonredundant"])
def test_a_foot_of_the_whole_machine_carries_the_tcp(machine: str) -> None:
    measured = campaign(machine, [], 1, 20)
    warm = measured.conditions.temperature[:, None] - 20
    step = moved(measured, "thermal_foot", "base", gx=4e-6, gy=-3e-6)
    assert step == pytest.approx(warm * [4e-6, -3e-6], abs=1e-13)


def test_an_inclined_guide_is_a_turned_guide() -> None:
    """To first order, but for the carriages, which a turn of the frame would turn too, and about another point."""
    measured = campaign("triglide", [], 1, 10, Scenario(errors=0.0))
    inclined = moved(measured, "guide_angle", "rail.y", g=1e-6)
    turned = PINNED["triglide"]().forward(measured.conditions.q, {"gamma": 1e-6}).tcp - measured.true_readings
    carriages = sum(shifted_joint(measured, carriage) for carriage in ("xb1r", "xb2r", "xb3r"))
    middle = 0.5 * (measured.conditions.q.min() + measured.conditions.q.max())
    lowered = {name: PLANS["triglide"].nominal[name] - 1e-6 * middle for name in ("yb1r", "yb2r", "yb3r")}
    whole = PINNED["triglide"]().forward(measured.conditions.q, lowered).tcp - measured.true_readings
    assert np.abs(inclined - turned + carriages - whole).max() < 2e-10


def shifted_joint(measured: Campaign, name: str) -> Array:
    """Change of the readings when a turn of 1e-6 rad carries a joint of the Triglide along x."""
    height = PLANS["triglide"].nominal[name.replace("x", "y")]
    changed = {name: PLANS["triglide"].nominal[name] - 1e-6 * height}
    shift: Array = PINNED["triglide"]().forward(measured.conditions.q, changed).tcp - measured.true_readings
    return shift


def test_a_carriage_turns_its_joint_about_its_origin() -> None:
    """The Triglide's joint stands 100 mm above its carriage: a turn moves it back along the guide."""
    measured = campaign("triglide-nonredundant", [], 1, 60, Scenario(errors=0.0))
    rows = measured.conditions
    q = rows.q[:, 0]
    u = 2 * (q - q.min()) / (q.max() - q.min()) - 1
    step = moved(measured, "carriage_angle", "c1.rz", a1=1e-4)
    expected = -0.1 * 1e-4 * u[:, None] * jacobian(rows.poses, rows.q)[:, :, 0]
    assert np.abs(step - expected).max() < 0.01 * np.abs(expected).max()


@pytest.mark.parametrize("machine", REDUNDANT)
def test_a_clearance_jumps_with_the_sign_of_the_force(machine: str) -> None:
    """Seen as a longer rod where it is pulled and a shorter one where it is pushed."""
    plan, measured = PLANS[machine], campaign(machine, [], 4, 60)
    before, rod = found(measured, []), plan.rods[2]
    pull = before.tension[:, 2]
    grown = moved(measured, "clearance", rod, c=1e-6) / 0.5e-6
    geometry = plan.geometry({**plan.nominal, **measured.parameters})
    length = geometry.length + 1e-6 * (np.arange(len(plan.rods)) == 2)
    longer = truth(plan, replace(geometry, length=length), measured.conditions).readings
    per_length = (longer - before.readings) / 1e-6
    clear = np.abs(pull) > 0.5 * rms(pull)
    assert clear.sum() > 10
    assert np.abs(grown - np.sign(pull)[:, None] * per_length)[clear].max() < 0.01 * np.abs(per_length).max()


def test_a_loose_joint_carries_nothing_until_its_clearance_is_crossed() -> None:
    """One rod between a wall and a platform that a force pulls: elongation F / k + c / 2 beyond the crossing."""
    ends = np.array([[[-1.0, 0, 0], [0, -1.0, 0]]]).repeat(4, 0)
    pull = np.array([-500.0, -200.0, 200.0, 500.0])
    force = Load(np.stack([pull, 0 * pull, 0 * pull], -1), np.zeros(3))
    two = np.ones((4, 2))
    problem = Problem(
        body=np.zeros((2, 3)),
        base=ends,
        length=two,
        stiffness=1e7 * two,
        gap=np.array([10e-6, 0.0]),
        loads=(force,),
        freedoms=(0, 1),
    )
    balance: Balance = solve(problem, np.zeros((4, 3)))
    assert balance.tension[:, 0] == pytest.approx(pull, rel=1e-6)
    assert balance.position[:, 0] == pytest.approx(pull / 1e7 + 10e-6 * np.sign(pull), rel=3e-3)


def test_windup_is_lost_motion_by_the_force_of_the_drive() -> None:
    measured = campaign("triglide", [], 4, 30)
    rows, before = measured.conditions, found(measured, [])
    step = moved(measured, "windup", "q2", w=1e-9)
    error = -1e-9 * rows.direction[:, 1] * np.abs(before.force[:, 1])
    shifted = replace(measured, conditions=replace(rows, q=rows.q + error[:, None] * np.array([0, 1, 0])))
    assert np.abs(step - (found(shifted, []).readings - before.readings)).max() < 1e-13
