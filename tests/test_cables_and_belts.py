"""Machines of other people with ropes, as `docs/machine-language.md` writes them: three cables, a router on belts."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.prediction import Request, Rows, predict
from pkmcal_cli.prediction.inverse_kinematics import drive_positions
from tests.command import ROOT, run
from tests.measured import jacobian_check
from tests.pages import machine_files
from tests.rope_lengths import planar_length, swivel_length
from tests.rope_machines import circle, point

FILES = machine_files((ROOT / "docs" / "machine-language.md").read_text(encoding="utf-8"))
DRUMS = np.array([0.025, 0.035, 0.035])
HOME = np.array([0.5, 0.45])
SINGLE = "extends: tackle.yaml\nropes: {fall: null, tackle: {EA: 20 kN}}\nactuators: {q2: {winds: {fall: null}}}\n"
WOUND = """
extends: pulley.yaml
parameters: {r3: {nominal: 30, range: 0.2}}
ropes:
  cable2: null
  fall: {between: [winch, A1, body], EA: 20 kN, pulleys: {A1: {radius: r, side: right}}}
  tackle: {between: [A3, body], pulleys: {A3: {radius: r3, side: left}}}
actuators: {q2: {winds: {fall: 1, tackle: 2}}}
"""
"""Weights and pulleys together."""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The files of the page."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def made(file: Path) -> Model:
    return compile_machine(read_machine(file)).model


def cables(place: Array) -> Array:
    """Lengths m + n, m + 2 k, n + 2 h of the three cables."""
    m, n, k, h = (float(np.hypot(*(place - np.array(a)))) for a in ((0, 0.9), (1.2, 0.9), (0, 0), (1.2, 0)))
    return np.array([m + n, m + 2 * k, n + 2 * h])


def over_pulley(place: Array) -> Array:
    """The second cable comes from a winch over a pulley of 20 mm at the first anchor."""
    bare = (place, 0.0, "left")
    out = cables(place)
    out[1] = planar_length([point(-0.02, 0), circle(0, 0.9, 0.02, "right"), bare, point(0, 0), bare])
    return out


@pytest.mark.parametrize(("name", "lengths"), [("cables", cables), ("tackle", cables), ("pulley", over_pulley)])
def test_three_cables_over_four_anchors(name: str, lengths: Callable[[Array], Array], folder: Path) -> None:
    """Angles of drums of 25, 35 and 35 mm, counted from the reference configuration."""
    built, places = made(folder / f"{name}.yaml"), np.random.default_rng(1).uniform([0.2, 0.2], [1, 0.7], (50, 2))
    aimed = np.full((50, 6), np.nan)
    aimed[:, :2] = places
    found = drive_positions(built, aimed)
    true = np.array([(lengths(place) - lengths(HOME)) / DRUMS for place in places])
    assert np.abs(found.readings - true).max() < 1e-12


def test_planted_anchors_and_a_drum_are_found(folder: Path) -> None:
    planted = {"x2": 1201.2, "y2": 899.1, "x3": -0.7, "y4": 0.9, "R1": 25.06}
    values = ", ".join(f"{name}: {value}" for name, value in planted.items())
    (folder / "true.yaml").write_text(f"parameters: {{{values}}}\n", encoding="utf-8")
    grid, more = "x=250:950:5,y=250:650:4", ("-p", folder / "true.yaml")
    table = run("simulate", folder / "cables.yaml", "--grid", grid, *more).out
    done = run("calibrate", folder / "cables.yaml", "-", "--holdout", "none", "--json", stdin=table)
    assert done.code == 0, done.err
    assert {p["name"]: p["value"] for p in done.json["parameters"]} == pytest.approx(planted, abs=1e-6)


def test_a_rope_of_weight_two_pulls_with_twice_the_tension(folder: Path) -> None:
    """By Hooke's law at the pose that is found, where ropes balance the weight; the drive feels it once."""
    file = folder / "least.yaml"
    text = "extends: tackle.yaml\nropes: {fall: {t_min: 1}, tackle: {t_min: 1}}\n"
    file.write_text(text, encoding="utf-8")
    built, wound = made(file), np.array([-0.05, -0.05, -0.05])
    found = predict(built, built.nominal, Rows.at(wound[None]), Request(forces=True))
    place, rest = found.values[0], cables(HOME) + wound * DRUMS
    first, second, third = pulls = 20e3 / rest * (cables(place) - rest)
    ways = np.array([[0, 0.9], [1.2, 0.9], [0, 0], [1.2, 0]]) - place
    a1, a2, a3, a4 = ways / np.linalg.norm(ways, axis=1)[:, None]
    total = first * (a1 + a2) + second * (a1 + 2 * a3) + third * (a2 + 2 * a4)
    assert np.abs(total - [0, 4 * 9.81]).max() < 1e-8
    assert found.tension is not None and found.forces is not None
    assert found.forces[0] == pytest.approx(pulls, rel=1e-9)
    assert [rope.name for rope in built.least_tensions] == ["fall", "tackle"]
    assert found.tension[0] == pytest.approx([second, 2 * second], rel=1e-9)


def test_natural_lengths_of_ropes_count_by_their_weights(folder: Path) -> None:
    """A cable of ropes with stated lengths, and one of a single rope of weight 2."""
    file = folder / "lengths.yaml"
    text = """
        extends: tackle.yaml
        ropes: {fall: {length: 600}, tackle: {length: 650}}
        actuators: {q1: {winds: {cable1: 2}}, q2: {zero: null}, q3: {winds: cable3}}
    """
    file.write_text(dedent(text), encoding="utf-8")
    built = made(file)
    places = np.array([[0.4, 0.5], [0.8, 0.3]])
    aimed = np.full((2, 6), np.nan)
    aimed[:, :2] = places
    base = np.array([*(2 * cables(HOME)[:1]), 0.6 + 2 * 0.65, *cables(HOME)[2:]])
    true = np.array([cables(place) * [2, 1, 1] - base for place in places]) / DRUMS
    assert np.abs(drive_positions(built, aimed).readings - true).max() < 1e-12


def test_a_point_may_hang_in_the_middle_of_every_rope(folder: Path) -> None:
    file = folder / "middle.yaml"
    file.write_text(
        "extends: cables.yaml\nropes: {cable2: {between: [A1, body, A3]}, cable3: {between: [A2, body, A4]}}\n"
    )
    done = run("check", file)
    assert done.code == 0, done.err


def test_a_single_straight_rope_of_weight_two(folder: Path) -> None:
    file = folder / "single.yaml"
    file.write_text(SINGLE)
    aimed = np.array([[0.4, 0.5, *[np.nan] * 4], [0.8, 0.3, *[np.nan] * 4]])
    true = 2 * (np.hypot(*aimed[:, :2].T) - np.hypot(*HOME)) / DRUMS[1]
    assert np.abs(drive_positions(made(file), aimed).readings[:, 1] - true).max() < 1e-12


@pytest.mark.parametrize("base", ["tackle", "single"])
def test_a_warm_rope_of_weight_two_counts_twice(base: str, folder: Path) -> None:
    """Thermal growth of the tackle by a k dT is that of the cable by twice as much, as if the drum had turned."""
    (folder / "single.yaml").write_text(SINGLE)
    growth, readings = 12e-6 * 10 * float(np.hypot(*HOME)), np.deg2rad([-30, -20, -25])
    (folder / "warm.yaml").write_text(f"extends: {base}.yaml\neffects: {{thermal_strut@tackle: {{a: 12 um/(m*K)}}}}\n")
    head, row = "q1 [rad],q2 [rad],q3 [rad],T.tackle [degC]\n", "{:.17g},{:.17g},{:.17g},{}\n"
    (folder / "warm.csv").write_text(head + row.format(*readings, 30))
    turned = readings + np.array([0, 2 * growth / DRUMS[1], 0])
    (folder / "cold.csv").write_text(head + row.format(*turned, 20))
    warm, cold = (
        run("simulate", folder / "warm.yaml", folder / f"{t}.csv").out.splitlines()[-1] for t in ("warm", "cold")
    )
    first, second = (np.array([float(v) for v in line.split(",")[-2:]]) for line in (warm, cold))
    assert first == pytest.approx(second, abs=1e-9)  # mm
    (folder / "cold.csv").write_text(head + row.format(*readings, 20))
    still = run("simulate", folder / "warm.yaml", folder / "cold.csv").out.splitlines()[-1]
    assert np.abs(first - [float(v) for v in still.split(",")[-2:]]).max() > 1e-3


def test_the_mass_of_a_rope_hangs_at_its_points_by_length(folder: Path) -> None:
    """Half of each cable, folded or not, hangs at the point that moves: half of every piece."""
    heavy = folder / "heavy.yaml"
    masses = ", ".join(f"cable{k}: {{mass: {k}}}" for k in (1, 2, 3))
    heavy.write_text(f"extends: cables.yaml\nropes: {{{masses}}}\n", encoding="utf-8")
    (folder / "same.yaml").write_text("extends: cables.yaml\nnodes: {body: {mass: 7}}\n", encoding="utf-8")
    (folder / "more.yaml").write_text("extends: cables.yaml\nnodes: {body: {mass: 7.1}}\n", encoding="utf-8")
    rows = Rows.at(np.array([[-0.1, -0.1, -0.1], [0.5, -1.0, 0.4]]))
    first, second, third = (
        predict(m, m.nominal, rows).values
        for m in (made(heavy), made(folder / "same.yaml"), made(folder / "more.yaml"))
    )
    assert np.abs(first - second).max() < 1e-13
    assert np.abs(third - second).min() > 1e-9


def test_what_lies_on_a_pulley_hangs_there(folder: Path) -> None:
    """Of a rope from the winch over the pulley, half of the last free piece hangs at the point that moves."""
    (folder / "heavy.yaml").write_text("extends: wound.yaml\nropes: {fall: {mass: 10}}\n")
    (folder / "wound.yaml").write_text(WOUND)
    total = planar_length([point(-0.02, 0), circle(0, 0.9, 0.02, "right"), (HOME, 0.0, "left")])
    free = np.sqrt(((HOME - [0, 0.9]) ** 2).sum() - 0.02**2)
    mass = 4 + 10 * 0.5 * free / total
    (folder / "same.yaml").write_text(f"extends: wound.yaml\nnodes: {{body: {{mass: {mass:.17g}}}}}\n")
    rows = Rows.at(np.array([[-0.1, -0.1, -0.1]]))
    first, second = (
        predict(m, m.nominal, rows).values for m in (made(folder / f"{n}.yaml") for n in ("heavy", "same"))
    )
    assert np.abs(first - second).max() < 1e-13


def test_a_rope_that_goes_far_round_its_pulley_is_doubted(folder: Path) -> None:
    file = folder / "side.yaml"
    text = "extends: pulley.yaml\nground: {winch: [-900, 1000]}\n"
    file.write_text(text, encoding="utf-8")
    assert "warning[pulley]" not in run("check", file).err
    file.write_text(text + "ropes: {cable2: {pulleys: {A1: {side: left}}}}\n", encoding="utf-8")
    done = run("check", file)
    assert done.code == 0
    assert "warning[pulley]: rope `cable2` goes round the pulley at `A1` by 327 deg" in done.err
    assert "help: if it only touches it, write `side: right`" in done.err


@pytest.mark.parametrize("name", ["pulley", "tackle", "swivel", "wound"])
def test_derivatives_where_zero_is_the_reference_configuration(name: str, folder: Path) -> None:
    """What is wound at reading 0 depends on anchors and radii of pulleys too."""
    (folder / "wound.yaml").write_text(WOUND)
    built = made(folder / f"{name}.yaml")
    text = f"extends: {folder / name}.yaml\n"
    shift = -0.1 if name != "swivel" else 0.01
    found = jacobian_check(text, built.reference_readings + shift * np.array([[1.0] * len(built.actuators)]))
    assert found.deviation < 1e-6, found.worst
    unseen = {"swivel": ("R", "q4")}  # in force control the drum is read, not followed
    assert set(found.null) <= set(unseen.get(name, ()))


def test_a_rope_from_the_ceiling_over_a_pulley_that_swivels(folder: Path) -> None:
    """Against the closed form, in force control: the drum reads what has been wound."""
    built = made(folder / "swivel.yaml")
    aimed = np.full((20, 6), np.nan)
    aimed[:, :3] = np.random.default_rng(2).uniform([-0.15, -0.15, 0.7], [0.15, 0.15, 0.9], (20, 3))
    found = drive_positions(built, aimed)
    top, axis = np.array([0, 0, 2.0]), np.array([-1.0, 0, 0])
    wound = [swivel_length(top, axis, 0.025, place) for place in aimed[:, :3]]
    home = swivel_length(top, axis, 0.025, np.array([0, 0, 0.8]))
    assert (found.status == 0).all()
    assert np.abs(found.readings[:, 3] * 0.020 / 5 - (np.array(wound) - home)).max() < 1e-12


# --- a router on four belts -----------------------------------------------------------------------------------------
ANCHORS = np.array([[0, 2.0, 0], [3.0, 2.0, 0], [0, 0, 0], [3.0, 0, 0]])
HEIGHTS = np.array([0.1, 0.077, 0.053, 0.03])
TRUE = {"xTL": 4.0, "yTL": 2007.0, "xTR": 2995.0, "yTR": 2003.0, "xBL": 0.0, "yBL": 0.0, "xBR": 3006.0, "yBR": 0.0}


def belts(places: Array, anchors: Array, heights: Array = HEIGHTS) -> Array:
    """Distances (N, 4) of the anchors from points above the places (N, 2)."""
    ends = np.concatenate([np.repeat(places[:, None], 4, axis=1), np.tile(heights[:, None], (len(places), 1, 1))], 2)
    return np.asarray(np.linalg.norm(ends - anchors, axis=2))


def test_belts_in_planes_of_their_own(folder: Path) -> None:
    """Lengths of belts to 1e-12; in one plane they would be off by up to 5 mm."""
    built, places = made(folder / "router.yaml"), np.random.default_rng(3).uniform([0.5, 0.4], [2.5, 1.6], (50, 2))
    aimed = np.full((50, 6), np.nan)
    aimed[:, :2] = places
    found = drive_positions(built, aimed).readings * 0.020
    assert np.abs(found - belts(places, ANCHORS)).max() < 1e-12
    assert np.abs(found - belts(places, ANCHORS, 0 * HEIGHTS)).max() > 5e-3


def test_the_anchors_of_the_router_are_found_by_its_own_belts(folder: Path) -> None:
    """Readings made here by trigonometry and Hooke's law, which pull the router off nowhere: all belts at 50 N.

    The base may be shifted and turned in the sheet: the datum holds three coordinates, and is told.
    """
    places = np.array([(x, y) for x in np.linspace(0.6, 2.4, 6) for y in np.linspace(0.5, 1.5, 5)])
    anchors = ANCHORS.copy()
    anchors[:, :2] = 1e-3 * np.array(list(TRUE.values())).reshape(4, 2)
    lengths = belts(places, anchors)
    pulls = np.array([tensions(row) for row in directions(places, anchors)])
    turns = lengths / (1 + pulls / 108e3) / 0.020 / (2 * np.pi)
    lines = ["TL [rev],TR [rev],BL [rev],BR [rev]", *(",".join(f"{v:.15g}" for v in row) for row in turns)]
    table = folder / "table.csv"
    table.write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = run("calibrate", folder / "router.yaml", table, "--holdout", "none", "--json")
    assert done.code == 0, done.err
    assert "computed, not measured" in done.err, "no noise at all, and nothing says that it is simulated"
    assert "rotation about z, shift along x, shift along y" in done.err
    values = {p["name"]: p["value"] for p in done.json["parameters"]}
    assert values.pop("EA") == pytest.approx(108, abs=1e-3)
    assert values == pytest.approx({name: value for name, value in TRUE.items() if name in values}, abs=1e-6)
    assert values.keys() == TRUE.keys() - {"xBL", "yBL", "yBR"}


def directions(places: Array, anchors: Array) -> Array:
    """Unit vectors (N, 4, 2) in the sheet from the router to the anchors, times the belts' share in the sheet."""
    ways = anchors[None, :, :2] - places[:, None]
    return np.asarray(ways / belts(places, anchors)[..., None])


def tensions(ways: Array) -> Array:
    """Of the upper belts such that they balance 50 N in each of the lower ones."""
    upper = np.linalg.solve(ways[:2].T, -50.0 * ways[2:].sum(axis=0))
    return np.array([*upper, 50.0, 50.0])
