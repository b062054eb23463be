"""`sensitivity` by sizes, coordinates and methods, `calibrate --method`, against the independent simulator."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from tests.command import GRID, MACHINES, SCISSORS, SHOPFLOOR, TRIGLIDE, clean, run
from tests.csv_tables import read_table
from tests.paper import scissors_shifts
from tests.support import truth

LINE = ("--grid", "x=-200:200:9,y=0:0:1")
SIZES = ("--size", "30 um", "--size", "1e-5 rad")
ALL = ("--select", "all", "--holdout", "none")
NONREDUNDANT = str(MACHINES / "triglide-nonredundant.yaml")


def along(*arguments: str) -> dict[str, dict[str, Any]]:
    """Parameters by name, as JSON has them."""
    done = clean(run("sensitivity", *arguments, "--json", "-q"))
    assert done.code == 0, done.err
    return {p["name"]: p for p in done.json["parameters"]}


def test_figure_17_is_that_of_the_simulator() -> None:
    """Mean shifts of x: the simulator moves each parameter by the whole size, so they differ by second order."""
    found = along(SCISSORS, *LINE, "--channel", "x", *SIZES, "--select", "all,-k*")
    stiff = along(SCISSORS, *LINE, "--channel", "x", *SIZES, "--select", "all,-k*", "--method", "rigid")
    linear = along(SCISSORS, *LINE, "--channel", "x", *SIZES, "--select", "all,-k*", "--method", "linear")
    for name, (_, rigid, true) in scissors_shifts().items():
        assert 1e3 * found[name]["mean"] == pytest.approx(true, rel=2e-3, abs=1e-3), name
        assert 1e3 * linear[name]["mean"] == pytest.approx(true, rel=2e-3, abs=1e-3), "one step from nominal is exact"
        assert 1e3 * stiff[name]["mean"] == pytest.approx(rigid, rel=2e-3, abs=1e-3), name


def test_a_size_stands_for_the_range_of_what_it_fits() -> None:
    plain, sized = along(SCISSORS, *LINE), along(SCISSORS, *LINE, "--size", "k*=20 kN/mm", "--size", "l?=30 um")
    for name, p in sized.items():
        factor = {"k": 2.0, "l": 0.3}.get(name[0], 1.0)
        assert p["size"] == pytest.approx(factor * plain[name]["range"]) and p["range"] == plain[name]["range"]
        assert p["position"] == pytest.approx(factor * plain[name]["position"], abs=1e-12)


def test_shifts_by_position_have_the_mean_that_is_told(tmp_path: Path) -> None:
    options = (*LINE, "--channel", "x", "--size", "30 um", "--select", "l1,ya2")
    found = along(SCISSORS, *options, "-o", str(tmp_path / "s.csv"))
    table = read_table(tmp_path / "s.csv")
    assert table.names == ("id", "x", "y", "rz", "shift.l1", "shift.ya2") and table.units[-1] == "um"
    np.testing.assert_allclose(table.numbers["x"], np.linspace(-200, 200, 9), atol=1e-9)
    for name in ("l1", "ya2"):
        shifts = table.numbers[f"shift.{name}"]
        assert shifts.mean() == pytest.approx(1e3 * found[name]["mean"], rel=1e-8)
        assert shifts[np.abs(shifts).argmax()] == pytest.approx(1e3 * found[name]["largest"], rel=1e-8)
    machine = truth("scissors")
    readings = machine.inverse(np.column_stack([np.linspace(-0.2, 0.2, 9), np.zeros(9)]))
    moved = machine.forward(readings, {"l1": 0.95 + 1e-6}).tcp - machine.forward(readings, {"l1": 0.95 - 1e-6}).tcp
    np.testing.assert_allclose(table.numbers["shift.l1"], moved[:, 0] / 2e-6 * 30, rtol=1e-4)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--size", "0 um"), "not above zero"),
        (("--size", "3 K"), "K does not fit any parameter"),
        (("--size", "l9=3 um"), "no selected parameter `l9`"),
        (("--size", "l1=30"), '`l1=30` has no unit\nhelp: give it with its unit, for example "20 um"'),
        (("--size", ""), "not a number with a unit"),
        (("--size", "l*=3 N"), "N does not fit `l1`"),
        (("--size", "many"), "--size"),
        (("--channel", "z"), "no coordinate `z`"),
        (("--method", "exakt"), "did you mean `exact`?"),
        (("-o", "s.csv"), "name it: `--channel x`"),
        (("-o", "-", "--channel", "x", "--json"), "both write to stdout"),
    ],
)
def test_what_does_not_go_together_is_refused(options: tuple[str, ...], told: str) -> None:
    done = clean(run("sensitivity", TRIGLIDE, "--grid", GRID, *options))
    assert done.code == 2 and told in done.err


@pytest.mark.slow
def test_without_redundancy_every_method_finds_the_same(tmp_path: Path) -> None:
    """No loads, no redundancy: nothing is strained. Derivatives by differences lead to the same end."""
    found = {}
    for method in ("exact", "linear", "rigid"):
        options = ("--method", method, "--starts", "1", "--holdout", "none", "--json")
        done = clean(run("calibrate", NONREDUNDANT, NONREDUNDANT.replace("yaml", "csv"), *options))
        assert done.code == 0 and done.json["method"] == method
        found[method] = np.array([(p["value"], p["std"]) for p in done.json["parameters"]])
    for method in ("linear", "rigid"):
        assert np.abs(found[method] - found["exact"])[:, 0] / found["exact"][:, 1] == pytest.approx(0, abs=1e-4)
        assert found[method][:, 1] == pytest.approx(found["exact"][:, 1], rel=1e-3)


@pytest.mark.slow
def test_a_rigid_model_of_a_strained_machine_is_worse_and_says_what_it_does_not_see(tmp_path: Path) -> None:
    """Paper, section 5.3: the redundant part belongs to no rigid model."""
    quick = ("--starts", "1", "--holdout", "none", "--json")
    runs = {
        m: clean(run("calibrate", SCISSORS, SHOPFLOOR, "--method", m, *quick, "-o", tmp_path / m))
        for m in ("exact", "linear", "rigid")
    }
    after = {m: r.json["after"]["position"]["criterion"] for m, r in runs.items()}
    assert after["rigid"] > 1.2 * after["exact"] and after["linear"] == pytest.approx(after["exact"], rel=1e-3)
    lost = {p["name"] for p in runs["rigid"].json["parameters"] if p["std"] is None}
    assert lost == {"l3", "xa2", "ya2"}
    assert yaml.safe_load((tmp_path / "rigid").read_text())["provenance"]["method"] == "rigid"
    assert "method" not in yaml.safe_load((tmp_path / "exact").read_text())["provenance"]


@pytest.mark.slow
def test_rows_that_are_joined_need_the_exact_method() -> None:
    quick = ("--method", "rigid", "--starts", "1", "--holdout", "none")
    done = clean(run("calibrate", MACHINES / "five-bar.yaml", MACHINES / "five-bar.csv", *quick))
    assert done.code in (0, 1, 2) and ("join rows" in done.err) == (done.code == 2)


def test_stiffnesses_under_internal_forces_come_back() -> None:
    machine = MACHINES / "scissors-strained.yaml"
    done = clean(run("calibrate", machine, machine.with_suffix(".csv"), *ALL, "--json"))
    planted = yaml.safe_load((MACHINES / "scissors-strained.csv.provenance.yaml").read_text())["planted"]["parameters"]
    found = {p["name"]: p for p in done.json["parameters"]}
    assert done.code == 0 and {f"k{i}" for i in range(1, 6)} <= found.keys()
    for name, p in found.items():
        assert p["std"] is None or abs(p["value"] - planted[name]["value"]) < 4 * p["std"], name
    for i in range(1, 6):
        assert found[f"k{i}"]["std"] < 0.01 * found[f"k{i}"]["value"], "determined, to 1 %"


def test_a_table_of_force_controlled_drives_comes_back(tmp_path: Path) -> None:
    """A drive whose force nobody states pulls with none; what is simulated can be calibrated."""
    (tmp_path / "m.yaml").write_text(
        f"extends: {SCISSORS}\n"
        "actuators: {q2: {control: force, sigma: 1 um}, q3: {control: force, sigma: 1 um}}\n"
    )
    options = ("--grid", "x=-200:200:5,y=-200:200:5", "--noise", "declared", "-o", tmp_path / "t.csv")
    assert clean(run("simulate", tmp_path / "m.yaml", *options)).code == 0
    done = clean(run("calibrate", tmp_path / "m.yaml", tmp_path / "t.csv", "--json"))
    assert done.code == 0 and 0.6 < done.json["chi2_per_dof"] < 1.5
