"""What `--select` means: declared parameters, and numbers of effects."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.calibration.selection import select
from tests.command import TRIGLIDE, TRIGLIDE_DATA, run
from tests.support import model, overlay

EFFECTS = overlay(
    "triglide",
    """
    actuators: {q1: {period: 10 mm}}
    effects:
      pitch@q1: {c: {value: 1 um, identify: false}, s: 2 um, c2: {identify: false}, s2: {identify: false}}
      frame@tracker: {tx: {value: 0, identify: false}, ty: 0, rz: 0}
    """,
)
DECLARED = {"l1", "l2", "l3", "xb1r", "yb1r", "xb2r", "yb2r", "xb3r", "yb3r"}
HELD = {"gamma", "k1", "k2", "k3"}
FREE = {"pitch@q1.s", "frame@tracker.ty", "frame@tracker.rz"}


@pytest.mark.parametrize(
    ("text", "chosen"),
    [
        ("auto", DECLARED | FREE),
        ("all", DECLARED | HELD | FREE),
        ("auto,gamma", DECLARED | FREE | {"gamma"}),
        ("auto,k*", DECLARED | FREE | {"k1", "k2", "k3"}),
        ("pitch@q1.s", {"pitch@q1.s"}),
        ("pitch@q1.c", {"pitch@q1.c"}),
        ("auto,pitch@q1.c", DECLARED | FREE - {"pitch@q1.s"} | {"pitch@q1.c"}),
        ("auto,frame@tracker.tx,frame@tracker.rz", DECLARED | {"pitch@q1.s", "frame@tracker.tx", "frame@tracker.rz"}),
        ("auto,frame@tracker.ty", DECLARED | {"pitch@q1.s", "frame@tracker.ty"}),
        ("frame@tracker.t*", {"frame@tracker.ty"}),
        ("*@*", FREE),
        ("all,-frame@tracker.*", DECLARED | HELD | {"pitch@q1.s"}),
        ("all,-*@*", DECLARED | HELD),
        ("auto,-frame@tracker.ty", DECLARED | FREE - {"frame@tracker.ty"}),
        ("gamma,pitch@q1.c,-pitch@q1.*", {"gamma"}),
    ],
)
def test_what_is_selected(text: str, chosen: set[str]) -> None:
    machine = model(EFFECTS)
    assert set(select(machine, text)) == chosen
    assert list(select(machine, text)) == [n for n in machine.names if n in chosen], "in the file's order"


@pytest.mark.parametrize("text", ["pitch@q1.x", "nope*", "", "auto,", "-q9"])
def test_what_means_nothing(text: str) -> None:
    with pytest.raises(UsageError):
        select(model(EFFECTS), text)


def test_a_fit_moves_what_is_named_of_an_effect_and_nothing_else_of_it(tmp_path: Path) -> None:
    machine = tmp_path / "m.yaml"
    machine.write_text(EFFECTS, encoding="utf-8")
    table = EFFECTS.split()[1].replace(".yaml", ".csv")
    done = run("calibrate", machine, table, "--select", "auto,frame@tracker.ty", "--holdout", "none", "--json")
    named = {p["name"] for p in done.json["parameters"]}
    assert done.code in (0, 1) and named == DECLARED | {"pitch@q1.s", "frame@tracker.ty"}


def test_sensitivity_lists_every_parameter(tmp_path: Path) -> None:
    machine = tmp_path / "m.yaml"
    machine.write_text(EFFECTS, encoding="utf-8")
    done = run("sensitivity", machine, "--json")
    held = {"pitch@q1.c", "pitch@q1.c2", "pitch@q1.s2", "frame@tracker.tx"}
    assert {p["name"] for p in done.json["parameters"]} == DECLARED | HELD | FREE | held


@pytest.mark.parametrize(
    ("select", "names"),
    [
        ("l*", ["l1", "l2", "l3"]),
        ("auto,-xb*,-yb*", ["l1", "l2", "l3"]),
        ("l1,gamma", ["l1", "gamma"]),
        ("gamma,l1", ["l1", "gamma"]),
    ],
)
def test_what_calibrate_identifies(select: str, names: list[str]) -> None:
    done = run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--select", select, "--holdout", "none", "--json")
    assert [p["name"] for p in done.json["parameters"]] == names


def test_parameters_not_selected_stay_and_are_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--select", "l1", "--holdout", "none", "-o", file).code == 0
    written = yaml.safe_load(file.read_text())["parameters"]
    assert written["l2"] == {"value": 300.0, "std": None, "unit": "mm", "identified": False}
    assert written["l1"]["identified"] is True
