"""Reading machines: valid files, exact messages of bad ones, overlays, repetition, warnings."""

from __future__ import annotations

import hashlib
import math
import pickle
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.language.channels import channels_of
from pkmcal_cli.language.machine import Machine, axis_vector
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.language.walk import quantities, written_values
from pkmcal_cli.units.dimensions import ANGLE, FORCE, LENGTH, STIFFNESS
from tests.machine_texts import TRIGLIDE, faults, read, warned
from tests.support import MACHINES

HERE = Path(__file__).parent
BAD = sorted(path.stem for path in (HERE / "bad").glob("*.expected") if path.with_suffix(".yaml").exists())


def bar_with(entry: str, head: str = "") -> str:
    """The smallest machine: one bar between ground and a node."""
    points = "ground: {o: [0, 0]}\nnodes: {n: [9, 0]}"
    return f"units: {{length: mm}}\nspace: planar\n{head}\n{points}\nbars: {{b: {{between: [o, n], {entry}}}}}\n"


def test_the_triglide_is_resolved() -> None:
    machine = read_machine(HERE / "data" / "triglide.yaml")
    values = machine.nominal_values()
    assert values["l3"] == 0.6
    assert values["k1"] == values["k3"] == 5e7
    assert machine.parameters["k3"].unit == "kN/mm"
    assert machine.parameters["k1"].unit == "N/mm"
    assert machine.parameters["gamma"].dimension == ANGLE
    assert machine.parameters["gamma"].range == pytest.approx(math.radians(1))
    assert machine.parameters["l1"].range == 1e-4
    assert machine.parameters["k1"].range == 1e6
    assert machine.parameters["k1"].dimension == STIFFNESS
    assert machine.frames["base"].turn[0].names == ("gamma",)
    assert machine.bodies["c1"].at[0].value(values) == 0.1
    assert machine.bars["rod1"].length is not None
    assert machine.bars["rod1"].length.value({"l1": 0.3 + 1e-20j}).imag == 1e-20
    assert machine.actuators["q3"].redundant and machine.actuators["q3"].kind == "carriage"
    assert machine.actuators["q1"].column == "q1"
    assert [(c.name, c.column) for c in channels_of(machine)] == [("x", "x"), ("y", "y")]
    assert machine.sensors["tracker"].sigma[""].constant.value({}) == 1e-5
    assert machine.warnings == ()
    assert not list(written_values(machine))


def test_defaults_depend_on_the_space(tmp_path: Path) -> None:
    machine = read_machine(HERE / "data" / "triglide.yaml")
    assert [q.value({}) for q in machine.gravity] == [0, 0]
    assert len(machine.frames["base"].at) == 2 and len(machine.bodies["c1"].turn) == 1
    text = "space: spatial\nbodies: {b: {at: [0, 0, 0], fixed: true}}\nground: {o: [0, 0, 0]}\n"
    text += "joints: {j: {between: [o, b], type: revolute, axis: -y}}\nloads: {f: {at: b, force: [0, 0, 1]}}\n"
    spatial = read(tmp_path, text)
    assert len(spatial.gravity) == len(spatial.bodies["b"].turn) == len(spatial.bodies["b"].centre) == 3
    assert spatial.bodies["b"].fixed == ("x", "y", "z", "rx", "ry", "rz")
    assert len(spatial.loads["f"].moment) == 3
    axis = spatial.joints["j"].axis
    assert axis is not None
    assert [q.value({}) for q in axis_vector(axis, 3)] == [0, -1, 0]


def test_the_source_and_the_files_are_told(tmp_path: Path) -> None:
    machine = read(tmp_path, TRIGLIDE)
    where = machine.source["bars", "rod2", "length"]
    assert TRIGLIDE.splitlines()[where.line - 1][where.column - 1 :].startswith("l2")
    assert machine.files == ((str(tmp_path / "m.yaml"), hashlib.sha256(TRIGLIDE.encode()).hexdigest()),)


def test_machines_are_frozen_and_can_be_sent(tmp_path: Path) -> None:
    machine = read(tmp_path, TRIGLIDE)
    with pytest.raises(ValueError, match="frozen"):
        machine.space = "spatial"  # type: ignore[misc]
    again: Machine = pickle.loads(pickle.dumps(machine))
    assert again.nominal_values() == machine.nominal_values()
    assert again.parameters["k1"].dimension == STIFFNESS
    pairs = zip(quantities(machine), quantities(again), strict=True)
    assert all(a == b for a, b in pairs)


@pytest.mark.parametrize("name", BAD)
def test_bad_machines_say_exactly_what_is_wrong(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(HERE / "bad")
    with pytest.raises(BadInput) as caught:
        read_machine(f"{name}.yaml")
    assert caught.value.text() + "\n" == Path(f"{name}.expected").read_text()
    assert all(fault.hint for fault in caught.value.faults)


def test_at_most_fifty_faults_are_told_and_the_rest_counted(tmp_path: Path) -> None:
    text = "space: planar\nnodes:\n" + "".join(f"  n{i}: [0, 0]\n" for i in range(80))
    with pytest.raises(BadInput) as caught:
        read(tmp_path, text)
    assert len(caught.value.faults) == 50
    assert caught.value.text().endswith("... and 30 more faults")


@pytest.mark.parametrize(
    ("entry", "head", "warning"),
    [
        ("EA: E", "materials: {}\nparameters: {E: {nominal: 3, range: 1, unit: N}}", None),
        ("length: 300 m", "", "length = 300 m: did you mean 300 mm?"),
        ("length: 300000", "", "length = 300000 mm: did you mean 300000 um?"),
        ("mass: 1200000", "", "mass = 1.2e+06 kg: did you mean 1.2e+06 g?"),
        ("length: l1", "parameters: {l1: {nominal: 300 m, range: 1}}", "l1 = 300 m: did you mean 300 mm?"),
        ("k: 5", "", None),
        ("k: 3e9", "", "k = 3e+09 N/mm: did you mean 3e+09 N/m?"),
    ],
)
def test_magnitudes_are_guessed(tmp_path: Path, entry: str, head: str, warning: str | None) -> None:
    assert warned(tmp_path, bar_with(entry, head)) == ([warning] if warning else [])


def test_the_modulus_of_steel_is_guessed(tmp_path: Path) -> None:
    text = (
        "units: {length: mm}\nspace: planar\nground: {o: [0, 0]}\nnodes: {n: [9, 0]}\n"
        "materials: {steel: {E: 210 Pa}}\nsections: {s: {square: 20}}\n"
        "beams: {b: {between: [o, n], section: s, material: steel}}\n"
    )
    (warning,) = read(tmp_path, text).warnings
    assert warning.what == "E = 210 Pa: did you mean 210 GPa?"
    assert warning.text().startswith(f"{tmp_path / 'm.yaml'}:5:24: warning[magnitude]: E = 210 Pa")


def test_pi_and_degrees_are_doubted(tmp_path: Path) -> None:
    text = "units: {length: mm, angle: deg}\nspace: planar\nbodies: {p: {at: [100*cos(30), 0], turn: pi/2}}\n"
    text += "ground: {o: [0, 0]}\nbars: {b: {between: [o, p]}}\n"
    found = warned(tmp_path, text)
    assert found == [
        "`cos(30)` is evaluated at 30 rad: function arguments are in rad",
        "`pi/2` is read in deg, the angle unit of this file",
    ]
    assert warned(tmp_path, text.replace("cos(30)", "cos(30*pi/180)").replace("pi/2", "90")) == []


@pytest.mark.parametrize(("unit", "scale"), [("deg", 180 / math.pi), ("mrad", 1000.0), ("rad", 1.0)])
def test_an_angle_that_is_added_inside_a_function_is_added_in_radians(unit: str, scale: float, tmp_path: Path) -> None:
    """By the angle-sum formula; 120*pi/180 was taken as 2.09 deg where a parameter in degrees is added."""
    text = f"units: {{length: mm, angle: {unit}}}\nspace: planar\nparameters: {{e: {{nominal: {0.01 * scale!r}, "
    text += "range: 1}}\nground: {A: [300*cos(120*pi/180 + e), 300*sin(e - pi/6)]}\n"
    text += "nodes: {n: [0, 0]}\nbars: {b: {between: [A, n]}}\n"
    machine = read(tmp_path, text)
    x, y = (q.number(machine.nominal_values()) for q in machine.ground["A"])
    assert x == pytest.approx(0.3 * (-0.5 * math.cos(0.01) - math.sqrt(0.75) * math.sin(0.01)), abs=1e-15)
    assert y == pytest.approx(0.3 * (math.sqrt(0.75) * math.sin(0.01) - 0.5 * math.cos(0.01)), abs=1e-15)
    assert not machine.warnings
    doubted = warned(tmp_path, text.replace("120*pi/180", "120"))
    assert [w for w in doubted if "rad: function" in w] == (
        [] if unit == "rad" else ["`cos(120 + e)` is evaluated at 120 + e rad: function arguments are in rad"]
    )


def test_masses_without_gravity_are_doubted(tmp_path: Path) -> None:
    text = "space: spatial\nground: {o: [0, 0, 0]}\nnodes: {n: {at: [1, 0, 0], mass: 2}}\n"
    text += "bars: {b: {between: [o, n]}}\n"
    assert warned(tmp_path, text) == ["`gravity` is missing: the given masses have no weight"]
    assert warned(tmp_path, text + "own_weight: false\n") == []
    assert warned(tmp_path, text + "gravity: [0, 0, -9.81]\n") == []


def test_what_a_sigma_is_says_nothing_without_it(tmp_path: Path) -> None:
    def q2(keys: str) -> list[str]:
        return warned(tmp_path, f"extends: {MACHINES}/scissors.yaml\nactuators: {{q2: {{{keys}}}}}\n")

    said = "`sigma_is` says nothing where the actuator has no `sigma` and the table no `sigma.q2`"
    assert q2("sigma_is: exact") == q2("sigma_is: unknown") == [said]
    assert q2("sigma_is: exact, sigma: 10 um") == []


def test_a_body_point_that_is_used_by_nothing_is_doubted(tmp_path: Path) -> None:
    text = TRIGLIDE.replace("points: {B1: [xb1r, yb1r]}", "points: {B1: [xb1r, yb1r], B9: [0, 0]}")
    assert warned(tmp_path, text) == ["point `B9` of body `c1` is not used"]


def test_a_parameter_used_as_two_things(tmp_path: Path) -> None:
    text = TRIGLIDE.replace("length: l1", "length: gamma").replace("l1: 300, ", "")
    assert faults(tmp_path, text) == ["15:38 dimension: `gamma` is an angle; expected a length"]


def test_a_range_is_needed(tmp_path: Path) -> None:
    head = "parameters: {l1: {nominal: 3, identify: false}}"
    assert faults(tmp_path, bar_with("length: l1", head)) == ["3:14 range: parameter `l1` (length) has no range"]


def test_drives_and_their_units(tmp_path: Path) -> None:
    text = TRIGLIDE.replace(
        "q1: {moves: c1}, q2: {moves: c2}",
        "q1: {moves: c1, unit: deg, scale: 5/360, limits: [-90, 90], sigma: 1 deg, stiffness: 5},"
        " q2: {moves: c2, sigma: 10 um, zero: home, control: force, force: {column: f, otherwise: 20}}",
    )
    machine = read(tmp_path, text)
    q1, q2 = machine.actuators["q1"], machine.actuators["q2"]
    assert q1.scale.number({}) * math.radians(360) == pytest.approx(0.005)
    assert q1.limits is not None and q1.limits[1].number({}) == pytest.approx(math.pi / 2)
    assert q1.reading_dimension == ANGLE and q1.travel_dimension == LENGTH
    assert q1.sigma is not None and q1.sigma.dimension == ANGLE
    assert q1.stiffness is not None and q1.stiffness.number({}) == 5000
    assert q2.zero == "home"
    assert q2.force is not None and q2.force.otherwise is not None
    assert q2.force.otherwise.dimension == FORCE
    needs = faults(tmp_path, TRIGLIDE.replace("q1: {moves: c1}", "q1: {moves: c1, unit: deg}"))
    assert needs == ["18:35 missing-key: a reading in deg needs `scale`, the travel per deg"]


@pytest.mark.parametrize("space", ["{a: 1}", "[planar]", "true", "2", "~"])
def test_a_space_that_is_none_is_told_whatever_else_there_is(tmp_path: Path, space: str) -> None:
    text = f"space: {space}\nground: {{o: [0, 0]}}\nnodes: {{n: [9, 0]}}\n"
    assert any(each.startswith("1:") for each in faults(tmp_path, text))


def test_a_fault_does_not_hide_others(tmp_path: Path) -> None:
    text = TRIGLIDE.replace("length: l1, k: k1", "lenght: l1, k: k9").replace("reads: [x, y]", "reads: [x, yy]")
    text = text.replace("guide: rail, at: 600", "guide: rial, at: six")
    assert [line.split(" ", 1)[1] for line in faults(tmp_path, text)] == [
        "unused-name: parameter `k1` is not used",
        "unknown-name: unknown guide `rial`",
        "unknown-name: unknown parameter `six`",
        "unknown-key: unknown key `lenght` in bars.rod1",
        "unknown-name: unknown parameter `k9`",
        "value: `yy` is not a channel of a sensor",
    ]


def test_reading_is_quick_and_light(tmp_path: Path) -> None:
    read(tmp_path, TRIGLIDE)
    best = min(_seconds(tmp_path) for _ in range(5))
    assert best < 0.03
    code = (
        "import sys, pkmcal_cli.language.machine_yaml, pkmcal_cli.language.json_schema;"
        "print([m for m in ('numpy', 'scipy', 'pandas', 'typer', 'rich') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=HERE.parent)
    assert done.stdout.strip() == "[]"


def _seconds(folder: Path) -> float:
    start = time.perf_counter()
    read(folder, TRIGLIDE)
    return time.perf_counter() - start


def test_a_rope_is_a_bar_with_one_stiffness(tmp_path: Path) -> None:
    """What is forbidden to bars is forbidden to ropes, and a spool winds ropes only."""
    both = bar_with("EA: 1 kN, k: 5 N/mm").replace("bars:", "ropes:")
    assert any("`EA` and `k` cannot both be given" in f for f in faults(tmp_path, both))
    wound = bar_with("EA: 1 kN").replace("bars:", "ropes:") + "actuators: {a: {winds: c, radius: 5 mm}}\n"
    assert any("unknown rope `c`" in f for f in faults(tmp_path, wound))
