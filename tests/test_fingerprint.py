"""Fingerprints: one for all ways of writing a machine and all values, another for another machine, checked by `-p`."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from pkmcal_cli.language.fingerprint import Fingerprint, fingerprint_of, read_fingerprint
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.yaml_source.tree import Pasted
from tests.command import MACHINES

SHIPPED = sorted(f for f in MACHINES.glob("*.yaml") if "." not in f.stem)

BASE = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.1}
parameters: {l1: 400, l2: 400, b: 50, k: {nominal: 60 kN/mm, range: 10 kN/mm}}
guides: {rail: {along: x}}
ground: {A: [1000, 300]}
nodes: {tcp: {at: [500, 350], fixed: [rz]}}
bodies:
  c1: {guide: rail, at: 235, points: {B1: [0, b], C1: [0, 0]}}
  c2: {guide: rail, at: 765, points: {B2: [0, 50]}}
bars:
  rod1: {between: [B1, tcp], length: l1, k: k}
  rod2: {between: [B2, tcp], length: l2 + 3, k: 70 kN/mm}
ropes: {rope: {between: [tcp, A], EA: 20 kN}}
actuators:
  q1: {moves: c1, stiffness: 90 kN/mm}
  q2: {moves: c2}
  q3: {winds: rope, radius: 20, redundant: true, control: force, force: 40, unit: deg, zero: home, sigma: 1 mm}
loads: {weight: {at: tcp, force: [0, -10]}}
sensors: {tracker: {at: tcp, reads: [x, y], sigma: 5 um, frame: machine}}
effects: {"pitch_curve@q1": {over: [200, 300]}}
"""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def of(text: str, name: str = "m.yaml") -> Fingerprint:
    Path(name).write_text(text, encoding="utf-8")
    return fingerprint_of(read_machine(name))


def changed(old: str, new: str) -> str:
    """The base machine with another text in one place."""
    assert BASE.count(old) == 1, old
    return BASE.replace(old, new)


# --- one machine ---------------------------------------------------------------------------
VALUES = [
    ("l1: 400", "l1: 401"),
    ("l1: 400", "l1: {nominal: 0.4 m, range: 1, bounds: [399, 402], identify: false, note: a rod}"),
    ("l2 + 3", "4 + l2"),
    ("[0, 50]", "[7, 51]"),
    ("at: 235", "at: 236"),
    ("A: [1000, 300]", "A: [1001, 300]"),
    ("70 kN/mm", "71000 N/mm"),
    ("along: x", "along: [1, 0]"),
    ("force: [0, -10]", "force: [0, -11]"),
    ("k: {nominal: 60 kN/mm, range: 10 kN/mm}", "k: {nominal: 61 kN/mm, range: 9 kN/mm}"),
    ("ranges: {length: 0.1}", "ranges: {length: 0.2, angle: 1}"),
    ("q2: {moves: c2}", "q2: {moves: c2, limits: [0, 2000], column: Q2, sigma: 1 um, period: 5, scale: 1.0001}"),
    ("q2: {moves: c2}", "q2: {moves: c2, force_limit: 300}"),
    ("EA: 20 kN}", "EA: 20 kN, t_min: 5 N}"),
    ("q2: {moves: c2}", "q2: {moves: c2, redundant: true}"),
    ("q2: {moves: c2}", "q2: {moves: c2, redundant: true, control: force, force: 3}"),
    ("control: force, force: 40, ", ""),
    ("sigma: 5 um", "sigma: 6 um, offset: [0, 3]"),
    ("reads: [x, y]", "reads: {y: Y, x: X}"),
    ("sensors: {", "sensors: {touch: {kind: touch, at: C1, surface: bed, sigma: 1 um}, "),
    ("sensors: {", "sensors: {tape: {kind: bench, of: l1, reading: 400.1, sigma: 0.1}, "),
    ("sensors: {", "sensors: {wire: {kind: distance, at: tcp, to: A, sigma: 10 um}, "),
    ("space: planar", "space: planar\ndatum: [b]\nown_weight: false"),
    ("over: [200, 300]", "p2: {value: 20 um, std: 3 um, range: 30 um}, over: [20 cm, 30 cm]"),
]


@pytest.mark.parametrize(("old", "new"), VALUES)
def test_values_do_not_count(old: str, new: str) -> None:
    """Nor ranges, notes, units, columns, and instruments without parameters of their own."""
    text = changed(old, new) + ("frames: {bed: {at: [0, 0]}}\n" if "bed" in new else "")
    assert of(text).entries == of(BASE).entries


@pytest.mark.parametrize("file", SHIPPED, ids=lambda f: str(f.stem))
def test_every_way_of_writing_a_machine(file: Path) -> None:
    """Flattened, with `each` written out and keys in another order; as an overlay that changes values."""
    machine = read_machine(str(file))
    own = fingerprint_of(machine)
    assert own.difference(own) is None and own.of == str(file)
    first = next(iter(machine.parameters))
    over = of(f"extends: {file}\nparameters: {{{first}: {{note: changed, range: 0.01}}}}\n")
    assert over.entries == own.entries

    def backwards(value: object) -> object:
        return {k: backwards(v) for k, v in reversed(value.items())} if isinstance(value, dict) else value

    plain = machine.source.root.plain()
    listed = yaml.safe_load(yaml.safe_dump(backwards(_listed(plain))))
    listed.pop("extends", None)
    assert of(yaml.safe_dump(listed, sort_keys=False), "flat.yaml").entries == own.entries


def _listed(value: object) -> object:
    if isinstance(value, dict):
        return {str(k): _listed(v) for k, v in value.items()}
    if isinstance(value, str):
        return str(value.expression if isinstance(value, Pasted) else value)
    return [_listed(v) for v in value] if isinstance(value, tuple) else value


@pytest.mark.parametrize("file", SHIPPED, ids=lambda f: str(f.stem))
def test_a_line_is_yaml_and_is_read_as_written(file: Path) -> None:
    """One line of a few kilobytes, for every reader of YAML."""
    own = fingerprint_of(read_machine(str(file)))
    line = own.line()
    assert "\n" not in line and len(line) < 4000
    assert read_fingerprint(yaml.safe_load(line)) == own
    assert {len(v) for things in own.entries.values() for v in things.values()} == {8}


# --- another machine -----------------------------------------------------------------------
STRUCTURE: list[tuple[str, str, str]] = [
    ("[B2, tcp]", "[C1, tcp]", "changed: bar `rod2`"),
    (
        "points: {B2: [0, 50]}",
        "points: {}",
        "changed: bar `rod2`",
    ),  # the bar ends on the other carriage
    ("length: l2 + 3", "length: l2 + l1", "changed: bar `rod2`"),
    ("k: 70 kN/mm", "k: k", "changed: bar `rod2`"),
    (", k: 70 kN/mm", "", "changed: bar `rod2`"),
    ("EA: 20 kN}", "EA: 20 kN, mass: 1}", "changed: rope `rope`"),
    ("EA: 20 kN}", "k: 20 kN/mm}", "changed: rope `rope`"),
    ("B2: [0, 50]", "B2: [0, b]", "changed: body `c2`"),
    ("B1: [0, b]", "B1: [b, 0]", "changed: body `c1`"),
    ("A: [1000, 300]", "A: [1000, 300 + b]", "additional: ground point `A`"),
    ("fixed: [rz]", "mass: 2", "changed: node `tcp`"),
    ("moves: c2", "moves: c2, stiffness: 80 kN/mm", "changed: actuator `q2`"),
    ("zero: home, ", "", "changed: actuator `q3`"),
    ("along: x", "along: x, stiffness: {y: 200 kN/mm}", "changed: guide `rail`"),
    ("b: 50, ", "b: 50, w: {nominal: 0, per: session}, ", "additional: parameter `w`, sensor `wire`"),
    ("weight: {at: tcp,", "weight: {at: C1,", "changed: load `weight`"),
    ("space: planar", "space: planar\ngravity: [0, -g]", "changed: key `gravity`"),
    ("effects: {", "effects: {backlash@q2: {}, ", "additional: effect `backlash@q2`"),
    ("over: [200, 300]", "over: [200, 301]", "changed: effect `pitch_curve@q1`"),
    ("frame: machine", "frame: fitted", "additional: sensor `tracker`"),
    ("ropes: {rope: {", "ropes: {cable: {", "additional: rope `cable`; missing: rope `rope`"),
]


def told(other: Fingerprint, mine: Fingerprint) -> str:
    difference = other.difference(mine)
    assert difference is not None
    return difference


@pytest.mark.parametrize(("old", "new", "words"), STRUCTURE)
def test_what_a_machine_is_made_of_counts(old: str, new: str, words: str) -> None:
    text = changed(old, new)
    if "points: {}" in new:
        text = text.replace("C1: [0, 0]", "C1: [0, 0], B2: [0, 50]")
    if "w:" in new:
        text = text.replace("sensors: {", "sensors: {wire: {kind: distance, at: tcp, to: C1, sigma: 1 um, zero: w}, ")
    if "gravity" in new:
        text = text.replace("b: 50, ", "b: 50, g: {nominal: 9.81, unit: m/s^2, range: 0.01}, ")
    if "cable" in new:
        text = text.replace("winds: rope", "winds: cable")
    assert words in told(of(text), of(BASE))


def test_files_written_when_limits_counted_are_taken_for_the_same_limits() -> None:
    """By the hashes that such files have."""
    text = changed("EA: 20 kN}", "EA: 20 kN, t_min: 5}").replace("moves: c2", "moves: c2, force_limit: 300")
    limited, written = of(text), {"ropes": {"rope": "eb5da99a"}, "actuators": {"q2": "7ae7afea"}}
    before = Fingerprint("m.yaml", {k: {**v, **written.get(k, {})} for k, v in limited.entries.items()})
    assert limited.difference(before) is None
    assert told(of(text.replace("k: 70 kN/mm", "k: k")), before) == "changed: bar `rod2`"
    assert told(of(text.replace("EA: 20 kN", "k: 20 kN/mm")), before) == "changed: rope `rope`"


def test_the_order_of_held_directions_does_not_count() -> None:
    text = changed("nodes: {", "nodes: {post: {at: [0, 0], fixed: HELD}, ")
    text = text.replace("bars:", "bars:\n  strut: {between: [post, A], k: 1 kN/mm}")
    one, other, less = (of(text.replace("HELD", held)) for held in ("[x, rz, y]", "[rz, x, y]", "[x, y]"))
    assert other.entries == one.entries
    assert told(less, one) == "changed: node `post`"


def test_a_parameter_that_every_session_has_is_another_one() -> None:
    wire = "sensors: {wire: {kind: distance, at: tcp, to: C1, sigma: 1 um, zero: w}, "
    one = changed("sensors: {", wire).replace("b: 50, ", "b: 50, w: 0, ")
    each = one.replace("w: 0, ", "w: {nominal: 0, per: session}, ")
    assert told(of(each), of(one)) == "changed: parameter `w`"


def test_a_difference_is_told_from_both_sides() -> None:
    more = of(changed("effects: {", "effects: {backlash@q1: {}, backlash@q2: {}, zero@q1: {}, zero@q2: {}, "))
    words = "effect `backlash@q1`, effect `backlash@q2`, effect `zero@q1` and 1 more"
    assert told(more, of(BASE)) == f"additional: {words}"
    assert told(of(BASE), more) == f"missing: {words}"
