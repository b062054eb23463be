"""What `correct` says beside its set values: coordinates that nothing holds, sides, options without effect."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.campaign_tables import true_values, write_table
from tests.command import MACHINES, SCISSORS, TRIGLIDE, column, run

GANTRY = str(MACHINES / "gantry.yaml")
POSES = "x=200:1300:4,y=200:1500:4"


def test_coordinates_that_set_values_do_not_hold_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """x and y of a gantry are corrected; z, which its rails and its beam make, stays as far off as `simulate` says."""
    monkeypatch.chdir(tmp_path)
    assert run("calibrate", GANTRY, MACHINES / "gantry.csv", "-o", "p.yaml", "-q", "--holdout", "none").code == 0
    done = run("correct", GANTRY, "--grid", POSES, "-p", "p.yaml", "-o", "c.csv", "--json")
    told = done.json["not_held"]
    assert "not held by the set values" in done.err and told["z"]["unit"] == "um" and "x" not in told
    assert run("simulate", GANTRY, "c.csv", "-p", "p.yaml", "-o", "real.csv", "-q").code == 0
    assert run("simulate", GANTRY, "--grid", POSES, "-o", "meant.csv", "-q").code == 0
    off = 1e3 * (column("real.csv", "z") - column("meant.csv", "z"))
    assert told["z"]["rms"] == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-6)
    assert told["z"]["max"] == pytest.approx(np.abs(off).max(), rel=1e-6) and told["z"]["max"] > 50
    assert run("correct", TRIGLIDE, "--grid", "x=300:400:2,y=250:300:2", "-o", "t.csv", "--json").json["not_held"] == {}


def test_a_first_row_without_a_side_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its set values are those in the middle of the backlash."""
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(f"extends: {SCISSORS}\neffects: {{backlash@q3: {{b: 12 um}}}}\n")
    for dirs, count in (("", 1), (",dir.q1=1,dir.q2=1,dir.q3=1,dir.q4=1", 0)):
        at = ("--at", dirs.removeprefix(",")) if dirs else ()
        done = run("correct", "m.yaml", "--grid", "x=0:0:1,y=0:0:1", *at, "-o", "c.csv", "--json", "--force")
        assert done.json["sides_not_settled"] == count and ("come from no side" in done.err) == bool(count)


NEXT = ("plan", SCISSORS, "t.csv", "--next", "--budget", "9", "--aim", "l3 5 um")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("correct", SCISSORS, "--grid", "4", "--dwell", "5"), "--dwell is for programs"),
        (("correct", SCISSORS, "--grid", "4", "--as", "csv", "--feed", "5"), "--feed is for programs"),
        (("correct", SCISSORS, "--grid", "4", "--feed", "0"), "`--feed 1000`"),
        (("plan", SCISSORS, "--dwell", "5"), "--dwell is for programs"),
        ((*NEXT, "--points", "2"), "--next finds"),
        ((*NEXT, "--power", "3"), "--power: --next simulates no campaigns"),
        ((*NEXT, "--grid", "4"), "--grid: --next reads a table"),
        ((*NEXT, "--jobs", "2"), "leave them out with `--next`"),
        (("correct", SCISSORS, "--grid", "4", "--at", "T=26 +- -1"), "is not a circumstance"),
    ],
)  # fmt: skip
def test_what_would_have_no_effect_is_refused(arguments: tuple[str, ...], told: str) -> None:
    done = run(*arguments)
    assert done.code == 2 and told in done.err


@pytest.mark.slow
def test_noise_alone_leaves_nothing_unexplained(tmp_path: Path) -> None:
    """Of ten honest tables one in twenty is beyond chance; with it every later uncertainty was twice as large."""
    said = 0
    for seed in range(10):
        table = write_table(tmp_path / "t.csv", "biglide", true_values("biglide", seed), 60 + seed, 40)
        options = ("--holdout", "2", "-o", tmp_path / "p.yaml", "-q", "--force")
        done = run("calibrate", MACHINES / "biglide.yaml", table, *options)
        assert done.code == 0
        said += "  position: {std" in (tmp_path / "p.yaml").read_text()
    assert said <= 2


def test_columns_on_which_nothing_depends_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As `--at` tells it; time counts where a part lags behind its temperature."""
    monkeypatch.chdir(tmp_path)
    Path("m.yaml").write_text(f"extends: {SCISSORS}\neffects: {{thermal_strut@all: {{a: 9 um/(m*K), lag: 20 min}}}}\n")
    Path("t.csv").write_text("id,session,x,y,T,time [s],payload [kg]\na,mon,0,0,25,0,15\n")
    done = run("correct", "m.yaml", "t.csv", "-o", "c.csv", "--json")
    assert "note: t.csv: `payload` changes nothing: no effect" in done.err
    assert done.json["without_effect"] == ["payload"]
    lagging = run("correct", "m.yaml", "--grid", "2", "--at", "T=26,time=0", "-o", "d.csv", "--json")
    assert "changes nothing" not in lagging.err and lagging.json["without_effect"] == []
    plain = run("correct", SCISSORS, "t.csv", "-o", "e.csv", "--json")
    assert "t.csv: `T`, `time`, `payload` change nothing" in plain.err


@pytest.mark.parametrize(
    ("at", "value", "far"),
    [("299", 299.0, True), ("26 K", -247.15, True), ("26", 26.0, False), ("24 degC", 24.0, False)],
)
def test_a_temperature_in_another_unit_is_told(
    at: str, value: float, far: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As it was understood, beside the measured range."""
    monkeypatch.chdir(tmp_path)
    Path("p.yaml").write_text("parameters: {}\nmeasured: {T: {low: 20.5, high: 23.9, unit: degC}}\n")
    done = run("correct", SCISSORS, "--grid", "2", "--at", f"T={at}", "-p", "p.yaml", "-o", "c.csv", "--json")
    assert f"farthest {value:g} degC, measured 20.5 to 23.9 degC" in done.err
    assert (f"warning: `T` is understood as {value:g} degC" in done.err) == far
    beyond = done.json["outside_values"]["T"]
    assert beyond["far"] == far and beyond["value"] == pytest.approx(value)
