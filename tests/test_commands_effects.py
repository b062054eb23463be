"""`pkmcal effects --simulate`, run: an effect moves what `simulate` shows where it is declared."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects import catalogue
from tests.command import HANGPRINTER, SCISSORS, SHOPFLOOR, TRIGLIDE, TRIGLIDE_DATA, Done, clean, run
from tests.csv_tables import read_table
from tests.elastic_guide import sliders
from tests.in_ci import in_ci

POSES = ("--grid", "x=300:500:4,y=220:330:3")
HANGING = (HANGPRINTER, "--grid", "x=-200:200:2,y=-100:300:2,z=400:400:1")
LOADED = "    loads: {hose: {at: tcp, force: [300, -200]}}\n"
SILENT = (
    "no gravity",
    "it needs column `time`",
    "no drive winds a spool",
    "no drive turns",
    "no force-controlled drive",
)


@cache
def simulated(*arguments: str) -> dict[str, Any]:
    """What the command prints as JSON."""
    done = clean(run("effects", *arguments, "--simulate", "--json"))
    assert done.code == 0, done.err
    found: dict[str, Any] = done.json
    return found


def by_name(*arguments: str) -> dict[str, dict[str, Any]]:
    """Its effects by name; those without a place by keyword."""
    return {e["effect"] + (f"@{e['at']}" if e["at"] else ""): e for e in simulated(*arguments)["simulated"]}


def readings(folder: Path, machine: str, poses: str) -> dict[str, Array]:
    """What `simulate` writes, by column."""
    out = folder / "out.csv"
    done = run("simulate", machine, poses, "-o", out, "--force", "-q")
    assert done.code == 0, done.err
    table = read_table(out)
    return dict(table.numbers)


LONG = ("zero@q2", "pitch_curve@q4", "drift@grid", "thermal_foot@left")
DECLARED = ["zero@q2", "backlash@q1", "scale@all", "pitch_curve@q4", "unequal_backlash@q3", "straight@left.x",
            "guide_angle@right.x", "carriage_angle@c2.rz", "thermal_strut@rod3", "thermal_foot@left", "zero_drift@q1",
            "thermal_screw@q2", "frame@grid", "drift@grid", "meas_shear@grid", "tool_load@grid",
            "tool@grid"]  # fmt: skip


@pytest.mark.parametrize("name", in_ci([name for name in DECLARED if name not in LONG], DECLARED))
def test_it_moves_what_it_moves_where_it_is_declared(tmp_path: Path, name: str) -> None:
    """Every parameter at its size, every reading: largest and rms change over the rows of a table."""
    found = by_name(SCISSORS, SHOPFLOOR)[name]
    still = readings(tmp_path, SCISSORS, SHOPFLOOR)
    assert {p["name"].partition(".")[0] for p in found["parameters"]} == {name.partition(".")[0]}
    for parameter in found["parameters"]:
        key, size = parameter["name"].rpartition(".")[2], f"{parameter['size']} {parameter['unit']}"
        file = tmp_path / "m.yaml"
        file.write_text(f"extends: {SCISSORS}\neffects:\n  {name}: {{{key}: {size}}}\n")
        moved = readings(tmp_path, str(file), SHOPFLOOR)
        for reading in parameter["readings"]:
            change = moved[reading["name"]] - still[reading["name"]]
            assert reading["max"] == pytest.approx(np.abs(change).max(), abs=1e-9)  # mm
            assert reading["rms"] == pytest.approx(np.sqrt((change**2).mean()), abs=1e-9)
    assert not any(p["name"].endswith(".n0") for p in found["parameters"]), "where the line lies is no error"
    most = max(r["rms"] for p in found["parameters"] for r in p["readings"])
    assert found["rms"] == pytest.approx(most, rel=2e-9), "of equals the first"
    assert found["parameter"] in {p["name"] for p in found["parameters"]}


@pytest.mark.parametrize("machine", [SCISSORS, TRIGLIDE, pytest.param(HANGPRINTER, marks=pytest.mark.slow)])
def test_every_effect_is_there_with_a_size_or_a_reason(machine: str) -> None:
    """At every place that the machine has for it, once."""
    every = simulated(machine)["simulated"]
    assert {e["effect"] for e in every} == set(catalogue())
    names = [(e["effect"], e["at"]) for e in every]
    assert len(set(names)) == len(names)
    listed = {e["effect"]: e["at"] for e in run("effects", machine, "--json").json["effects"]}
    for effect, at in listed.items():
        places = {place for place in at if "SESSION" not in place}
        assert places <= {p for e, p in names if e == effect} or effect == "resetup"
    for e in every:
        assert e["status"] in ("moves", "taken_up", "nothing") and (e["reason"] is None) == (e["status"] == "moves")
        assert (e["reading"] is None) == (e["status"] == "nothing") == (e["unit"] is None)
        assert e["reading"] is None or e["max"] >= e["rms"] > 0


def test_a_shipped_machine_is_called_by_its_name() -> None:
    assert clean(run("effects", "scissors")).out == clean(run("effects", SCISSORS)).out


@pytest.mark.slow
def test_most_comes_first_in_standard_uncertainties() -> None:
    """The camera of the hangprinter is known to 0.1 mm, its drive D to 1 mm of line."""
    sizes = []
    for e in simulated(*HANGING)["simulated"]:
        if e["reading"] is not None:
            line = 75 * 20 / 255 / 4 * np.pi / 180  # mm per degree
            sizes.append(e["rms"] / 0.1 if e["unit"] == "mm" else e["rms"] * line / 1.0)
            assert e["unit"] in ("mm", "deg")
    assert len(sizes) > 30 and sizes == sorted(sizes, reverse=True)


def test_reasons_are_those_of_the_machine(tmp_path: Path) -> None:
    found = by_name(TRIGLIDE, *POSES)
    assert found["sag"]["reason"] == found["payload"]["reason"] == found["self_weight"]["reason"] == "no gravity"
    assert found["buildup"]["reason"] == "no drive winds a spool" and found["gear"]["reason"] == "no drive turns"
    assert found["preload"]["reason"] == "no force-controlled drive"
    assert found["thermal_base"]["reason"] == "every part of the base is at its origin"
    assert found["zero_drift@q1"]["reason"] == found["drift@tracker"]["reason"] == "it needs column `time`"
    assert found["thermal_strut@rod2"]["reason"].startswith("it needs column `T`")
    assert found["resetup"]["reason"] == "it needs at least two sessions"
    assert "`period`" in found["pitch@q1"]["reason"]
    assert (
        found["stiffness@rod1"]["reason"] == found["clearance@rod1"]["reason"] == "nothing is strained at these poses"
    )
    assert "looks at" not in str(found) and by_name(*HANGING)["straight"]["reason"].startswith("no drive moves")
    file = tmp_path / "m.yaml"
    file.write_text(sliders("", LOADED))
    strained = by_name(str(file))
    assert strained["stiffness@rod1"]["status"] == "moves" and strained["windup@q1"]["status"] == "moves"
    assert strained["clearance@rod2"]["max"] > 0.01  # mm, of 60 um


def test_what_parameters_take_up_is_told_with_their_names(tmp_path: Path) -> None:
    """The zero of a drive where the machine file has a parameter for it, and no longer where that is held."""
    file = tmp_path / "m.yaml"
    parameters = "parameters: {o1: {nominal: 0, range: 1}}\nactuators: {q1: {zero: o1}}\n"
    file.write_text(f"extends: {SCISSORS}\n{parameters}")
    grid = ("--grid", "x=-250:250:7,y=-200:200:7")
    free = by_name(str(file), *grid)["zero@q1"]
    held = by_name(str(file), *grid, "--select", "auto,-o1")["zero@q1"]
    assert free["status"] == "taken_up" and free["taken_up_by"][0] == "o1" and "o1" in free["reason"]
    assert held["status"] == "moves" and free["rms"] == held["rms"] > 0.1


def test_a_declared_effect_is_not_simulated_again(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(f"extends: {SCISSORS}\neffects:\n  backlash@q1: {{b: 20 um}}\n  zero@q1[s2]: {{o: 20 um}}\n")
    found = by_name(str(file))
    for name in ("backlash@q1", "zero@q1[s2]"):
        assert found[name]["status"] == "nothing" and found[name]["reason"] == "the machine file declares it"
    assert found["backlash@q2"]["status"] == "moves" and found["zero@q1"]["status"] == "taken_up"


def test_sessions_of_a_table(tmp_path: Path) -> None:
    """In one session of two, a zero moves half of the rows: rms by the square root of two less."""
    head, *lines = Path(TRIGLIDE_DATA).read_text().splitlines()[:41]
    file = tmp_path / "two.csv"
    file.write_text("\n".join([f"session,{head}", *(f"s{k % 2},{line}" for k, line in enumerate(lines))]))
    found = by_name(TRIGLIDE, str(file))
    assert "zero@q2[s0]" not in found, "the first of two sessions is the datum"
    one, every = ({r["name"]: r for r in found[n]["parameters"][0]["readings"]} for n in ("zero@q2[s1]", "zero@q2"))
    assert 0.5 < one["y"]["rms"] / every["y"]["rms"] < 0.9 and one["y"]["max"] <= every["y"]["max"] * (1 + 1e-9)
    assert found["resetup@s1"]["status"] in ("moves", "taken_up")


def shown(*arguments: str) -> Done:
    return clean(run("effects", *arguments, "--simulate"))


def test_every_number_of_the_table_has_a_unit() -> None:
    done = shown(SCISSORS, SHOPFLOOR)
    body = done.err.partition("Changes of readings")[2].partition("Moves nothing")[0]
    rows = [line for line in body.splitlines() if "@" in line]
    assert len(rows) > 60
    for line in rows:
        numbers = re.findall(r"  ([\d.]+(?:e-?\d+)?)(?: (\S+))?", line)
        units = [unit for _, unit in numbers]
        assert len(units) == 3 and all(units[1:]) and (units[0] or "stiffness@" in line), line


def test_it_says_which_poses_it_draws_and_always_the_same() -> None:
    one, other = shown(TRIGLIDE), shown(TRIGLIDE)
    assert one.code == 0 and one.err == other.err
    assert "no poses given: 30 are drawn within reach of the reference configuration" in one.err
    assert simulated(TRIGLIDE)["n_poses"] == 30 and simulated(TRIGLIDE, *POSES)["n_poses"] == 12


def test_drawn_poses_keep_the_limits_of_the_drives(tmp_path: Path) -> None:
    """A reversal error that grows to 80 um at the ends of the travel is nowhere larger."""
    file = tmp_path / "m.yaml"
    text = sliders("", LOADED)
    for name, low, high in (("q1", 225, 245), ("q2", 755, 775), ("q3", 1122, 1142)):
        text = text.replace(f"{name}: {{", f"{name}: {{limits: [{low}, {high}], ")
    file.write_text(text)
    narrow = by_name(str(file))
    assert simulated(str(file))["n_poses"] == 50  # spread between them, as over a workspace
    for q in ("q1", "q2", "q3"):
        ends, plain = narrow[f"unequal_backlash@{q}"], narrow[f"backlash@{q}"]
        assert 0 < ends["max"] <= plain["max"] * 80 / 60 * (1 + 1e-3)


def test_without_sensors_the_tcp_is_shown(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(re.sub(r" *sensors: .*\n", "", sliders("", LOADED)))
    done = shown(str(file))
    assert done.code == 0 and "coordinates of the TCP are shown instead" in done.err
    found = by_name(str(file))
    assert found["scale@q1"]["unit"] == "mm" and found["frame"]["reason"] == "no sensor looks at a point of the machine"
    assert not any(e["taken_up_by"] for e in found.values())


def test_a_machine_without_parameters_is_simulated(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    text = sliders("", LOADED).replace("k: k}", "k: 60 kN/mm}")
    text = re.sub(r"    parameters: .*\n.*\n", "", text).replace("ranges: {length: 0.1 mm}", "")
    for name, value in (("l1", 400), ("l2", 400), ("l3", 700), ("b1", 50), ("b2", 50), ("b3", 50)):
        text = re.sub(rf"\b{name}\b", str(value), text)
    file.write_text(text)
    found = by_name(str(file))
    assert found["zero@q1"]["status"] == "moves" and not any(e["taken_up_by"] for e in found.values())


WRONG = [
    (["--simulate"], 2, "--simulate needs a machine file"),
    ([TRIGLIDE, *POSES], 2, "add `--simulate`"),
    ([TRIGLIDE, TRIGLIDE_DATA], 2, "add `--simulate`"),
    ([TRIGLIDE, "-p", "nothing.yaml"], 2, "add `--simulate`"),
    ([TRIGLIDE, "--simulate", "--select", "nonsense"], 2, "no parameter `nonsense`"),
    ([TRIGLIDE, TRIGLIDE_DATA, "--simulate", *POSES], 2, "give either"),
    ([TRIGLIDE, "--simulate", "--grid", "x=300:400:2,y=9000:9999:2"], 3, "out of reach"),
    ([TRIGLIDE, "nothing.csv", "--simulate"], 3, "does not exist"),
    ([TRIGLIDE, "--simulate", "-p", "nothing.yaml"], 3, "cannot be read"),
    (["nothing.yaml", "--simulate"], 3, "cannot be read"),
]


@pytest.mark.parametrize(("arguments", "code", "said"), WRONG)
def test_wrong_arguments_are_told(arguments: list[str], code: int, said: str) -> None:
    done = clean(run("effects", *arguments))
    assert done.code == code and said in done.err and done.out == ""
