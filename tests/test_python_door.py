"""`import pkmcal`: what the commands say, tables in all their forms, frozen results, errors in the same words."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
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
    assert without(done.json) == found.json()
    options = ("--grid", GRID, "-p", values)
    done = clean(run("simulate", TRIGLIDE, *options, "--forces", "-o", tmp_path / "s.csv", "--json"))
    made = pkmcal.simulate(TRIGLIDE, grid=GRID, parameters=found, forces=True)
    assert without(done.json, "output") == made.json()
    read = pd.read_csv(tmp_path / "s.csv", comment="#")
    assert read.columns.tolist() == made.table.columns.tolist()
    assert np.array_equal(read.iloc[:, 1:], made.table.iloc[:, 1:])
    done = clean(run("observability", TRIGLIDE, *options, "--json"))
    assert without(done.json) == pkmcal.observe(TRIGLIDE, grid=GRID, parameters=found).json()
    done = clean(run("correct", TRIGLIDE, *options, "-o", tmp_path / "c.csv", "--json"))
    assert without(done.json, "output") == pkmcal.correct(TRIGLIDE, grid=GRID, parameters=found).json()


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


def test_every_form_of_a_table_is_the_same_table(found: pkmcal.Calibration, machine: pkmcal.Machine) -> None:
    """A path, a DataFrame in other units, arrays with units: the same estimates to rounding."""
    raw = pd.read_csv(TRIGLIDE_DATA, comment="#")
    names = {label.partition(" [")[0]: label for label in raw.columns}
    metres = pd.DataFrame({f"{n} [m]": raw[names[n]] * 1e-3 for n in ("q1", "q2", "q3", "x", "y")})
    arrays = {n: (raw[names[n]].to_numpy() * 1e3, "um") for n in ("q1", "q2", "q3", "x", "y")}
    bare = {n: raw[names[n]].tolist() for n in ("q1", "q2", "q3", "x", "y")}
    for table in (Path(TRIGLIDE_DATA), raw, raw.set_index("id"), metres, arrays, bare, found.table):
        again = pkmcal.calibrate(machine, table, holdout="none")
        assert again.parameters.value.to_numpy() == pytest.approx(found.parameters.value.to_numpy(), abs=1e-6)
        assert len(again.table) == len(again.residuals) == len(raw)


def test_tables_in_a_list_are_sessions(machine: pkmcal.Machine) -> None:
    raw = pd.read_csv(TRIGLIDE_DATA, comment="#")
    both = pkmcal.calibrate(machine, [raw.iloc[:120], raw.iloc[120:]], holdout="session")
    assert both.table["session"].unique().tolist() == ["table1", "table2"] and "2" in both.held_out
    apart = pkmcal.calibrate(machine, raw.iloc[:150], holdout=raw.iloc[150:])
    assert apart.held_out == "rows of holdout"
    assert np.isfinite(apart.errors.rms_held_out).all()


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


def test_an_earlier_calibration_is_a_prior(found: pkmcal.Calibration, tmp_path: Path) -> None:
    """In memory as from its file: a few rows and what was known give more than the rows."""
    found.write(tmp_path / "old.params.yaml")
    few = found.table.iloc[::40]
    by_result, by_file = (
        pkmcal.calibrate("triglide", few, prior=prior, holdout="none").parameters
        for prior in (found, str(tmp_path / "old.params.yaml"))
    )
    assert by_result.equals(by_file)
    alone = pkmcal.calibrate("triglide", few, holdout="none").parameters["std"].fillna(np.inf)
    known = by_result["std"].loc[alone.index]
    assert (known <= alone * 1.001).all() and (known < 0.7 * alone).any()


def test_values_by_name_are_parameters(machine: pkmcal.Machine) -> None:
    """A strut 0.1 mm longer; numbers are in the parameter's unit."""
    one, other = (
        pkmcal.simulate(machine, grid=GRID, parameters={"l1": value}).table["x [mm]"] for value in ("0.3001 m", 300.1)
    )
    assert one.to_numpy() == pytest.approx(other.to_numpy(), abs=1e-12)
    assert np.abs(one - pkmcal.simulate(machine, grid=GRID).table["x [mm]"]).max() > 0.01
    with pytest.raises(pkmcal.BadInput, match="no parameter `l9`"):
        pkmcal.simulate(machine, grid=GRID, parameters={"l9": 1.0})


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


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (lambda: pkmcal.load("no-machine.yaml"), "No such file"),
        (lambda: pkmcal.load("triglid"), "did you mean `triglide`"),
        (lambda: pkmcal.load("-"), "stdin"),
        (lambda: pkmcal.calibrate("triglide", "-"), "stdin"),
        (lambda: pkmcal.calibrate("triglide", []), "no table"),
        (lambda: pkmcal.calibrate("triglide", 3), "no table"),  # type: ignore[arg-type]
        (lambda: pkmcal.calibrate("triglide", {}), "no table"),
        (lambda: pkmcal.calibrate("triglide", pd.DataFrame()), "no table"),
        (lambda: pkmcal.calibrate("triglide", {"q1": ([1.0], "mm"), "x": ([1.0, 2.0], "mm")}), "differ in length"),
        (lambda: pkmcal.calibrate("triglide", {"q1": (1.0, "mm")}), "no list of values"),
        (lambda: pkmcal.load(None), "no file: NoneType"),  # type: ignore[arg-type]
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, starts=-1), "--starts: -1"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, seed=1.5), "--seed: 1.5"),  # type: ignore[arg-type]
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, holdout=True), "--holdout: True"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, select=3), "--select"),  # type: ignore[arg-type]
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, parameters={"l1": None}), "`l1`"),  # type: ignore[dict-item]
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, parameters={"l1": "3 kg"}), "give `l1` in mm"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, select="l9"), "--select"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, method="exakt"), "did you mean `exact`"),
        (lambda: pkmcal.calibrate("triglide", TRIGLIDE_DATA, parameters=3), "no parameters"),  # type: ignore[arg-type]
        (lambda: pkmcal.simulate("triglide"), "either a table of poses or --grid"),
        (lambda: pkmcal.simulate("triglide", grid=GRID, seed=-1), "--seed: -1"),
        (lambda: pkmcal.correct("triglide", grid=GRID, redundant="none"), "--redundant"),
        (lambda: pkmcal.diagnose("triglide", TRIGLIDE_DATA, alpha=2.0), "alpha"),
        (lambda: pkmcal.shipped("nothing.csv"), "no shipped file"),
    ],
)
def test_what_is_wrong_is_told(wrong: Callable[[], object], text: str) -> None:
    with pytest.raises(pkmcal.PkmcalError) as caught:
        wrong()
    assert text in caught.value.text()


def test_faults_of_a_table_have_their_cells() -> None:
    """All of them at once, in the table's own lines: the header is the first."""
    table = pd.read_csv(TRIGLIDE_DATA, comment="#").astype(object)
    table.iloc[2, 1], table.iloc[5, 2] = "12,3 mm", float("inf")
    with pytest.raises(pkmcal.BadInput) as caught:
        pkmcal.calibrate("triglide", table)
    places = {(f.where.file, f.where.line) for f in caught.value.faults if f.where}
    assert places == {("table", 4), ("table", 7)}
    with pytest.raises(pkmcal.BadInput, match="duplicate column"):
        pkmcal.calibrate("triglide", pd.concat([table, table], axis=1))


def test_odd_tables_are_read_as_they_are_meant() -> None:
    """Lines in texts, numbers that may be absent, an index with the name of a column, names in a list."""
    raw = pd.read_csv(TRIGLIDE_DATA, comment="#")
    plain = pkmcal.calibrate("triglide", raw, select="l1,l2", holdout="none").parameters
    odd = (
        raw.assign(id=[f'p"{k}",\n{k}' for k in range(len(raw))]),
        raw.convert_dtypes(),
        raw.set_index("id", drop=False),
        raw.assign(time=pd.date_range("2026-05-04", periods=len(raw), freq="min", tz="Europe/Berlin")),
    )
    for table in odd:
        again = pkmcal.calibrate("triglide", table, select=["l1", "l2"], holdout="none").parameters
        assert again.value.equals(plain.value)


def test_a_result_that_cannot_be_used_warns() -> None:
    """Readings in mm called m: no parameters make sense of them, and who calls is told."""
    raw = pd.read_csv(TRIGLIDE_DATA, comment="#")
    label = next(c for c in raw.columns if c.startswith("y"))
    raw[label] = raw[label] + 40 * np.sin(np.arange(len(raw)))
    with pytest.warns(pkmcal.PkmcalWarning, match="IMPLAUSIBLE|NOT CONVERGED"):
        found = pkmcal.calibrate("triglide", raw, holdout="none")
    assert not found.ok and found.status in ("implausible", "not_converged")


def test_pictures_are_figures(found: pkmcal.Calibration, tmp_path: Path) -> None:
    """One panel for each channel, with axes that name quantity and unit."""
    from matplotlib.figure import Figure

    results = [
        found, pkmcal.simulate("triglide", grid=GRID), pkmcal.observe("triglide", grid=GRID),
        pkmcal.correct("triglide", grid=GRID, parameters=found),
    ]  # fmt: skip
    for result in results:
        figure = result.plot()
        assert isinstance(figure, Figure)
        figure.savefig(tmp_path / "p.svg")
    labels = [ax.get_ylabel() for ax in found.plot().axes]
    assert labels == ["x [um]", "y [um]"]


def test_a_force_controlled_drive_and_labels_come_through() -> None:
    """The hangprinter: motors in degrees, forces without unit, columns with names of their own."""
    found = pkmcal.calibrate("hangprinter", MACHINES / "hangprinter_2021-12-16.csv", holdout="none")
    again = pkmcal.calibrate("hangprinter", found.table, holdout="none")
    assert again.parameters.value.to_numpy() == pytest.approx(found.parameters.value.to_numpy(), rel=1e-7)


def test_an_observer_hears_of_every_step() -> None:
    rows = pkmcal.simulate(PLAIN, grid="x=200:700:4,y=200:350:3", noise="declared", seed=3).table
    steps: list[str] = []
    told = pkmcal.diagnose(PLAIN, rows, observer=lambda stage: steps.append(stage.name))
    assert steps and told.status in ("clean", "sigma_too_small", "unknown")
    assert told.table.shape[0] == told.residuals.shape[0] == 12
    done = clean(run("diagnose", PLAIN, "-", "--json", stdin=rows.to_csv(index=False)))
    ours = json.loads(json.dumps(told.json()))
    theirs = without(done.json)
    assert theirs.keys() == ours.keys() and theirs["verdict"] == ours["verdict"]
    assert theirs["chi2_per_dof_before"] == ours["chi2_per_dof_before"]


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
