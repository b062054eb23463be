"""The exact Jacobian against central differences of the converged model, with Richardson extrapolation.

Steps of 5 % of a range (1 % of a stiffness) leave an error of 1e-8 of the column by the step's fourth power; rounding
of predictions (1e-16 m) over steps of 5 um leaves 1e-11, more for columns of little effect. Required: 1e-6.
"""

from __future__ import annotations

import numpy as np
import pytest

from pkmcal_cli.prediction import Request, Rows, predict
from tests import structures
from tests.in_ci import in_ci
from tests.kinds import PLANAR_KINDS, SPATIAL_KINDS
from tests.measured import REDUNDANT, JacobianCheck, hangprinter, jacobian_check, readings_of, strained_values
from tests.support import SHIPPED, at, model, overlay, truth

LIMIT = 1e-6


def passes(found: JacobianCheck, null: tuple[str, ...] = ()) -> None:
    assert found.deviation < LIMIT, found.worst
    assert found.null == null
    assert found.null_size < 1e-9


@pytest.mark.parametrize("name", in_ci([name for name in SHIPPED if name != "hexapod7"], SHIPPED))
def test_every_column_at_strained_poses(name: str) -> None:
    """All parameters off. The non-redundant Triglide without load stays unstrained: its stiffness has no effect."""
    text = hangprinter(40.0) if name == "hangprinter" else name
    null = {"triglide-nonredundant": ("k1", "k2"), "hangprinter": ("D",), "belt-router": ("BL", "BR")}
    passes(jacobian_check(text, readings_of(name), strained_values(text)), null.get(name, ()))


NOMINAL_NULL = {
    "triglide": ("k1", "k2", "k3"),
    "triglide-nonredundant": ("k1", "k2"),
    "biglide": ("k1", "k2", "k3"),
    "scissors": ("k1", "k2", "k3", "k4", "k5"),
    "belt-router": ("BL", "BR"),
}
"""Without strain no stiffness is felt; delta4, hexapod7 and belt-router have weight. Nothing hangs on the set values of
drives in force control."""


@pytest.mark.parametrize(
    "name",
    in_ci(
        [*NOMINAL_NULL, "delta4", "delta-printer"], [*NOMINAL_NULL, "delta4", "hexapod7", "five-bar", "delta-printer"]
    ),
)
def test_every_column_at_the_unstrained_nominal(name: str) -> None:
    passes(jacobian_check(name, readings_of(name)), NOMINAL_NULL.get(name, ()))


@pytest.mark.parametrize("name", in_ci(["triglide", "delta4"], REDUNDANT))
def test_readings_of_force_controlled_drives(name: str) -> None:
    """Redundant drives in force control: their readings are channels, their set values move nothing."""
    drives = truth(name).redundant
    text = overlay(name, structures.force_controlled({d: 150.0 * (-2) ** k for k, d in enumerate(drives)}))
    assert [c.name for c in model(text).channels[-len(drives) :]] == list(drives)
    passes(jacobian_check(text, readings_of(name), strained_values(text)), drives)


KINDS = {
    "spatial": (SPATIAL_KINDS, [[1e-3, -0.15, 5e-4, 0.01, -1e-3], [-5e-4, -0.25, -1e-3, -0.01, 1e-3]]),
    "planar": (PLANAR_KINDS, [[1e-3, 5e-3, -5e-4, 0.01], [-5e-4, -5e-3, 5e-4, -0.01]]),
}


@pytest.mark.parametrize("space", KINDS)
def test_a_parameter_in_every_place_of_the_machine_file(space: str) -> None:
    text, moves = KINDS[space]
    machine = model(text)
    found = jacobian_check(text, machine.reference_readings + np.array(moves), strained_values(text, 0))
    passes(found)
    assert found.columns == len(machine.names) + len(machine.actuators)


FORCED = {
    "spool": (
        "spatial",
        "redundant: true}\n      q3",
        "redundant: true, control: force, force: Fd}\n      q3",
        "400 N",
    ),
    "crank with spring": ("planar", "kd4, redundant: true", "kd4, redundant: true, control: force, force: Fd", "3 Nm"),
    "ideal crank": ("planar", "turns: crank2, zero: z2", "turns: crank2, zero: z2, control: force, force: Fd", "2 Nm"),
    "ideal telescope": ("planar", "drives: slide3", "drives: slide3, control: force, force: Fd", "30 N"),
    "carriage with spring": ("planar", "zero: z1", "zero: z1, control: force, force: Fd", "30 N"),
    "telescope with spring": (
        "planar",
        "drives: slide3, redundant: true",
        "drives: slide3, redundant: true, stiffness: k3, control: force, force: Fd",
        "30 N",
    ),
    "leg": ("spatial", "scale: scale1", "scale: scale1, control: force, force: Fd", "300 N"),
}


@pytest.mark.parametrize("kind", in_ci(["crank with spring", "ideal telescope"], FORCED))
def test_every_kind_of_drive_in_force_control(kind: str) -> None:
    """Its force is a parameter. Where it held the mechanism, a drive that was redundant does so in its place."""
    space, old, new, force = FORCED[kind]
    text, moves = KINDS[space]
    if kind in ("ideal crank", "leg"):
        text = text.replace("drives: slide3, redundant: true", "drives: slide3")
        text = text.replace("zero: home, redundant: true", "zero: home")
    assert text.count(old) == 1
    text = text.replace(old, new).replace(
        "parameters:\n", f"parameters:\n      Fd: {{nominal: {force}, range: {force}}}\n"
    )
    machine = model(text)
    driven = [d.name for d in machine.topology.drives if d.force_controlled]
    values = machine.by_name(strained_values(text, 0))
    values["Fd"] = machine.by_name(machine.nominal)["Fd"]
    found = jacobian_check(text, machine.reference_readings + 0.3 * np.array(moves), np.array(list(values.values())))
    passes(found, tuple(driven))


def test_ideal_carriage_in_force_control() -> None:
    text = PLANAR_KINDS.replace("stiffness: kd1, ", "control: force, force: Fd, redundant: true, ")
    text = text.replace("      kd1: {nominal: 4000, unit: N/mm}\n", "      Fd: {nominal: 30, unit: N}\n")
    text = text.replace("drives: slide3, redundant: true", "drives: slide3")
    machine = model(text)
    found = jacobian_check(text, machine.reference_readings + np.array(KINDS["planar"][1]), strained_values(text, 0))
    passes(found, ("q1",))


def test_a_column_of_forces_replaces_the_machines_force() -> None:
    """Row by row: a given force acts as if declared, and the declared one has no influence there."""
    changes = "parameters: {F: {nominal: 100, unit: N, range: 10}}\nactuators: {q3: {control: force, force: F}}"
    machine, readings = model(overlay("triglide", changes)), readings_of("triglide")[:3]
    given = np.full(readings.shape, np.nan)
    given[1, 2] = 250.0
    found = predict(machine, machine.nominal, Rows(readings, given), Request(parameters=("F",), forces=True))
    assert found.forces[:, 2].tolist() == [100.0, 250.0, 100.0]
    assert np.abs(found.jacobian[1]).max() == 0.0 < np.abs(found.jacobian[0]).min()
    declared = at(machine, readings, Request(), F=250.0)
    assert np.abs(found.values[1] - declared.values[1]).max() < 1e-14
