"""`pkmcal study`: errors by the law of large numbers, the same whoever computes, stopped and gone on, refusals."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pkmcal_cli.base.rotation import exp, log
from pkmcal_cli.calibration.fitted_frames import parameter_errors
from pkmcal_cli.diagnosis.power import PowerWork
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.workflow.state import State
from tests.command import ROOT, SCISSORS, TRIGLIDE, run, timeless
from tests.json_schemas import faults_of

PLAIN = TRIGLIDE.replace("triglide", "triglide-nonredundant")
HEXAPOD, DELTA = (TRIGLIDE.replace("triglide", name) for name in ("hexapod7", "delta4"))
BOX = ("--within", "x=0:950,y=160:390")


def results(*arguments: str) -> Any:
    done = run("study", *arguments, "--json")
    assert done.code == 0, done.err
    assert faults_of("study", done.json) == []
    told = done.json
    del told["provenance"]
    return told


@pytest.fixture(scope="module")
def both() -> Any:
    return results(TRIGLIDE, PLAIN, *BOX, "--held", "nominal", "--points", "5,45", "--repeat", "7", "--noise", "10 um")


def case(told: Any, machine: str, points: int) -> Any:
    return next(c for c in told["cases"] if (c["machine"], c["points"]) == (machine, points))


@pytest.mark.slow
def test_nine_times_the_points_make_a_third_of_the_error(both: Any) -> None:
    """Of the tool point of the non-redundant machine, whose six parameters few points determine already."""
    few, many = (case(both, "triglide-nonredundant", n)["tool"] for n in (5, 45))
    assert 2 < few["mean"] / many["mean"] < 7 and many["std"] < few["std"]
    assert both["verdict"] == "complete" and case(both, "triglide", 5)["n_calibrations"] == 7


def test_the_redundant_leg_leaves_more_in_the_parameters(both: Any) -> None:
    """As in the paper's figure 12: more parameters, of which the points determine no more."""
    (length,) = case(both, "triglide", 45)["kinds"]
    (plain,) = case(both, "triglide-nonredundant", 45)["kinds"]
    assert length["mean"] > plain["mean"] == pytest.approx(plain["common"]["mean"])
    told = next(d for d in both["differences"] if d["points"] == 45)
    assert told["kinds"][0]["mean"] == pytest.approx(plain["common"]["mean"] - length["common"]["mean"])


def test_ten_times_the_noise_makes_ten_times_the_error() -> None:
    """Of well determined parameters: the same points, and the same noise but for its size."""
    told = [results(PLAIN, *BOX, "--points", "60", "--repeat", "3", "--noise", n) for n in ("0.1 um", "1 um")]
    small, large = (t["cases"][0]["tool"]["mean"] for t in told)
    assert large / small == pytest.approx(10, rel=0.02)


def test_two_processes_and_more_repetitions_go_on_with_the_same_bits(tmp_path: Path) -> None:
    state, asked = str(tmp_path / "state.json"), (SCISSORS, "--points", "10,15", "--noise", "5 um")
    whole = results(*asked, "--repeat", "4")
    results(*asked, "--repeat", "2", "--state", state)
    assert results(*asked, "--repeat", "4", "--state", state, "--jobs", "2") == whole
    kept = json.loads(Path(state).read_text())
    assert len(kept["results"]) == 8
    assert results(*asked, "--repeat", "4", "--state", state) == whole  # nothing is left to be done


def test_tables_and_pictures(tmp_path: Path) -> None:
    table, picture = tmp_path / "s.csv", tmp_path / "s.svg"
    done = run("study", SCISSORS, "--points", "12", "--repeat", "2", "-o", table, "--plot", picture)
    assert done.code == 0 and "mean error of the tool point" in done.err
    written = pd.read_csv(table)
    assert written["points"].tolist() == [12] and written["machine"].tolist() == ["scissors"]
    assert (written[["tool [um]", "u_tool [um]", "error.l3 [um]"]] > 0).all(axis=None)
    assert "measured points" in picture.read_text(encoding="utf-8")


@pytest.mark.parametrize("how", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
@pytest.mark.parametrize("jobs", [pytest.param("1"), pytest.param("2", marks=pytest.mark.slow)])
def test_stopped_it_goes_on_without_loss(tmp_path: Path, how: signal.Signals, jobs: str) -> None:
    state = tmp_path / "state.json"
    asked = (SCISSORS, "--points", "10", "--seed", "4")
    command = [sys.executable, "-m", "pkmcal_cli", "study", *asked, "--repeat", "5000", "--jobs", jobs]
    with subprocess.Popen(
        [*command, "--state", str(state)], cwd=ROOT, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(how, signal.SIG_DFL),  # what runs in the background ignores some
    ) as process:  # fmt: skip
        deadline = time.monotonic() + 100
        while not state.exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        os.killpg(process.pid, how) if how is signal.SIGINT else process.send_signal(how)
        told = process.communicate()[1]
    assert process.returncode == 130 and "of 5000 are done; run the same command again" in told, told
    assert "Traceback" not in told
    done = len(json.loads(state.read_text())["results"])
    assert 1 <= done < 5000
    few = str(max(2, min(done, 6)))
    kept = results(*asked, "--repeat", few, "--state", str(state))
    assert timeless(json.dumps(kept)) == timeless(json.dumps(results(*asked, "--repeat", few)))


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((SCISSORS, "--points", "2"), "2 points give 4 values, but scissors has"),
        ((SCISSORS, "--points", "10,ten"), "is not a list of distinct numbers"),
        ((SCISSORS, "--points", "10,10"), "is not a list of distinct numbers"),
        ((SCISSORS, "--noise", "-1 um"), "is not a noise of a channel"),
        ((SCISSORS, "--noise", "0 um"), "is not a noise of a channel"),
        ((SCISSORS, "--noise", "1 kg"), "1 kg"),
        ((SCISSORS, SCISSORS), "given twice"),
        ((SCISSORS, "--within", "x=5"), "is not a side of a box"),
        ((SCISSORS, "--within", "x=5:1"), "has no room"),
        ((SCISSORS, "--within", "u=1:5"), "--within: `u` is not a coordinate"),
        ((DELTA, SCISSORS), "error[usage]: x and y and z cannot be held together"),
        ((DELTA, SCISSORS, "--within", "z=-500:-450"), "error[usage]: --within: z cannot be held together"),
        ((TRIGLIDE,), "no workspace to draw points from"),
        ((SCISSORS, "--state", "-"), "--state"),
        ((SCISSORS, "--jobs", "2", "--cluster", "tcp://a:1"), "exclude"),
    ],
)
def test_what_does_not_go_together_is_a_usage_error(arguments: tuple[str, ...], told: str) -> None:
    done = run("study", *arguments)
    assert done.code == 2 and told in done.err and "help: " in done.err


def test_points_out_of_reach_are_bad_input() -> None:
    done = run("study", TRIGLIDE, "--within", "x=90000:91000,y=90000:91000")
    assert done.code == 3 and "too few points that triglide reach" in done.err


def test_a_state_of_another_study_is_refused(tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    asked = ("study", SCISSORS, "--points", "10", "--repeat", "2", "--state", state)
    assert run(*asked, "--noise", "5 um").code == 0
    other = run(*asked, "--noise", "6 um")
    assert other.code == 3 and "noise was 5 um, now 6 um" in other.err
    for text in ("", "{}", "[1]", '{"form": "pkmcal/state/1", "asked": 3, "results": {}}'):
        state.write_text(text)
        done = run(*asked)
        assert done.code == 3 and "this is not a state file" in done.err, text


def test_a_state_of_other_files_says_which(tmp_path: Path) -> None:
    """By content: a file of another name is the same."""
    state, one, other, third = (tmp_path / name for name in ("state.json", "one.yaml", "other.yaml", "third.yaml"))
    for k, file in enumerate((one, other, third)):
        file.write_text(Path(SCISSORS).read_text(encoding="utf-8") + k * "# the same\n", encoding="utf-8")
    asked = ("--points", "10", "--repeat", "2", "--state", state)
    assert run("study", one, other, *asked).code == run("study", SCISSORS, other, *asked).code == 0
    for files, told in (
        ((other, one), f"its files were in another order, not `{other}`, `{one}`"),
        ((one,), f"it was made from 2 files, not only from `{one}`"),
        ((one, third), f"`{third}` has changed since, or was not part of it"),
    ):
        done = run("study", *files, *asked)
        assert done.code == 3 and f"different run: {told}" in done.err, done.err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize("command", [("study", SCISSORS), ("plan", SCISSORS, "--power", "1")])
def test_a_state_in_a_device_without_end_is_refused(command: tuple[str, ...]) -> None:
    done = run(*command, "--state", "/dev/full")
    assert done.code == 4 and "keeps nothing to resume from" in done.err and "help: " in done.err


def test_results_that_were_changed_are_refused(tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    asked = ("study", SCISSORS, "--points", "10", "--repeat", "2", "--state", state)
    assert run(*asked).code == 0
    kept = json.loads(state.read_text())
    ((first, *errors),) = kept["results"]["0"]
    for other in ([[2 * first, *errors]], [[math.nan, *errors]], [[str(first), *errors]], [errors], [], "x", None):
        results = kept["results"] | {"0": other}
        state.write_text(json.dumps(kept | {"results": results}))
        assert (done := run(*asked)).code == 3 and "this state file is damaged" in done.err, other
        State(str(state), kept["asked"], results).write()  # its checksum is right, as another program could write it
        assert (run(*asked).code == 3) == (other != [[2 * first, *errors]]), other


@pytest.mark.parametrize("other", [[], {"a": 1}, None, "found"], ids=str)
def test_outcomes_of_campaigns_are_words_that_are_counted(other: object) -> None:
    work = PowerWork(campaigns=None, effects=(None,), count=1)  # type: ignore[arg-type]
    assert not work.fits(other) and all(map(work.fits, ("named", "in_set", "other", "missed", "lost")))


@pytest.mark.slow
def test_campaigns_of_a_plan_go_on_too(tmp_path: Path) -> None:
    """What is kept counts: another result, with its checksum, is counted as it is."""
    state, asked = tmp_path / "state.json", ("plan", SCISSORS, "--power", "1", "--aim", "backlash@q1", "--json")
    first = run(*asked, "--state", state)
    assert first.code == 0, first.err
    kept = json.loads(state.read_text())
    assert kept["asked"]["power"] == 1 and sum(len(r) > 0 for r in kept["results"].values()) == len(kept["results"]) > 0
    State(str(state), kept["asked"], kept["results"] | {"0": "lost"}).write()
    assert run(*asked, "--state", state).json["power"][0]["lost"] == 1
    assert run("plan", SCISSORS, "--jobs", "2").code == 2


def test_an_instrument_that_stands_anywhere_leaves_no_more(tmp_path: Path) -> None:
    """Metres away and turned, found as `calibrate` finds it; where it stands is no error of the machine."""
    free = tmp_path / "free.yaml"
    free.write_text(f"extends: {PLAIN}\nsensors: {{tracker: {{frame: fitted}}}}\n", encoding="utf-8")
    told = results(PLAIN, str(free), *BOX, "--points", "40", "--repeat", "6", "--seed", "36")  # two beyond half a turn
    aligned, anywhere = told["cases"]
    assert anywhere["n_failed"] == 0 and [k["kind"] for k in anywhere["kinds"]] == ["length"]
    assert anywhere["kinds"][0]["mean"] < 3 * aligned["kinds"][0]["mean"]
    frame = {p["name"]: p["mean"] for p in anywhere["parameters"] if p["name"].startswith("frame@tracker.r")}
    assert frame and all(0 < angle < 1e-3 for angle in frame.values())  # whole turns are no error


@pytest.mark.parametrize("turned", [(3.1, 0.0, 0.0), (0.0, 3.2, 1.0), (6.28, 0.0, 0.01), (0.0, 0.0, 0.0)])
def test_errors_of_a_frame_are_the_rotation_that_is_left(turned: tuple[float, ...], tmp_path: Path) -> None:
    """Whichever of the vectors of a rotation is found: near half a turn, beyond it, near a whole one."""
    file = tmp_path / "free.yaml"
    file.write_text(f"extends: {HEXAPOD}\nsensors: {{tracker: {{frame: fitted}}}}\n", encoding="utf-8")
    model = load_machine(str(file)).model
    at = [model.names.index(f"frame@tracker.r{c}") for c in "xyz"]
    true, values = model.nominal, model.nominal
    true[at], left = turned, np.array([1e-3, -2e-3, 3e-3])
    values[at] = log(exp(left) @ exp(np.array(turned)))
    assert parameter_errors(model, values, true)[at] == pytest.approx(left, abs=1e-9)


STAGE = """\
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 0.5 mm}
parameters:
  {a2x: 1200, a3x: 1150, a3y: 900, a4x: 50, a4y: 950, "o{i}": {each: {i: [1, 2, 3, 4]}, nominal: 400, range: 0.3},
   p1x: {nominal: -120, range: 0.1}, p1y: {nominal: -80, range: 0.1}, p2x: {nominal: 120, range: 0.1},
   p2y: {nominal: -80, range: 0.1}, p3x: {nominal: 120, range: 0.1}, p3y: {nominal: 80, range: 0.1},
   p4x: {nominal: -120, range: 0.1}, p4y: {nominal: 80, range: 0.1}}
ground: {A1: [0, 0], A2: [a2x, 0], A3: [a3x, a3y], A4: [a4x, a4y]}
bodies: {plate: {at: [600, 450], points: {P1: [p1x, p1y], P2: [p2x, p2y], P3: [p3x, p3y], P4: [p4x, p4y]}}}
bars: {"leg{i}": {each: {i: [1, 2, 3, 4]}, between: ["A{i}", "P{i}"], k: 8 N/um}}
actuators:
  {"q{i}": {each: {i: [1, 2, 3]}, drives: "leg{i}", offset: "o{i}"}, q4: {drives: leg4, offset: o4, redundant: true}}
sensors: {tracker: {at: plate, reads: [x, y, rz], sigma: {position: 6 um, orientation: 25 urad}, frame: fitted}}
tool_point: plate
workspace: {box: {x: [450, 750], y: [330, 570], rz: [-10, 10]}}
"""
"""Few points leave its legs' ends two minima."""


def test_false_minima_are_left_as_calibrate_leaves_them(tmp_path: Path) -> None:
    file = tmp_path / "stage.yaml"
    file.write_text(STAGE, encoding="utf-8")
    (told,) = results(str(file), "--points", "12", "--repeat", "2", "--seed", "59")["cases"]
    assert told["n_failed"] == 0 and told["tool"]["mean"] < 250, "by the false one of the second, a millimetre"


def test_calibrations_that_leave_more_than_noise_are_in_no_mean(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pkmcal_cli.calibration.study._NEVER", 1.0)
    done = run("study", SCISSORS, "--points", "10", "--repeat", "2", "--json")
    (told,) = done.json["cases"]
    assert done.code == 1 and (told["n_calibrations"], told["n_failed"], told["tool"]["mean"]) == (0, 2, None)
    assert "no calibration has converged to what noise explains" in done.err
