"""Errors that come once or twice per period of a drive, from measurement to set values: two crossed screws by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from pkmcal_cli.base.rotation import Array
from tests.command import run

MACHINE = """
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {scale: 1e-3}
parameters: {sx: {nominal: 1}, sy: {nominal: 1}}
guides: {rail: {along: x}, column: {frame: head, along: y}}
frames: {head: {body: slide}}
bodies:
  slide: {guide: rail, at: 100}
  ram: {guide: column, at: 100, points: {tip: [0, 0]}}
actuators:
  X: {moves: slide, scale: sx, period: 80 mm}
  Y: {moves: ram, scale: sy, period: 80 mm}
sensors: {grid: {at: tip, reads: [x, y], sigma: 1 um, frame: machine}}
tool_point: tip
"""
PERIOD, ROWS, SIGMA = 0.08, 60, 1e-6
ONCE, TWICE, NOT = (9e-6, -5e-6), (-4e-6, 12e-6), (0.0, 0.0)


def error(x: Array, once: tuple[float, float], twice: tuple[float, float]) -> Array:
    """Error (N,) m of a screw at set values (N,) m."""
    turn = 2 * np.pi * x / PERIOD
    first = once[0] * np.cos(turn) + once[1] * np.sin(turn)
    return np.asarray(first + twice[0] * np.cos(2 * turn) + twice[1] * np.sin(2 * turn))


def measured(once: tuple[float, float], twice: tuple[float, float]) -> None:
    """`t.csv`: a campaign in which the screw of X errs so."""
    rng = np.random.default_rng(7)
    q = rng.uniform(0, 0.2, size=(ROWS, 2))
    true = q + np.stack([error(q[:, 0], once, twice), np.zeros(ROWS)], axis=1)
    read = true + SIGMA * rng.normal(size=true.shape)
    np.savetxt("t.csv", 1e3 * np.hstack([q, read]), delimiter=",", header="X,Y,x,y", comments="", fmt="%.7f")


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(MACHINE)


@pytest.mark.parametrize(
    ("once", "twice", "words", "numbers"),
    [
        (ONCE, NOT, "once", ["c", "s"]),
        (NOT, TWICE, "twice", ["c2", "s2"]),
        (ONCE, TWICE, "once and twice", ["c", "s", "c2", "s2"]),
    ],
)
def test_words_say_how_often(
    once: tuple[float, float], twice: tuple[float, float], words: str, numbers: list[str]
) -> None:
    measured(once, twice)
    (found,) = run("diagnose", "m.yaml", "t.csv", "--json").json["effects"]
    assert (found["effect"], found["at"]) == ("pitch", "X")
    assert [p["name"] for p in found["parameters"]] == [f"pitch@X.{n}" for n in numbers]
    true = dict(zip(("c", "s", "c2", "s2"), (*once, *twice), strict=True))
    for p in found["parameters"]:
        assert abs(p["value"] - 1e6 * true[p["name"].rpartition(".")[2]]) < 3.5 * p["std"] < 3
    text = run("diagnose", "m.yaml", "t.csv").err
    assert f"periodic positioning error, {words} per period" in text
    assert f"The drive train of X errs {words} per period: " in text


@pytest.mark.parametrize("twice", [(1.1e-6, 0.0), (0.0, 1.3e-6)], ids=["cosine", "sine"])
def test_its_interval_is_that_of_the_number_that_is_told(twice: tuple[float, float]) -> None:
    """Near the limit of detection: as wide as this number is uncertain, whichever of the two it is."""
    measured(NOT, twice)
    (found,) = run("diagnose", "m.yaml", "t.csv", "--json").json["effects"]
    told = max(found["parameters"], key=lambda p: abs(p["value"]) / p["std"])
    size, std, chosen = abs(told["value"]), told["std"], found["selection"]
    assert abs(size - 1e6 * max(twice)) < 3.5 * std < 1
    assert 0.4 < (chosen["high"] - chosen["low"]) * size / (2 * 1.96 * std) < 2


def test_set_values_and_tables_take_it_out() -> None:
    """Improved, identified, simulated and corrected: at the set values the screw by hand is at its targets."""
    measured(NOT, TWICE)
    assert run("improve", "m.yaml", "t.csv", "-o", "better.yaml").code == 0
    written = yaml.safe_load(Path("better.yaml").read_text())["effects"]["pitch@X"]
    assert written["c"] == written["s"] == {"identify": False}
    assert run("calibrate", "better.yaml", "t.csv", "-o", "p.yaml").code == 0
    known = yaml.safe_load(Path("p.yaml").read_text())["parameters"]
    assert {n for n in known if n.startswith("pitch@") and known[n]["value"]} == {"pitch@X.c2", "pitch@X.s2"}
    wanted = np.linspace(0.005, 0.195, 120)
    text = "".join(f"{1e3 * x:.9f},100\n" for x in wanted)
    Path("targets.csv").write_text("x,y\n" + text)
    Path("rows.csv").write_text("X,Y\n" + text)
    assert run("simulate", "better.yaml", "rows.csv", "-p", "p.yaml", "-o", "read.csv").code == 0
    seen = 1e-3 * column("read.csv", "x") - wanted
    assert rms(seen - error(wanted, NOT, TWICE)) < 0.8e-6 < 9e-6 / 10 < 0.1 * rms(seen) + 1e-7
    assert run("correct", "better.yaml", "targets.csv", "-p", "p.yaml", "-o", "commands.csv").code == 0
    sent = 1e-3 * column("commands.csv", "X")
    assert rms(sent + error(sent, NOT, TWICE) - wanted) < 0.8e-6
    done = run("correct", "better.yaml", "targets.csv", "-p", "p.yaml", "--as", "csv", "-o", "table.csv", "--json")
    assert done.json["export"]["remaining"]["position"]["before"]["rms"] > 8
    rows = [line.split(",") for line in Path("table.csv").read_text().splitlines()]
    at, change = (np.array([float(r[k]) for r in rows if r[0] == "X"]) for k in (2, 3))
    sent = wanted + 1e-3 * np.interp(1e3 * wanted, at, change)
    assert rms(sent + error(sent, NOT, TWICE) - wanted) < 1.5e-6


def rms(x: Array) -> float:
    return float(np.sqrt((x**2).mean()))


def column(file: str, name: str) -> Array:
    """A column of a table, by the first word of its header."""
    head, *rows = [line for line in Path(file).read_text().splitlines() if not line.startswith("#")]
    k = [h.split(" ")[0] for h in head.split(",")].index(name)
    return np.array([float(r.split(",")[k]) for r in rows])


def test_plans_tell_what_of_it_will_be_seen() -> None:
    """Poses over whole periods show both harmonics alike: sizes detected are those of a sine in white noise."""
    measured(NOT, NOT)
    effects: list[dict[str, Any]] = run("plan", "m.yaml", "t.csv", "--json").json["effects"]
    (found,) = (e for e in effects if (e["effect"], e["at"]) == ("pitch", "X"))
    assert [n["name"] for n in found["numbers"]] == ["pitch@X.c", "pitch@X.s", "pitch@X.c2", "pitch@X.s2"]
    sine = 1e6 * SIGMA * np.sqrt(17.07 / (ROWS / 2))  # um: its sum of squares over sigma^2 is the noncentrality
    assert all(n["mdb"] == pytest.approx(sine, rel=0.15) for n in found["numbers"])
