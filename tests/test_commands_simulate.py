"""`pkmcal simulate`: grids, tables, noise, methods, what is written and what is said."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from tests.command import (
    GRID,
    HANGPRINTER,
    HANGPRINTER_DATA,
    MACHINES,
    SCISSORS,
    TRIGLIDE,
    TRIGLIDE_DATA,
    clean,
    column,
    run,
    table,
)
from tests.in_ci import in_ci

QUICK = ("triglide", "hangprinter", "delta4")
POSES = "id,x,y\na,200,200\nb,300,250\nc,400,300\n"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("poses.csv").write_text(POSES)


def test_the_last_axis_of_a_grid_runs_fastest_and_both_ends_are_in() -> None:
    assert run("simulate", TRIGLIDE, "--grid", "x=200:700:3,y=200:350:4", "-o", "out.csv").code == 0
    x, y = column("out.csv", "x"), column("out.csv", "y")
    assert np.allclose(x, np.repeat([200, 450, 700], 4), atol=1e-4)
    assert np.allclose(y, np.tile([200, 250, 300, 350], 3), atol=1e-4)


def test_a_grid_has_many_rows_in_blocks_and_one_where_the_count_is_one() -> None:
    assert run("simulate", TRIGLIDE, "--grid", "x=200:700:200,y=200:350:200", "-o", "many.csv").code == 0
    y = column("many.csv", "y")
    assert len(y) == 40000 and np.allclose(y.reshape(200, 200), np.linspace(200, 350, 200), atol=1e-4)
    assert run("simulate", TRIGLIDE, "--grid", "x=300:700:1,y=250:250:1", "-o", "one.csv").code == 0
    assert column("one.csv", "x") == pytest.approx([300], abs=1e-4)


def test_other_coordinates_of_a_grid_are_those_of_the_drawing() -> None:
    assert run("simulate", TRIGLIDE, "--grid", "x=300:400:2", "-o", "out.csv").code == 0
    assert column("out.csv", "y") == pytest.approx([275, 275], abs=1e-4)


def test_limits_of_a_grid_may_have_units() -> None:
    assert run("simulate", TRIGLIDE, "--grid", "x=0.3 m:40 cm:2", "-o", "out.csv").code == 0
    assert column("out.csv", "x") == pytest.approx([300, 400], abs=1e-4)


def test_tcp_coordinates_are_driven_with_the_set_values_of_the_nominal_machine() -> None:
    """With other parameters the same set values reach another place (Ecorchard 2010, 4.1)."""
    Path("p.yaml").write_text("parameters: {l1: 300.5, yb2r: 100.2 mm}\n")
    assert run("simulate", TRIGLIDE, "poses.csv", "-o", "nominal.csv").code == 0
    assert run("simulate", TRIGLIDE, "poses.csv", "-p", "p.yaml", "-o", "moved.csv").code == 0
    for name in ("q1", "q2", "q3"):
        assert (column("nominal.csv", name) == column("moved.csv", name)).all()
    assert column("nominal.csv", "x") == pytest.approx([200, 300, 400], abs=1e-4)
    assert np.abs(column("moved.csv", "x") - column("nominal.csv", "x")).min() > 0.05


def test_actuator_positions_win_over_tcp_coordinates_and_it_is_said() -> None:
    Path("both.csv").write_text("q1,q2,q3,x,y\n117,603,947,1,2\n")
    done = run("simulate", TRIGLIDE, "both.csv", "-o", "out.csv")
    assert done.code == 0
    assert "the actuator columns give the poses; the TCP coordinates are not used" in done.err
    assert column("out.csv", "q1") == pytest.approx([117]) and column("out.csv", "x")[0] > 300


def test_a_table_without_a_coordinate_takes_the_drawings_and_says_so() -> None:
    Path("x.csv").write_text("x\n300\n")
    done = run("simulate", TRIGLIDE, "x.csv", "-o", "out.csv")
    assert "no column for `y`: the reference configuration is used" in done.err
    assert column("out.csv", "y") == pytest.approx([275], abs=1e-4)


def test_a_coordinate_that_does_not_move_freely_is_said_or_refused() -> None:
    Path("turned.csv").write_text("x,y,rz\n0,0,0.1\n")
    done = run("simulate", SCISSORS, "turned.csv", "-o", "out.csv")
    assert done.code == 0 and "not used: `rz`, which the mechanism does not move independently" in done.err
    assert "the table differs by up to 0.1 rad from the value that follows" in done.err
    refused = run("simulate", SCISSORS, "--grid", "rz=0:0.1:2")
    assert refused.code == 2 and "no degree of freedom moves `rz` of tool point `platform`" in refused.err


@pytest.mark.parametrize("machine", in_ci(QUICK, [*QUICK, "scissors", "hexapod7", "biglide"]))
def test_the_table_is_one_that_calibrate_reads(machine: str) -> None:
    """Its columns have the headers that the machine gives them, with units."""
    file = MACHINES / f"{machine}.yaml"
    data = HANGPRINTER_DATA if machine == "hangprinter" else MACHINES / f"{machine}.csv"
    made = run("simulate", file, data, "--noise", "declared", "-o", "out.csv")
    assert made.code == 0, made.err
    done = run("calibrate", file, "out.csv", "--holdout", "none", "--json")
    assert done.code == 0 and done.json["status"] == "converged", done.err
    assert done.json["n_rows"] == len(table("out.csv").lines)
    assert "no column" not in done.err


def test_foreign_headers_and_their_units_are_kept() -> None:
    assert run("simulate", HANGPRINTER, "--grid", "x=-300:300:2", "-o", "out.csv").code == 0
    assert table("out.csv").names[1:5] == ("motor_a_deg", "motor_b_deg", "motor_c_deg", "x_mm")
    text = Path(TRIGLIDE).read_text().replace("reads: [x, y]", 'reads: {x: "X [um]", y: Y}')
    Path("m.yaml").write_text(text)
    assert run("simulate", "m.yaml", "poses.csv", "-o", "units.csv").code == 0
    assert column("units.csv", "X") == pytest.approx([200e3, 300e3, 400e3], abs=0.1)
    assert run("calibrate", "m.yaml", "units.csv", "--select", "l1", "--holdout", "none").code == 0


def test_forces_of_a_table_stay_with_its_rows() -> None:
    text = Path(HANGPRINTER).read_text().replace("force: 0.1,", "force: {column: force_d, otherwise: 0.1, scale: 2},")
    Path("m.yaml").write_text(text)
    Path("poses.csv").write_text("x,y,z,force_d\n100,0,0,5\n0,100,0,\n")
    done = run("simulate", "m.yaml", "poses.csv", "-o", "out.csv")
    assert done.code == 0, done.err
    assert column("out.csv", "force_d") == pytest.approx([5, np.nan], nan_ok=True)
    assert run("simulate", "m.yaml", "out.csv", "--forces", "-o", "again.csv").code == 0
    assert column("again.csv", "force_d") == pytest.approx([5, 0.05])


def test_forces_and_energy_are_given_on_request() -> None:
    assert run("simulate", TRIGLIDE, "poses.csv", "--forces", "-o", "free.csv").code == 0
    Path("p.yaml").write_text("parameters: {l1: 300.1}\n")
    assert run("simulate", TRIGLIDE, "poses.csv", "--forces", "-p", "p.yaml", "-o", "strained.csv").code == 0
    assert np.abs(column("free.csv", "q1.force")).max() < 1e-3 < 10 < np.abs(column("strained.csv", "q1.force")).max()
    assert column("strained.csv", "strain_energy_J").min() > 1e-3
    units = dict(zip(table("strained.csv").names, table("strained.csv").units, strict=True))
    assert units["q1.force"] == "N"
    assert "q1.force" not in table(_made("plain.csv")).names


def _made(name: str, *more: str) -> str:
    assert run("simulate", TRIGLIDE, "poses.csv", "-o", name, *more).code == 0
    return name


def test_methods_differ_where_the_machine_is_strained() -> None:
    """Released (rigid), one linear step of the paper, and equilibrium (exact)."""
    Path("p.yaml").write_text("parameters: {l1: 302, l3: 598}\n")
    x = {m: column(_made(f"{m}.csv", "--method", m, "-p", "p.yaml"), "x") for m in ("exact", "linear", "rigid")}
    assert (column(_made("default.csv", "-p", "p.yaml"), "x") == x["exact"]).all()
    assert 1e-6 < np.abs(x["linear"] - x["exact"]).max() < 1e-2
    assert np.abs(x["rigid"] - x["exact"]).max() > 1e-2


def test_noise_has_the_declared_sigma_or_the_one_given() -> None:
    grid = ("--grid", "x=200:700:40,y=200:350:40")
    for name, noise in (("none", "none"), ("declared", "declared"), ("given", "50 um")):
        assert run("simulate", TRIGLIDE, *grid, "--noise", noise, "-o", f"{name}.csv").code == 0
    clear = column("none.csv", "x")
    assert np.std(column("declared.csv", "x") - clear) == pytest.approx(0.01, rel=0.1)
    assert np.std(column("given.csv", "y") - column("none.csv", "y")) == pytest.approx(0.05, rel=0.1)
    assert (column("given.csv", "q1") == column("none.csv", "q1")).all()


def test_noise_of_the_drives_moves_what_is_read_not_what_is_set() -> None:
    for noise in ("none", "declared"):
        assert run("simulate", HANGPRINTER, HANGPRINTER_DATA, "--noise", noise, "-o", f"{noise}.csv").code == 0
    assert (column("declared.csv", "motor_a_deg") == column("none.csv", "motor_a_deg")).all()
    assert np.std(column("declared.csv", "x_mm") - column("none.csv", "x_mm")) > 0.3


def test_noise_is_the_seeds_and_does_not_depend_on_other_rows() -> None:
    def data(*more: str, poses: str = POSES) -> list[str]:
        Path("these.csv").write_text(poses)
        clean(run("simulate", TRIGLIDE, "these.csv", "--noise", "declared", "-o", "out.csv", "--force", *more))
        return [line for line in Path("out.csv").read_text().splitlines() if not line.startswith("#")]

    first = data("--seed", "7")
    assert data("--seed", "7") == first != data("--seed", "8")
    assert data() == data("--seed", "0")
    lost = data("--seed", "7", poses=POSES.replace("a,200,200", "a,99999,200"))
    assert lost == [first[0], *first[2:]]


def test_a_channel_without_sigma_gets_no_noise_and_it_is_said() -> None:
    text = Path(HANGPRINTER).read_text().replace("column: motor_d_deg, unit: deg, sigma: 1 mm", "unit: deg")
    Path("m.yaml").write_text(text)
    done = run("simulate", "m.yaml", "--grid", "x=0:100:2", "--noise", "declared", "-o", "out.csv")
    assert done.code == 0 and "no `sigma` declared for D: no noise added there" in done.err


def test_rows_out_of_reach_are_named_and_not_written() -> None:
    Path("poses.csv").write_text("id,x,y\ngood,300,250\nfar,9999,250\n\nalso far,300,5000\n")
    done = run("simulate", TRIGLIDE, "poses.csv", "-o", "out.csv", "--json")
    assert done.code == 1
    assert "poses.csv:3 (far): out of reach" in done.err and "poses.csv:5 (also far): out of reach" in done.err
    assert table("out.csv").texts["id"] == ("good",)
    assert done.json["n_rows"] == 1 and done.json["n_failed"] == 2
    assert [(f["file"], f["line"], f["id"]) for f in done.json["failed"]] == [
        ("poses.csv", 3, "far"), ("poses.csv", 5, "also far"),
    ]  # fmt: skip
    quiet = run("simulate", TRIGLIDE, "poses.csv", "-o", "quiet.csv", "-q")
    assert "poses.csv:3 (far): out of reach" in quiet.err and "simulated" not in quiet.err


def test_points_of_a_grid_out_of_reach_are_skipped_and_keep_their_numbers() -> None:
    done = run("simulate", TRIGLIDE, "--grid", "x=300:300:1,y=2500:250:2")
    assert done.code == 0 and "skipped: 1 of 2 grid points: out of reach: no actuator positions" in done.err
    assert [line.split(",")[0] for line in done.out.splitlines() if not line.startswith("#")] == ["id", "2"]


def test_a_table_of_which_no_row_can_be_simulated_is_empty() -> None:
    Path("far.csv").write_text("x,y\n300,2500\n300,2600\n")
    done = run("simulate", TRIGLIDE, "far.csv", "-o", "out.csv", "--json")
    assert done.code == 1 and done.json["n_rows"] == 0 and done.json["channels"][0]["min"] is None
    assert Path("out.csv").read_text().splitlines()[-1].startswith("id,")


def test_a_grid_of_which_no_point_can_be_reached_is_an_error() -> None:
    done = run("simulate", TRIGLIDE, "--grid", "y=2500:2600:2", "-o", "out.csv")
    assert done.code == 3 and "--grid: error[grid]: none of 2 grid points can be used: out of reach" in done.err
    assert not Path("out.csv").exists()


def test_drive_positions_that_do_not_close_have_a_reason() -> None:
    Path("q.csv").write_text("q1,q2,q3\n117,603,947\n117,9603,947\n")
    done = run("simulate", TRIGLIDE, "q.csv", "-o", "out.csv")
    assert done.code == 1 and "q.csv:3: out of reach" in done.err


def test_notes_of_the_table_are_passed_on() -> None:
    done = run("simulate", TRIGLIDE, "poses.csv", "-o", "out.csv")
    assert "no units in the header; the units of the machine file are used: mm (x, y)" in done.err


def test_the_head_of_the_table_says_where_it_comes_from() -> None:
    import hashlib

    import yaml

    Path("p.yaml").write_text("parameters: {l1: 300.5}\n")
    assert run("simulate", TRIGLIDE, "poses.csv", "-p", "p.yaml", "--seed", "3", "-o", "out.csv").code == 0
    told = yaml.safe_load(Path("out.csv.provenance.yaml").read_text())
    assert told["note"] == "simulated: no measurements" and table("out.csv").comments == ()
    assert told["sha256"] == hashlib.sha256(Path("out.csv").read_bytes()).hexdigest()
    head = told["provenance"]
    assert head["seed"] == 3 and head["noise"] == "none" and head["method"] == "exact"
    assert head["arguments"][:2] == ["simulate", TRIGLIDE]
    files = {TRIGLIDE, "poses.csv", "p.yaml"}
    assert head["inputs"] == {f: hashlib.sha256(Path(f).read_bytes()).hexdigest() for f in files}


def test_an_overlays_base_is_among_the_inputs() -> None:
    done = run("simulate", MACHINES / "triglide-nonredundant.yaml", "poses.csv", "-o", "out.csv", "--json")
    assert {Path(f).name for f in done.json["provenance"]["inputs"]} == {
        "triglide-nonredundant.yaml", "triglide.yaml", "poses.csv",
    }  # fmt: skip


def test_json_needs_a_file_for_the_table() -> None:
    for more in ((), ("-o", "-")):
        done = run("simulate", TRIGLIDE, "poses.csv", "--json", *more)
        assert done.code == 2 and done.out == "" and "both write to stdout" in done.err


def test_nothing_is_overwritten_without_force() -> None:
    Path("out.csv").write_text("precious")
    done = run("simulate", TRIGLIDE, "poses.csv", "-o", "out.csv")
    assert done.code == 4 and "use `--force` to replace it" in done.err
    assert Path("out.csv").read_text() == "precious"
    assert run("simulate", TRIGLIDE, "poses.csv", "-o", "out.csv", "--force").code == 0
    assert len(column("out.csv", "x")) == 3


def test_a_fault_in_the_middle_of_a_table_leaves_no_file() -> None:
    rows = "".join(f"{200 + i % 100},{250 + i % 50}\n" for i in range(40000))
    Path("long.csv").write_text(f"x,y\n{rows}200,abc\n")
    done = run("simulate", TRIGLIDE, "long.csv", "-o", "out.csv")
    assert done.code == 3 and "long.csv:40002" in done.err
    assert sorted(os.listdir()) == ["long.csv", "poses.csv"]


def test_a_measurement_table_can_be_simulated_again() -> None:
    done = run("simulate", TRIGLIDE, TRIGLIDE_DATA, "-o", "out.csv")
    assert done.code == 0 and len(column("out.csv", "x")) == 231
    assert np.abs(column("out.csv", "x") - column(TRIGLIDE_DATA, "x")).max() < 0.5
    assert run("simulate", TRIGLIDE, "--grid", GRID).out.count("\n") > 12


def test_drives_that_would_leave_their_limits_are_told(tmp_path: Path) -> None:
    """Poses that need more travel than a drive has are simulated, but not silently."""
    machine = tmp_path / "m.yaml"
    machine.write_text(f"extends: {TRIGLIDE}\nactuators: {{q1: {{limits: [0, 300]}}, q2: {{limits: [0, 2000]}}}}\n")
    grid = ("--grid", "x=200:500:4,y=300:300:1")
    told = "warning: `q1` exceeds its limits (0 mm to 300 mm) at 1 of 4 poses; worst: -23.6068 mm at --grid point 1\n"
    made = run("simulate", machine, *grid, "-o", tmp_path / "t.csv")
    assert made.code == 0 and told in made.err
    assert told in run("observability", machine, *grid).err and told in run("sensitivity", machine, *grid).err
