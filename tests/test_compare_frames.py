"""`compare` where the tracker stands elsewhere each time, and the base has another datum."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.campaign_tables import MM, true_values, write_table
from tests.command import MACHINES, run

ANYWHERE = f"extends: {MACHINES / 'biglide.yaml'}\nsensors: {{tracker: {{frame: fitted}}}}\n"


def calibrated(folder: Path, name: str, datum: str, table: str) -> str:
    machine, file = folder / f"{name}.machine.yaml", str(folder / f"{name}.yaml")
    machine.write_text(f"{ANYWHERE}datum: [{datum}]\n")
    done = run("calibrate", machine, table, "-o", file, "-q", "--holdout", "none")
    assert done.code == 0, done.err
    return file


def table(folder: Path, name: str, seed: int, turn: float, **changed: float) -> str:
    return write_table(folder / f"{name}.csv", "biglide", true_values("biglide", 5, **changed), seed, 40, turn=turn)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("first")
    return calibrated(folder, "first", "x8, y8, yb1r", table(folder, "a", 1, 0.5))


@pytest.mark.slow
def test_frame_and_datum_are_removed(first: str, tmp_path: Path) -> None:
    again = table(tmp_path, "b", 2, -2.5)
    tests = []
    for name, datum in (("same", "x8, y8, yb1r"), ("other", "x8, xb2r, yb2r")):
        done = run("compare", first, calibrated(tmp_path, name, datum, again), "--json", "-q")
        assert done.code == 0 and {a["name"] for a in done.json["apart"]} >= {"frame@tracker.tx", "frame@tracker.rz"}
        tests.append(done.json["test"])
    assert tests[1]["statistic"] == pytest.approx(tests[0]["statistic"], rel=0.05)
    assert tests[1]["degrees_of_freedom"] == tests[0]["degrees_of_freedom"] >= 3


def test_a_changed_strut_is_seen_from_elsewhere(first: str, tmp_path: Path) -> None:
    second = table(tmp_path, "c", 3, -2.5, l2=0.2 * MM)
    done = run("compare", first, calibrated(tmp_path, "second", "x8, y8, yb1r", second), "--json", "-q")
    assert done.code == 1 and "l2" in done.json["named"]
    assert done.json["alone"]["change"] == pytest.approx(0.2, abs=3 * done.json["alone"]["std"])
