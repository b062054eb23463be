"""`plan --next`: as few rows as a plan that knows all, what it promises, and where nothing could be measured."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.observability_indices import observability
from pkmcal_cli.calibration.problem import design_problem
from pkmcal_cli.prediction import Rows
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.workflow import approaches
from pkmcal_cli.workflow.next_batch import Advice, advice, batch
from pkmcal_cli.workflow.next_points import NextPoints, next_points
from tests.command import clean, run
from tests.next_campaigns import BOX, CASES, LIMIT, MACHINE, NAME, SIGMA, Case, Knowing, grown, measured, table
from tests.truth.generate import campaigns, grid


def campaign(case: Case, seed: int, k: int = 3) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Set values and readings of an even grid, and the true parameters."""
    machine, rng = campaigns()["triglide-nonredundant"].machine, np.random.default_rng(seed)
    true = {n: v + rng.normal(0, 0.05e-3) for n, v in machine.nominal.items() if n[0] in "lxy"}
    readings = machine.inverse(grid((*BOX[0], k), (*BOX[1], k)))
    return readings, measured(readings, case, seed, true, rng), true


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few ways to step back are tried: for tests of what is said."""
    monkeypatch.setattr(approaches, "_TRIES", 2)


def asked(file: Path, readings: np.ndarray, values: np.ndarray, limit: float = LIMIT) -> NextPoints:
    file.write_text(table(readings, values), encoding="utf-8")
    aim = f"{NAME} {1e6 * limit:g} um"
    return next_points(MACHINE, str(file), None, "auto", aim=aim, budget=150, seed=0, to=Reporter(True))


@pytest.mark.slow
@pytest.mark.parametrize("seed", [8, 3])
def test_points_as_good_as_those_of_a_plan_that_knows_all(seed: int, tmp_path: Path) -> None:
    """Row by row, at the noise as it is; how many there are depends on how large the noise turned out to be."""
    found, knowing = grown(CASES[0], seed, tmp_path), Knowing.of(CASES[0], seed, tmp_path)
    assert found.status == "reached" and abs(found.error) < 4 * LIMIT
    asked_for = np.loadtxt(tmp_path / f"{seed}.csv", delimiter=",", skiprows=1)[:, :2] * 1e-3
    best = knowing.fixed()
    assert best <= found.rows
    design = design_problem(knowing.loaded.model, Rows.at(asked_for[:best]))
    observed = observability(design, knowing.values, knowing.selected)
    assert observed.std[observed.selected.index(NAME)] < 1.02 * LIMIT


@pytest.mark.usefixtures("hasty")
def test_noise_is_told_by_the_residuals_not_by_what_is_stated(tmp_path: Path) -> None:
    """Twice the stated noise: the uncertainty that decides is that of a calibration to which no sigma is stated."""
    readings, values, _ = campaign(CASES[1], 2, 4)
    file = tmp_path / "a.csv"
    file.write_text(table(readings, values), encoding="utf-8")
    unknown = tmp_path / "unknown.yaml"
    unknown.write_text(f"extends: {MACHINE}\nsensors: {{tracker: {{sigma_is: unknown}}}}\n", encoding="utf-8")
    stds = [run("plan", m, file, "--next", "--budget", 40, "--aim", "l1 1 um", "--json", "-q").json["aim"]["before"]
            for m in (MACHINE, unknown)]  # fmt: skip
    assert stds[0] == pytest.approx(stds[1], rel=1e-9)
    stated = run("calibrate", MACHINE, file, "--json", "-q").json
    (l1,) = (p for p in stated["parameters"] if p["name"] == NAME)
    assert stds[0] > 1.03 * l1["std"], "which takes a mean of both"


@pytest.mark.parametrize(("k", "command", "more"), [(4, "diagnose", 20 - 16), (6, "improve", 36 // 4)])
@pytest.mark.usefixtures("hasty")
def test_where_there_is_more_than_noise_a_cause_is_to_be_looked_for(
    k: int, command: str, more: int, tmp_path: Path
) -> None:
    """By a command that takes so few rows; as many are proposed as `improve` lacks, then a quarter of what there is."""
    readings, values, _ = campaign(CASES[3], 4, k)
    found = asked(tmp_path / "a.csv", readings, values, 12e-6)
    assert found.advice == command and found.needed > 2 * k**2 and len(found.added.points) == more
    done = run("plan", MACHINE, tmp_path / "a.csv", "--next", "--budget", 150, "--aim", "l1 12 um")
    assert f"times the stated noise: `pkmcal {command}` looks for a cause" in done.err
    quiet = asked(tmp_path / "b.csv", readings, campaign(CASES[0], 4, k)[1], 12e-6)
    assert not quiet.advice and len(quiet.added.points) == min(-(-quiet.needed // 2), k**2)


def test_noise_as_it_is_stated_asks_for_no_search_but_by_chance() -> None:
    """In 5 % of tables at most, whatever their size; of a noise 20 % larger in most of those that are large."""
    rng = np.random.default_rng(0)
    for dof, larger in ((10, 0.05), (40, 0.3), (150, 0.9)):
        noise = np.sqrt(rng.chisquare(dof, 4000) / dof)
        rates = [np.mean([bool(advice(f * n, dof, 30)) for n in noise]) for f in (1.0, 1.2)]
        assert rates[0] < 0.06 and rates[1] > larger
    assert not advice(1.09, 3000, 1500) and advice(1.11, 3000, 1500), "nobody states noise better than by a tenth"


def test_a_machine_with_backlash_whose_first_side_is_unknown(tmp_path: Path) -> None:
    """As `improve` adds it: half of it is an uncertainty of the first row, and of no point that is planned."""
    machine, file = tmp_path / "m.yaml", tmp_path / "a.csv"
    machine.write_text(f"extends: {MACHINE}\neffects: {{backlash@q1: {{b: 20 um}}}}\n", encoding="utf-8")
    readings, values, _ = campaign(CASES[0], 1, 5)
    file.write_text(table(readings, values), encoding="utf-8")
    for more in (("--next", "--budget", 60, "--aim", "l1 10 um"), ("--aim", "l1 10 um", "--points", 4)):
        done = clean(run("plan", machine, file, *more, "--json"))
        assert done.code == 0 and done.json["points"]


@pytest.mark.parametrize(
    ("rows", "advised", "most"),
    [(9, "", 9), (6, "diagnose", 6), (16, "diagnose", 4), (20, "improve", 5), (60, "improve", 15)],
)
def test_never_more_points_than_were_measured(rows: int, advised: Advice, most: int) -> None:
    assert batch(100, rows, advised) == most and batch(3, rows, advised) == 3


@pytest.mark.slow
def test_who_follows_the_advice_needs_fewer_rows_than_one_who_counts_the_cause_as_noise(tmp_path: Path) -> None:
    found = grown(CASES[3], 4, tmp_path)
    assert found.status == "reached" and abs(found.error) < 2 * LIMIT
    assert found.rows < 0.6 * Knowing.of(CASES[3], 4, tmp_path).fixed()


@pytest.mark.usefixtures("hasty")
def test_the_rows_that_it_asks_for_tell_what_it_says(tmp_path: Path) -> None:
    case, rng = CASES[0], np.random.default_rng(5)
    readings, values, true = campaign(case, 5)
    first = asked(tmp_path / "a.csv", readings, values, 2 * LIMIT / 3)
    reached = first.added.reached
    assert first.status == "continue" and reached is not None and reached.after <= 2 * LIMIT / 3 < reached.before
    more = first.added.points.rows.readings
    assert len(more) == -(-first.needed // 2), "half of them before the rest is planned"
    after = asked(
        tmp_path / "b.csv", np.vstack([readings, more]), np.vstack([values, measured(more, case, 5, true, rng)])
    )
    assert after.added.reached is not None
    assert reached.after * 0.7 < after.added.reached.before < reached.before


def test_where_nothing_could_be_measured_nothing_is_proposed(tmp_path: Path) -> None:
    readings, values, _ = campaign(replace(CASES[0], lost=0.3), 1, 5)
    lost = readings[np.isnan(values[:, 0])]
    assert len(lost) > 2
    found = asked(tmp_path / "a.csv", readings, values, 5e-6)
    apart = np.abs(found.added.points.rows.readings[:, None] - lost[None]) / np.ptp(readings, axis=0)
    assert len(found.added.points) and (apart.max(axis=2) > 0.05).all()


@pytest.mark.usefixtures("hasty")
def test_a_command_that_is_asked_again(tmp_path: Path) -> None:
    """Ends with 0 where there is something to do or nothing left, with 1 where the budget does not do."""
    readings, values, _ = campaign(CASES[0], 2)
    file = tmp_path / "a.csv"
    file.write_text(table(readings, values), encoding="utf-8")
    codes = []
    for limit, budget in (("20 um", 40), ("1 m", 40), ("1 um", 12)):
        done = clean(run("plan", MACHINE, file, "--next", "--budget", budget, "--aim", f"l1 {limit}", "--json", "-q"))
        codes.append((done.code, done.json["status"]))
        assert ("NOT REACHED within 12 rows: l1" in done.err) if done.code else not done.err, "even when quiet"
    assert codes == [(0, "continue"), (0, "reached"), (1, "not_reached")]
    assert SIGMA == 1e-5


def test_from_rows_at_one_place_a_workspace_leads_on(tmp_path: Path) -> None:
    """Around three near rows nothing determines l1, however many are added; where in all to look the file may say."""
    wide = tmp_path / "wide.yaml"
    wide.write_text(f"extends: {MACHINE}\nworkspace: {{box: {{x: [200, 700], y: [160, 390]}}}}\n", encoding="utf-8")
    head, *rows = [r for r in Path(MACHINE).with_suffix(".csv").read_text().splitlines() if not r.startswith("#")]
    near = tmp_path / "near.csv"
    near.write_text("\n".join([head, *rows[:3], ""]), encoding="utf-8")
    for machine, code, helped in ((MACHINE, 1, True), (wide, 0, False)):
        done = run("plan", machine, near, "--next", "--budget", 30, "--aim", "l1 0.1 mm")
        told = done.out + done.err
        assert done.code == code and ("`workspace:`" in told) is helped, told


@pytest.mark.usefixtures("hasty")
def test_it_goes_on_with_the_session_measured_last_and_says_so(tmp_path: Path) -> None:
    """By time, however the rows are ordered: here the last row of the file is the first that was measured."""
    readings, values, _ = campaign(CASES[0], 5)
    head, *rows = table(readings, values).splitlines()
    days = [f"{row},{'mon' if k < 4 else 'tue'},{60 * k}" for k, row in enumerate(rows)]
    file, more = tmp_path / "t.csv", tmp_path / "next.csv"
    ask = ("plan", MACHINE, file, "--next", "--budget", "150", "--aim", "l1 15 um", "-o", more, "--force")
    for order, last, session in ((days[::-1], "time [s]", "tue"), (days[::-1], "note", "mon")):
        file.write_text("\n".join([f"{head},session,{last}", *order]) + "\n", encoding="utf-8")
        done = clean(run(*ask))
        assert f"they go on with session `{session}`; if they are measured in another" in done.err
        plan = [line.split(",") for line in more.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
        assert {row[plan[0].index("session")] for row in plan[1:]} == {session}
    file.write_text(table(readings, values), encoding="utf-8")
    assert "they go on with session" not in run(*ask).err


@pytest.mark.usefixtures("hasty")
def test_what_two_rows_do_not_determine_is_so_told(tmp_path: Path) -> None:
    readings, values, _ = campaign(CASES[0], 2, 4)
    file = tmp_path / "two.csv"
    file.write_text(table(readings[:2], values[:2]), encoding="utf-8")
    done = run("plan", MACHINE, file, "--next", "--budget", 3, "--aim", "l1 1 um")
    assert done.code == 1 and "NOT REACHED within 3 rows: l1 is undetermined, wanted 1 um" in done.err, done.err
