"""Carriages on springs: a rail that is bent, inclined, sagging or that tilts them moves them through the springs.

The truth is an energy minimisation of its own: rods, and for each carriage a spring across the rail and one against
tilt, between the carriage and the rail where it really is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import root

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.prediction import Request
from tests.command import clean, run
from tests.elastic_guide import TOWERS, sliders
from tests.in_ci import in_ci
from tests.support import at, model

pytestmark = pytest.mark.usefixtures("unsized")

READINGS = np.array([[0.1354, 0.6646, 1.0325], [0.2354, 0.7646, 1.1325], [0.3354, 0.8646, 1.2325]])
LENGTHS, LEVER, ROD = (0.400, 0.400, 0.7003), 0.05, 60e6
LONG = 1.4  # m, over which shapes are spread
LOAD = np.array([300.0, -500.0])
STIFF, SOFT = (2e12, 5e11), (20e6, 60e3)  # N/m, N m/rad
SIZES = {
    "straight@rail.y": "n2: 500 um, n3: -300 um, over: [0, 1400]",
    "guide_angle@rail.y": "g: 900 urad, over: [0, 1400]",
    "sag@rail.y": "c: 400 um, over: [0, 1400]",
    "carriage_angle@c2.rz": "a1: 700 urad, a2: -400 urad, over: [0, 1400]",
    "none": "",
}


def shape(name: str, q: float) -> tuple[float, float]:
    """How far the rail is off across (m), and how it turns the carriage c2 (rad), at travel q."""
    u = 2 * q / LONG - 1
    second, third = (3 * u**2 - 1) / 2, (5 * u**3 - 3 * u) / 2
    across = {
        "straight@rail.y": 500e-6 * second - 300e-6 * third,
        "guide_angle@rail.y": 900e-6 * (q - LONG / 2),
        "sag@rail.y": -400e-6 * (1 - u**2) ** 2,
    }
    turn = 700e-6 * u - 400e-6 * second if name.startswith("carriage") else 0.0
    return across.get(name, 0.0), turn


def minimum(name: str, travels: Array, springs: tuple[float, float]) -> Array:
    """Place of the TCP where the energy is least: unknowns x, y, and of each carriage its way across and its tilt."""

    def energy(z: Array) -> complex:
        total = -(LOAD @ z[:2])
        for i, (q, length) in enumerate(zip(travels, LENGTHS, strict=True)):
            across, tilt = z[2 + 2 * i], z[3 + 2 * i]
            rail, turn = shape(name, q)
            joint = np.array([q - LEVER * np.sin(tilt), across + LEVER * np.cos(tilt)])
            way = z[:2] - joint
            total += 0.5 * ROD * (np.sqrt(way @ way) - length) ** 2
            total += 0.5 * springs[0] * (across - rail) ** 2
            total += 0.5 * springs[1] * (tilt - (turn if i == 1 else 0.0)) ** 2
        return complex(total)

    def gradient(z: Array) -> Array:
        steps = 1e-30j * np.eye(8)
        scale = np.array([ROD, ROD] + [springs[0] + ROD, springs[1] + ROD * LEVER**2] * 3)
        return np.array([energy(z + step).imag / 1e-30 for step in steps]) / scale

    begin = np.zeros(8)
    begin[:2] = (travels[0] + travels[1]) / 2, 0.35
    begin[2::2] = [shape(name, q)[0] for q in travels]
    found = root(gradient, begin, method="hybr", options={"xtol": 1e-15})
    assert np.abs(gradient(found.x)).max() < 1e-14
    return np.asarray(found.x[:2])


def machine(name: str, springs: tuple[float, float] | None) -> str:
    guidance = "" if springs is None else f"stiffness: {{y: {springs[0]:g} N/m, rz: {springs[1]:g} Nm/rad}}"
    load = f"    loads: {{push: {{at: tcp, force: [{LOAD[0]}, {LOAD[1]}]}}}}\n    gravity: [0, -9.81]\n"
    effects = "" if name == "none" else f"    effects: {{{name}: {{{SIZES[name]}}}}}\n"
    return sliders(guidance, load + effects)


@pytest.mark.parametrize("name", SIZES)
def test_the_pose_is_that_of_least_energy(name: str) -> None:
    found = at(model(machine(name, SOFT)), READINGS, l3=LENGTHS[2])
    for row, travels in enumerate(READINGS):
        assert np.abs(found.values[row] - minimum(name, travels, SOFT)).max() < 5e-9
    plain = at(model(machine("none", SOFT)), READINGS, l3=LENGTHS[2])
    assert name == "none" or np.abs(found.values - plain.values).max() > 2e-6, "the effect is there"


@pytest.mark.parametrize("name", SIZES)
def test_stiff_springs_are_a_rigid_guide(name: str) -> None:
    """To the compliance, 10 kN on 2e12 N/m; an ideal guide takes angles to first order."""
    ideal = at(model(machine(name, None)), READINGS, l3=LENGTHS[2])
    stiff = at(model(machine(name, STIFF)), READINGS, l3=LENGTHS[2])
    assert np.abs(ideal.values - stiff.values).max() < (5e-8 if name.startswith("carriage") else 5e-9)


def test_a_carriage_on_springs_that_hold_its_tilt() -> None:
    """Springs across the rail only: a turn of the carriage moves its joint along, as on an ideal guide."""
    name = "carriage_angle@c2.rz"
    effects = f"    effects: {{{name}: {{{SIZES[name]}}}}}\n"
    change = []
    for guidance in ("stiffness: {y: 2e12 N/m}", ""):
        bare, moved = (at(model(sliders(guidance, e)), READINGS, l3=LENGTHS[2]).values for e in ("", effects))
        change.append(moved - bare)
    assert np.abs(change[1]).max() > 2e-6
    np.testing.assert_allclose(change[0], change[1], rtol=0, atol=5e-9)


def test_forces_of_the_drives_follow() -> None:
    """A rail bent under one carriage loads the drives; on an ideal and on a stiff guide by the same forces."""
    asked = Request(forces=True)
    forces = [at(model(machine("straight@rail.y", s)), READINGS, asked, l3=LENGTHS[2]).forces for s in (None, STIFF)]
    bare = at(model(machine("none", STIFF)), READINGS, asked, l3=LENGTHS[2]).forces
    assert forces[0] is not None and forces[1] is not None and bare is not None
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-4)
    assert np.abs(forces[1] - bare).max() > 100


IN_SPACE = {
    "straight@rail1.x": "n2: 200 um, over: [0, 900]",
    "straight@rail4.y": "n3: 200 um, over: [0, 900]",
    "guide_angle@rail2.y": "g: 500 urad",
    "carriage_angle@c1.rx": "a1: 600 urad, over: [0, 600]",
    "carriage_angle@c2.ry": "a1: 600 urad, over: [0, 600]",
    "carriage_angle@c3.rz": "a2: 600 urad, over: [0, 600]",
}


@pytest.mark.parametrize("name", in_ci(["straight@rail1.x", "guide_angle@rail2.y", "carriage_angle@c1.rx"], IN_SPACE))
def test_stiff_springs_are_a_rigid_guide_in_space(name: str) -> None:
    """Every direction with its sign: what the effect does on stiff springs is what it does on an ideal guide."""
    spring = TOWERS[TOWERS.index("stiffness: {x: 40") : TOWERS.index("}}\n    bodies") + 1]
    stiff = "stiffness: {x: 1e12 N/m, y: 1e12 N/m, rx: 1e11 Nm/rad, ry: 1e11 Nm/rad, rz: 1e11 Nm/rad}"
    readings = 0.433 + np.array([[0.0, 0, 0, 0], [0.02, -0.03, 0.01, 0.05], [-0.04, 0.02, 0.05, -0.02]])
    change = []
    for guidance in (stiff, ""):
        text = TOWERS.replace(spring, guidance).replace("along: z,\n        }", "along: z}")
        bare = at(model(text), readings)
        moved = at(model(f"{text}    effects: {{{name}: {{{IN_SPACE[name]}}}}}\n"), readings)
        change.append(moved.values - bare.values)
    assert np.abs(change[1]).max() > 3e-7
    assert np.abs(change[0] - change[1]).max() < 2e-3 * np.abs(change[1]).max()


def campaign(folder: Path, entry: str) -> tuple[Path, Path]:
    """A machine without, and a table of one with, an effect; noise as declared."""
    plain, bent, table = folder / "m.yaml", folder / "bent.yaml", folder / "t.csv"
    plain.write_text(sliders())
    bent.write_text(f"extends: {plain}\neffects: {{{entry}}}\n")
    grid = ("--grid", "x=250:950:12,y=250:400:7", "--noise", "declared", "--seed", "3")
    assert clean(run("simulate", bent, *grid, "-o", table)).code == 0
    return plain, table


@pytest.mark.parametrize(
    "entry",
    [
        "straight@rail.y: {n2: 60 um, n3: -40 um, n4: 30 um}",
        pytest.param("guide_angle@rail.y: {g: 600 urad}", marks=pytest.mark.slow),
    ],
)
def test_a_diagnosis_names_what_is_wrong_with_the_guide(tmp_path: Path, entry: str) -> None:
    """With a guide of springs as with an ideal one; it was told that no effect of the catalogue explains it."""
    done = clean(run("diagnose", *campaign(tmp_path, entry), "--json"))
    assert done.code in (0, 1), done.err
    found = [(e["effect"], e["at"]) for e in done.json["effects"]]
    keyword, _, rest = entry.partition("@")
    assert (keyword, rest.partition(":")[0]) in found, done.err
    assert "no effect of the catalogue" not in done.err


def test_the_places_are_listed(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(sliders())
    told = clean(run("effects", file)).err
    for keyword, place in (("straight", "rail.y"), ("guide_angle", "rail.y"), ("carriage_angle", "c2.rz")):
        line = next(line for line in told.splitlines() if line.startswith(keyword))
        assert place in line
