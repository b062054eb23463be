"""Guides that bodies and beams carry: the shipped gantry against fine beam elements, others against closed forms."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array, exp
from pkmcal_cli.equilibrium.status import RowStatus
from pkmcal_cli.prediction import Rows, predict
from tests.command import MACHINES, clean, run
from tests.computed_once import run_once
from tests.in_ci import in_ci
from tests.measured import against_frame, jacobian_check, skewed_gantry
from tests.structures import force_controlled
from tests.support import at, compiled, model, overlay
from tests.truth.gantry import BOWED, NOMINAL, RANGES, Bow, Gantry

pytestmark = pytest.mark.usefixtures("unsized")

MM, UM = 1e-3, 1e-6
BRIDGE = """\
space: planar
gravity: [0, -9.81]
nodes: {{a: {{at: [0, 0], fixed: true}}, b: {{at: [{length}, 0], fixed: {far}}}}}
beams: {{bridge: {{between: [a, b], EA: 1e9, EI: {ei}{own}, pieces: {pieces}}}}}
guides: {{way: {{beam: bridge}}}}
bodies: {{trolley: {{guide: way, at: 0.4, mass: {mass}}}}}
actuators: {{X: {{moves: trolley{more}}}}}
sensors: {{probe: {{at: trolley, reads: [x, y], sigma: 1 um, frame: machine}}}}
"""
LENGTH, EI, WEIGHT = 1.0, 1e6, 9.81
TRAVELS = np.array([[0.02], [0.3], [0.5], [0.91]])


def bridge(mass: float, own: float = 0.0, pieces: int = 1, far: str = "true", more: str = "") -> str:
    """A trolley on a beam that is clamped at its start, and at its end too, or free there."""
    own_mass = f", mass: {own}" if own else ""
    return BRIDGE.format(length=LENGTH, ei=EI, own=own_mass, mass=mass, pieces=pieces, far=far, more=more)


@pytest.mark.parametrize(("errors", "seed"), in_ci(["True-1"], product([False, True], [0, 1])))
def test_readings_agree_to_a_millionth_of_the_deflection(seed: int, errors: bool) -> None:
    """Drives out of step, rails that are not parallel or square, the carriage's weight."""
    deviation, deflection = against_frame(seed, errors, rows=3)
    assert 10 < deflection < 30
    assert deviation < 1e-6


def test_weight_of_the_carriage_bends_the_beam_with_x() -> None:
    """Most in the middle; next to the rigid rail hardly, next to the elastic one, which tilts, by more."""
    across = np.array([[0.9, 0.9, x] for x in (0.15, 0.75, 1.35)])
    heavy, light = (at(model("gantry"), across, m=m).values[:, 2] for m in (40.0, 20.0))
    sag = light - heavy
    assert sag[1] > 1.5 * sag[2] > 1.5 * 5 * sag[0] > 0


@pytest.mark.slow
def test_one_beam_is_enough_and_more_pieces_say_the_same() -> None:
    """Quadratic strains: one element a span is good to 1e-4 of the deflection, four to 1e-7."""
    one, four = (against_frame(2, errors=True, pieces=n)[0] for n in (1, 4))
    assert one < 1e-4
    assert four < 1e-7


@pytest.mark.slow
def test_bow_of_the_elastic_rail_moves_the_tool_as_the_frame_does() -> None:
    """An arc is the second Legendre polynomial over the limits, by -2/3 of its height. Without its slope to 1e-6."""
    readings = skewed_gantry(4)[0]
    text = f"effects: {{straight@rail2.x: {{n2: {-2 / 3 * BOWED / UM} um, n3: 0, n4: 0}}}}"
    true = Gantry(bow=_Shift(x=BOWED)).forward(readings).tcp
    assert np.abs(true - Gantry().forward(readings).tcp).max() > 10 * UM
    assert np.abs(at(model(overlay("gantry", text)), readings).values - true).max() < 1e-4 * BOWED


class _Shift(Bow):
    """A bow whose slope does not turn the carriage, as `straight` has it."""

    def at(self, travel: float) -> tuple[Array, Array]:
        place, turn = super().at(travel)
        return place, 0 * turn


@pytest.mark.parametrize("own", [0.0, 30.0])
@pytest.mark.parametrize("pieces", [1, 3])
def test_trolley_on_a_beam_clamped_at_both_ends(own: float, pieces: int) -> None:
    """F a^3 b^3 / (3 EI L^3), and w a^2 b^2 / (24 EI) of the beam's own weight; deflections of 1e-6, squared: 1e-9."""
    found = at(model(bridge(20.0, own, pieces)), TRAVELS).values
    a = TRAVELS[:, 0]
    b = LENGTH - a
    point = 20 * WEIGHT * (a * b) ** 3 / (3 * EI * LENGTH**3)
    spread = own * WEIGHT / LENGTH * (a * b) ** 2 / (24 * EI)
    assert -found[:, 1] == pytest.approx(point + spread, rel=1e-8)
    assert np.abs(found[:, 0] - a).max() < 1e-9


def test_trolley_on_a_beam_with_a_free_end() -> None:
    """F a^3 / (3 EI): what is beyond the trolley carries nothing."""
    found = at(model(bridge(20.0, far="false")), TRAVELS).values
    assert -found[:, 1] == pytest.approx(20 * WEIGHT * TRAVELS[:, 0] ** 3 / (3 * EI), rel=1e-8)


def test_two_trolleys_on_one_beam() -> None:
    """Small deflections add up: each trolley under the weight of both, by the influence line of the clamped beam."""
    text = bridge(20.0).replace("bodies: {", "bodies: {second: {guide: way, at: 0.8, mass: 5}, ")
    text = text.replace("actuators: {", "actuators: {W: {moves: second}, ")
    found = at(model(text), np.array([[0.8, 0.3]])).values[0]
    assert -found[1] == pytest.approx(_influence(0.3, 0.3, 20 * WEIGHT) + _influence(0.3, 0.8, 5 * WEIGHT), rel=1e-7)


def _influence(x: float, load: float, force: float) -> float:
    """Deflection at x of a beam clamped at both ends under a force at `load`."""
    x, load = (x, load) if x <= load else (LENGTH - x, LENGTH - load)
    b = LENGTH - load
    return force * b**2 * x**2 * (3 * load * LENGTH - x * (3 * load + b)) / (6 * EI * LENGTH**3)


def test_a_drive_that_yields_lets_the_trolley_roll_to_the_middle() -> None:
    """U = -C F^2 / 2 with C = (a b / L)^3 / 3 EI: the weight pushes the drive with F^2 C' / 2."""
    spring = 1e3
    text = bridge(2000.0, more=f", stiffness: {spring}")
    found = at(model(text), TRAVELS[1:]).values
    for (reading,), (x, *_) in zip(TRAVELS[1:], found, strict=True):
        a, b = x, LENGTH - x
        slope = (a * b) ** 2 * (b - a) / (EI * LENGTH**3)
        assert spring * (x - reading) == pytest.approx(0.5 * (2000 * WEIGHT) ** 2 * slope, rel=2e-3, abs=1e-4)


@pytest.mark.parametrize("change", ["", "actuators: {X: {stiffness: 30 N/um}}", force_controlled({"Y2": 150.0})])
def test_derivatives(change: str) -> None:
    """By all parameters and drives, at strain; also where the travel on the beam is unknown."""
    readings, values = skewed_gantry(5, 3)
    text = overlay("gantry", change) if change else "gantry"
    machine = model(text)
    vector = np.array([values.get(p.name, p.nominal) for p in machine.parameters])
    assert jacobian_check(text, readings, vector).deviation < 1e-6


def test_a_carriage_beyond_its_beam_is_out_of_reach() -> None:
    """The other rows are solved as they are alone."""
    machine = model("gantry")
    readings = np.array([[0.9, 0.9, x] for x in (0.7, -0.01, 1.5, 1.6, 1.2)])
    found = predict(machine, machine.nominal, Rows.at(readings))
    assert list(found.status == RowStatus.OUT_OF_REACH) == [False, True, True, True, False]
    assert np.array_equal(found.values[[0, 4]], predict(machine, machine.nominal, Rows.at(readings[[0, 4]])).values)


STACKED = """\
space: spatial
gravity: [0, 0, -9.81]
parameters: {sx: {nominal: 0, range: 1e-3, unit: rad}, sz: {nominal: 0, range: 1e-3, unit: rad}}
frames: {table: {body: saddle, at: [0.1, 0.2, 0.3], turn: [sx, 0.02, sz]}}
guides: {ways: {along: x}, top: {frame: table, along: y}}
bodies:
  saddle: {guide: ways, at: 0.5}
  slide: {guide: top, at: 0.1, mass: 0.4, centre: [0, 0, 0.2], points: {tip: [0.3, 0, 0.25]}}
actuators: {X: {moves: saddle}, Y: {moves: slide}}
sensors: {probe: {at: tip, reads: [x, y, z], sigma: 1 um, frame: machine}}
"""
"""A cross slide: the upper guide stands on a frame of the saddle."""
WAYS = {"rx": 3e5, "ry": 2e5, "rz": 1e5, "y": 4e7, "z": 5e7}
"""Stiffness of the lower guide."""


@pytest.mark.parametrize("elastic", [False, True])
def test_cross_slide_on_a_frame_of_a_body(elastic: bool) -> None:
    """tip = saddle + R (at + T (y e_y + tip)); the springs of the ways take weight and its moment."""
    ways = f"ways: {{along: x, stiffness: {{{', '.join(f'{k}: {v}' for k, v in WAYS.items())}}}}}"
    machine = model(STACKED.replace("ways: {along: x}", ways) if elastic else STACKED)
    readings, angles = np.array([[0.5, 0.1], [-0.2, 0.4], [0.3, -0.3]]), {"sx": 8e-4, "sz": -5e-4}
    found = at(machine, readings, **angles).values
    turn = exp(np.array([angles["sx"], 0.02, angles["sz"]]))
    for (x, y), tip in zip(readings, found, strict=True):
        place, tilt = np.array([x, 0.0, 0.0]), np.eye(3)
        slide = np.array([0.1, 0.2, 0.3]) + turn @ [0, y, 0]
        if elastic:
            force = np.array([0, 0, -0.4 * WEIGHT])
            for _ in range(50):  # the moment acts where the tilt has put the weight
                moment = np.cross(tilt @ (slide + turn @ [0, 0, 0.2]), force)
                tilt = exp(moment / [WAYS["rx"], WAYS["ry"], WAYS["rz"]])
            place = place + force / [1, WAYS["y"], WAYS["z"]] * [0, 1, 1]
        assert tip == pytest.approx(place + tilt @ (slide + turn @ [0.3, 0, 0.25]), abs=1e-11 if elastic else 1e-14)


def test_cross_slide_in_the_plane() -> None:
    """A guide on a body that is turned: the upper axis is that of the body."""
    text = """
        space: planar
        parameters: {square: {nominal: 0, range: 1e-3, unit: rad}}
        frames: {table: {body: saddle, turn: square}}
        guides: {ways: {along: x}, top: {frame: table, along: y}, cap: {body: slide, at: [0, 0.1], along: x}}
        bodies: {saddle: {guide: ways, at: 0}, slide: {guide: top, at: 0}, ram: {guide: cap, at: 0}}
        actuators: {X: {moves: saddle}, Y: {moves: slide}, U: {moves: ram}}
        sensors: {probe: {at: ram, reads: [x, y], sigma: 1 um, frame: machine}}
    """
    found = at(model(text), np.array([[0.5, 0.3, -0.2]]), square=2e-3).values[0]
    turn = exp(np.array([0, 0, 2e-3]))[:2, :2]
    assert found == pytest.approx([0.5, 0.0] + turn @ [-0.2, 0.4], abs=1e-15)


def test_counts_of_a_cross_slide() -> None:
    """Two freedoms, two drives, nothing strained."""
    found = compiled(STACKED).mobility
    assert (found.degrees_of_freedom, found.actuators, found.self_stress) == (2, 2, 0)


@pytest.mark.slow
def test_diagnose_finds_the_bow_of_the_elastic_rail() -> None:
    """The shipped table: one cause, at its place, with its size, and nothing else."""
    done = clean(run_once("diagnose", MACHINES / "gantry.yaml", MACHINES / "gantry-bow.csv", "--json", "--quiet"))
    _found_bow(json.loads(done.out), -2 / 3 * BOWED)


def _found_bow(diagnosis: dict, size: float) -> None:  # type: ignore[type-arg]
    (cause,) = diagnosis["effects"]
    assert (cause["effect"], cause["at"]) == ("straight", "rail2.x")
    assert [r["at"] for r in cause["credible_set"]] == ["rail2.x"]
    n2 = next(p for p in cause["parameters"] if p["name"].endswith("n2"))
    assert n2["unit"] == "um"
    assert abs(n2["value"] * UM - size) < 3 * n2["std"] * UM < 0.5 * abs(size)


@pytest.mark.slow
def test_diagnose_finds_nothing_on_the_straight_gantry() -> None:
    done = clean(run_once("diagnose", MACHINES / "gantry.yaml", MACHINES / "gantry.csv", "--json", "--quiet"))
    assert json.loads(done.out)["effects"] == []


@pytest.mark.slow
@pytest.mark.parametrize("outward", [1.0, -1.0])
def test_the_loop_on_another_gantry(outward: float, tmp_path) -> None:  # type: ignore[no-untyped-def]
    """Other errors, noise and poses from the frame: `improve` adds the bow, and what is left is noise."""
    rng, gantry = np.random.default_rng(42), Gantry(bow=Bow(x=outward * 0.12 * MM), pieces=(2, 4))
    readings = np.round(gantry.inverse(rng.uniform([0.12, 0.0], [1.38, 1.65], (90, 2))), 9)
    values = {n: v + RANGES[n] * rng.uniform(-0.5, 0.5) for n, v in NOMINAL.items()}
    measured = gantry.forward(readings, values).tcp + 3 * UM * rng.normal(size=(90, 3))
    table = tmp_path / "rows.csv"
    head = "Y1 [mm],Y2 [mm],X [mm],x [mm],y [mm],z [mm]"
    np.savetxt(table, np.hstack([readings, measured]) / MM, "%.6f", ",", header=head, comments="")
    arguments = ("--json", "--quiet")
    _found_bow(
        json.loads(clean(run_once("diagnose", MACHINES / "gantry.yaml", table, *arguments)).out), -0.08 * outward * MM
    )
    better = tmp_path / "better.yaml"
    clean(run_once("improve", MACHINES / "gantry.yaml", table, "-o", better, *arguments))
    assert "straight@rail2.x" in better.read_text(encoding="utf-8")
    fitted = json.loads(clean(run("calibrate", better, table, *arguments)).out)
    assert 0.7 < fitted["chi2_per_dof"] < 1.3
