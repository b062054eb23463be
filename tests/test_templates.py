"""`pkmcal new KIND`: machine files of every size that check, that move as closed forms have it, and that calibrate."""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pkmcal_cli.loading.machine_templates import names, template
from tests.command import column, run
from tests.in_ci import in_ci
from tests.truth import templates_true as truth
from tests.truth.templates_true import Array

KINDS = ("cable", "delta", "gantry", "hexapod", "rrr", "scissors")
SPANS = {"10 mm": 0.01, "100 mm": 0.1, "1 m": 1.0, "2345.6 mm": 2.3456, "10 m": 10.0, "30 m": 30.0}
POSES = {  # in the workspace, of a span of 1 m; mm, deg
    "cable": [[120, -60, 350], [-150, 100, 500], [0, 190, 690]],
    "delta": [[300, -250, -1450], [-100, 420, -1120], [0, -490, -1300]],
    "gantry": [[130, 40, 20], [500, 450, 100], [870, 850, 180]],
    "hexapod": [[90, -80, 540, 10, -8, 12], [-120, 60, 670, -6, 14, -9], [0, 140, 600, 3, 2, -14]],
    "rrr": [[80, -60, 12], [-100, 90, -15], [0, 140, 5]],
    "scissors": [[60, -50], [-65, 20], [10, 68]],
}
DRIVES = {
    "cable": ("q1", "q2", "q3"),
    "delta": ("q1", "q2", "q3"),
    "gantry": ("Y1", "Y2", "X", "Z"),
    "hexapod": tuple(f"q{i}" for i in range(1, 7)),
    "rrr": ("q1", "q2", "q3"),
    "scissors": ("q1", "q2", "q3", "q4"),
}
GRIDS = {  # shares of the span; deg
    "cable": "x=-0.13:0.13:4,y=-0.13:0.13:4,z=0.32:0.68:4",
    "delta": "x=-0.34:0.34:4,y=-0.34:0.34:4,z=-1.48:-1.12:3",
    "gantry": "x=0.12:0.88:4,y=0.02:0.88:4,z=0.02:0.18:3",
    "hexapod": "x=-0.14:0.14:2,y=-0.14:0.14:2,z=0.53:0.67:2,rx=-12:12:2,ry=-12:12:2,rz=-12:12:3",
    "rrr": "x=-0.1:0.1:4,y=-0.1:0.1:4,rz=-18:18:4",
    "scissors": "x=-0.068:0.068:8,y=-0.068:0.068:8",
}


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def make(kind: str, span: str = "1 m") -> dict[str, Any]:
    """The written file, and what `check --json` says of it."""
    done = run("new", kind, "--span", span, "-o", "m.yaml", "--force")
    assert done.code == 0, done.err
    checked = run("check", "m.yaml", "--json")
    assert checked.code == 0, checked.err
    assert checked.json["faults"] == [] and checked.json["warnings"] == [], checked.err
    return dict(checked.json)


def parameters(found: dict[str, Any]) -> dict[str, tuple[float, float, bool]]:
    """Nominal value, range, and whether it is identified, by name; in the units of the file."""
    return {p["name"]: (p["nominal"], p["range"], p["identify"]) for p in found["parameters"]}


def planted(kind: str, span: str, share: float, seed: int) -> dict[str, float]:
    """Writes p.yaml: identified parameters off by a share of their ranges (one standard deviation of a draw)."""
    rng = np.random.default_rng(seed)
    known = parameters(make(kind, span))
    values = {n: v + identified * share * r * rng.normal() for n, (v, r, identified) in known.items()}
    if kind == "gantry" and share < 0.5:  # the sides agree, the rails are straight
        values |= dict.fromkeys(("zr", "al", "bl", "cl", "ar", "cr"), 0.0)
        values |= {"y2": values["y1"], "sy2": values["sy1"], "size": 1000 * SPANS[span]}
    Path("p.yaml").write_text(yaml.safe_dump({"parameters": {n: v for n, v in values.items() if n != "size"}}))
    return values


def scaled(kind: str, span: str) -> list[Array]:
    """The poses for a span: lengths grow, angles do not."""
    angles = {"hexapod": 3, "rrr": 2}.get(kind, 9)
    return [np.array([v * (SPANS[span] if k < angles else 1) for k, v in enumerate(pose)]) for pose in POSES[kind]]


def reached(kind: str, q: list[Array], columns: tuple[str, ...], machine: str = "m.yaml") -> Array:
    """Poses (N, C) that the machine takes at set values."""
    lines = [",".join(DRIVES[kind]), *(",".join(repr(float(v)) for v in row) for row in q)]
    Path("q.csv").write_text("\n".join([*lines, ""]))
    done = run("simulate", machine, "q.csv", "-p", "p.yaml", "-o", "out.csv", "--force", "-q")
    assert done.code == 0, done.err
    return np.stack([column("out.csv", name) for name in columns], axis=1)


# --- the files -----------------------------------------------------------------------------------
def test_these_kinds_there_are() -> None:
    assert tuple(names()) == KINDS
    help_text = run("new", "--help").out
    assert all(kind in help_text for kind in KINDS)


@pytest.mark.parametrize(
    ("kind", "span"),
    in_ci(
        [*(f"{k}-{s}" for k in KINDS for s in ("1 m", "30 m")), "rrr-10 mm", "cable-2345.6 mm"], product(KINDS, SPANS)
    ),
)
def test_every_size_checks_at_once(kind: str, span: str) -> None:
    """Lengths, ranges of lengths and sigmas grow with the span; angles and scales stay."""
    size = SPANS[span]
    one, other = parameters(make(kind)), parameters(made := make(kind, span))
    units = {p["name"]: p["unit"] for p in made["parameters"]}
    for name, unit in units.items():
        if unit in ("kg", "kN"):  # their power depends on the machine
            continue
        power = {"mm": 1, "kN/mm": 1}.get(unit, 0)
        assert other[name][:2] == pytest.approx(np.array(one[name][:2]) * size**power, rel=1e-5), name
    assert "<" not in re.sub(r"#.*", "", Path("m.yaml").read_text())


@pytest.mark.parametrize("kind", KINDS)
def test_every_file_says_where_to_change_it(kind: str) -> None:
    made = make(kind)
    text = Path("m.yaml").read_text()
    head = [line for line in text.splitlines() if line.startswith("#")]
    assert head[0].startswith("# yaml-language-server: $schema=") and "# Arranged otherwise:" in head
    assert sum(line.startswith("# - ") for line in head) >= 3
    assert made["channels"] and "workspace" in yaml.safe_load(text)
    assert template(kind).description in text and template(kind).span in text
    assert max(map(len, text.splitlines())) <= 240


# --- the kinematics --------------------------------------------------------------------------------
@pytest.mark.parametrize("span", ["1 m", "10 m"])
@pytest.mark.parametrize("kind", ["hexapod", "rrr", "delta", "scissors"])
def test_machines_without_strain_are_where_closed_forms_put_them(kind: str, span: str) -> None:
    values = planted(kind, span, 0.4, 1)
    channels = {"hexapod": ("x", "y", "z", "rx", "ry", "rz"), "rrr": ("x", "y", "rz"), "scissors": ("x", "y")}
    poses = scaled(kind, span)
    got = reached(kind, [truth.INVERSE[kind](pose, values) for pose in poses], channels.get(kind, ("x", "y", "z")))
    assert got == pytest.approx(np.array(poses), abs=2e-6 * SPANS[span])  # mm, deg: digits of the table


def test_scissors_that_are_strained_hold_the_least_energy() -> None:
    values = planted("scissors", "1 m", 0.4, 2)
    q = [truth.scissors(pose, values) + np.array([0.03, -0.02, 0.04, 0.01]) for pose in scaled("scissors", "1 m")]
    expected = [truth.scissors_strained(row, values) for row in q]
    assert np.abs(np.array(expected) - scaled("scissors", "1 m")).max() > 5e-3
    assert reached("scissors", q, ("x", "y")) == pytest.approx(np.array(expected), abs=2e-6)


@pytest.mark.parametrize("span", ["1 m", "10 m"])
def test_the_load_of_cables_is_in_balance(span: str) -> None:
    """Weight, three tensions, and the pull of the fourth cable, whose length is read."""
    values = planted("cable", span, 0.4, 3) | {}
    values["EA"] *= 1000  # kN
    poses = scaled("cable", span)
    q = [truth.cable(pose, values, 20 * SPANS[span] ** 2) for pose in poses]
    got = reached("cable", [row[:3] for row in q], ("x", "y", "z", "q4"))
    wanted = np.hstack([poses, np.array(q)[:, 3:]])
    assert got == pytest.approx(wanted, abs=2e-6 * SPANS[span])


@pytest.mark.parametrize("span", ["1 m", "10 m"])
def test_a_gantry_without_weight_is_where_its_sides_agree(span: str) -> None:
    values = planted("gantry", span, 0.4, 4)
    Path("light.yaml").write_text("extends: m.yaml\ngravity: [0, 0, 0]\n")
    poses = scaled("gantry", span)
    q = [truth.gantry(pose, values) for pose in poses]
    got = reached("gantry", q, ("x", "y", "z"), "light.yaml")
    assert got == pytest.approx(np.array(poses), abs=2e-6 * SPANS[span])
    sag = reached("gantry", q, ("x", "y", "z")) - got
    assert (sag[:, 2] < 0).all() and sag[1, 2] < sag[[0, 2], 2].min()  # most where the carriage is at the middle


# --- the calibration -------------------------------------------------------------------------------
def grid(kind: str, size: float) -> str:
    """The grid for a span, mm."""
    parts = []
    for part in GRIDS[kind].split(","):
        name, _, rest = part.partition("=")
        low, high, number = rest.split(":")
        grow = 1.0 if name.startswith("r") else 1000 * size
        parts.append(f"{name}={float(low) * grow:g}:{float(high) * grow:g}:{number}")
    return ",".join(parts)


@pytest.mark.parametrize(
    ("kind", "span"),
    in_ci(
        [*(f"{k}-1 m" for k in KINDS if k != "delta"), "delta-100 mm"],
        [*((k, "1 m") for k in KINDS), *((k, "100 mm") for k in KINDS[:3])],
    ),
)
def test_what_is_planted_is_found(kind: str, span: str) -> None:
    """All parameters within what is stated, as a whole: the sum of squares of errors in standard uncertainties."""
    true = planted(kind, span, 0.5, 5)
    done = run("simulate", "m.yaml", "--grid", grid(kind, SPANS[span]), "-p", "p.yaml", "--noise", "declared",
               "--seed", "6", "-o", "data.csv", "--force", "-q")  # fmt: skip
    assert done.code == 0, done.err
    seen = run("observability", "m.yaml", "data.csv", "--json", "-q").json
    assert seen["rank"] == len(seen["parameters"])
    done = run("calibrate", "m.yaml", "data.csv", "--holdout", "none", "--json", "-q")
    assert done.code == 0, done.err
    found = done.json
    assert 0.7 < found["chi2_per_dof"] < 1.35, found["chi2_per_dof"]
    errors = [(p["value"] - true[p["name"]]) / p["std"] for p in found["parameters"] if p.get("std")]
    assert len(errors) >= 9 and np.abs(errors).max() < 5 and np.mean(np.square(errors)) < 3, np.round(errors, 1)


# --- the command -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), ["`gantry`", "`scissors`", "--from"]),
        (("gantri",), ["`gantri`", "did you mean `gantry`?"]),
        (("tripod",), ["`tripod`", "`hexapod`", "docs/my-machine.md"]),
        (("gantry", "--from", "printer.cfg"), ["not both"]),
        (("--span", "2 m", "--from", "printer.cfg"), ["--span"]),
        (("gantry", "--span", "2"), ["`2` is not a length", '"2 m"']),
        (("gantry", "--span", "2 kg"), ["`2 kg` is not a length"]),
        (("gantry", "--span", "0 m"), ["is not a size of a machine"]),
        (("gantry", "--span", "-2 m"), ["is not a size of a machine"]),
        (("gantry", "--span", "1e9 m"), ["is not a size of a machine"]),
        (("gantry", "--span", "nan m"), ["--span"]),
        (("gantry", "--json"), ["stdout"]),
    ],
)
def test_what_is_not_understood_is_told(arguments: tuple[str, ...], told: list[str]) -> None:
    done = run("new", *arguments)
    assert done.code == 2 and done.out == "" and [t for t in told if t not in done.err] == [], done.err
    assert list(Path().iterdir()) == []


def test_a_file_is_not_replaced_unasked() -> None:
    Path("my.yaml").write_text("mine")
    assert run("new", "gantry", "-o", "my.yaml").code == 4 and Path("my.yaml").read_text() == "mine"
    assert run("new", "gantry", "-o", "my.yaml", "--force").code == 0
    assert run("new", "gantry", "-o", "no/my.yaml").code == 4


def test_the_file_goes_to_stdout_too() -> None:
    done = run("new", "delta", "--span", "40 cm", "-q")
    assert done.code == 0 and done.err == "" and "nominal: 280, note: distance of the column" in done.out
    Path("my.yaml").write_text(done.out)
    assert run("check", "my.yaml").code == 0
    made = run("new", "delta", "--span", "40 cm", "-o", "other.yaml", "--json", "-q").json
    assert (made["kind"], made["span"], made["output"]) == ("delta", pytest.approx(0.4), "other.yaml")
    assert Path("other.yaml").read_text() == done.out
