"""`import pkmcal`: what the commands say, in frozen results with units; tables and errors: test_python_tables.py."""

from __future__ import annotations

import html
import inspect
import json
from dataclasses import FrozenInstanceError
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pkmcal
import pytest
import yaml

from tests.command import GRID, MACHINES, SHOPFLOOR, TRIGLIDE, TRIGLIDE_DATA, clean, run

PLAIN = str(MACHINES / "triglide-nonredundant.yaml")
WRITING = {"output", "run", "as_json", "quiet", "style", "force", "fail_above", "fail_on", "max_rms", "accept", "plots"}
WRITING |= {"plot", "as_format", "dwell", "feed"}
"""Options that say where a result goes, and what its exit code is."""


@pytest.fixture(scope="module")
def found() -> pkmcal.Calibration:
    return pkmcal.calibrate("triglide", TRIGLIDE_DATA)


@pytest.fixture(scope="module")
def machine() -> pkmcal.Machine:
    return pkmcal.load(TRIGLIDE)


@pytest.mark.parametrize(
    ("command", "function"),
    [(n, n) for n in ("calibrate", "simulate", "diagnose", "improve", "correct")] + [("observability", "observe")],
)
def test_functions_have_the_options_of_their_commands(command: str, function: str) -> None:
    own = inspect.signature(getattr(import_module(f"pkmcal_cli.commands.{command}"), command)).parameters
    door = inspect.signature(getattr(pkmcal, function)).parameters
    here = {n: p.default for n, p in door.items() if n not in ("machine", "measurements", "observer")}
    there = {n: p.default for n, p in own.items() if n not in ("machine", "measurements", *WRITING)}
    assert here == there
    assert all(p.kind is p.KEYWORD_ONLY for p in list(door.values())[2:])


def without(result: dict[str, Any], *names: str) -> dict[str, Any]:
    """The JSON of a command as the function has it: no provenance, no files, no limits."""
    gone = ("provenance", "gates", "schema", *names)
    return {k: v for k, v in result.items() if k not in gone}


def test_functions_say_what_the_commands_say(tmp_path: Path, found: pkmcal.Calibration) -> None:
    values = tmp_path / "p.yaml"
    done = clean(run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", values, "--json"))
    assert without(done.json, "verdict") == found.json()
    options = ("--grid", GRID, "-p", values)
    done = clean(run("simulate", TRIGLIDE, *options, "--forces", "-o", tmp_path / "s.csv", "--json"))
    made = pkmcal.simulate(TRIGLIDE, grid=GRID, parameters=found, forces=True)
    assert without(done.json, "verdict", "output") == made.json()
    read = pd.read_csv(tmp_path / "s.csv", comment="#", dtype=str)
    assert read.columns.tolist() == made.table.columns.tolist()
    assert np.array_equal(read.iloc[:, 1:].astype(float), made.table.iloc[:, 1:])  # parsed to the last bit
    done = clean(run("observability", TRIGLIDE, *options, "--json"))
    assert without(done.json, "verdict") == pkmcal.observe(TRIGLIDE, grid=GRID, parameters=found).json()
    done = clean(run("correct", TRIGLIDE, *options, "-o", tmp_path / "c.csv", "--json"))
    assert without(done.json, "verdict", "output") == pkmcal.correct(TRIGLIDE, grid=GRID, parameters=found).json()


def test_a_written_calibration_is_the_result(tmp_path: Path, found: pkmcal.Calibration) -> None:
    by_command, by_function = tmp_path / "c.yaml", tmp_path / "f.yaml"
    assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", by_command).code == 0
    found.write(by_function)
    one, other = (yaml.safe_load(f.read_text(encoding="utf-8")) for f in (by_command, by_function))
    assert other["provenance"]["arguments"] == ["pkmcal.calibrate"]
    for each in (one, other):
        del each["provenance"]["arguments"], each["provenance"]["created"]
        each.pop("fingerprint", None)  # names the file as it was called
    assert one == other
    with pytest.raises(pkmcal.OutputError, match="exists"):
        found.write(by_function)
    with pytest.raises(pkmcal.OutputError, match="input"):
        found.write(TRIGLIDE_DATA, force=True)


def test_residuals_are_measured_minus_predicted(found: pkmcal.Calibration) -> None:
    """What the found parameters predict at the table's set values, by another way: simulated, then subtracted."""
    drives = found.table[["q1 [mm]", "q2 [mm]", "q3 [mm]"]]
    model = pkmcal.simulate("triglide", drives, parameters=found).table
    for name in ("x [mm]", "y [mm]"):
        assert found.residuals[name].to_numpy() == pytest.approx((found.table[name] - model[name]).to_numpy(), abs=1e-9)
    size = np.sqrt((found.residuals**2).sum(axis=1).mean())
    assert found.errors.loc["position", "rms_after"] == pytest.approx(size, rel=1e-9)


def test_estimates_are_within_their_uncertainties(found: pkmcal.Calibration) -> None:
    """The planted truth, by value, uncertainty and interval, in the units that the table names."""
    planted = yaml.safe_load((MACHINES / "triglide.csv.provenance.yaml").read_text(encoding="utf-8"))["planted"]
    true = pd.DataFrame(planted["parameters"]).T.loc[found.parameters.index]
    assert (true.unit == found.parameters.unit).all()
    off = (found.parameters.value - true.value.astype(float)) / found.parameters["std"]
    assert np.abs(off).max() < 3.5 and np.sqrt((off**2).mean()) < 2
    within = (found.parameters.low < true.value) & (true.value < found.parameters.high)
    assert within.sum() >= len(within) - 2


def test_results_do_not_change(found: pkmcal.Calibration, machine: pkmcal.Machine) -> None:
    with pytest.raises(FrozenInstanceError):
        found.notes = ()  # type: ignore[misc]
    for of in (lambda: found.parameters, lambda: found.residuals, lambda: found.table, lambda: machine.parameters):
        was, table = of().copy(), of()
        table.insert(0, "more", 0.0)
        assert of().equals(was) and len(was)
    given = pd.read_csv(TRIGLIDE_DATA, comment="#")
    before = given.copy()
    pkmcal.calibrate(machine, given, holdout="none")
    assert given.equals(before)


def test_functions_print_nothing(capfd: pytest.CaptureFixture[str], machine: pkmcal.Machine) -> None:
    pkmcal.simulate(machine, grid=GRID, noise="declared")
    pkmcal.observe(machine, grid=GRID)
    pkmcal.correct(machine, grid=GRID)
    assert capfd.readouterr() == ("", "")


def test_a_result_that_cannot_be_used_warns() -> None:
    """Readings in mm called m: no parameters make sense of them, and who calls is told."""
    raw = pd.read_csv(TRIGLIDE_DATA, comment="#")
    label = next(c for c in raw.columns if c.startswith("y"))
    raw[label] = raw[label] + 40 * np.sin(np.arange(len(raw)))
    with pytest.warns(pkmcal.PkmcalWarning, match="IMPLAUSIBLE|NOT CONVERGED"):
        found = pkmcal.calibrate("triglide", raw, holdout="none", starts=1)
    assert not found.ok and found.status in ("implausible", "not_converged")


@pytest.mark.slow
def test_pictures_are_those_of_the_commands(found: pkmcal.Calibration, tmp_path: Path) -> None:
    """Figures with the axes of what `--plot` writes."""
    from matplotlib.figure import Figure

    (tmp_path / "p.yaml").write_text(found.parameter_text())
    rows = tmp_path / "rows.csv"
    pkmcal.simulate(PLAIN, grid=GRID, noise="declared", seed=3).table.to_csv(rows, index=False)
    results = {
        ("calibrate", TRIGLIDE, TRIGLIDE_DATA): found,
        ("simulate", TRIGLIDE, "--grid", GRID, "-o", str(tmp_path / "s.csv")): pkmcal.simulate("triglide", grid=GRID),
        ("observability", TRIGLIDE, "--grid", GRID): pkmcal.observe("triglide", grid=GRID),
        ("correct", TRIGLIDE, "--grid", GRID, "-p", str(tmp_path / "p.yaml"), "-o", str(tmp_path / "c.csv")):
            pkmcal.correct("triglide", grid=GRID, parameters=found),
        ("diagnose", PLAIN, str(rows)): pkmcal.diagnose(PLAIN, rows),
    }  # fmt: skip
    for command, result in results.items():
        figure = result.plot()
        assert isinstance(figure, Figure)
        file = tmp_path / f"{command[0]}.svg"
        run(*command, "--plot", str(file))
        drawn = file.read_text(encoding="utf-8")
        axes = [a for pane in (figure, *figure.subfigs) for a in pane.axes]
        labels = {text for a in axes for text in (a.get_xlabel(), a.get_ylabel()) if text}
        assert len(labels) >= 2 and all(html.escape(text, quote=False) in drawn for text in labels), command


def test_an_observer_hears_of_every_step() -> None:
    rows = pkmcal.simulate(PLAIN, grid=GRID, noise="declared", seed=3).table
    steps: list[str] = []
    told = pkmcal.diagnose(PLAIN, rows, observer=lambda stage: steps.append(stage.name))
    assert steps and told.status in ("clean", "sigma_too_small", "unknown")
    assert told.table.shape[0] == told.residuals.shape[0] == 12
    done = clean(run("diagnose", PLAIN, "-", "--json", stdin=rows.to_csv(index=False)))
    ours = json.loads(json.dumps(told.json()))
    theirs = without(done.json)
    assert theirs.keys() == ours.keys() and theirs["verdict"] == ours["verdict"]
    assert theirs["chi2_per_dof_before"] == ours["chi2_per_dof_before"]


@pytest.mark.slow
def test_improved_machines_need_no_file(tmp_path: Path) -> None:
    """The improved machine in memory and the one that was written give the same set values."""

    def rows(grid: str, seed: int) -> pd.DataFrame:
        table = pkmcal.simulate(PLAIN, grid=grid, noise="declared", seed=seed).table
        return table.assign(**{"q1 [mm]": table["q1 [mm]"] * 0.9995})

    fitted, apart = rows("x=200:700:4,y=200:350:3", 1), rows("x=220:680:3,y=210:340:3", 2)
    made = pkmcal.improve(PLAIN, fitted, validation=apart, only="scale@q1")
    assert made.ok and made.steps.accepted.tolist() == [True]
    scale = made.parameters.loc["scale@q1.s"]
    assert abs(scale.value - 500.0) < 4 * scale["std"] and scale.unit == "um/m"
    files = made.write(tmp_path / "better.yaml")
    by_file = pkmcal.correct(files[0], grid=GRID, parameters=files[1])
    in_memory = pkmcal.correct(made.improved, grid=GRID, parameters=made)
    assert np.array_equal(by_file.table.iloc[:, 1:-1], in_memory.table.iloc[:, 1:-1])
    with pytest.raises(pkmcal.UsageError, match="in none"):
        _ = pkmcal.improve(made.improved, fitted, validation=apart, only="zero@q2").improved


@pytest.mark.slow
def test_the_shop_floor_is_diagnosed_as_by_the_command() -> None:
    told = pkmcal.diagnose("scissors", SHOPFLOOR)
    done = clean(run("diagnose", MACHINES / "scissors.yaml", SHOPFLOOR, "--json"))
    assert without(done.json) == json.loads(json.dumps(told.json()))
    assert set(told.parameters.effect) == {e["effect"] for e in done.json["effects"]}
