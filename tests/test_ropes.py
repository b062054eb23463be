"""Ropes over several points and over pulleys, against plane trigonometry and against a general minimiser of energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize, root

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.equilibrium.assembly import balance, typical_stiffness
from pkmcal_cli.equilibrium.kinematics import advance, reference_state
from pkmcal_cli.prediction import Request, Rows, predict
from tests.in_ci import in_ci
from tests.rope_machines import MACHINES, RopeMachine, spatial, spatial_lengths
from tests.support import model
from tests.verification_ropes import derivative_check, length_error

G = 9.80665
EVERY = pytest.mark.parametrize("name", MACHINES)


@EVERY
def test_lengths_and_wraps(name: str) -> None:
    """What the drives read where nothing is strained, all over the workspace."""
    assert length_error(name) < 1e-14


def test_the_platform_stands_where_rigid_ropes_say() -> None:
    """Six rigid ropes hold it, two are pulled by a force and read."""
    text = spatial(False, "redundant: true, control: force, force: 100")
    poses = replace(MACHINES["spatial"], text=text).poses(30, 2, 0.5)
    readings = np.array([spatial_lengths(pose) for pose in poses])
    for method in ("rigid", "exact"):
        found = predict(model(text), model(text).nominal, Rows.at(readings), Request(method=method))
        assert found.solved.all()
        assert np.abs(found.values[:, :6] - poses).max() < 1e-12
        assert np.abs(found.values[:, 6:] - readings[:, 6:]).max() < 1e-12


# --- equilibrium ----------------------------------------------------------------------------------------------------
def slopes(machine: RopeMachine, pose: Array) -> Array:
    """Derivative (ropes, f) of what the drives read, by differences of eighth order."""
    weights, h = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280]), 2e-3
    columns = []
    for unit in np.eye(len(pose)):
        parts = [machine.readings(pose + k * h * unit) - machine.readings(pose - k * h * unit) for k in (1, 2, 3, 4)]
        columns.append(weights @ np.array(parts) / h)
    return np.array(columns).T


def minimum(machine: RopeMachine, start: Array, rest: Array, gain: Array, stiffness: float) -> Array:
    """Pose of least energy of ropes that only pull, with natural lengths `rest`, less the work of the weight."""
    height = machine.columns.index(2 if 2 in machine.columns else 1)

    def elongation(pose: Array) -> Array:
        return np.maximum(machine.readings(pose) * gain - rest, 0)

    def energy(pose: Array) -> float:
        return float(0.5 * (stiffness / rest * elongation(pose) ** 2).sum() + machine.mass * G * pose[height])

    def force(pose: Array) -> Array:
        pulls = stiffness / rest * elongation(pose)
        return np.asarray(
            pulls @ (slopes(machine, pose) * gain[:, None]) + machine.mass * G * np.eye(len(pose))[height]
        )

    rough = minimize(energy, start, jac=force, method="BFGS", options={"gtol": 1e-7, "maxiter": 1000})
    found = root(force, rough.x, method="hybr", options={"xtol": 1e-13})
    assert np.abs(force(found.x)).max() < 1e-7
    return np.asarray(found.x)


GAINS = {"cables": np.array([0.025, 0.035, 0.035]), "weighted": np.array([0.025, 0.035, 0.035])}


@pytest.mark.parametrize("name", in_ci(["cables", "weighted"], ["cables", "weighted", "rolled", "spatial"]))
def test_elastic_ropes_with_a_payload_some_of_them_slack(name: str) -> None:
    machine = MACHINES[name]
    built, rng = model(machine.text), np.random.default_rng(3)
    rows = {"spatial": 10, "rolled": 20}.get(name, 40)
    poses, gain = machine.poses(rows, 4, 0.5), GAINS.get(name, np.ones(1))
    stiffness = built.by_name(built.nominal)["EA"]
    rest = np.array([machine.readings(pose) for pose in poses]) * gain
    rest += rng.normal(0, 2e-3, rest.shape)
    gain = np.broadcast_to(gain, rest.shape[1:])
    true = np.array([minimum(machine, p, r, gain, stiffness) for p, r in zip(poses, rest, strict=True)])
    pull = np.array([stiffness / r * (machine.readings(p) * gain - r) for p, r in zip(true, rest, strict=True)])
    found = predict(built, built.nominal, Rows.at(rest / gain), Request(forces=True))
    assert found.solved.all()
    assert np.abs(found.values - (machine.aimed(true)[:, machine.columns])).max() < 1e-9
    assert found.forces is not None
    assert np.abs(found.forces - np.maximum(pull, 0)).max() < 1e-4  # N, of the minimiser
    loose = (pull < 0).any(axis=1)
    assert loose.sum() > 0.25 * rows
    assert [k in found.slack for k in range(rows)] == loose.tolist()


# --- derivatives ----------------------------------------------------------------------------------------------------
@EVERY
def test_derivatives_by_every_parameter_and_drive(name: str) -> None:
    """EA, radii of pulleys and drums, anchors, points of bodies."""
    found = derivative_check(name)
    assert found.deviation < 1e-6, found.worst
    assert found.null == ()


@EVERY
@pytest.mark.parametrize("rigid", [False, True])
def test_tangent_is_the_derivative_of_the_residual(name: str, rigid: bool) -> None:
    """At random states, ropes that push or pull and multipliers included; by complex steps.

    Rigid ropes are constraints where no more drives hold positions than there are freedoms: the others pull.
    """
    text = MACHINES[name].text
    if rigid:
        text = (
            text.replace("EA: EA, ", "").replace(", EA: EA}", "}").replace("EA: 20 kN, ", "").replace("EA: 50 kN, ", "")
        )
        text = text.replace(", EA: 20 kN", "").replace("redundant: true", "redundant: true, control: force, force: 100")
    built = model(text)
    system, rng = built.exact, np.random.default_rng(6)
    assert (system.constraints > 0) == rigid
    coefficients = built.reference_coefficients
    scale = typical_stiffness(system, coefficients)
    state = reference_state(built.topology, coefficients, 1, system.constraints)
    state = advance(system, state, 0.05 * rng.normal(size=(1, system.size)), 100.0)
    found = balance(system, coefficients, state, scale, taut=True).tangent.dense()
    assert found is not None
    for k, unit in enumerate(np.eye(system.size)):
        stepped = advance(system, state, 1e-30j * unit[None], scale)
        column = balance(system, coefficients, stepped, scale, tangent=False, taut=True).residual.imag / 1e-30
        assert np.abs(column[0] - found[0, :, k]).max() < 1e-13 * np.abs(found).max()


def test_ropes_of_one_drive_are_one_cable() -> None:
    """m + 2 k as weights, and as a point that occurs twice: the same readings, forces and derivatives."""
    one, other = model(MACHINES["cables"].text), model(MACHINES["weighted"].text)
    readings = np.array([MACHINES["cables"].readings(p) for p in MACHINES["cables"].poses(20, 7)]) - 0.1
    request = Request(forces=True, parameters=one.names, by_drive=True)
    first, second = (predict(m, m.nominal, Rows.at(readings), request) for m in (one, other))
    for key in ("values", "forces", "energy", "jacobian", "by_drive"):
        a, b = getattr(first, key), getattr(second, key)
        assert np.abs(a - b).max() < 1e-12 * np.abs(a).max()
