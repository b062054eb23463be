"""`pkmcal diagnose` and `pkmcal effects`, run: the real machine, the shop-floor table, clean tables, odd tables."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import pytest

from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, SCISSORS, SHOPFLOOR, Done, clean, run, timeless
from tests.computed_once import run_once

SECOND = str(MACHINES / "hangprinter_2022-04-12.csv")
Rows = list[dict[str, str]]


@cache
def diagnosed(machine: str, *tables: str) -> Done:
    return clean(run_once("diagnose", machine, *tables, "--json"))


def names(done: Done) -> set[str]:
    return {f"{e['effect']} {e['at']}" for e in done.json["effects"]}


def value(done: Done, name: str) -> tuple[float, float, str]:
    """An effect's parameter: value, standard uncertainty, unit."""
    (found,) = (p for e in done.json["effects"] for p in e["parameters"] if p["name"] == name)
    return found["value"], found["std"], found["unit"]


def shopfloor(folder: Path, change: Callable[[int, dict[str, str]], dict[str, str]], rows: int = 80) -> str:
    """The shop-floor table with its rows changed."""
    with Path(SHOPFLOOR).open(encoding="utf-8") as file:
        table = [change(k, row) for k, row in enumerate(csv.DictReader(file)) if k < rows]
    return written(folder / "table.csv", table)


def written(file: Path, table: Rows) -> str:
    with file.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, table[0].keys())
        writer.writeheader()
        writer.writerows(table)
    return str(file)


def without(*starts: str) -> Callable[[int, dict[str, str]], dict[str, str]]:
    return lambda _, row: {h: c for h, c in row.items() if not h.startswith(starts)}


# --- what is there is found ----------------------------------------------------------------
@pytest.mark.parametrize("table", [HANGPRINTER_DATA, pytest.param(SECOND, marks=pytest.mark.slow)])
def test_hangprinter_radius_and_build_up(table: str) -> None:
    """The maker's own model has line that builds up on spools by its length: they shrink as it unwinds.

    Two radii are larger than stated, by 1 % in both sessions, though in the second scales of the drives would do too.
    """
    done = diagnosed(HANGPRINTER, table)
    (spools,) = (e["parameters"] for e in done.json["effects"] if e["effect"] == "buildup")
    assert len(spools) == 4 and all(p["value"] < 0 for p in spools)
    assert done.json["chi2_per_dof_before"] > 8 * done.json["chi2_per_dof_after"]
    assert names(done) == {"release R_low", "release R_high", "buildup each"}
    assert done.json["verdict"] == ("ambiguous" if table == SECOND else "found")
    for name in ("R_low", "R_high"):
        radius, std, unit = value(done, name)
        assert unit == "mm" and 75.4 < radius < 76.4 and 0.01 < std < 0.2


@pytest.mark.slow
def test_hangprinter_bad_row() -> None:
    """The row with index 17 of 2022-04-12, in line 19 of the file; at most one row more is suspected."""
    done = diagnosed(HANGPRINTER, SECOND)
    suspected = [(o["file"], o["line"]) for o in (*done.json["outliers"], *done.json["suspected"])]
    assert suspected[0] == (SECOND, 19) and len(suspected) <= 2
    assert Path(SECOND).read_text(encoding="utf-8").splitlines()[18].startswith("17,")
    assert f"row: {SECOND}:19" in done.err


def test_the_chance_that_is_told_is_that_on_which_the_words_rest(tmp_path: Path) -> None:
    """Play that 231 rows show a little of each: the sum of squares is that of noise, the shape is not."""
    worn, table = tmp_path / "worn.yaml", tmp_path / "t.csv"
    machine, poses = MACHINES / "triglide-nonredundant.yaml", MACHINES / "triglide-nonredundant.csv"
    worn.write_text(f"extends: {machine}\neffects: {{backlash@q2: {{b: 13.5 um}}}}\n")
    assert run("simulate", worn, poses, "--noise", "declared", "--seed", "1", "-o", table).code == 0
    done = diagnosed(str(machine), str(table))
    (found,) = done.json["effects"]
    assert names(done) == {"backlash q2"} and found["evidence"] > 10 and "overwhelming" in done.err
    told = re.search(r", p (\S+) by the shape of backlash@q2\)\.", done.err)
    assert told is not None and done.json["p_value"] > 0.1 > 1e-5 > float(told[1])
    assert float(told[1]) == pytest.approx(found["p_value"], rel=0.5)
    ends = re.search(r"Found near the limit of detection.*?: 95 % interval (\S+) um to (\S+) um\.", done.err)
    assert ends is not None and 0 <= float(ends[1]) < 13.5 < float(ends[2]), "the planted size is in the interval"


@pytest.mark.parametrize(
    ("sigma", "words"),
    [("9.9 um", "residuals agree with the stated noise"), ("9.5 um", "residuals are larger than the stated noise")],
)
def test_residuals_beyond_the_noise_agree_with_it_nowhere(sigma: str, words: str, tmp_path: Path) -> None:
    """At 1.09 times the stated noise with 456 degrees of freedom a calibration is incomplete."""
    machine = tmp_path / "m.yaml"
    base = MACHINES / "triglide-nonredundant"
    machine.write_text(f"extends: {base}.yaml\nsensors: {{tracker: {{sigma: {sigma}}}}}\n", encoding="utf-8")
    for command in ("diagnose", "improve"):
        done = run(command, machine, f"{base}.csv")
        assert done.code == 0 and words in done.err, done.err


def test_what_is_far_beyond_its_range_is_found_last_and_said_to_be_unusual(tmp_path: Path) -> None:
    """Play of 8 mm on a machine of 4 m whose lines are measured to 1 mm: a usual one of 0.3 mm nobody could see."""
    worn, table = tmp_path / "worn.yaml", tmp_path / "t.csv"
    worn.write_text(f"extends: {HANGPRINTER}\neffects: {{backlash@A: {{b: 8 mm}}}}\n")
    assert run("simulate", worn, SECOND, "--noise", "declared", "--seed", "3", "-o", table).code == 0
    done = diagnosed(HANGPRINTER, str(table))
    assert names(done) == {"backlash A"}
    found, std, unit = value(done, "backlash@A.b")
    assert unit == "um" and abs(found - 8000) < 2 * std < 1500  # 0.34 mm by noise, 0.52 mm by what is not identified
    assert "its size is beyond the plausible range" in done.err and done.json["effects"][0]["provisional"]
    (shown,) = (d for d in done.json["invisible"] if (d["effect"], d["at"]) == ("backlash", "B"))
    assert shown["effect"] == "backlash", "what cannot be seen within its range is still told"


def test_shop_floor() -> None:
    """What its generator planted: play of the third drive, rods that grow, one bad row; and no more."""
    done = diagnosed(SCISSORS, SHOPFLOOR)
    assert (done.code, done.json["verdict"]) == (1, "found")
    assert names(done) == {"backlash q3", "thermal_strut all"}
    for name, true, unit in (("backlash@q3.b", 12.0, "um"), ("thermal_strut@all.a", 9.0, "um/(m*K)")):
        found, std, shown = value(done, name)
        assert shown == unit and abs(found - true) < 3 * std < 0.1 * true
    assert [o["id"] for o in done.json["outliers"]] == ["p37"]
    assert done.json["chi2_per_dof_after"] < 1.3
    assert all(len(e["credible_set"]) == 1 and e["confirmed"] for e in done.json["effects"])


@pytest.mark.parametrize(
    "name",
    [*("biglide", "scissors", "triglide", "triglide-nonredundant"), pytest.param("delta4", marks=pytest.mark.slow)],
)
def test_clean_tables_are_clean(name: str) -> None:
    done = diagnosed(str(MACHINES / f"{name}.yaml"), str(MACHINES / f"{name}.csv"))
    assert (done.code, done.json["verdict"]) == (0, "clean")
    assert done.json["effects"] == done.json["outliers"] == done.json["unknown"] == []


@pytest.mark.slow
def test_one_seed_one_result() -> None:
    first, again = (run("diagnose", SCISSORS, SHOPFLOOR, "--json", "--seed", 3) for _ in range(2))
    assert timeless(first.out) == timeless(again.out) and first.err == again.err
    assert first.json["seed"] == 3


# --- what is shown -------------------------------------------------------------------------
def test_sentences_are_about_places_of_the_machine() -> None:
    shown = diagnosed(SCISSORS, SHOPFLOOR).err
    assert "Cause: Every member grows with temperature." in shown
    assert "Cause: The nut, end bearing, belt or gear of q3 has play." in shown
    spools = diagnosed(HANGPRINTER, HANGPRINTER_DATA).err
    assert "The effective radius of the spool of every drive changes by" in spools
    assert " of all " not in shown + spools and "all grows" not in shown


@pytest.mark.parametrize("table", [SHOPFLOOR, HANGPRINTER_DATA])
def test_sizes_are_readable(table: str) -> None:
    """No powers of ten, no unit 1, nothing cut off."""
    shown = diagnosed(SCISSORS if table == SHOPFLOOR else HANGPRINTER, table).err
    assert "e+0" not in shown and "\u2026" not in shown and " 1  " not in shown
    assert shown.count("not testable:") < 8, "one line for each thing that is needed"


def test_narrow_terminals_show_names_and_sizes_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pkmcal_cli.report.console._WIDTH", 80)
    shown = clean(run_once("diagnose", SCISSORS, SHOPFLOOR)).err
    causes = shown.partition("Causes")[2].partition("bad row")[0]
    assert re.search("thermal growth +all", causes) and "um/(m*K)" in causes and "\u2026" not in causes
    assert "not shown in 80 columns: share, evidence" in causes
    assert "unequal_backlash" in run("effects", SCISSORS).err


def test_commands_to_go_on_with_can_be_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """`plan` with the machine and table of the diagnosis, in which few ways are tried; stdin has no name."""
    monkeypatch.setattr("pkmcal_cli.workflow.approaches._TRIES", 2)
    shown = diagnosed(SCISSORS, SHOPFLOOR).err
    (line,) = (row for row in shown.splitlines() if "points that would show one: " in row)
    words = line.partition("pkmcal ")[2].replace("EFFECT", "clearance@rod5").split()
    assert clean(run(*words, "--points", "1")).code == 0
    plain = MACHINES / "triglide-nonredundant.yaml"
    short = "".join(plain.with_suffix(".csv").read_text(encoding="utf-8").splitlines(keepends=True)[:230:10])
    piped = run("diagnose", plain, "-", stdin=short).err
    assert "MEAS.csv --aim EFFECT" in piped


def test_growth_at_a_constant_temperature_has_no_name(tmp_path: Path) -> None:
    still = shopfloor(tmp_path, lambda _, row: row | {"T [degC]": "20"})
    done = clean(run("diagnose", SCISSORS, still, "--json"))
    assert (done.code, done.json["verdict"], done.json["effects"]) == (1, "unknown", [])
    assert all(unknown["depends_on"] == "time" for unknown in done.json["unknown"])
    assert "Log temperatures of more parts" in done.err


def test_quiet_says_the_verdict_only_where_it_is_bad(tmp_path: Path) -> None:
    assert run_once("diagnose", SCISSORS, str(MACHINES / "scissors.csv"), "-q") == Done(0, "", "")
    bad = run_once("diagnose", SCISSORS, shopfloor(tmp_path, without("T ", "time", "dir")), "-q")
    assert bad.code == 1 and bad.err.count("\n") == 2 and bad.err.startswith("diagnosis: ")


# --- columns -------------------------------------------------------------------------------
def test_missing_columns_are_not_testable(tmp_path: Path) -> None:
    done = clean(run_once("diagnose", SCISSORS, shopfloor(tmp_path, without("T ", "time", "dir")), "--json"))
    needs = {n["effect"]: n["needs"] for n in done.json["not_testable"]}
    assert "`time`" in needs["drift"] and "temperature" in needs["thermal_strut"]
    assert "session" in needs["resetup"] and "spindle" in needs["runout"]
    assert "payload" not in needs, "without gravity no column would make it testable"
    assert done.code == 1 and done.json["verdict"] in ("unknown", "ambiguous")
    assert "thermal" not in str(done.json["effects"])
    assert "direction of q1, q2, q3, q4: taken from the order of the rows" in done.err


def test_gaps_in_a_column_are_told(tmp_path: Path) -> None:
    def gaps(k: int, row: dict[str, str]) -> dict[str, str]:
        return row | ({"T [degC]": ""} if k % 7 == 0 else {})

    done = clean(run("diagnose", SCISSORS, shopfloor(tmp_path, gaps, 15), "--json"))
    assert "column `T` is empty in 3 of 15 rows: effects that need it are not tested" in done.err
    assert "thermal_strut" in {n["effect"] for n in done.json["not_testable"]}


@pytest.mark.slow
def test_names_of_parts_do_not_matter(tmp_path: Path) -> None:
    """Rods and actuators called otherwise: the same effects under the new names."""
    other = tmp_path / "other.yaml"
    text = Path(SCISSORS).read_text(encoding="utf-8")
    other.write_text(text.replace("rod", "link_").replace("c3", "wagon"), encoding="utf-8")
    done = clean(run("diagnose", other, SHOPFLOOR, "--json"))
    assert names(done) == {"backlash q3", "thermal_strut all"}
    mine, theirs = value(done, "backlash@q3.b"), value(diagnosed(SCISSORS, SHOPFLOOR), "backlash@q3.b")
    assert mine[:2] == pytest.approx(theirs[:2], rel=1e-6)


def test_temperature_and_reference_shift_together(tmp_path: Path) -> None:
    """Rods at T with reference 20 degC are rods at T + 3 K with reference 23 degC."""
    warm = shopfloor(tmp_path, lambda _, row: row | {"T [degC]": f"{float(row['T [degC]']) + 3:.3f}"})
    fits = []
    for reference, table in ((20, SHOPFLOOR), (23, warm)):
        file = tmp_path / f"at{reference}.yaml"
        effect = f"thermal_strut@all: {{a: 0 um/(m*K), reference: {reference} degC}}"
        file.write_text(f"extends: {SCISSORS}\neffects: {{{effect}}}\n", encoding="utf-8")
        fits.append(run("calibrate", file, table, "--holdout", "none", "--json").json)
    one, other = ({p["name"]: p["value"] for p in f["parameters"]} for f in fits)
    assert one == pytest.approx(other, rel=1e-9)


# --- odd tables and options ----------------------------------------------------------------
@pytest.mark.parametrize("rows", [1, 3, 7])
def test_too_few_rows(tmp_path: Path, rows: int) -> None:
    done = clean(run("diagnose", SCISSORS, shopfloor(tmp_path, lambda _, row: row, rows)))
    assert done.code == 3 and "too few measurements" in done.err and "8 rows or more" in done.err


@pytest.mark.slow
def test_a_sigma_that_is_far_too_large_is_told(tmp_path: Path) -> None:
    table = shopfloor(tmp_path, lambda _, row: row | {"sigma.x [mm]": "1", "sigma.y [mm]": "1"})
    assert "sigma 1 mm, which is too large" in clean(run("diagnose", SCISSORS, table)).err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--alpha", "0"], "--alpha: 0 is not a false-alarm rate"),
        (["--alpha", "0.5"], "at most 0.2"),
        (["--seed", "-1"], "--seed"),
        (["--select", "nothing"], "nothing"),
    ],
)
def test_wrong_options(options: Sequence[str], said: str) -> None:
    done = clean(run("diagnose", SCISSORS, SHOPFLOOR, *options))
    assert done.code == 2 and said in done.err and done.out == ""


def test_effects_lists_places() -> None:
    done = clean(run("effects", SCISSORS, "--json"))
    at = {e["effect"]: e["at"] for e in done.json["effects"]}
    assert at["backlash"] == ["q1", "q2", "q3", "q4", "all"] and at["straight"] == ["left.x", "right.x"]
    assert "buildup" not in at and "preload" not in at, "it has no spools, and no force-controlled drives"
    everything = clean(run("effects"))
    assert everything.code == 0 and "buildup" in everything.err and "\u2026" not in everything.err
