"""Joints and guides as `draw` shows them: symbols where they are, axes along which they turn, all as the file says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.loading.poses import reference_poses
from pkmcal_cli.pictures.machine_picture import machine_picture
from pkmcal_cli.pictures.machine_shape import machine_shape
from pkmcal_cli.pictures.shapes import MachineShape
from pkmcal_cli.pictures.text_machine import text_machine
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.prediction import Rows
from tests.command import MACHINES, run
from tests.drawn import collisions, figure_of, lines

PAGES = {
    "isometric": np.array([[1, 1, 0], [-1, 1, 2]]) / np.sqrt([[2], [6]]),
    "from above (xy)": np.eye(3)[[0, 1]],
    "from the front (xz)": np.eye(3)[[0, 2]],
    "from the right (yz)": np.eye(3)[[1, 2]],
}
"""Right and up of each view in base axes: seen from (1, -1, 1), from +z, -y and +x."""
ARM = """
units: {length: mm, angle: deg, force: N}
space: spatial
parameters: {ex: {nominal: 0, range: 0.1}, z0: {nominal: 0, range: 1}, w: {nominal: 0, range: 1}}
ground: {O: [100, 200, 300]}
bodies:
  arm: {at: [100, 200, 300], points: {elbow: [400, 0, 0]}}
  hand: {at: [500, 200, 300], points: {tip: [0, 0, 150]}}
joints:
  shoulder: {between: [O, arm], type: revolute, axis: [ex, 0.5, 1]}
  wrist: {between: [elbow, hand], type: revolute, axis: [2, -1, 3]}
actuators: {q: {turns: arm, zero: z0}, p: {turns: hand, zero: w}}
sensors: {s: {kind: tcp, at: tip, reads: [x, y, z], sigma: 1 um, frame: machine}}
"""
SLIDER = """
units: {length: mm, angle: deg, force: N}
space: spatial
parameters: {h: {nominal: 0, range: 1}}
frames: {f: {at: [50, 0, 0], turn: [0, 0, 90]}}
guides: {rail: {frame: f, along: [-2, 0, 1]}}
bodies: {c: {guide: rail, at: 100, points: {P: [0, 0, 40]}}}
actuators: {q: {moves: c, zero: h}}
sensors: {s: {kind: tcp, at: P, reads: [x, y, z], sigma: 1 um, frame: machine}}
"""
EYE = """
units: {length: mm, angle: deg, force: N}
space: spatial
parameters: {z1: {nominal: 0, range: 1}}
ground: {O1: [0, 0, 0], O2: [0, 0, 0], O3: [0, 0, 0]}
bodies:
  "b{i}": {each: {i: [1, 2, 3, 4, 5, 6]}, at: [0, 0, 0]}
  platform: {at: [0, 0, 0]}
joints:
  a1: {between: [O1, b1], type: revolute, axis: x}
  a2: {between: [O2, b2], type: revolute, axis: y}
  a3: {between: [O3, b3], type: revolute, axis: z}
  e1: {between: [b1, b4], type: revolute, axis: z}
  e2: {between: [b2, b5], type: revolute, axis: x}
  e3: {between: [b3, b6], type: revolute, axis: y}
  t1: {between: [b4, platform], type: revolute, axis: y}
  t2: {between: [b5, platform], type: revolute, axis: z, stiffness: {radial: 1 N/um, rx: 1 kNm/rad, ry: 1 kNm/rad}}
  t3: {between: [b6, platform], type: revolute, axis: x, stiffness: {radial: 1 N/um, rx: 1 kNm/rad, ry: 1 kNm/rad}}
actuators: {m1: {turns: b1, zero: z1}, m2: {turns: b2}, m3: {turns: b3}}
sensors: {s: {kind: tcp, at: platform, reads: [rx, ry, rz], sigma: 0.01 deg, frame: machine}}
"""
"""A spherical 3-RRR: all axes through one point."""


def shape_of(text: str, folder: Path, readings: tuple[float, ...] | None = None, **off: float) -> MachineShape:
    file = folder / "m.yaml"
    file.write_text(text, encoding="utf-8")
    loaded = load_machine(str(file))
    values = loaded.model.nominal.copy()
    for name, by in off.items():
        values[loaded.model.names.index(name)] += by
    rows = reference_poses(loaded.model).rows if readings is None else Rows.at(np.array([readings]))
    shape = machine_shape(loaded, values, rows, 0)
    assert isinstance(shape, MachineShape)
    return shape


def views(figure: Figure) -> list[tuple[str, np.ndarray]]:  # type: ignore[type-arg]
    return [(name, PAGES[name]) for name in (ax.get_title() for ax in figure.axes)]


def on_axis(drawn: np.ndarray, way: np.ndarray, through: np.ndarray) -> bool:  # type: ignore[type-arg]
    """Whether a line drawn on a page runs along `way`, towards its positive end, and through a place, between ends."""
    start, end = drawn
    unit = way / np.linalg.norm(way)
    parts = (end - through, through - start)
    return all(np.linalg.norm(p - (p @ unit) * unit) < 1e-6 and p @ unit > 0 for p in parts)


def about(axis: tuple[float, float, float], angle: float) -> np.ndarray:  # type: ignore[type-arg]
    """Rotation by Rodrigues' formula."""
    u = np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)


@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_axes_are_drawn_as_declared_and_turn_with_their_part(turned: float, tmp_path: Path) -> None:
    """The shoulder's axis stays; the wrist's, (2, -1, 3) as drawn, turns about it with the arm; all in mm."""
    shape = shape_of(ARM, tmp_path, (turned, 0.0))
    shoulder = np.array([0.0, 0.5, 1.0])
    turn = about((0.0, 0.5, 1.0), turned)
    origin = np.array([100.0, 200.0, 300.0])
    expected = {"shoulder": (shoulder, origin), "wrist": (turn @ [2, -1, 3], origin + turn @ [400, 0, 0])}
    with figure_of(machine_picture(shape, titles("m", "", []))) as (figure, _):
        for name, (way, at) in expected.items():
            drawn = lines(figure, f"axis-{name}")
            pages = [page for _, page in views(figure)]
            assert len(drawn) == len(pages) == 4
            assert all(on_axis(line, page @ way, page @ at) for line, page in zip(drawn, pages, strict=True))
            sizes = [np.linalg.norm(np.diff(line, axis=0)) for line in drawn]
            true = [np.linalg.norm(page @ way) / np.linalg.norm(way) for page in pages]
            assert np.ptp(np.array(sizes) / true) < 1e-6 * max(sizes)


def test_an_axis_that_parameters_tilt_is_drawn_tilted(tmp_path: Path) -> None:
    """Shoulder (ex, 0.5, 1) at ex = 0.1: exact at true scale; at 3 times, the change of its unit vector 3 times."""
    shape = shape_of(ARM, tmp_path, ex=0.1)
    nominal, tilted = (np.array([x, 0.5, 1.0]) / np.hypot(x, np.sqrt(1.25)) for x in (0.0, 0.1))
    for scale in (1.0, 3.0):
        with figure_of(machine_picture(shape, titles("m", "", []), scale=scale)) as (figure, _):
            way, at = nominal + scale * (tilted - nominal), np.array([100.0, 200.0, 300.0])
            for line, (_, page) in zip(lines(figure, "axis-shoulder"), views(figure), strict=True):
                assert on_axis(line, page @ way, page @ at)


def test_marks_are_where_joints_are(tmp_path: Path) -> None:
    """The drive's mark is on the shoulder that it turns, not elsewhere on the arm, and the base below it."""
    shape = shape_of(ARM.replace("p: {turns: hand, zero: w}", "p: {turns: wrist, zero: w}"), tmp_path)
    with figure_of(machine_picture(shape, titles("m", "", []))) as (figure, _):
        for name, at in (("drive-q", [100, 200, 300]), ("drive-p", [500, 200, 300]), ("base", [100, 200, 300])):
            for line, (_, page) in zip(lines(figure, name), views(figure), strict=True):
                assert line == pytest.approx(np.atleast_2d(page @ np.array(at)))


def test_a_guide_points_where_travel_grows(tmp_path: Path) -> None:
    """Along (-2, 0, 1) in a frame turned by 90 deg about z: (0, -2, 1) in base axes."""
    shape = shape_of(SLIDER, tmp_path)
    with figure_of(machine_picture(shape, titles("m", "", []))) as (figure, _):
        drawn, pages = lines(figure, "travel-rail"), [page for _, page in views(figure)]
        ways = [page @ np.array([0.0, -2.0, 1.0]) for page in pages]
    assert len(drawn) == 4
    for line, way in zip(drawn, ways, strict=True):
        arrow = line[1] - line[0]
        assert arrow @ way == pytest.approx(np.linalg.norm(arrow) * np.linalg.norm(way), rel=1e-9)


def test_a_beam_that_is_a_guide_points_to_its_second_end() -> None:
    """The gantry's cross beam, from L to R: its carriage travels towards R."""
    loaded = load_machine(str(MACHINES / "gantry.yaml"))
    shape = machine_shape(loaded, loaded.model.nominal, reference_poses(loaded.model).rows, 0)
    assert isinstance(shape, MachineShape)
    course, places = shape.reference.guides["cross"], shape.reference.places
    assert course[0] == pytest.approx(places["L"]) and course[-1] == pytest.approx(places["R"])


def test_ends_of_beams_show_both_axes_of_a_universal_joint(tmp_path: Path) -> None:
    text = (MACHINES / "hexapod7.yaml").read_text(encoding="utf-8")
    axes = "{joint: universal, axes: [[1, 1, 0], [-1, 1, 0]]}"
    shape = shape_of(text.replace("ends: [universal, fixed]", f"ends: [{axes}, fixed]"), tmp_path)
    with figure_of(machine_picture(shape, titles("m", "", []), scale=1.0)) as (figure, _):
        drawn = lines(figure, "axis-lower1.i")[2:4]  # isometric two, then from above
    ways = [(line[1] - line[0]) / np.linalg.norm(line[1] - line[0]) for line in drawn]
    assert ways[0] == pytest.approx(np.array([1, 1]) / np.sqrt(2), abs=1e-6)
    assert np.abs(ways[1] @ [-1, 1]) / np.sqrt(2) == pytest.approx(1, abs=1e-6)


def test_joints_in_one_point_are_drawn_apart_on_their_axes(tmp_path: Path) -> None:
    """Each symbol lies on its axis, none on another; links lie between those of their joints; no scale is shown."""
    shape = shape_of(EYE, tmp_path)
    names = ("a1", "a2", "a3", "e1", "e2", "e3", "t1", "t2", "t3")
    declared = dict(zip(names, np.eye(3)[[0, 1, 2, 2, 0, 1, 1, 2, 0]], strict=True))
    at = {name: shape.symbol(name, shape.actual) for name in declared}
    for name, axis in declared.items():
        assert np.linalg.norm(np.cross(at[name], axis)) < 1e-12 and at[name] @ axis > 0
    least = min(np.linalg.norm(at[a] - at[b]) for a in at for b in at if a < b)
    assert least > 0.1 * max(np.linalg.norm(place) for place in at.values())
    for body, joints in (("b1", names[0:4:3]), ("b5", names[4:8:3]), ("platform", names[6:])):
        outline = shape.outline(body, shape.actual)
        assert all(min(np.linalg.norm(outline - at[j], axis=1)) < 1e-12 for j in joints)
    picture = machine_picture(shape, titles("m", "", []))
    assert collisions(picture) == []
    with figure_of(picture) as (figure, texts):
        assert all(any(t.text == name for t in texts) for name in declared)
        assert all(len(ax.get_xticks()) == 0 for ax in figure.axes)
        spread = np.ptp(np.vstack(lines(figure, "axis-t1") + lines(figure, "axis-a3")), axis=0)
        assert (spread > 0.3 * np.diff(figure.axes[0].get_xlim())).any()
    rows = text_machine(shape, 1.0)
    assert len(rows) > 10 and sum(line.count("+") for line in rows) > 15


def test_a_machine_that_only_turns_is_displaced_too(tmp_path: Path) -> None:
    """Crank 1 turned by 0.2 deg about x: the axis of its elbow, z, turns by 0.2 deg, though no point moves."""
    shape = shape_of(EYE, tmp_path, z1=np.deg2rad(0.2))
    assert shape.largest[1] == 0.0 and shape.moved
    reference, actual = (s.joints["e1"].axes[0] for s in (shape.reference, shape.actual))
    assert np.arccos(reference @ actual) == pytest.approx(np.deg2rad(0.2), rel=1e-6)
    assert shape.most_turned[1] == pytest.approx(np.deg2rad(0.2), rel=1e-6)
    (tmp_path / "p.yaml").write_text("parameters: {z1: {value: 0.2, unit: deg}}\n", encoding="utf-8")
    done = run("draw", tmp_path / "m.yaml", "-p", tmp_path / "p.yaml", "-o", tmp_path / "m.svg")
    assert "largest turn: 0.2 deg" in done.err and "nothing is displaced" not in done.err
