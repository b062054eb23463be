"""What `--select` means: declared parameters, and numbers of effects."""

from __future__ import annotations

import pytest

from pkmcal_cli.calibration.selection import select
from pkmcal_cli.errors import UsageError
from tests.command import run
from tests.support import model, overlay

EFFECTS = overlay(
    "triglide",
    """
    actuators: {q1: {period: 10 mm}}
    effects:
      pitch@q1: {c: {value: 1 um, identify: false}, s: 2 um}
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


def test_a_fit_moves_what_is_named_of_an_effect_and_nothing_else_of_it(tmp_path) -> None:  # type: ignore[no-untyped-def]
    machine = tmp_path / "m.yaml"
    machine.write_text(EFFECTS, encoding="utf-8")
    table = EFFECTS.split()[1].replace(".yaml", ".csv")
    done = run("calibrate", machine, table, "--select", "auto,frame@tracker.ty", "--holdout", "none", "--json")
    named = {p["name"] for p in done.json["parameters"]}
    assert done.code in (0, 1) and named == DECLARED | {"pitch@q1.s", "frame@tracker.ty"}


def test_sensitivity_lists_every_parameter(tmp_path) -> None:  # type: ignore[no-untyped-def]
    machine = tmp_path / "m.yaml"
    machine.write_text(EFFECTS, encoding="utf-8")
    done = run("sensitivity", machine, "--json")
    held = {"pitch@q1.c", "frame@tracker.tx"}
    assert {p["name"] for p in done.json["parameters"]} == DECLARED | HELD | FREE | held
