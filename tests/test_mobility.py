"""Mobility by rank at the drawing: counts of every shipped machine by hand, and what is wrong with broken ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from pkmcal_cli.prediction import Request, Rows, predict
from tests.support import SHIPPED, at, compiled, errors_of, model, overlay, poses_of, truth

# unknowns with all drives released, freedom, drives, self-stress that no drive causes; by hand:
COUNTS = {
    "triglide": (2 + 3, 2, 3, 0),  # the TCP's x and y, three travels; three rods
    "triglide-nonredundant": (2 + 2, 2, 2, 0),
    "biglide": (2 + 2, 2, 3, 0),  # the leg is a drive: it holds nothing when released
    "scissors": (3 + 4, 2, 4, 0),  # x, y, rz of the platform, four travels; five rods
    "scissors-strained": (3 + 4, 2, 4, 0),
    # eight bars: four sums hold the place, four differences hold three turns, so one stresses another
    "delta4": (6 + 4, 3, 4, 1),
    "hangprinter": (3, 3, 4, 0),  # every line is a drive
    # a leg: turn of the lower beam's start (3), place and turn of the telescope (6), its travel, the upper beam's end
    # (3); held by one turn of the universal joint and six strains of each beam
    "hexapod7": (6 + 7 * 13, 6, 7, 0),
    # travel of the left plate, place and turn of the right one, travel and section of the carriage (1 + 6), the middle
    # of both spans (6 each); a closed frame holds itself in six ways, less those that the rails release: 6 + 1 - 2
    "gantry": (1 + 6 + 1 + 6 + 2 * 6, 2, 3, 5),
    "belt-router": (2, 2, 4, 0),  # every belt is a drive
    "five-bar": (2 + 2, 2, 2, 0),  # the tip's x and y, two cranks; two rods
    "delta-printer": (3 + 3, 3, 3, 0),  # the nozzle's place, three travels; three rods
}


@pytest.mark.parametrize("name", SHIPPED)
def test_counts_of_the_shipped_machines(name: str) -> None:
    found = compiled(name).mobility
    unknowns, freedom, drives, self_stress = COUNTS[name]
    assert found.unknowns == unknowns
    assert found.degrees_of_freedom == freedom
    assert found.actuators == drives
    assert found.redundancy == drives - freedom
    assert found.self_stress == self_stress
    assert found.free_motions == found.uncontrolled == found.rigid_loops == ()
    assert found.undetermined == found.overdetermined == 0


def test_too_few_drives() -> None:
    """One drive for two freedoms: what is free is named."""
    found = compiled(overlay("triglide", "actuators: {q2: null, q3: null}")).mobility
    assert (found.degrees_of_freedom, found.actuators, found.redundancy) == (2, 1, -1)
    assert len(found.uncontrolled) == 1


def test_substructure_that_does_not_hold_the_mechanism() -> None:
    found = compiled(overlay("triglide", "actuators: {q2: {redundant: true}}")).mobility
    assert (found.undetermined, found.overdetermined) == (1, 0)
    assert found.uncontrolled == ()


def test_substructure_with_a_drive_too_many() -> None:
    found = compiled(overlay("triglide", "actuators: {q3: {redundant: false}}")).mobility
    assert (found.undetermined, found.overdetermined) == (0, 1)


def test_singular_choice_of_redundant_drives() -> None:
    """Scissors with q1 and q3 free: enough drives by number, but q2 and q4 do not hold it at the drawing."""
    text = "actuators: {q1: {redundant: true}, q2: {redundant: false}}"
    found = compiled(overlay("scissors", text)).mobility
    assert (found.undetermined, found.overdetermined) == (1, 1)


RIGID_RODS = """
parameters: {k1: null, k2: null, k3: null}
bars: {rod1: {k: null}, rod2: {k: null}, rod3: {k: null}}
"""


def test_closed_loop_in_which_nothing_yields() -> None:
    """Three rigid rods hold two coordinates; with one drive that yields they do not, and without any all do alike."""
    shared = compiled(overlay("triglide", RIGID_RODS))
    assert shared.mobility.rigid_loops == () and shared.shared_by == ("rod1", "rod2", "rod3")
    yielding = RIGID_RODS + "actuators: {q2: {stiffness: 20000}}"
    found = compiled(overlay("triglide", yielding)).mobility
    assert found.rigid_loops == ()
    assert found.redundancy == 1


def test_rigid_redundant_machines_may_have_effects_and_instruments_that_stand_anywhere() -> None:
    """They are compiled a second time, without loads: with places of effects that ended in an internal error."""
    plain = compiled(overlay("triglide", RIGID_RODS)).model
    seen = predict(plain, plain.nominal, Rows.at(plain.reference_readings[None])).values
    for more in ("sensors: {tracker: {frame: fitted}}\n", "effects: {backlash@q1: {b: 0 um}}\n"):
        made = compiled(overlay("triglide", RIGID_RODS + more))
        assert made.shared_by == ("rod1", "rod2", "rod3")
        rows = Rows.at(made.model.reference_readings[None])
        assert predict(made.model, made.model.nominal, rows).values == pytest.approx(seen, abs=1e-12)


def test_drives_of_a_rigid_machine_share_their_misfit() -> None:
    """Least squares of all drives' misfits, by the closed form; where all agree, the pose that all hold. No loads."""
    rigid, simulator, poses = overlay("triglide", RIGID_RODS), truth("triglide"), poses_of("triglide", 40)
    readings = simulator.inverse(poses)
    assert np.abs(at(model(rigid), readings).values[:, :2] - poses).max() < 1e-12
    apart = readings + np.random.default_rng(0).normal(0, 1e-3, readings.shape)
    found = at(model(rigid), apart).values[:, :2]
    loaded = overlay("triglide", RIGID_RODS + "loads: {weight: {at: tcp, force: [0, -5000]}}")
    np.testing.assert_array_equal(at(model(loaded), apart).values[:, :2], found)
    for row, begin, pose in zip(apart, poses, found, strict=True):
        best = least_squares(lambda p, row=row: simulator.inverse([p])[0] - row, begin, xtol=1e-15, gtol=1e-15)
        assert np.abs(best.x - pose).max() < 1e-8  # m; the optimiser differentiates by differences


def test_a_drive_in_force_control_opens_a_loop() -> None:
    """Rigid rods whose redundant drive holds a force: the pose of the others, and their readings the closed form's."""
    forced = overlay("triglide", RIGID_RODS + "actuators: {q3: {control: force, force: 100}}")
    assert compiled(forced).mobility.rigid_loops == ()
    poses = poses_of("triglide", 5)
    readings = truth("triglide").inverse(poses)
    found = at(model(forced), np.where([True, True, False], readings, np.nan))
    assert np.abs(found.values[:, :2] - poses).max() < 1e-12
    assert np.abs(found.values[:, 2] - readings[:, 2]).max() < 1e-12


def test_rigid_rods_without_redundancy_are_no_fault() -> None:
    """And their pose is that of stiff rods without load."""
    text = """
    parameters: {k1: null, k2: null}
    bars: {rod1: {k: null}, rod2: {k: null}}
    """
    rigid = overlay("triglide-nonredundant", text)
    assert compiled(rigid).mobility.rigid_loops == ()
    readings = truth("triglide").inverse(poses_of("triglide", 5))[:, :2]
    values = errors_of(model(rigid), 1e-3)
    found, stiff = at(model(rigid), readings, **values), at(model("triglide-nonredundant"), readings, **values)
    assert np.abs(found.values - stiff.values).max() < 1e-13


LEGS = "each: {i: [1, 2, 3, 4, 5, 6, 7]}"


def test_spin_of_legs_between_spherical_joints_is_held() -> None:
    """Spherical instead of universal joints at the base: seven idle turns, found, named, held; the pose is the same.

    A leg bent by its weight stays bent downwards whatever its spin, as its section is round.
    """
    ends = f'beams: {{"lower{{i}}": {{{LEGS}, ends: [spherical, fixed]}}}}'
    made = compiled(overlay("hexapod7", ends))
    assert len(made.mobility.free_motions) == 7
    assert all("rotation of" in name for name in made.mobility.free_motions)
    assert made.mobility.uncontrolled == ()
    assert made.mobility.degrees_of_freedom == 6
    readings = truth("hexapod7").inverse(poses_of("hexapod7", 4))
    values = errors_of(made.model, 1e-4)
    spinning, held = (at(m, readings, Request(forces=True), **values) for m in (made.model, model("hexapod7")))
    assert np.abs(spinning.values - held.values).max() < 1e-12  # positions round to 1e-16, forces of 1e4 N to 1e-12
    assert spinning.forces == pytest.approx(held.forces, rel=1e-8)


STRUT = """
units: {length: mm, angle: deg, force: N}
space: spatial
gravity: [0, 0, -9.81]
ground: {A: [0, 0, 0], B: [300, 0, 0], C: [0, 300, 0]}
nodes: {tcp: {at: [100, 100, 400], mass: 1}}
beams:
  one: {between: [A, tcp], ends: [spherical, spherical], EA: 1e7, EI: 1e9, GJ: 1e9, pieces: PIECES}
  two: {between: [B, tcp], ends: [spherical, spherical], EA: 1e7, EI: 1e9, GJ: 1e9}
  three: {between: [C, tcp], ends: [universal, spherical], EA: 1e7, EI: 1e9, GJ: 1e9}
sensors: {t: {kind: tcp, at: tcp, reads: [x, y, z], sigma: 1 um, frame: machine}}
"""


@pytest.mark.parametrize("pieces", [1, 3])
def test_struts_between_spherical_joints_carry_as_bars(pieces: int) -> None:
    found = compiled(STRUT.replace("PIECES", str(pieces)))
    assert len(found.mobility.free_motions) == 2
    assert found.mobility.uncontrolled == ()
    linear = at(found.model, np.zeros((1, 0)), Request(method="linear")).values[0] - found.model.tool.reference[:3]
    feet = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0]])
    way = np.array([0.1, 0.1, 0.4]) - feet
    length = np.linalg.norm(way, axis=1)
    stiffness = np.einsum("r,ri,rj->ij", 1e7 / length**3, way, way)
    assert linear == pytest.approx(np.linalg.solve(stiffness, [0, 0, -9.81]), rel=1e-6)


POINT = "nodes: {tcp: null}\nbodies: {tcp: {at: [360, 275]}}"


def test_turn_of_a_platform_that_is_a_point_is_held() -> None:
    made = compiled(overlay("triglide", POINT))
    assert made.mobility.free_motions == ("rotation of tcp",)
    assert made.mobility.uncontrolled == ()
    readings = truth("triglide").inverse(poses_of("triglide", 5))
    values = errors_of(made.model, 1e-3)
    assert (
        np.abs(at(made.model, readings, **values).values - at(model("triglide"), readings, **values).values).max()
        < 1e-13
    )


def test_a_turn_that_nothing_holds_must_not_be_measured() -> None:
    reads = "sensors: {tracker: {reads: [x, y, rz], sigma: {position: 1 um, orientation: 1 urad}}}"
    found = compiled(overlay("triglide", f"{POINT}\n{reads}")).mobility
    assert found.free_motions == ()
    assert found.uncontrolled == ("rotation of tcp",)


@pytest.mark.parametrize("place", ["[117, 0]", "[217, 100]"], ids=["hanging", "lying"])
def test_a_free_motion_that_carries_load_is_a_fault(place: str) -> None:
    """A weight on a string from a carriage: it moves no TCP, but it is no idle motion."""
    text = f"""
    gravity: [0, -9.81]
    nodes: {{bob: {{at: {place}, mass: 1 kg}}}}
    bars: {{string: {{between: [B1, bob], k: 100000}}}}
    """
    found = compiled(overlay("triglide", text)).mobility
    assert found.free_motions == ()
    assert len(found.uncontrolled) == 1 and "bob" in found.uncontrolled[0]


HEAD = """
units: {length: mm, angle: deg, force: N}
space: spatial
sensors: {s: {kind: tcp, at: AT, reads: [x, y, z, rx, ry, rz], frame: machine,
  sigma: {position: 1 um, orientation: 1 urad}}}
"""


@pytest.mark.parametrize(
    ("kind", "freedom"),
    [
        ("fixed", 0),
        ("prismatic", 1),
        ("revolute", 1),
        ("universal", 2),
        ("cylindrical", 2),
        ("planar", 3),
        ("spherical", 3),
    ],
)
def test_freedom_of_a_body_on_one_joint(kind: str, freedom: int) -> None:
    axis = {"fixed": "", "spherical": "", "universal": "axes: [x, y], "}.get(kind, "axis: [0, 0.6, 0.8], ")
    text = f"""
ground: {{A: [10, 20, 30]}}
bodies: {{arm: {{at: [0, 0, 0], points: {{P: [10, 20, 30], Q: [50, 50, 0]}}}}}}
joints: {{j: {{between: [A, P], {axis}type: {kind}}}}}
"""
    found = compiled(HEAD.replace("AT", "Q") + text).mobility
    assert found.degrees_of_freedom == freedom
    assert len(found.uncontrolled) == freedom


LOOP = """
ground: {A: [0, 0, 0], B: [300, 0, 0]}
bodies:
  crank: {at: [0, 0, 0], points: {K: [0, 80, 0]}}
  rocker: {at: [300, 0, 0], points: {R: [0, 150, 0]}}
  coupler: {at: [0, 80, 0], points: {C: [0, 0, 0], D: [300, 70, 0]}}
joints:
  a: {between: [A, crank], type: revolute, axis: z}
  b: {between: [B, rocker], type: revolute, axis: z}
  c: {between: [K, C], type: revolute, axis: z}
  d: {between: [D, R], type: revolute, axis: z}
actuators: {q: {turns: a}}
"""


def test_four_hinges_in_space_stress_themselves() -> None:
    """Gruebler says -2; the loop moves in its plane with three self-stresses, and nothing in it yields."""
    found = compiled(HEAD.replace("AT", "R") + LOOP).mobility
    assert (found.degrees_of_freedom, found.redundancy, found.self_stress) == (1, 0, 3)
    assert found.rigid_loops
    yielding = LOOP.replace("c: {between: [K, C], type: revolute, axis: z}", "c: {between: [K, C], type: spherical}")
    found = compiled(
        HEAD.replace("AT", "R")
        + yielding.replace(
            "d: {between: [D, R], type: revolute, axis: z}", "d: {between: [D, R], type: universal, axes: [z, x]}"
        )
    ).mobility
    assert (found.degrees_of_freedom, found.self_stress, found.rigid_loops) == (1, 0, ())
