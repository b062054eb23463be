"""A hexapod of which a tracker sees three reflectors, simulated by Newton's method on its leg lengths."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array
from tests.command import Done, run

BASE = np.radians([8, 112, 128, 232, 248, 352])
TOP = np.radians([52, 68, 172, 188, 292, 308])
MARKS = np.array([[0.15, 0.0, 0.012], [-0.08, 0.12, 0.012], [-0.07, -0.13, 0.015]])
STAND = Rotation.from_rotvec([0.02, -0.03, 2.1])
MACHINE = """\
units: {length: mm, angle: deg, force: N}
space: spatial
ranges: {length: 0.1}
parameters: {"o{i}": {each: {i: [1, 2, 3, 4, 5, 6]}, nominal: 450}}
ground: {"B{i}": {each: {i: [1, 2, 3, 4, 5, 6], a: [8, 112, 128, 232, 248, 352]},
  at: ["400*cos({a}*pi/180)", "400*sin({a}*pi/180)", 0]}}
bodies:
  cell:
    at: [0, 0, 337]
    points: {"P{i}": [0, 0, 0], m1: [150, 0, 12], m2: [-80, 120, 12], m3: [-70, -130, 15]}
bars: {"leg{i}": {each: {i: [1, 2, 3, 4, 5, 6]}, between: ["B{i}", "P{i}"]}}
actuators: {"q{i}": {each: {i: [1, 2, 3, 4, 5, 6]}, drives: "leg{i}", offset: "o{i}"}}
sensors: {tracker: {at: [m1, m2, m3], reads: [x, y, z], sigma: 10 um, frame: fitted}}
"""
POINTS = ", ".join(f'P{i}: ["180*cos({a}*pi/180)", "180*sin({a}*pi/180)", 0]'
                   for i, a in enumerate((52, 68, 172, 188, 292, 308), 1))  # fmt: skip


def platform(lengths: Array) -> tuple[Rotation, Array]:
    """Orientation and place of the platform on legs of these lengths (6,), m."""
    base = 0.4 * np.stack([np.cos(BASE), np.sin(BASE), 0 * BASE], axis=1)
    top = 0.18 * np.stack([np.cos(TOP), np.sin(TOP), 0 * TOP], axis=1)

    def misfit(pose: Array) -> Array:
        joints = pose[:3] + Rotation.from_rotvec(pose[3:]).apply(top)
        return np.asarray(np.linalg.norm(joints - base, axis=1) - lengths)

    pose = fsolve(misfit, [0, 0, 0.337, 0, 0, 0], xtol=1e-12)
    return Rotation.from_rotvec(pose[3:]), pose[:3]


def read(marks: Array = MARKS) -> tuple[Array, Array]:
    """Readings of the drives (40, 6) and of the tracker (40, 9), m; true legs are off within their ranges."""
    rng = np.random.default_rng(3)
    drives = rng.uniform(-0.02, 0.02, (40, 6))
    offsets = 0.45 + 5e-5 * rng.normal(size=6)
    seen = []
    for row in drives:
        turn, place = platform(offsets + row)
        seen.append(STAND.apply(place + turn.apply(marks)) + np.array([6.0, -3.5, 1.2]))
    return drives, np.array(seen).reshape(40, 9) + 1e-5 * rng.normal(size=(40, 9))


def written(drives: Array, seen: Array, machine: str = MACHINE) -> list[str]:
    """The machine and the table."""
    Path("m.yaml").write_text(machine.replace('"P{i}": [0, 0, 0]', POINTS))
    head = ",".join([*(f"q{k} [m]" for k in range(1, 7)), *(f"m{k}.{c} [m]" for k in (1, 2, 3) for c in "xyz")])
    np.savetxt("t.csv", np.hstack([drives, seen]), fmt="%.9f", delimiter=",", header=head, comments="")
    return ["m.yaml", "t.csv"]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def swapped(seen: Array) -> Array:
    """The second reflector's x and y exchanged."""
    return seen[:, [0, 1, 2, 4, 3, 5, 6, 7, 8]]


def reversed_in_sign(seen: Array) -> Array:
    """The third reflector's z with the other sign: that was told as all z 1000 times too large."""
    return seen * np.array([1.0] * 8 + [-1.0])


def in_inches(seen: Array) -> Array:
    """The first reflector's y in inches, as if in millimetres."""
    return seen * np.array([1.0, 1 / 25.4, *[1.0] * 7])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (swapped, "`m2.x` and `m2.y` look swapped"),
        (reversed_in_sign, "`m3.z` looks reversed in sign"),
        (in_inches, "`m1.y` looks 25.4 times too small (is it in `in`, not `mm`?)"),
    ],
)
def test_a_column_of_one_reflector(change: Callable[[Array], Array], told: str) -> None:
    """Told whatever the others read, of an instrument that stands nobody knows where."""
    drives, seen = read()
    done = run("check", *written(drives, change(seen)))
    assert done.code == 1 and told in done.err, done.err


def test_a_tracker_that_is_said_to_stand_at_the_origin() -> None:
    """One rigid motion explains all nine columns; each was told another offset, sign or unit."""
    drives, seen = read()
    files = written(drives, seen, MACHINE.replace("frame: fitted", "frame: machine"))
    done = run("check", *files)
    assert done.code == 1 and done.err.count("error[") == 1, done.err
    assert "the readings of `tracker` look taken from another place, turned by 120 deg" in done.err
    done = run("calibrate", *written(drives, seen), "--json")
    assert done.code == 0 and done.json["status"] == "converged" and 0.8 < done.json["chi2_per_dof"] < 1.25


@pytest.mark.parametrize("frame", ["fitted", "machine"])
def test_a_reflector_that_is_elsewhere_on_the_body(frame: str) -> None:
    """Its x has another sign in the machine file: 283 mm and 251 mm from the others, where the file has 139 and 292."""
    drives, seen = read()
    if frame == "machine":
        seen = STAND.inv().apply(seen.reshape(-1, 3) - np.array([6.0, -3.5, 1.2])).reshape(40, 9)
    text = MACHINE.replace("m2: [-80, 120, 12]", "m2: [80, 120, 12]").replace("frame: fitted", f"frame: {frame}")
    files = written(drives, seen, text)
    apart, drawn = (np.linalg.norm(1e3 * MARKS[[0, 2]] - mark, axis=1) for mark in ([-80, 120, 12], [80, 120, 12]))
    told = f"{apart[0]:.4g} mm from `m1`, {apart[1]:.4g} mm from `m3` instead of {drawn[0]:.4g} mm, {drawn[1]:.4g} mm"
    done = run("check", *files)
    assert done.code == 1 and done.err.count("error[") == 1, done.err
    assert f"`m2` looks read elsewhere on its body than the machine file says, {told}: residual rms" in done.err
    if frame == "fitted":
        done = run("diagnose", *files, "--json")
        assert done.json["mistakes"] and done.json["effects"] == [] and done.json["verdict"] == "measurement_fault"


def test_a_reflector_in_its_place() -> None:
    """Nothing is told of 0.2 mm, which ranges that were guessed too small may be, nor of all moved as one."""
    drives, seen = read(MARKS + np.array([[0, 0, 0], [0, 2e-4, 0], [0, 0, 0]]))
    assert "looks read elsewhere" not in run("check", *written(drives, seen)).err
    drives, seen = read(MARKS + np.array([0.02, 0, 0]))
    assert "looks read elsewhere" not in run("check", *written(drives, seen)).err


def elsewhere(*moved: tuple[int, tuple[float, float, float]]) -> Array:
    """The marks, some of them moved by millimetres."""
    out = MARKS.copy()
    for k, by in moved:
        out[k] += np.array(by) * 1e-3
    return out


def named(done: Done) -> list[str]:
    """Reflectors that are told to be elsewhere."""
    assert done.err.count("error[") == done.err.count("looks read elsewhere on its body"), done.err
    return re.findall(r"`(m\d)` looks read elsewhere on its body", done.err)


def seen_from(frame: str, marks: Array) -> list[str]:
    """Files of a campaign with marks, in a frame of the tracker or aligned to the machine."""
    drives, seen = read(marks)
    if frame == "machine":
        seen = STAND.inv().apply(seen.reshape(-1, 3) - np.array([6.0, -3.5, 1.2])).reshape(40, 9)
    return written(drives, seen, MACHINE.replace("frame: fitted", f"frame: {frame}"))


@pytest.mark.parametrize("frame", ["fitted", "machine"])
def test_reflectors_off_across_their_plane_and_two_at_once(frame: str) -> None:
    """By the radius of a ball: distances to the others change by 1 mm; a zero of one column was told, or nothing."""
    assert named(run("check", *seen_from(frame, elsewhere((1, (0, 0, 25.4)))))) == ["m2"]
    assert named(run("check", *seen_from(frame, elsewhere((0, (0, 0, 25.4)), (1, (25.4, 0, 0)))))) == ["m1", "m2"]


def test_a_diagnosis_puts_both_back() -> None:
    done = run("diagnose", *seen_from("fitted", elsewhere((0, (0, 0, 25.4)), (1, (25.4, 0, 0)))), "--json")
    assert [m[:4] for m in done.json["mistakes"]] == ["`m1`", "`m2`"] and done.json["effects"] == []
    assert 0.8 < done.json["chi2_per_dof_after"] < 1.25


@pytest.mark.parametrize("frame", ["fitted", "machine"])
def test_no_reflector_is_named_where_all_are_moved(frame: str) -> None:
    """As one, or each elsewhere."""
    for marks in (MARKS + np.array([0, 0, 0.0254]), elsewhere((0, (0, 0, 25.4)), (1, (10, 0, 0)), (2, (0, 15, 0)))):
        assert "looks read elsewhere" not in run("check", *seen_from(frame, marks)).err


def test_what_bends_the_body_or_moves_it_wrong_names_no_reflector() -> None:
    """Backlash of 0.1 mm, legs and cell that grow by 120 um/m, a leg whose zero is 3 mm off: 18 campaigns."""
    for seed in range(18):
        rng = np.random.default_rng(seed)
        drives = rng.uniform(-0.02, 0.02, (40, 6))
        legs, grown = 0.45 + 5e-5 * rng.normal(size=6) + drives, np.ones(40)
        if seed % 3 == 0:
            legs = legs + 1e-4 * np.sign(rng.normal(size=(40, 6)))
        elif seed % 3 == 1:
            grown = 1 + 1.2e-5 * np.linspace(0, 10, 40)
            legs = legs * grown[:, None]
        else:
            legs[:, 0] += 3e-3
        poses = [platform(row) for row in legs]
        seen = np.array([place + turn.apply(MARKS * k) for (turn, place), k in zip(poses, grown, strict=True)])
        seen = STAND.apply(seen.reshape(-1, 3)).reshape(40, 9) + 1e-5 * rng.normal(size=(40, 9))
        assert "looks read elsewhere" not in run("check", *written(drives, seen)).err


TABLE = """\
units: {length: mm, angle: deg, force: N}
space: spatial
ranges: {length: 0.1}
parameters: {sx: {nominal: 1, range: 0.0005}, sy: {nominal: 1, range: 0.0005}}
guides: {across: {along: x}, along: {body: saddle, along: y}}
bodies:
  saddle: {guide: across, at: 0}
  table: {guide: along, at: 0, points: {m1: [150, 0, 12], m2: [-80, 120, 12], m3: [-70, -130, 15]}}
actuators: {q1: {moves: saddle, scale: sx}, q2: {moves: table, scale: sy}}
sensors: {tracker: {at: [m1, m2, m3], reads: [x, y, z], sigma: 10 um, frame: FRAME}}
"""
AWAY = np.array([6, -3.5, 1.2])


def on_table(frame: str, marks: Array) -> Done:
    """What is said of a table that moves in a plane, with marks."""
    rng = np.random.default_rng(3)
    drives = rng.uniform(-0.5, 0.5, (40, 2))
    places = np.pad(drives * (1 + 2.5e-4 * rng.normal(size=2)), ((0, 0), (0, 1)))[:, None] + marks
    seen = STAND.apply(places.reshape(-1, 3)).reshape(places.shape) + AWAY if frame == "fitted" else places
    Path("xy.yaml").write_text(TABLE.replace("FRAME", frame))
    head = ",".join(["q1 [m]", "q2 [m]", *(f"m{k}.{c} [m]" for k in (1, 2, 3) for c in "xyz")])
    columns = np.hstack([drives, seen.reshape(40, 9) + 1e-5 * rng.normal(size=(40, 9))])
    np.savetxt("xy.csv", columns, fmt="%.9f", delimiter=",", header=head, comments="")
    return run("check", "xy.yaml", "xy.csv")


@pytest.mark.parametrize("frame", ["fitted", "machine"])
def test_a_machine_that_moves_in_a_plane(frame: str) -> None:
    """Off across the plane, where coordinates do not vary, and within it."""
    assert named(on_table(frame, MARKS)) == []
    for by in ((0, 0, 25.4), (25.4, 0, 0)):
        assert named(on_table(frame, elsewhere((1, by)))) == ["m2"]


def test_two_of_three_that_only_shift_are_named_where_the_tracker_stands_in_a_known_place() -> None:
    """Elsewhere the one that is right may be wrong, and one of the others right: nothing tells."""
    two = elsewhere((0, (0, 0, 25.4)), (1, (25.4, 0, 0)))
    assert named(on_table("machine", two)) == ["m1", "m2"] and "looks read" not in on_table("fitted", two).err
