"""Values that `each` pastes: whole ones stay what they are, an expression takes them as one value, a name as text."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.loading.load_machine import load_machine
from tests.machine_texts import faults, read
from tests.support import MACHINES


def x_of(folder: Path, text: str, value: str) -> float:
    """The first coordinate of a ground point into which `value` is pasted, m."""
    machine = read(
        folder,
        "units: {length: mm}\nspace: planar\nranges: {length: 1}\nparameters: {a: 10, b: 4}\n"
        f'ground: {{"p{{i}}": {{each: {{i: [1], v: [{value}]}}, at: ["{text}", "a+b"]}}}}\n'
        "nodes: {n: [0, 0]}\nbars: {bar: {between: [p1, n]}}\n",
    )
    return machine.ground["p1"][0].number(machine.nominal_values())


@pytest.mark.parametrize(
    ("text", "value", "expected"),
    [
        ("hypot({v}*3, {v}*4)", "-2", 10.0),
        ("{v}", "-235", -235.0),
        ("{v} mm", "-235", -235.0),
        ("{v}mm", "-2", -2.0),
        ("{v}e1", "-2", -20.0),
        ("({v})**2*a/100", "-235", 5522.5),
        ("{v}**2*a/100", "-235", 5522.5),
        ("2-{v}", "-2", 4.0),
        ("-{v}", "-2", 2.0),
        ("-{v}", "2", -2.0),
        ("2*{v}", "a+b", 28.0),
        ("{v}", "a+b", 14.0),
        ("a/{v}", "2*2", 2.5),
        ("-{v}", "a-b", -6.0),
        ("2*{v}", "a", 20.0),
        ("{v}a", "'-'", -10.0),
        ("{v}a", "''", 10.0),
        ("b {v} a", "'-'", -6.0),
        ("b {v} a", "+ 2*", 24.0),
        ("1{v}", "2", 12.0),
        ("a*{v}**2", "1e1", 1000.0),
    ],
)
def test_a_value_in_an_expression_is_one_value(tmp_path: Path, text: str, value: str, expected: float) -> None:
    assert x_of(tmp_path, text, value) == pytest.approx(expected / 1000, rel=1e-14)


@pytest.mark.parametrize(("inner", "value"), [("{d} - 1", -4), ("{d}**2 - 1", 8)])
def test_a_value_of_an_inner_each_made_of_one_of_the_outer(tmp_path: Path, inner: str, value: float) -> None:
    machine = read(
        tmp_path,
        "units: {length: mm}\nspace: planar\nbodies:\n"
        '  "b{i}": {each: {i: [1], d: [-3]}, at: [0, 0],\n'
        f'    points: {{"P{{i}}{{j}}": {{each: {{j: [1], e: ["{inner}"]}}, at: ["2*{{e}}", "{{e}}"]}}}}}}\n',
    )
    place = [q.number({}) for q in machine.bodies["b1"].points["P11"]]
    assert place == pytest.approx([2e-3 * value, 1e-3 * value])


def test_names_columns_notes_and_units_take_the_text(tmp_path: Path) -> None:
    machine = read(
        tmp_path,
        "units: {length: mm, angle: deg}\nspace: planar\nranges: {length: 1}\n"
        'parameters: {"l{i}": {each: {i: [1], d: [-5], u: [um]}, nominal: "{d} {u}", note: "off by {d}, a {i}-th"}}\n'
        "guides: {rail: {along: x}}\n"
        'bodies: {"c{i}": {each: {i: [1], d: [-5]}, guide: rail, at: "{d}", points: {"P{i}": ["l{i}", 2]}}}\n'
        'actuators: {"q{i}": {each: {i: [1], d: [-5], axis: [x]}, moves: "c{i}", column: "motor_{d}_deg"}}\n'
        'sensors: {"s{i}": {each: {i: [1], c: [x]}, at: "P{i}", reads: ["{c}"], sigma: 1, frame: machine}}\n',
    )
    assert machine.parameters["l1"].note == "off by -5, a 1-th"
    assert machine.nominal_values()["l1"] == pytest.approx(-5e-6)
    assert machine.actuators["q1"].column == "motor_-5_deg"
    assert machine.bodies["c1"].at[0].number({}) == pytest.approx(-0.005)
    assert machine.bodies["c1"].points["P1"][0].names == ("l1",)


def test_an_axis_may_be_pasted(tmp_path: Path) -> None:
    machine = read(
        tmp_path,
        'space: planar\nguides: {"g{i}": {each: {i: [1, 2], c: [x, y]}, along: "-{c}"}}\n'
        'bodies: {"c{i}": {each: {i: [1, 2]}, guide: "g{i}", at: 0}}\n',
    )
    assert [machine.guides[g].along for g in ("g1", "g2")] == ["-x", "-y"]


def test_a_negative_number_in_the_middle_of_a_name_is_refused(tmp_path: Path) -> None:
    """`l{i}` with i = -1 was l - 1."""
    text = (
        "space: planar\nranges: {length: 1}\nparameters: {l: 1}\nnodes: {n: [0, 0]}\nbars: {b: {between: [p1, n]}}\n"
        'ground: {"p{j}": {each: {j: [1], i: [-1]}, at: ["l{i}", 0]}}\n'
    )
    assert faults(tmp_path, text)[0].endswith("expression: unknown function `l`")


def test_the_fault_shows_the_expression_that_was_read(tmp_path: Path) -> None:
    text = (
        "space: planar\nranges: {length: 1}\nparameters: {l: 1}\nnodes: {n: [0, 0]}\nbars: {b: {between: [p1, n]}}\n"
        'ground: {"p{j}": {each: {j: [1], d: [-2]}, at: ["sqrt({d}*l)", 0]}}\n'
    )
    assert any("`sqrt((-2)*l)`" in fault for fault in faults(tmp_path, text))


def test_one_warning_of_one_line_names_its_members(tmp_path: Path) -> None:
    text = (
        f"extends: {MACHINES}/scissors.yaml\n"
        'effects: {"sag@{i}.x": {each: {i: [left, right]}}}\n'
        'actuators: {"q{i}": {each: {i: [1, 2, 3, 4]}, limits: [1 m, 2 m]}}\n'
    )
    read(tmp_path, text)
    warnings = load_machine(str(tmp_path / "m.yaml")).warnings
    assert [w.what for w in warnings if w.code == "no-gravity"] == [
        "`sag@left.x` does nothing: no gravity acts (also `sag@right.x`)"
    ]
    readings = [w.what for w in warnings if w.code == "limits"]  # what differs in more than its name stays apart
    assert [(w.partition(" in the")[0], w.rpartition(") ")[2]) for w in readings] == [
        ("`q1` reads 911.056 mm", "(also `q4`)"),
        ("`q2` reads -911.056 mm", "(also `q3`)"),
    ]


def test_one_fault_of_one_line_names_its_members(tmp_path: Path) -> None:
    text = f'extends: {MACHINES}/scissors.yaml\neffects: {{"self_weight@rod{{i}}": {{each: {{i: [1, 2, 3]}}}}}}\n'
    read(tmp_path, text)
    with pytest.raises(BadInput) as caught:
        load_machine(str(tmp_path / "m.yaml"))
    assert [f.what for f in caught.value.faults] == ["`self_weight` cannot be placed at `rod1` (also `rod2`, `rod3`)"]
