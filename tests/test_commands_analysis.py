"""`pkmcal sensitivity` and `pkmcal observability`: the paper's figures, strained poses, selections, verdicts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.command import GRID, HANGPRINTER, MACHINES, SCISSORS, TRIGLIDE, TRIGLIDE_DATA, run

NONREDUNDANT = str(MACHINES / "triglide-nonredundant.yaml")
PAPER_GRID = "x=0:950:3,y=160:390:77"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("one.csv").write_text("q1,q2,q3\n116.33,603.67,946.83\n")


def ranked(*arguments: str) -> dict[str, Any]:
    done = run("sensitivity", *arguments, "--json", "-q")
    assert done.code == 0, done.err
    return {p["name"]: p for p in done.json["parameters"]}


def test_condition_number_of_the_paper_without_and_with_the_guides_turn() -> None:
    """Triglide non-redundant, 3 x 77 grid: 60.06 and 3139."""
    without = run("observability", NONREDUNDANT, "--grid", PAPER_GRID, "--json").json
    with_gamma = run("observability", NONREDUNDANT, "--grid", PAPER_GRID, "--select", "auto,gamma", "--json").json
    assert without["condition_number"] == pytest.approx(60.06, abs=0.005)
    assert with_gamma["condition_number"] == pytest.approx(3139, abs=0.5)
    assert without["n_rows"] == 231 and without["n_values"] == 462 and without["rank"] == 6


def test_observability_promises() -> None:
    done = run("observability", TRIGLIDE, "--grid", GRID, "--select", "l*", "--json")
    found = done.json
    assert done.code == 0
    assert {"condition_number", "condition_number_whitened", "rank", "singular_values", "O1", "O2", "O3", "O4", "O5",
            "parameters", "undetermined"} <= found.keys()  # fmt: skip
    assert {"name", "std"} <= found["parameters"][0].keys()
    s = found["singular_values"]
    assert s == sorted(s, reverse=True) and found["condition_number_whitened"] == pytest.approx(s[0] / s[-1])
    assert found["O2"] == pytest.approx(s[-1] / s[0]) and found["O3"] == s[-1]
    for text in ("standard uncertainty", "condition number", "O1", "singular values", "rank"):
        assert text in done.err


def test_the_papers_condition_number_is_of_positions_only() -> None:
    hexapod = run("observability", MACHINES / "hexapod7.yaml", "--json", "-q").json
    assert hexapod["condition_number"] is None


def test_undetermined_combinations_are_told_with_a_remedy() -> None:
    done = run("observability", TRIGLIDE, "one.csv", "--select", "l1,xb1r", "--json")
    assert done.code == 1
    assert [p["std"] for p in done.json["parameters"]] == [None, None]
    assert done.json["undetermined"][0]["kind"] == "null" and done.json["rank"] == 1
    assert "undetermined: l1" in done.err and "fix one of them" in done.err
    assert "named in --select but undetermined: l1, xb1r" in done.err
    assert run("observability", TRIGLIDE, "one.csv").code == 0, "nothing was asked for by name"


def test_a_stiffness_without_influence_is_told() -> None:
    done = run("observability", NONREDUNDANT, "--grid", PAPER_GRID, "--select", "auto,k1")
    assert done.code == 1 and "k1 has no effect on these readings\nhelp: leave it out" in done.err


def test_nothing_determined_is_a_negative_verdict() -> None:
    done = run("observability", NONREDUNDANT, "--grid", PAPER_GRID, "--select", "k*")
    assert done.code == 1 and "determine none of the selected parameters" in done.err


def test_sensitivities_are_ranked_per_range_in_position_and_orientation() -> None:
    done = run("sensitivity", SCISSORS, "--grid", "x=-203:203:10,y=-200:200:8", "--json")
    parameters = done.json["parameters"]
    shifts = [p["position"] for p in parameters]
    assert done.code == 0 and shifts == pytest.approx(sorted(shifts, reverse=True), rel=1e-9)  # ties go by name
    assert {"name", "position", "orientation", "unit"} <= parameters[0].keys()
    assert all(p["unit"] == "mm" and p["orientation"] > 0 for p in parameters)
    assert {p["name"] for p in parameters} >= {"l1", "k5", "g2"}, "all parameters by default"
    assert "\u2588" in done.err, "bars"


def test_doubling_a_range_doubles_its_sensitivity() -> None:
    text = Path(TRIGLIDE).read_text().replace("  l1: 300\n", "  l1: {nominal: 300, range: 0.2}\n")
    Path("wide.yaml").write_text(text)
    assert ranked("wide.yaml")["l1"]["position"] == pytest.approx(2 * ranked(TRIGLIDE)["l1"]["position"])


def test_a_strained_working_point_makes_stiffness_felt() -> None:
    """At nominal geometry without load below 1e-9 um; with an actuator off its set value clearly not."""
    free, strained = ranked(TRIGLIDE), ranked(TRIGLIDE, "--offset", "q1=50 um", "--offset", "q3=-0.05")
    assert all(free[k]["position"] < 1e-9 for k in ("k1", "k2", "k3"))
    assert all(strained[k]["position"] > 1e-5 for k in ("k1", "k2", "k3"))


def test_an_offset_without_unit_is_in_the_actuators() -> None:
    assert ranked(TRIGLIDE, "--offset", "q1=0.05") == ranked(TRIGLIDE, "--offset", "q1=50 um")


def test_parameter_files_set_the_working_point() -> None:
    Path("p.yaml").write_text("parameters: {l3: 600.2}\n")
    assert ranked(TRIGLIDE, "-p", "p.yaml")["k3"]["position"] > 1e-4
    strained = run("observability", TRIGLIDE, "--grid", GRID, "-p", "p.yaml", "--select", "l1,k3", "--json").json
    free = run("observability", TRIGLIDE, "--grid", GRID, "--select", "l1,k3", "--json").json
    assert strained["rank"] == 2 > free["rank"]


def test_without_poses_the_drawing_is_taken_and_it_is_said() -> None:
    for command in ("sensitivity", "observability"):
        done = run(command, TRIGLIDE, "--json")
        assert done.json["n_rows"] == 1 and "note: no poses given: only the reference configuration is used" in done.err


def test_a_table_of_measurements_serves_as_poses() -> None:
    done = run("observability", TRIGLIDE, TRIGLIDE_DATA, "--json")
    assert done.json["n_rows"] == 231
    assert "the actuator columns give the poses; the TCP coordinates are not used" in done.err


def test_rows_out_of_reach_are_named() -> None:
    Path("far.csv").write_text("id,x,y\na,300,250\nb,300,9000\n")
    for command in ("sensitivity", "observability"):
        done = run(command, TRIGLIDE, "far.csv")
        assert done.code == 3 and "far.csv:3: error[row]: row `b`: out of reach" in done.err
        grid = run(command, TRIGLIDE, "--grid", "x=300:300:1,y=250:9000:2", "--json")
        assert grid.code == 0 and "skipped: 1 of 2 grid points: out of reach" in grid.err
        assert (grid.json["n_rows"], grid.json["n_failed"], grid.json["failed"][0]["line"]) == (1, 1, 2)


def test_rows_that_do_not_close_are_named() -> None:
    Path("open.csv").write_text("q1,q2,q3\n117,9000,947\n")
    for command in ("sensitivity", "observability"):
        done = run(command, TRIGLIDE, "open.csv")
        assert done.code == 3 and "open.csv:2: error[row]: out of reach: the mechanism cannot be assembled" in done.err


@pytest.mark.parametrize(
    ("offset", "told"),
    [
        ("q9=1 um", "the machine has no actuator `q9`"),
        ("q1", "`q1` is not an offset"),
        ("q1=", "not a number with a unit"),
        ("q1=1 deg", "the unit of `1 deg` does not fit `q1`"),
        ("q1=1e400", "too large"),
        ("=1", "no actuator ``"),
    ],
)
def test_offsets_that_mean_nothing(offset: str, told: str) -> None:
    done = run("sensitivity", TRIGLIDE, "--offset", offset)
    assert done.code == 2 and told in done.err


def test_a_force_controlled_drive_has_no_set_value_to_offset() -> None:
    done = run("sensitivity", HANGPRINTER, "--offset", "D=1 deg")
    assert done.code == 2 and "force-controlled" in done.err


@pytest.mark.parametrize("select", ["nope", "", ",", "-l1", "all,-*", "l[1"])
def test_selections_that_choose_nothing(select: str) -> None:
    done = run("sensitivity", TRIGLIDE, "--select", select)
    assert done.code == 2 and "--select" in done.err


def test_machines_without_what_an_analysis_needs() -> None:
    text = Path(TRIGLIDE).read_text()
    Path("blind.yaml").write_text(text[: text.index("sensors:")])
    blind = run("observability", "blind.yaml")
    assert blind.code == 3 and "the machine has no sensors: nothing can be measured with it" in blind.err
    assert "the machine has no tool point" in run("sensitivity", "blind.yaml").err
    Path("seeing.yaml").write_text("extends: blind.yaml\ntool_point: tcp\n")
    assert run("sensitivity", "seeing.yaml").code == 0
    Path("numbers.yaml").write_text(
        "units: {length: mm}\nspace: planar\nground: {o: [0, 0]}\nguides: {r: {along: x}}\n"
        "bodies: {c: {guide: r, at: 0}}\nactuators: {q: {moves: c}}\n"
        "sensors: {s: {at: c, reads: [x], sigma: 1 um, frame: machine}}\n".replace("ground: {o: [0, 0]}\n", "")
    )
    none = run("sensitivity", "numbers.yaml")
    assert none.code == 2 and "the machine has no parameters" in none.err
    Path("fixed.yaml").write_text(Path(HANGPRINTER).read_text().replace("range: 50}", "range: 50, identify: false}"))
    fixed = run("observability", "fixed.yaml")
    assert fixed.code == 2 and "every parameter is declared `identify: false`" in fixed.err


@pytest.mark.parametrize("select", ["auto,-k*", "all"])
def test_rank_and_condition_tell_of_the_measurement_and_what_is_undetermined_of_the_fit(
    select: str, tmp_path: Path
) -> None:
    """The former are what `observability` tells of the same positions and values, by the ranges of the machine file.

    Ranges a hundredth of what they should be are estimated as larger ones: the fit then determines more.
    """
    tight, params = tmp_path / "tight.yaml", tmp_path / "p.yaml"
    tight.write_text(f"extends: {TRIGLIDE}\nranges: {{length: 2e-3}}\n", encoding="utf-8")
    options = (tight, TRIGLIDE_DATA, "--select", select)
    done = run("calibrate", *options, "--holdout", "none", "-o", params, "--json").json
    plan = run("observability", *options, "-p", params, "--json").json
    assert done["uncertainty"]["ranges"]["factors"]["length"] > 3
    assert done["rank"] == plan["rank"]
    assert (done["condition_number"] is None) == (plan["condition_number_whitened"] is None) == (select == "all")
    if select != "all":
        assert done["condition_number"] == pytest.approx(plan["condition_number_whitened"], rel=1e-2)
    assert 0 < len(done["undetermined"]) < len(plan["undetermined"])
