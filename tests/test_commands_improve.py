"""`pkmcal improve`, run: what it gains on rows that had no part, the files that it writes, and what it refuses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
import yaml

from pkmcal_cli.diagnosis.closed_loop import improve
from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.report_rows import Interval, OuterFold
from pkmcal_cli.report.improvement import rms_change
from pkmcal_cli.units.unit_text import parse_unit
from pkmcal_cli.workflow import improve as improve_command
from tests.benchmark.setting import ready
from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, SCISSORS, SHOPFLOOR, Done, clean, run, timeless
from tests.computed_once import run_once
from tests.truth.campaigns import campaign, unit

pytestmark = pytest.mark.usefixtures("unsized")

CLEAN = str(MACHINES / "scissors.csv")
SOME = ("--only", "backlash@q3,thermal_strut@all")


@dataclass(frozen=True)
class Improved:
    """A run of the loop, the machine that it wrote and its parameters."""

    done: Done
    machine: Path
    parameters: Path


def improved(folder: Path, machine: str, table: str) -> Improved:
    target = folder / "better.yaml"
    done = clean(run_once("improve", machine, table, "-o", target, "--json"))
    return Improved(done, target, folder / "better.params.yaml")


@pytest.fixture(scope="module")
def hangprinter(tmp_path_factory: pytest.TempPathFactory) -> Improved:
    return improved(tmp_path_factory.mktemp("hangprinter"), HANGPRINTER, HANGPRINTER_DATA)


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Improved:
    return improved(tmp_path_factory.mktemp("shop"), SCISSORS, SHOPFLOOR)


@pytest.fixture
def halves(tmp_path: Path) -> tuple[Path, Path]:
    """The shop-floor table in two: every third row is kept apart."""
    head, *rows = Path(SHOPFLOOR).read_text(encoding="utf-8").splitlines(keepends=True)
    files = tmp_path / "use.csv", tmp_path / "apart.csv"
    for file, chosen in zip(files, ([0, 1], [2]), strict=True):
        file.write_text(head + "".join(r for k, r in enumerate(rows) if k % 3 in chosen), encoding="utf-8")
    return files


# --- the real machine ----------------------------------------------------------------------
@pytest.mark.slow
def test_hangprinter_is_improved_on_rows_that_had_no_part(hangprinter: Improved) -> None:
    """Line lengths: from 4.96 mm (all rows; more on rows apart) to less than the 1.38 mm of two radii alone."""
    result = hangprinter.done.json
    assert (hangprinter.done.code, result["verdict"], result["rotations"]) == (0, "improved", 5)
    accepted = {(s["effect"], s["at"]) for s in result["steps"] if s["accepted"]}
    assert accepted == {("release", "R_low"), ("release", "R_high"), ("buildup", "each")}
    assert not result["provisional"], "what else resamples could find of its last radius is far beyond its range"
    assert result["before"]["length"]["rms"] > 4.9 and result["after"]["length"]["rms"] < 1.22
    assert result["after"]["length"]["count"] == 100, "every row reports once"
    assert result["improvement"]["low"] > 0
    assert result["improvement"]["low"] < result["improvement"]["value"] < result["improvement"]["high"]
    falls = [s["report"]["length"]["rms"] for s in result["steps"]]
    assert falls == sorted(falls, reverse=True)
    assert all(s["fit"]["length"]["rms"] < s["report"]["length"]["rms"] for s in result["steps"])


@pytest.mark.slow
def test_the_written_machine_calibrates_to_less_than_any_radii(hangprinter: Improved) -> None:
    """On all rows: 0.97 mm; 1.14 mm is what two radii reach."""
    done = clean(run("calibrate", hangprinter.machine, HANGPRINTER_DATA, "--holdout", "none", "--json"))
    assert done.json["after"]["length"]["rms"] <= 0.97
    released = {p["name"] for p in done.json["parameters"] if p["identified"]}
    assert {"R_low", "R_high", "buildup@A.b", "buildup@B.b", "buildup@C.b", "buildup@D.b"} <= released


# --- the files -----------------------------------------------------------------------------
@pytest.mark.slow
@pytest.mark.parametrize("name", ["hangprinter", "shop"])
def test_the_files_work_in_every_command(name: str, request: pytest.FixtureRequest) -> None:
    made: Improved = request.getfixturevalue(name)
    table = HANGPRINTER_DATA if name == "hangprinter" else SHOPFLOOR
    assert made.done.json["machine"] == str(made.machine) and made.done.json["parameters"] == str(made.parameters)
    assert clean(run("check", made.machine, table)).code == 0
    seen = clean(run("observability", made.machine, table, "-p", made.parameters, "--json"))
    assert seen.code == 0
    simulated = clean(run("simulate", made.machine, table, "-p", made.parameters))
    assert simulated.code == 0 and simulated.out != clean(run("simulate", made.machine, table)).out
    again = clean(run("diagnose", made.machine, table, "--json"))
    assert not again.json["effects"], "nothing is found twice"


def test_the_improved_machine_calibrates_to_the_noise(shop: Improved, tmp_path: Path) -> None:
    """Without the bad row, what is left is the noise of the instrument."""
    head, *rows = Path(SHOPFLOOR).read_text(encoding="utf-8").splitlines(keepends=True)
    good = tmp_path / "good.csv"
    good.write_text(head + "".join(r for r in rows if not r.startswith("p37,")), encoding="utf-8")
    done = clean(run("calibrate", shop.machine, good, "--holdout", "none", "--json"))
    assert 0.7 < done.json["chi2_per_dof"] < 1.3
    assert 0.5 < done.json["after"]["position"]["rms"] * 1e3 < 0.85, "0.5 um in two coordinates"


def test_uncertainties_are_those_of_a_calibration_with_what_is_held(shop: Improved, tmp_path: Path) -> None:
    """Most lengths of the Scissors are held with a range of 0.1 mm: what they add is in the file, and jointly so."""
    again = clean(run("calibrate", shop.machine, SHOPFLOOR, "--loss", "tukey", "--holdout", "none", "--json"))
    calibrated = {p["name"]: p for p in again.json["parameters"] if p["identified"] and "@" not in p["name"]}
    written = yaml.safe_load(shop.parameters.read_text(encoding="utf-8"))
    assert len(calibrated) == 9
    for name, found in calibrated.items():
        assert found["std_by_held"] > 2 * found["std_by_data"], name
        assert written["parameters"][name]["std"] == pytest.approx(found["std"], rel=0.1), name
    names = written["correlations"]["names"]
    assert set(calibrated) < set(names) and len(names) > 30


def test_the_overlay_says_where_it_holds(shop: Improved) -> None:
    text = shop.machine.read_text(encoding="utf-8")
    assert text.startswith("# Written by `pkmcal improve`")
    for part in (
        "extends: ",
        "thermal_strut@all:",
        "backlash@q3:",
        "std: ",
        "log evidence",
        "T 15.4 to 24.3 degC",
    ):
        assert part in text


# --- simulated -----------------------------------------------------------------------------
def test_shop_floor_ends_at_the_noise(shop: Improved) -> None:
    result = shop.done.json
    assert (shop.done.code, result["verdict"], result["diagnosis"]) == (0, "improved", "found")
    assert [o["id"] for o in result["outliers"]] == ["p37"]
    assert result["chi2_before"] > 50 and 0.8 < result["chi2_after"] < 1.3
    assert result["after"]["position"]["rms"] < 0.8e-3 < 7e-3 < result["before"]["position"]["rms"]
    assert "position rms falls by 8." in shop.done.err and " um, 95 % interval: " in shop.done.err
    assert "added: backlash@q3.b 12.2" in shop.done.err


def test_rows_kept_apart_report(halves: tuple[Path, Path]) -> None:
    """With a validation file there is one rotation."""
    use, apart = halves
    first = clean(run("improve", SCISSORS, use, "--validation", apart, *SOME, "--json"))
    assert first.json["rotations"] == 1 and first.json["verdict"] == "improved"
    assert first.json["after"]["position"]["count"] == 26
    assert first.json["after"]["position"]["rms"] < 0.2 * first.json["before"]["position"]["rms"]
    assert first.json["machine"] is None and first.json["parameters"] is None


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes(halves: tuple[Path, Path]) -> None:
    use, apart = halves
    first, again = (clean(run("improve", SCISSORS, use, "--validation", apart, *SOME, "--json")) for _ in range(2))
    assert timeless(first.out) == timeless(again.out) and first.err == again.err


def test_nothing_to_improve(tmp_path: Path) -> None:
    target = tmp_path / "better.yaml"
    done = clean(run_once("improve", SCISSORS, CLEAN, "-o", target, "--json"))
    assert (done.code, done.json["verdict"], done.json["steps"]) == (0, "clean", [])
    assert "nothing to improve" in done.err and done.json["failures"] == []
    assert f"no effect was accepted: the machine in {target} is that of" in done.err and "unchanged" in done.err
    assert "written: " in done.err and "(effects" not in done.err
    assert "no effect was accepted" in target.read_text(encoding="utf-8"), "files are written either way"
    again = clean(run("calibrate", target, CLEAN, "--holdout", "none", "--json"))
    plain = clean(run("calibrate", SCISSORS, CLEAN, "--holdout", "none", "--json"))
    assert again.json["chi2_per_dof"] == pytest.approx(plain.json["chi2_per_dof"], rel=1e-9)


def test_values_of_a_fit_that_does_not_converge_are_not_passed_off_as_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, target = improve_command.improve, tmp_path / "better.yaml"

    def unsettled(*arguments: Any, **named: Any) -> Any:
        done = found(*arguments, **named)
        return replace(done, fit=replace(done.fit, status="not_converged"))

    monkeypatch.setattr(improve_command, "improve", unsettled)
    done = run("improve", SCISSORS, CLEAN, "--only", "backlash@q1", "-o", target, "--json")
    assert done.code == 1 and "does not converge: do not use its values" in done.err
    assert "implausible" in done.json["failures"]
    assert "status: not_converged" in target.with_suffix(".params.yaml").read_text(encoding="utf-8")


@pytest.mark.slow
def test_fails_on_what_is_asked_for(tmp_path: Path) -> None:
    """A step in time is in no catalogue: something is missing still, whatever was accepted."""
    lines = Path(CLEAN).read_text(encoding="utf-8").splitlines()
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    column = [cell.split(" ")[0] for cell in lines[head].split(",")].index("x")
    lines = [*lines[: head + 1], *lines[head + 1 :: 2]]
    for k in range(head + 1 + (len(lines) - head) // 2, len(lines)):
        cells = lines[k].split(",")
        cells[column] = f"{float(cells[column]) + 0.02:.6f}"
        lines[k] = ",".join(cells)
    stepped, target = tmp_path / "stepped.csv", tmp_path / "better.yaml"
    stepped.write_text("\n".join(lines) + "\n", encoding="utf-8")
    few = ("--only", "backlash@q1,windup@all")  # they explain nothing of it
    done = clean(run_once("improve", SCISSORS, stepped, *few, "-o", target, "--json"))
    assert done.code == 1 and "missing" in done.json["failures"] and target.exists()
    assert run_once("improve", SCISSORS, stepped, *few, "--fail-on", "none", "-q") == Done(0, "", "")
    told = clean(run_once("diagnose", SCISSORS, stepped, "--json"))
    assert told.code == 1 and told.json["verdict"] == "unknown"
    first, second = told.err[told.err.index("diagnosis:") :].splitlines()[:2]
    assert first.startswith("diagnosis: unknown; depends on ") and second.startswith("The residuals after calibration")
    assert run_once("diagnose", SCISSORS, stepped, "--fail-on", "found,ambiguous", "-q") == Done(0, "", "")
    for command, near, known in (("diagnose", "unknwn", "`unknown`"), ("improve", "mising", "`missing`")):
        wrong = clean(run(command, SCISSORS, stepped, "--fail-on", near))
        assert wrong.code == 2 and f"did you mean {known}?" in wrong.err
        both = clean(run(command, SCISSORS, stepped, "--fail-on", f"none,{known.strip('`')}"))
        assert both.code == 2 and "`none` stands alone" in both.err and "did you mean" not in both.err


# --- refused -------------------------------------------------------------------------------
def test_wrong_options(tmp_path: Path, halves: tuple[Path, Path]) -> None:
    existing = tmp_path / "there.yaml"
    existing.write_text("mine", encoding="utf-8")
    for options, code, said in (
        (["-o", "-"], 2, "-o M-improved.yaml"),
        (["-o", existing], 4, "--force"),
        (["--alpha", "3"], 2, "at most 0.2"),
        (["--validation", tmp_path / "none.csv"], 3, "none.csv"),
        (["-o", tmp_path / "no" / "folder.yaml"], 4, "folder"),
    ):
        done = clean(run("improve", SCISSORS, SHOPFLOOR, *options))
        assert done.code == code and said in done.err and done.out == "", options
    assert existing.read_text(encoding="utf-8") == "mine"


@pytest.mark.slow
def test_too_few_rows_to_keep_some_apart(tmp_path: Path, halves: tuple[Path, Path]) -> None:
    few = tmp_path / "few.csv"
    few.write_text(
        "".join(Path(SHOPFLOOR).read_text(encoding="utf-8").splitlines(keepends=True)[:13]), encoding="utf-8"
    )
    done = clean(run("improve", SCISSORS, few))
    assert done.code == 3 and "20 rows or more" in done.err
    assert clean(run("improve", SCISSORS, few, "--validation", halves[1])).code in (0, 1)


# --- rows that report ----------------------------------------------------------------------
@pytest.mark.slow
def test_report_rows_see_only_what_their_own_rotation_chose(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rotation that did not choose an effect reports without it, though most rotations chose it and it is added."""
    there = ready(campaign("scissors", [unit("scissors", "backlash", "q3", 4).scaled(0.6)], 4))
    arguments = (there.candidates, there.problem, there.selected, None, 0.005, 0)
    every = improve(*arguments)
    plain = OuterFold.chose
    first: list[OuterFold] = []

    def stubborn(fold: OuterFold, alike: tuple[Hypothesis, ...]) -> bool:
        first[:] = first or [fold]
        return fold.report is not first[0].report and plain(fold, alike)

    monkeypatch.setattr(OuterFold, "chose", stubborn)
    most = improve(*arguments)
    assert [h.name for h in most.accepted] == [h.name for h in every.accepted] == ["backlash@q3"]
    assert [s.chosen for s in most.steps] == [4] and [s.chosen for s in every.steps] == [5]
    assert most.before == every.before
    assert every.after.report["position"].rms < most.after.report["position"].rms < every.before.report["position"].rms


def test_an_error_that_grows_is_said_to_rise() -> None:
    """With the ends of its interval in the order of numbers; nothing falls by less than nothing."""
    um = parse_unit("um")
    assert rms_change(Interval(8e-6, 6e-6, 9e-6), um) == "falls by 8 um, 95 % interval: 6 um to 9 um"
    assert rms_change(Interval(-8e-6, -9e-6, 2e-6), um) == "rises by 8 um, 95 % interval: -2 um to 9 um"
