"""Fits from far away, several minima: what further starts find, and what is said of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.budget import HELP, Budget
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration import starts
from pkmcal_cli.calibration.fit import Fit
from pkmcal_cli.calibration.holdout import cross_validate
from pkmcal_cli.calibration.identify import identify
from pkmcal_cli.calibration.problem import Problem
from pkmcal_cli.calibration.starts import best_of_starts, identify_from
from pkmcal_cli.prediction import WarmStart
from tests.campaigns import by_engine, shipped
from tests.command import SCISSORS, run
from tests.support import MACHINES

BALL = """
extends: {scissors}
parameters: {{bx: {{nominal: {x}, range: 50}}, by: {{nominal: {y}, range: 150}}}}
ground: {{ball: [bx, by]}}
sensors: {{ballbar: {{kind: distance, at: platform, to: ball, sigma: 2 um}}}}
"""


def swept(folder: Path, height: float) -> tuple[Path, Path]:
    """A ballbar on the Scissors, swept along the x axis, up and down by `height` mm.

    The ball is at (0, 60) mm; the machine file that is returned has it at (20, -60) mm, on the wrong side.
    """
    true, drawn, poses, table = (folder / n for n in ("true.yaml", "drawn.yaml", "poses.csv", "table.csv"))
    true.write_text(BALL.format(scissors=SCISSORS, x=0, y=60), encoding="utf-8")
    drawn.write_text(BALL.format(scissors=SCISSORS, x=20, y=-60), encoding="utf-8")
    rows = [f"{x:.1f},{height * np.cos(x / 10):.6f}" for x in np.linspace(-200, 200, 41)]
    poses.write_text("x [mm],y [mm]\n" + "\n".join(rows), encoding="utf-8")
    done = run("simulate", true, poses, "-o", table, "--noise", "declared", "-q")
    assert done.code == 0, done.err
    return drawn, table


def test_a_false_minimum_is_left_without_being_asked(tmp_path: Path) -> None:
    """On the wrong side of the axis a sweep of 3 mm does not fit by hundreds of standard uncertainties."""
    machine, table = swept(tmp_path, 3.0)
    done = run("calibrate", machine, table, "--select", "bx,by", "--json", "--holdout", "none")
    found = {p["name"]: p for p in done.json["parameters"]}
    assert done.code == 0 and done.json["starts"]["worse"] > 0 and done.json["chi2_per_dof"] < 2
    for name, true in (("bx", 0.0), ("by", 60.0)):
        assert abs(found[name]["value"] - true) < 4 * found[name]["std"]


def test_two_minima_that_are_as_good_are_told(tmp_path: Path) -> None:
    """From the axis itself nobody can say on which side the ball is."""
    machine, table = swept(tmp_path, 0.0)
    done = run("calibrate", machine, table, "--select", "bx,by", "--json", "--holdout", "none", "--starts", "10")
    assert done.json["starts"]["agree"] > 0 and done.json["starts"]["rivals"] > 0
    assert "the data cannot separate them" in done.err


def test_what_is_not_seen_stays_where_it_was(tmp_path: Path) -> None:
    """Further starts differ in what data do not see; that is no disagreement, and not a reason to move it."""
    machine, table = swept(tmp_path, 3.0)
    machine.write_text(machine.read_text(encoding="utf-8").replace("nominal: -60", "nominal: 30"), encoding="utf-8")
    args = ("calibrate", machine, table, "--select", "bx,by,k*", "--json", "--holdout", "none")
    one, many = run(*args).json, run(*args, "--starts", "8").json
    assert one["undetermined"] and one["starts"] is None
    assert [p["value"] for p in one["parameters"]] == [p["value"] for p in many["parameters"]]
    assert many["starts"]["agree"] >= 4 and many["starts"]["rivals"] == 0


@pytest.mark.parametrize("seed", range(3))
def test_anchors_a_hundred_millimetres_off_converge(seed: int) -> None:
    """The prior's range says so, too: what ranges do not allow is not looked for."""
    from tests.test_holdout import table

    problem, _ = table("hangprinter_2021-12-16.csv", machine="hangprinter")
    names = (*(n for n in problem.model.names if n[0] in "ABCD"), "R_low", "R_high")
    wide = tuple(replace(p, range=0.1) if p.name[0] in "ABCD" else p for p in problem.model.parameters)
    far = replace(problem, model=replace(problem.model, parameters=wide))
    start = problem.model.nominal
    index = [k for k, n in enumerate(problem.model.names) if n[0] in "ABCD"]
    start[index] += np.random.default_rng(seed).uniform(-0.1, 0.1, len(index))
    best = identify(far, names)
    found, agreement = identify_from(far, names, start, 1, seed)
    assert found.status == "converged" and agreement is None
    assert found.chi2 == pytest.approx(best.chi2, rel=1e-6)


def campaign() -> tuple[Problem, tuple[str, ...], Fit]:
    """A table of the Scissors, and its fit."""
    plan, rng = by_engine(shipped("scissors")), np.random.default_rng(0)
    problem = plan.measured(plan.drawn(rng), rng)
    return problem, plan.selected, identify(problem, plan.selected)


def test_an_end_that_leaves_rows_out_is_neither_the_best_nor_as_good() -> None:
    """Fewer rows leave less chi-square."""
    problem, selected, fit = campaign()
    values = fit.values.copy()
    values[problem.model.names.index(selected[0])] += 20 * np.nanmax(fit.std)
    fewer = replace(fit, values=values, chi2=fit.chi2 - 5, failed={3: "out of reach"})
    best, agreement = best_of_starts(problem, selected, problem.model.nominal, fewer, 2, 0)
    assert best is not None and not best.failed and best.chi2 == pytest.approx(fit.chi2, rel=1e-9)
    assert (agreement.agree, agreement.rivals, agreement.worse) == (1, 0, 1)
    same = replace(fit, chi2=fit.chi2 - 5, failed={3: "out of reach"})
    best, _ = best_of_starts(problem, selected, problem.model.nominal, same, 2, 0)
    assert best is not None and not best.failed, "though the values are the same"


@pytest.mark.parametrize(("failed", "further"), [({}, False), ({3: "out of reach"}, True)])
def test_a_fit_that_leaves_rows_out_and_not_all_explained_is_helped(
    failed: dict[int, str], further: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three times the noise alone asks for no further start, and neither do rows that nothing predicts alone."""
    problem, selected, fit = campaign()
    ends = [replace(fit, chi2=3 * fit.chi2, failed=failed), fit]
    monkeypatch.setattr(starts, "identify", lambda *_, **__: ends[0] if len(ends) == 1 else ends.pop(0))
    told = list[str]()
    _, agreement = identify_from(problem, selected, problem.model.nominal, 0, 0, told.append)
    assert bool(told) == (agreement is not None) == further
    ends = [replace(fit, failed={3: "out of reach"})]
    assert identify_from(problem, selected, problem.model.nominal, 0, 0)[1] is None


def test_help_that_nobody_asked_for_ends_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each step of a start takes two seconds here; what was not tried is told, and tried where it is asked for."""
    problem, selected, fit = campaign()
    poor, seconds = replace(fit, chi2=1e9 * fit.chi2, status="not_converged"), [0.0]

    def slow(*_: object, progress: starts.Progress = None, **__: object) -> Fit:
        for step in range(3):
            seconds[0] += 2.0
            if progress is not None:
                progress(step, poor.chi2)
        return poor

    monkeypatch.setattr(starts, "Budget", lambda: Budget(clock=lambda: seconds[0]))
    monkeypatch.setattr(starts, "identify", slow)
    _, agreement = best_of_starts(problem, selected, problem.model.nominal, poor, 0, 0)
    assert seconds[0] <= HELP + 2.0 and agreement.starts + agreement.untried == starts.ON_FAILURE
    assert agreement.untried and f"{agreement.untried} not tried after 20 s" in agreement.text
    assert not best_of_starts(problem, selected, problem.model.nominal, poor, 8, 0)[1].untried


def test_folds_that_end_in_a_worse_minimum_begin_where_the_fit_ended() -> None:
    """Fewer rows leave less, so an end that leaves more is another minimum."""
    problem, _, fit = campaign()

    def again(part: Problem, selected: tuple[str, ...], start: Array, states: WarmStart | None) -> Fit:
        end = identify(part, selected, start, states=states)
        at_first = np.array_equal(start, fit.before.values)
        return replace(end, values=fit.before.values, chi2=10 * fit.chi2) if at_first else end

    folds = np.arange(len(problem)) % 2
    held, good = (cross_validate(problem, fit, folds, "2 folds", how) for how in (again, None))
    for kind, figures in good.after.items():
        assert held.after[kind].rms == pytest.approx(figures.rms, rel=1e-3)


def test_starts_agree_and_are_counted() -> None:
    plan = by_engine(shipped("scissors"))
    rng = np.random.default_rng(0)
    problem = plan.measured(plan.drawn(rng), rng)
    fit, agreement = identify_from(problem, plan.selected, plan.model.nominal, 6, 1)
    assert agreement is not None and agreement.starts >= 6
    assert agreement.agree == agreement.starts and agreement.spread < 1e-3
    assert fit.chi2 == pytest.approx(identify(problem, plan.selected).chi2, rel=1e-9)


def test_a_start_that_fails_is_helped_and_hopeless_data_are_told() -> None:
    """Cranks and lengths 20 mm and 5 degrees off; then rods that cannot reach at all."""
    plan = by_engine_of_five_bar()
    for seed in (3, 11):
        start = plan.model.nominal
        rng = np.random.default_rng(seed)
        for k, p in enumerate(plan.model.parameters):
            start[k] += rng.uniform(-1, 1) * (0.02 if p.dimension == "length" else np.radians(5))
        fit, _ = identify_from(plan, plan.model.names, start, 1, seed)
        assert fit.status == "converged" and fit.chi2_per_dof < 1.5


@cache
def by_engine_of_five_bar() -> Problem:
    from pkmcal_cli.calibration.measured_problem import problem_of
    from pkmcal_cli.loading.load_machine import load_machine, load_measurements

    loaded = load_machine(str(MACHINES / "five-bar.yaml"))
    problem = problem_of(loaded.model, load_measurements(loaded, [str(MACHINES / "five-bar.csv")]))
    wide = tuple(replace(p, range=0.02 if p.dimension == "length" else np.radians(5)) for p in problem.model.parameters)
    return replace(problem, model=replace(problem.model, parameters=wide))


def test_weak_directions_end_about_nominal_wherever_the_fit_began(tmp_path: Path) -> None:
    """Half a range along what the router's belts hardly see: the estimate is that from the drawing."""
    values = tmp_path / "p.yaml"
    values.write_text("parameters: {TLx: -7, TRx: 2993, TRy: 2210, BRy: 10}\n", encoding="utf-8")
    args = ("calibrate", MACHINES / "belt-router.yaml", MACHINES / "belt-router.csv", "--holdout", "none", "--json")
    one, other = run(*args).json["parameters"], run(*args, "-p", values).json["parameters"]
    for a, b in zip(one, other, strict=True):
        assert abs(a["value"] - b["value"]) < 0.1 * a["std"], a["name"]
