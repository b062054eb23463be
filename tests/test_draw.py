"""`draw`: parts are where kinematics puts them, displacements as large as is said, and no text lies on another."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine
from pkmcal_cli.loading.poses import reference_poses
from pkmcal_cli.pictures.machine_picture import default_scale, machine_picture
from pkmcal_cli.pictures.machine_shape import machine_shape
from pkmcal_cli.pictures.shapes import MachineShape
from pkmcal_cli.pictures.text_machine import text_machine
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Rows
from tests.command import MACHINES, SCISSORS, TRIGLIDE, run
from tests.drawn import collisions, figure_of, lines
from tests.in_ci import in_ci
from tests.odd_machines import MACHINES as ODD
from tests.pages import all_files, write

SHIPPED = sorted(p.stem for p in MACHINES.glob("*.yaml") if "provenance" not in p.name)


@cache
def loaded(file: str) -> LoadedMachine:
    return load_machine(file)


def strained(machine: LoadedMachine, seed: int = 1) -> MachineShape | str:
    """The reference configuration with parameters anywhere in their ranges."""
    model = machine.model
    off = np.random.default_rng(seed).uniform(-1, 1, len(model.nominal))
    values = model.nominal + np.nan_to_num(model.ranges, posinf=0.0) * off
    return machine_shape(machine, values, reference_poses(model).rows, 0)


def shape_of(file: str, **offsets: float) -> MachineShape:
    """The reference configuration with some parameters off nominal, SI."""
    model = loaded(file).model
    values = model.nominal.copy()
    for name, off in offsets.items():
        values[model.names.index(name)] += off
    shape = machine_shape(loaded(file), values, reference_poses(model).rows, 0)
    assert isinstance(shape, MachineShape)
    return shape


# --- where things are ----------------------------------------------------------------------
def test_the_triglide_is_where_its_closed_form_puts_it() -> None:
    """Carriers at (q, 0), joints above them; the tool where circles of the rods about B1 and B2 meet."""
    shape = shape_of(TRIGLIDE)
    q1, q2, q3 = shape.readings.values()
    at = shape.actual.places
    assert at["B1"] == pytest.approx([q1, 0.1, 0]) and at["B2"] == pytest.approx([q2, 0.1, 0])
    assert at["B3"] == pytest.approx([q3, 0.15, 0])
    half = (q2 - q1) / 2
    assert at["tcp"] == pytest.approx([q1 + half, 0.1 + np.sqrt(0.09 - half**2), 0], abs=1e-9)
    for rod, length in (("rod1", 0.3), ("rod2", 0.3), ("rod3", 0.6)):
        a, b = shape.actual.members[rod]
        assert np.linalg.norm(b - a) == pytest.approx(length, abs=1e-9)


def test_without_its_redundant_leg_a_longer_rod_moves_the_tool_as_geometry_says() -> None:
    """Rod 1 longer by 0.1 mm: the two circles meet elsewhere; what is believed stays, and nothing is strained."""
    file = str(MACHINES / "triglide-nonredundant.yaml")
    shape = shape_of(file, l1=1e-4)
    q1, q2 = shape.readings.values()
    apart, r1, r2 = q2 - q1, 0.3 + 1e-4, 0.3
    along = (r1**2 - r2**2 + apart**2) / (2 * apart)
    assert shape.actual.places["tcp"] == pytest.approx([q1 + along, 0.1 + np.sqrt(r1**2 - along**2), 0], abs=1e-9)
    believed = shape.reference.places["tcp"]
    assert believed == pytest.approx([q1 + apart / 2, 0.1 + np.sqrt(0.09 - apart**2 / 4), 0], abs=1e-9)
    assert shape.displacement("tcp") == pytest.approx(shape.actual.places["tcp"] - believed)
    assert all(abs(t) < 1e-3 for t in shape.tensions.values())


def test_forces_of_the_scissors_are_in_balance() -> None:
    """Nothing but its five rods holds the platform: their forces and moments add up to nothing."""
    shape = shape_of(SCISSORS, l3=1e-4, xa2=-5e-5)
    force, moment = np.zeros(3), np.zeros(3)
    for name, tension in shape.tensions.items():
        a, b = shape.actual.members[name]
        ends = loaded(SCISSORS).machine.bars[name].between
        inner, outer = (a, b) if ends[0].startswith("A") else (b, a)
        pull = tension * (outer - inner) / np.linalg.norm(outer - inner)
        force, moment = force + pull, moment + np.cross(inner - shape.actual.places["platform"], pull)
    largest = max(abs(t) for t in shape.tensions.values())
    assert largest > 100 and np.abs(force).max() < 1e-6 * largest and np.abs(moment).max() < 1e-6 * largest
    drives = dict(shape.forces)
    assert sum(drives.values()) == pytest.approx(0, abs=1e-6 * largest)  # both guides are vertical: nothing else is


def test_a_beam_is_drawn_as_it_bends() -> None:
    """The gantry's cross beam: the curve passes its ends and its carriage, and is not straight when strained."""
    shape = strained(loaded(str(MACHINES / "gantry.yaml")))
    assert isinstance(shape, MachineShape)
    course, places = shape.actual.members["beam"], shape.actual.places
    assert course[0] == pytest.approx(places["L"], abs=1e-12) and course[-1] == pytest.approx(places["R"], abs=1e-12)
    chord = (course[-1] - course[0]) / np.linalg.norm(course[-1] - course[0])
    sag = np.linalg.norm(np.cross(course - course[0], chord), axis=1).max()
    assert 1e-6 < sag < 1e-3


@pytest.mark.parametrize("ratio", [1.0, -2.0])
def test_a_guide_is_drawn_over_the_limits_of_its_drive(ratio: float, tmp_path: Path) -> None:
    """Rails of the gantry along y, by the limits in its file: 1.8 m of reading, whichever way and however geared."""
    file = tmp_path / "m.yaml"
    drive = f"{{ratio: {ratio}, limits: [-700, 200]}}"
    change = "" if ratio == 1.0 else f"actuators: {{Y2: {drive}}}\n"
    file.write_text(f"extends: {MACHINES / 'gantry.yaml'}\n{change}", encoding="utf-8")
    shape = strained(loaded(str(file)))
    assert isinstance(shape, MachineShape)
    low, high = (0.0, 1.8) if ratio == 1.0 else (-0.4, 1.4)  # m: -2 * 200 and -2 * -700 mm
    ends = np.sort(shape.reference.guides["rail2"][:, 1])
    assert ends[0] == pytest.approx(low, abs=1e-9) and ends[1] == pytest.approx(high, abs=1e-9)


def test_the_legend_tells_every_mark() -> None:
    """Of the shipped gantry: bars of guides, welded ends of the beam; nothing that is not drawn."""
    shape = strained(loaded(str(MACHINES / "gantry.yaml")))
    assert isinstance(shape, MachineShape)
    with figure_of(machine_picture(shape, titles("gantry", "", []))) as (figure, _):
        entries = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"guide, arrow: travel grows", "fixed end or joint", "drive"} <= entries and not {"base", "node"} & entries


@pytest.mark.slow
def test_a_telescope_is_drawn_in_one() -> None:
    """From the base to the platform, across the drive: lower beam, the way it has slid, upper beam."""
    shape = shape_of(str(MACHINES / "hexapod7.yaml"))
    with figure_of(machine_picture(shape, titles("m.yaml", "", []), scale=1.0)) as (figure, _):
        slid = lines(figure, "joint")
    places = shape.actual.places
    from_above = [1e3 * np.array([places[f"m{i}"][:2], places[f"n{i}"][:2]]) for i in range(1, 8)]
    for ends in from_above:
        assert any(np.allclose(ends, drawn, atol=1e-3) for drawn in slid)


def test_the_picture_shows_displacements_as_large_as_it_says() -> None:
    shape = shape_of(TRIGLIDE, l3=1e-4)
    with figure_of(machine_picture(shape, titles("m.yaml", "", []), scale=200.0)) as (figure, texts):
        for name, believed in shape.reference.members.items():
            shown = believed + 200 * (shape.actual.members[name] - believed)
            dashed, solid = lines(figure, f"member-{name}")
            assert dashed == pytest.approx(1e3 * believed[:, :2]) and solid == pytest.approx(1e3 * shown[:, :2])
        assert any("displacements 200 x" in t.text for t in texts)
        (ax,) = figure.axes
        left, right = ax.get_xlim()
        low, high = ax.get_ylim()
        box = ax.get_window_extent()
        assert (right - left) / box.width == pytest.approx((high - low) / box.height, rel=1e-6)  # circles are round


def test_the_usual_scale_is_round_and_shows_something() -> None:
    for off in (1e-7, 1e-5, 1e-3):
        shape = shape_of(TRIGLIDE, l3=off)
        scale = default_scale(shape)
        assert f"{scale:.6e}"[0] in "125" and 0.02 < scale * shape.largest[1] / shape.length < 0.09
    assert default_scale(shape_of(TRIGLIDE)) == 1.0 and shape_of(TRIGLIDE).largest[1] == 0.0


def test_effects_see_the_whole_table() -> None:
    """A row is drawn as it is among the others: backlash follows the direction of the last motion."""
    machine = loaded(TRIGLIDE)
    readings = np.tile(machine.model.reference_readings, (3, 1))
    readings[:, 0] += [0.0, 0.01, 0.0]
    shapes = [machine_shape(machine, machine.model.nominal, Rows.at(readings), k) for k in (0, 2)]
    assert all(isinstance(s, MachineShape) for s in shapes)
    first, last = (s.actual.places["tcp"] for s in shapes if isinstance(s, MachineShape))
    assert first == pytest.approx(last, abs=1e-9)


# --- every machine -------------------------------------------------------------------------
@pytest.mark.parametrize("name", in_ci(["triglide", "belt-router", "delta-printer", "gantry"], SHIPPED))
def test_no_text_lies_on_another(name: str) -> None:
    machine = loaded(str(MACHINES / f"{name}.yaml"))
    shape = strained(machine)
    assert isinstance(shape, MachineShape), shape
    named = titles(f"{name}.yaml", "reference configuration", [])
    picture = machine_picture(shape, named, forces=not machine.compiled.shared_by)
    assert collisions(picture) == []
    with figure_of(picture) as (figure, texts):
        told = " ".join(t.text for t in texts)
        assert len(figure.axes) == (1 if shape.planar else 4)
        assert all(drive in told for drive in shape.readings)
    rows = text_machine(shape, default_scale(shape))
    assert max(len(line) for line in rows) <= 78
    assert all(any(drive in line for line in rows) for drive in shape.readings)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    (folder / "machines").symlink_to(MACHINES)
    write(folder, all_files())
    write(folder, {f"odd-{name}.yaml": text for name, text in ODD.items()})
    return folder


DRAWN = (
    "tripod-head", "folded", "hinge", "pulley", "cables", "crane", "forced", "elbows", "frame", "marks", "turntable",
    "planted", "faulty", "odd-two-sensors", "odd-ropes", "odd-no-sensors", "odd-no-actuators", "odd-one-carriage",
    "odd-nothing-moves", "odd-huge-stiffness", "odd-space", "odd-coincident", "odd-binary",
)  # fmt: skip
"""Of every kind one: in the plane and in space, with beams, joints, ropes, frames, without drives, refused."""


@pytest.mark.parametrize(
    "name",
    in_ci([f"{name}.yaml" for name in DRAWN], [*all_files(), *(f"odd-{name}.yaml" for name in ODD)]),
)
def test_machines_of_pages_and_odd_ones_are_drawn(name: str, written: Path) -> None:
    """Also such as have no drive, no sensor, only ropes; where a machine is refused, nothing is drawn."""
    try:
        machine = load_machine(str(written / name))
    except BadInput:
        return
    try:
        shape = strained(machine)
    except BadInput:  # an effect with a lag needs times
        shape = "no times"
    if isinstance(shape, str):
        shape = machine_shape(machine, machine.model.nominal, reference_poses(machine.model).rows, 0)
    if isinstance(shape, str):
        done = run("draw", written / name)
        assert done.code == 3 and "Traceback" not in done.err
        return
    assert collisions(machine_picture(shape, titles(name, "", []))) == []
    assert max((len(line) for line in text_machine(shape, default_scale(shape))), default=0) <= 78


# --- the command ---------------------------------------------------------------------------
def test_files_are_pictures_and_the_same_every_time(tmp_path: Path) -> None:
    for ending, begins in (("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")):
        one, two = tmp_path / f"one.{ending}", tmp_path / f"two.{ending}"
        for file in (one, two):
            assert run("draw", SCISSORS, MACHINES / "scissors.csv", "--row", 5, "--forces", "-o", file).code == 0
        assert one.read_bytes() == two.read_bytes() and one.read_bytes().startswith(begins)
    root = ET.fromstring((tmp_path / "one.svg").read_text(encoding="utf-8"))
    told = [t.strip() for t in root.itertext()]
    assert "scissors.yaml: line 6 (5)" in told and any(t.startswith("scissors.csv, 20") for t in told)


def test_names_are_names(tmp_path: Path) -> None:
    """No mathematics, no markup, no control characters of a file's name reach the page."""
    odd = tmp_path / "a$x_1$ & <b> \u65e5\x07.csv"
    odd.write_text((MACHINES / "scissors.csv").read_text(encoding="utf-8"), encoding="utf-8")
    done = run("draw", SCISSORS, odd, "-o", tmp_path / "m.svg")
    assert done.code == 0 and "Glyph" not in done.err
    told = " ".join(ET.fromstring((tmp_path / "m.svg").read_text(encoding="utf-8")).itertext())
    assert "a$x_1$ & <b> \u65e5\ufffd.csv" in told


def test_json_says_what_is_drawn() -> None:
    done = run("draw", TRIGLIDE, "--grid", "x=400:500:2,y=250:250:1", "--row", 2, "--json", "-q")
    found = done.json
    assert done.code == 0 and done.err == "" and found["row"] == "--grid point 2"
    at = {p["name"]: p["believed"] for p in found["places"]}
    assert at["tcp"] == pytest.approx([0.5, 0.25, 0.0], abs=1e-9)
    assert {d["name"] for d in found["drives"]} == {"q1", "q2", "q3"}
    assert {m["name"] for m in found["members"]} == {"rod1", "rod2", "rod3"}


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["--row", "3"], 2, "add POSES.csv, or --grid"),
        (["--grid", "x=400:500:2,y=250:250:1", "--row", "3"], 2, "there are 2 rows"),
        (["--grid", "x=400:500:2,y=999:999:1"], 3, "out of reach"),
        (["--scale", "0"], 2, "is no factor"),
        (["--scale", "nan"], 2, "is no factor"),
        (["-q"], 2, "-q suppresses the drawing"),
        (["-o", "m.txt"], 2, "-o: `m.txt` is no picture"),
        (["-o", "-"], 2, "-o: `-` is no picture"),
        (["-o", "/nowhere/m.svg"], 4, "the folder does not exist"),
    ],
)
def test_what_cannot_be_drawn_is_told(arguments: list[str], code: int, told: str) -> None:
    done = run("draw", TRIGLIDE, *arguments)
    assert done.code == code and told in done.err and "Traceback" not in done.err and done.out == ""


def test_a_file_is_replaced_only_by_force(tmp_path: Path) -> None:
    file = tmp_path / "m.svg"
    file.write_text("kept", encoding="utf-8")
    assert run("draw", TRIGLIDE, "-o", file).code == 4 and file.read_text(encoding="utf-8") == "kept"
    assert run("draw", TRIGLIDE, "-o", file, "--force", "-q").code == 0
    assert file.read_text(encoding="utf-8").startswith("<?xml")


def test_the_terminal_shows_the_machine() -> None:
    done = run("draw", SCISSORS)
    assert done.code == 0 and done.out == "" and max(len(line) for line in done.err.splitlines()) <= 80
    assert all(name in done.err for name in ("q1 #", "# q4", "q2 #", "# q3", "@ platform"))
