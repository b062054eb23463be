"""`pkmcal calibrate`: verdicts, what is printed and written, held-out errors, sessions, limits."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.problem import Problem
from tests.command import (
    HANGPRINTER,
    HANGPRINTER_DATA,
    MACHINES,
    SCISSORS,
    TRIGLIDE,
    TRIGLIDE_DATA,
    Done,
    column,
    run,
)

SECOND = str(MACHINES / "hangprinter_2022-04-12.csv")
PLAIN = MACHINES / "triglide-nonredundant.yaml"
ONE = "id,q1,q2,q3,x,y\np1,116.33,603.67,946.83,360,275\n"


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("one.csv").write_text(ONE)


def calibrated(*arguments: str | Path) -> tuple[Done, Any]:
    done = run("calibrate", *arguments, "--json")
    return done, json.loads(done.out) if done.out else None


def test_the_result_has_what_the_interface_promises() -> None:
    done, result = calibrated(TRIGLIDE, TRIGLIDE_DATA)
    assert done.code == 0
    assert result["status"] == "converged" and result["n_rows"] == 231
    assert ",".join(p["name"] for p in result["parameters"]) == "l1,l2,l3,xb1r,yb1r,xb2r,yb2r,xb3r,yb3r"
    l1 = result["parameters"][0]
    assert {"name", "nominal", "value", "std", "unit", "identified", "reason"} <= l1.keys()
    assert l1["nominal"] == 300.0 and l1["unit"] == "mm" and 0 < l1["std"] < 0.1
    assert {"rms", "max", "criterion", "unit"} <= result["before"]["position"].keys()
    assert result["after"]["position"]["rms"] < 0.3 * result["before"]["position"]["rms"]
    assert result["chi2_per_dof"] == pytest.approx(1, abs=0.2)
    assert result["heldout"]["rms_after"] < 0.3 * result["heldout"]["rms_before"]
    assert "5 folds" in result["heldout"]["scheme"]
    assert result["condition_number"] > 1 and result["undetermined"] is not None


def test_the_table_shows_value_uncertainty_errors_and_verdict() -> None:
    done = run("calibrate", TRIGLIDE, TRIGLIDE_DATA)
    assert done.code == 0 and done.out == ""
    for text in ("nominal", "identified", "range", "rms before", "rms after", "held-out rms", "criterion", "+-0.1 mm"):
        assert text in done.err
    assert "converged in" in done.err and "chi-square per degree of freedom" in done.err


def test_a_named_parameter_that_is_not_determined_is_a_negative_verdict() -> None:
    done, result = calibrated(TRIGLIDE, "one.csv", "--select", "l1,xb1r")
    assert done.code == 1 and "named in --select but undetermined: l1, xb1r" in done.err
    assert [p["std"] for p in result["parameters"]] == [None, None]
    assert result["parameters"][0]["reason"] == "undetermined: cannot be separated from xb1r"
    (combination,) = result["undetermined"]
    (determined,) = combination["determined"]
    assert determined["coefficients"]["l1"] == 1 and determined["std"] < 0.1
    assert "The data cannot separate these parameters. Fix one of them, e.g. `--select auto,-" in done.err


def test_without_names_what_is_undetermined_is_no_failure() -> None:
    done, result = calibrated(TRIGLIDE, "one.csv", "--select", "l1*,xb1*")
    assert done.code == 0 and [p["std"] for p in result["parameters"]] == [None, None]
    assert result["heldout"]["rms_after"] is None
    assert result["heldout"]["reason"] == "2 measured values for 2 parameters: fewer than 3 values per parameter"
    assert "held-out error: not available (2 measured values for 2 parameters" in done.err


def test_fewer_equations_than_unknowns_are_refused_before_the_fit() -> None:
    done = run("calibrate", TRIGLIDE, "one.csv", "-o", "p.yaml")
    assert done.code == 3 and "Parameters" not in done.err and not Path("p.yaml").exists()
    assert "error[under-determined]: too few equations: 2 equations, 9 unknowns, 7 null directions" in done.err
    assert "--prior OLD.params.yaml" in done.err
    assert "cannot be separated" in done.err and "--select" in done.err


def test_nothing_identifiable() -> None:
    done, result = calibrated(str(MACHINES / "triglide-nonredundant.yaml"), "one.csv", "--select", "k*")
    assert done.code == 1 and result["status"] == "nothing_identifiable"
    assert "NOTHING IDENTIFIABLE" in done.err
    quiet = run("calibrate", MACHINES / "triglide-nonredundant.yaml", "one.csv", "--select", "k*", "-q")
    assert quiet.code == 1 and "NOTHING IDENTIFIABLE" in quiet.err


def test_a_fit_that_does_not_converge_is_a_negative_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    from pkmcal_cli.calibration.identify import identify

    def hurried(problem: Problem, selected: tuple[str, ...], start: Array, iterations: int = 1, **_: Any) -> Fit:
        return identify(problem, selected, start, min(iterations, 1))

    monkeypatch.setattr("pkmcal_cli.calibration.starts.identify", hurried)
    done, result = calibrated(SCISSORS, str(MACHINES / "scissors.csv"), "-o", "p.yaml")
    assert done.code == 1 and result["status"] == "not_converged"
    assert "NOT CONVERGED" in done.err and result["heldout"]["reason"] == "the fit did not succeed (not_converged)"
    assert yaml.safe_load(Path("p.yaml").read_text())["provenance"]["status"] == "not_converged"
    used = run("observability", SCISSORS, "-p", "p.yaml")
    assert "warning: p.yaml: the fit ended with status `not_converged`" in used.err


def test_a_limit_on_the_command_line_decides() -> None:
    arguments = (TRIGLIDE, TRIGLIDE_DATA, "--holdout", "none", "-q", "--max-rms")
    assert run("calibrate", *arguments, "20 um").code == 0
    done = run("calibrate", *arguments, "0.001 mm")
    assert done.code == 1
    what = "position rms of fitted rows: 0.01465 mm, above the limit of 0.001 mm (--max-rms)"
    assert done.err == f"{TRIGLIDE_DATA}: error[above]: {what}\n"
    Path("d.csv").write_text("motor_a_deg,motor_b_deg,motor_c_deg,motor_d_deg\n1,2,3,4\n")
    none = run("calibrate", HANGPRINTER, "d.csv", "--max-rms", "1 mm")
    assert none.code == 2 and "no positions were measured" in none.err


def test_the_parameter_file_is_accepted_and_its_values_exactly_kept() -> None:
    done, result = calibrated(HANGPRINTER, HANGPRINTER_DATA, "--select", "auto,R_*", "-o", "p.yaml")
    assert done.code == 0
    written = yaml.safe_load(Path("p.yaml").read_text())["parameters"]
    for p in result["parameters"]:
        assert written[p["name"]]["value"] == p["value"] and written[p["name"]]["std"] == p["std"]
    again, second = calibrated(
        HANGPRINTER, HANGPRINTER_DATA, "--select", "auto,R_*", "-p", "p.yaml", "--holdout", "none"
    )
    assert again.code == 0
    for kind, figures in result["after"].items():
        assert second["before"][kind]["rms"] == pytest.approx(figures["rms"], rel=1e-9)


def test_provenance_is_complete() -> None:
    Path("start.yaml").write_text("parameters: {l1: 300.01}\n")
    data = "\n".join(Path(TRIGLIDE_DATA).read_text().splitlines()[:100]) + "\n"
    Path("meas.csv").write_text(data)
    Path("held.csv").write_text(ONE)
    arguments = ["calibrate", MACHINES / "triglide.yaml", "meas.csv", "-p", "start.yaml", "--holdout", "held.csv"]
    assert run(*arguments, "-o", "p.yaml").code == 0
    head = yaml.safe_load(Path("p.yaml").read_text())["provenance"]
    files = [TRIGLIDE, "meas.csv", "start.yaml", "held.csv"]
    assert head["inputs"] == {f: hashlib.sha256(Path(f).read_bytes()).hexdigest() for f in files}
    assert head["arguments"] == [*map(str, arguments), "-o", "p.yaml"]
    assert head["status"] == "converged" and head["seed"] is None
    assert {"program", "python", "numpy", "scipy", "created"} <= head.keys()


def test_same_inputs_give_the_same_bytes_but_for_the_time() -> None:
    texts = []
    for name in ("a", "b"):
        Path(name).mkdir()
        assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", f"{name}/p.yaml", "--holdout", "none").code == 0
        text = Path(name, "p.yaml").read_text().replace(f"{name}/p.yaml", "p.yaml")
        texts.append([line for line in text.splitlines() if "created:" not in line])
    assert texts[0] == texts[1]


def test_correlations_are_written() -> None:
    assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", "p.yaml", "--holdout", "none").code == 0
    found = yaml.safe_load(Path("p.yaml").read_text())["correlations"]
    size = len(found["names"])
    assert size == 12 and found["names"][9:] == ["k1", "k2", "k3"], "what is held is uncertain too"
    assert [row[k] for k, row in enumerate(found["matrix"])] == [1.0] * size
    assert all(abs(v) <= 1 for row in found["matrix"] for v in row)


def test_several_files_are_sessions() -> None:
    done, result = calibrated(HANGPRINTER, HANGPRINTER_DATA, SECOND, "--select", "auto,R_*", "--holdout", "session")
    assert done.code == 0 and result["n_rows"] == 25 + 44
    assert "by session, 2 sessions" in result["heldout"]["scheme"]
    assert 2 < result["heldout"]["after"]["length"]["rms"] < 8


def test_a_column_makes_sessions_too() -> None:
    lines = Path(TRIGLIDE_DATA).read_text().splitlines()
    rows = [f"{line},{'am' if k % 2 else 'pm'}" for k, line in enumerate(lines[1:60])]
    Path("s.csv").write_text("\n".join([lines[0] + ",session", *rows]) + "\n")
    assert "by session, 2 sessions" in calibrated(TRIGLIDE, "s.csv", "--holdout", "session")[1]["heldout"]["scheme"]


@pytest.mark.parametrize(
    ("scheme", "words"),
    [("3", "3 folds"), ("cells", "by workspace cell"), ("none", None), ("other.csv", "rows of ")],
)
def test_schemes_of_holding_out(scheme: str, words: str | None) -> None:
    Path("other.csv").write_text("".join(PLAIN.with_suffix(".csv").read_text().splitlines(keepends=True)[:50]))
    done, result = calibrated(PLAIN, PLAIN.with_suffix(".csv"), "--holdout", scheme)
    assert done.code == 0
    if words is None:
        assert result["heldout"]["reason"] == "not requested" and result["heldout"]["scheme"] is None
    else:
        assert words in result["heldout"]["scheme"] and result["heldout"]["reason"] is None
        assert result["heldout"]["rms_after"] < 0.02


def test_too_few_distinct_poses_are_the_reason_why_there_is_no_held_out_error() -> None:
    Path("same.csv").write_text(ONE + "".join(ONE.splitlines()[1].replace("p1", f"p{k}") + "\n" for k in range(2, 40)))
    done, result = calibrated(TRIGLIDE, "same.csv")
    assert done.code == 0 and "distinct poses" in result["heldout"]["reason"]
    asked, _ = calibrated(TRIGLIDE, "same.csv", "--holdout", "5")
    assert asked.code == 2 and "--holdout 5" in asked.err


@pytest.mark.parametrize("scheme", ["0", "1", "-1", "2.5", "", "9" * 5000, "1000"])
def test_impossible_folds_are_usage_errors(scheme: str) -> None:
    assert run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--holdout", scheme).code == 2


def test_a_limit_is_one_for_rows_that_were_not_fitted() -> None:
    """Nine parameters fit twelve rows of noise better than they predict others: the limit lies between."""
    head, *rows = (MACHINES / "scissors.csv").read_text(encoding="utf-8").splitlines()
    for name, chosen in (("few.csv", rows[:56:5]), ("others.csv", rows[3::5])):
        Path(name).write_text("\n".join([head, *chosen, ""]))
    _, result = calibrated(SCISSORS, "few.csv", "--holdout", "others.csv")
    fitted, held = (f["position"]["rms"] for f in (result["after"], result["heldout"]["after"]))
    assert fitted < 0.8 * held
    limit = f"{0.9 * held} mm"
    judged = run("calibrate", SCISSORS, "few.csv", "--holdout", "others.csv", "-q", "--max-rms", limit)
    assert judged.code == 1 and "position rms of held-out rows: " in judged.err
    assert run("calibrate", SCISSORS, "few.csv", "--holdout", "none", "-q", "--max-rms", limit).code == 0


def test_rows_out_of_reach_are_named_with_file_line_and_reason() -> None:
    rows = "id,q1,q2,q3,x,y\ngood,117,603,947,360,275\nbad one,117,9603,947,360,275\n"
    Path("m.csv").write_text(rows)
    done = run("calibrate", TRIGLIDE, "m.csv")
    assert done.code == 3
    assert "m.csv:3: error[row]: row `bad one`: out of reach: the mechanism cannot be assembled" in done.err
    assert "good" not in done.err
    held = run("calibrate", TRIGLIDE, "one.csv", "--select", "l1,l2", "--holdout", "m.csv")
    assert held.code == 3 and "m.csv:3: error[row]" in held.err, "half of the rows are lost"


def test_line_lengths_are_a_kind_of_channel() -> None:
    """The figures of the hangprinter data's own documentation: 4.96 and 1.14 mm."""
    anchors = calibrated(HANGPRINTER, HANGPRINTER_DATA, "--holdout", "none")[1]["after"]["length"]
    radii = calibrated(HANGPRINTER, HANGPRINTER_DATA, "--select", "auto,R_*", "--holdout", "none")[1]["after"]["length"]
    assert anchors["rms"] == pytest.approx(4.96, rel=0.03) and anchors["unit"] == "mm"
    assert radii["rms"] == pytest.approx(1.14, rel=0.03)


@pytest.mark.slow
def test_gross_mistakes_are_told_before_the_fit() -> None:
    lines = Path(TRIGLIDE_DATA).read_text().splitlines()
    Path("swapped.csv").write_text("\n".join([lines[0].replace("x [mm],y [mm]", "y [mm],x [mm]"), *lines[1:231:9]]))
    done = run("calibrate", TRIGLIDE, "swapped.csv", "--holdout", "none")
    assert "warning: " in done.err and "swapped" in done.err


def test_channels_without_sigma_are_told_and_not_used() -> None:
    text = Path(HANGPRINTER).read_text().replace("motor_d_deg, unit: deg, sigma: 1 mm", "motor_d_deg, unit: deg")
    Path("m.yaml").write_text(text)
    done, result = calibrated("m.yaml", HANGPRINTER_DATA, "--holdout", "none")
    assert done.code == 0 and "`D` not used in 25 rows" in done.err and "drive" not in result["after"]


def test_a_sigma_by_row_weighs() -> None:
    lines = Path(TRIGLIDE_DATA).read_text().splitlines()
    Path("s.csv").write_text("\n".join([lines[0] + ",sigma.x", *(line + ",1000" for line in lines[1:])]))
    heavy, light = calibrated(TRIGLIDE, TRIGLIDE_DATA)[1], calibrated(TRIGLIDE, "s.csv")[1]
    assert light["chi2"] < 0.7 * heavy["chi2"]


def test_a_parameter_file_on_stdout_and_json_exclude_one_another() -> None:
    both = run("calibrate", TRIGLIDE, "one.csv", "-o", "-", "--json")
    assert both.code == 2 and both.out == "" and "both write to stdout" in both.err
    piped = run("calibrate", TRIGLIDE, "one.csv", "--select", "l1,l2", "-o", "-")
    assert piped.code == 0 and yaml.safe_load(piped.out)["parameters"]["l1"]["unit"] == "mm"
    assert run("simulate", TRIGLIDE, "one.csv", "-p", "-", "-o", "s.csv", stdin=piped.out).code == 0
    assert column("s.csv", "x")[0] == pytest.approx(360, abs=0.01)


def test_an_output_that_exists_is_refused_before_the_work() -> None:
    Path("p.yaml").write_text("precious")
    done = run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "-o", "p.yaml")
    assert done.code == 4 and Path("p.yaml").read_text() == "precious" and "Parameters" not in done.err
    assert run("calibrate", TRIGLIDE, "one.csv", "--select", "l1,l2", "-o", "p.yaml", "--force").code == 0
    assert "provenance:" in Path("p.yaml").read_text()


def test_bounds_hold_and_are_told() -> None:
    text = Path(TRIGLIDE).read_text().replace("  yb3r: 150\n", "  yb3r: {nominal: 150, bounds: [149.9, 150.01]}\n")
    Path("m.yaml").write_text(text)
    (found,) = calibrated("m.yaml", TRIGLIDE_DATA, "--select", "yb3r", "--holdout", "none")[1]["parameters"]
    assert found["value"] in (149.9, 150.01) and found["reason"] == "at its bound"
