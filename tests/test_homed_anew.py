"""Drives that were homed anew between sessions, by a clock: no drift, unless the time within sessions says so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.effects import catalogue
from pkmcal_cli.report.sentences import cause_effect_action
from tests.command import MACHINES, Done, run
from tests.support import poses_of, truth

pytestmark = pytest.mark.usefixtures("unsized")

DAY, ROWS, SIGMA = 86400.0, 16, 10e-6
ZEROS = np.array([[0, 0, 0, 0], [60, -90, 70, 50], [-80, 40, 60, -70]]) * 1e-6
HEAD = "session,time [s],T [degC],q1 [mm],q2 [mm],q3 [mm],q4 [mm],x [mm],y [mm],z [mm]\n"


def diagnosed(folder: Path, sessions: int, gap: float, shifts: Callable[[int, Array], Array]) -> Done:
    """The diagnosis of sessions of half an hour each, a gap apart; `shifts`: of the drives, by session and share of
    the time of the table. What is measured comes from the independent simulator.
    """
    simulator, rng, lines = truth("delta4"), np.random.default_rng(5), []
    readings = np.round(simulator.inverse(poses_of("delta4", sessions * ROWS, seed=3)), 9)  # type: ignore[attr-defined]
    time = np.concatenate([k * gap + np.sort(rng.uniform(0, 1800, ROWS)) for k in range(sessions)])
    moved = np.stack([shifts(i // ROWS, time[i] / time[-1]) for i in range(len(time))])
    place = simulator.forward(readings + moved).tcp[:, :3]  # type: ignore[attr-defined]
    place += rng.normal(0, SIGMA, place.shape)
    for i, (t, q, p) in enumerate(zip(time, readings * 1e3, place * 1e3, strict=True)):
        warm = f"{t:.1f},{rng.normal(20, 1):.1f}"
        lines.append(",".join([f"s{i // ROWS + 1}", warm, *(f"{v:.6f}" for v in (*q, *p))]))
    (folder / "t.csv").write_text(HEAD + "\n".join(lines) + "\n")
    return run("diagnose", MACHINES / "delta4.yaml", folder / "t.csv", "--json")


def sets(done: Done) -> list[list[str]]:
    """The names of each cause, best first."""
    return [[f"{c['effect']}@{c['at']}" for c in e["credible_set"]] for e in done.json["effects"]]


@pytest.mark.parametrize(
    ("sessions", "name"), [(2, "zero@each[s2]"), pytest.param(3, "zero@each[each]", marks=pytest.mark.slow)]
)
def test_all_drives_homed_anew_are_one_cause_and_no_drift_alone(sessions: int, name: str, tmp_path: Path) -> None:
    """A day apart, a drift would be nearly the same in shape: the usual cause is in the set."""
    done = diagnosed(tmp_path, sessions, DAY, lambda k, t: ZEROS[k])
    (names,) = sets(done)
    assert name in names and set(names) <= {name, "zero_drift@each"}
    if sessions == 2:
        numbers = {p["name"]: p for p in done.json["effects"][0]["parameters"]}
        for q in range(4):
            found = numbers[f"zero@q{q + 1}[s2].o"]
            assert abs(found["value"] - 1e6 * ZEROS[1][q]) < 4 * found["std"] < 100


@pytest.mark.slow
def test_one_drive_homed_anew_every_day_is_one_cause(tmp_path: Path) -> None:
    (names,) = sets(diagnosed(tmp_path, 3, DAY, lambda k, t: ZEROS[k] * [0, 1, 0, 0]))
    assert "zero@q2[each]" in names and set(names) <= {"zero@q2[each]", "zero_drift@q2"}


@pytest.mark.slow
@pytest.mark.parametrize("drives", [(1, 1, 1, 1), (0, 1, 0, 0)])
def test_a_drift_that_the_time_within_the_sessions_shows_is_called_so(
    drives: tuple[int, ...], tmp_path: Path
) -> None:
    done = diagnosed(tmp_path, 2, 2400.0, lambda k, t: 3 * t * ZEROS[1] * drives)
    assert sets(done) == [["zero_drift@each" if all(drives) else "zero_drift@q2"]]


def test_drives_of_a_session_are_told_in_a_sentence() -> None:
    for at, where in (("each[tue]", "in session tue"), ("each[each]", "in every session")):
        cause, result, action = cause_effect_action(catalogue()["zero"], at, "5 um")
        assert cause == f"The home position or encoder zero of every drive {where} is off by 5 um."
        assert result.startswith(f"Every position of every drive {where} is")
        assert f"every drive {where}" in action
    assert "of q1 in every session is" in cause_effect_action(catalogue()["zero"], "q1[each]", "it")[0]


def test_the_datum_of_two_sessions_is_that_of_the_earlier_clock(tmp_path: Path) -> None:
    """Rows of a table may be shuffled; without a clock it is the session that comes first."""
    rows = [("tue", "90000,21", "350,650,980,450,200"), ("mon", "10,20", "360,660,990,455,205")]
    for clock, name in (("time [s],T [degC],", "zero@q1[tue]"), ("", "zero@q1[mon]")):
        lines = [",".join([s, *([at] if clock else []), values]) for s, at, values in rows]
        (tmp_path / "t.csv").write_text(f"session,{clock}q1,q2,q3,x,y\n" + "\n".join(lines) + "\n")
        done = run("effects", MACHINES / "triglide.yaml", tmp_path / "t.csv", "--simulate", "--json")
        names = [f"{e['effect']}@{e['at']}" for e in done.json["simulated"]]
        assert [n for n in names if n.startswith("zero@q1[")] == [name]
