"""Overlays by `extends` and repetition by `each`."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.units.dimensions import ANGLE, FORCE
from tests.command import run
from tests.machine_texts import SPOOLS, TRIGLIDE, faults, read


def test_entries_are_repeated(tmp_path: Path) -> None:
    machine = read(tmp_path, SPOOLS)
    assert list(machine.ropes) == ["lineA", "lineB"]
    assert machine.ropes["lineB"].between == ("B", "tcp")
    assert machine.actuators["B"].column == "m_B_deg"
    assert machine.actuators["B"].kind == "spool"
    assert machine.actuators["B"].reading_dimension == ANGLE
    assert machine.nominal_values()["By"] == 1.2
    assert machine.parameters["EA"].dimension == FORCE
    assert machine.nodes["B"].at[1].names == ("By",)


def test_repetition_inside_repetition(tmp_path: Path) -> None:
    text = (
        "space: planar\nground: {o: [0, 0]}\nbodies:\n"
        '  "p{i}": {each: {i: [1, 2]}, at: [0, 0],\n'
        '    points: {"P{i}{j}": {each: {j: [1, 2], x: [5, 6]}, at: ["{x}", "{i}"]}}}\n'
        'bars: {"b{i}{j}": {each: {i: [1, 1, 2, 2], j: [1, 2, 1, 2]}, between: [o, "P{i}{j}"]}}\n'
    )
    machine = read(tmp_path, text)
    assert list(machine.bodies["p2"].points) == ["P21", "P22"]
    assert [q.value({}) for q in machine.bodies["p2"].points["P22"]] == [6, 2]


def test_repetition_is_bounded(tmp_path: Path) -> None:
    many = "[" + ", ".join(str(i) for i in range(900)) + "]"
    points = f'{{"q{{i}}x{{j}}": {{each: {{j: {many}}}, at: [0, 0]}}}}'
    text = f'space: planar\nbodies: {{"p{{i}}": {{each: {{i: {many}}}, at: [0, 0], points: {points}}}}}\n'
    assert faults(tmp_path, text)[0].endswith("each: `each` produces more than 200000 values")


def test_overlays_merge_by_name(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(TRIGLIDE)
    (tmp_path / "middle.yaml").write_text("extends: base.yaml\nparameters: {l1: {range: 0.2}}\n")
    over = (
        "extends: middle.yaml\nparameters: {l1: 301, k1: {identify: false},\n"
        " l3: null, xb3r: null, yb3r: null, k3: null}\n"
        "bodies: {c3: null}\nbars: {rod3: null}\nactuators: {q3: null}\nnodes: {tcp: {mass: 2}}\n"
    )
    machine = read(tmp_path, over, "over.yaml")
    assert machine.nominal_values()["l1"] == 0.301
    assert machine.parameters["l1"].range == 2e-4
    assert machine.parameters["k1"].identify is False
    assert machine.nominal_values()["k1"] == 5e7
    assert list(machine.bars) == ["rod1", "rod2"]
    assert machine.nodes["tcp"].at[0].value({}) == 0.36
    assert [Path(file).name for file, _ in machine.files] == ["over.yaml", "middle.yaml", "base.yaml"]
    assert Path(machine.source["parameters", "l1", "nominal"].file).name == "over.yaml"
    assert Path(machine.source["parameters", "l1", "range"].file).name == "middle.yaml"
    assert Path(machine.source["parameters", "l2"].file).name == "base.yaml"
    assert machine.extends == "middle.yaml"


def test_overlays_name_the_file_a_fault_is_in(tmp_path: Path) -> None:
    (tmp_path / "base.yaml").write_text(TRIGLIDE)
    with pytest.raises(BadInput) as caught:
        read(tmp_path, "extends: base.yaml\nactuators: {q3: null}\nbars: {rod3: null}\n", "over.yaml")
    assert {Path(f.where.file).name for f in caught.value.faults if f.where} == {"base.yaml"}
    assert "parameter `l3` is not used" in caught.value.text()


MARKED = """
space: planar
ranges: {length: 1}
parameters: {l1: 180, l2: 180}
ground: {o: [0, 0], mark: [0, 500]}
guides: {rail: {at: [0, 0], along: x}}
bodies: {c1: {guide: rail, at: 0}, c2: {guide: rail, at: 300}}
nodes: {n: {at: [150, 100]}}
bars: {b1: {between: [c1, n], length: l1}, b2: {between: [c2, n], length: l2}}
actuators: {q1: {moves: c1}, q2: {moves: c2}}
sensors:
  t: {at: n, reads: [x, y], sigma: 10 um, frame: machine}
  tape: {kind: distance, at: n, to: mark, sigma: 0.1}
"""


def test_an_overlay_may_leave_a_mark_to_which_nothing_refers(tmp_path: Path) -> None:
    """A sensor is removed; the ground point that it aimed at stays and changes no result: `check` tells it."""
    base = tmp_path / "base.yaml"
    base.write_text(MARKED, encoding="utf-8")
    overlay = tmp_path / "m.yaml"
    overlay.write_text("extends: base.yaml\nsensors: {tape: null}\n", encoding="utf-8")
    checked = run("check", overlay)
    assert checked.code == 0 and "warning[unused-name]: ground point `mark` is not used" in checked.err
    done = run("simulate", overlay, "--grid", "x=140:160:3,y=95:105:3")
    assert done.code == 0 and "not used" not in done.err


def test_a_parameter_file_is_no_machine(tmp_path: Path) -> None:
    """One fault, not one for each of its keys; in a file with `space` that key alone is unknown."""
    file = tmp_path / "p.yaml"
    file.write_text("fingerprint: {of: m.yaml}\nstatus: converged\nparameters:\n  l1: {value: 300 mm, std: 1 um}\n")
    done = run("check", file)
    assert done.code == 1 and done.err.count("error[") == 1
    assert ":1:1: error[missing-key]: this is a parameter file, no machine" in done.err
    assert "name the machine file first, and this one by `-p`" in done.err
    file.write_text("fingerprint: {of: m.yaml}\nspace: planar\n")
    assert "no machine" not in run("check", file).err
