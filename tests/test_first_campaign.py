"""docs/first-campaign.md: its files are those of the independent simulator, and the planted machine is found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.command import column, run
from tests.first_campaign import BACKLASH, FOLDER, FOUND, SIGMA, TARGETS, files, machine, positions
from tests.truth.templates_true import delta, delta_pose


def numbers(text: str) -> list[list[float]]:
    """The cells of a table that are numbers."""
    return [[float(c or "nan") for c in line.split(",")[1:]] for line in text.splitlines()[1:]]


@pytest.mark.slow
def test_the_files_are_those_of_the_simulator() -> None:
    for name, text in files().items():
        stored = (FOLDER / name).read_text(encoding="utf-8")
        if name.endswith(".yaml"):
            assert stored == text, "run `python -m tests.first_campaign`"
            continue
        assert stored.splitlines()[0] == text.splitlines()[0]
        assert np.array(numbers(stored)) == pytest.approx(np.array(numbers(text)), abs=2e-4, nan_ok=True), name


def test_both_ways_of_the_closed_form_agree() -> None:
    p = machine()
    for pose in ([100.0, -60.0, -500.0], [-140.0, 120.0, -460.0]):
        assert delta_pose(delta(np.array(pose), p), p) == pytest.approx(pose, abs=1e-9)


def test_what_was_planted_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dimensions within their uncertainties; the corrected machine, without noise, is at its targets."""
    monkeypatch.chdir(tmp_path)
    Path("delta.yaml").write_text((FOLDER / "delta.yaml").read_text())
    Path("found.yaml").write_text(FOUND)
    done = run("calibrate", "found.yaml", FOLDER / "measured.csv", "-o", "p.yaml", "--holdout", "none", "--json", "-q")
    found, true = {p["name"]: p for p in done.json["parameters"]}, machine()
    backlash = found.pop("backlash@q2.b")
    assert backlash["value"] == pytest.approx(1e3 * BACKLASH, abs=4 * backlash["std"])
    off = np.array([(p["value"] - true[n]) / p["std"] for n, p in found.items()])
    assert np.abs(off).max() < 4 and (off**2).mean() < 2
    done = run("correct", "found.yaml", "--grid", TARGETS, "-p", "p.yaml", "-q", "-o", "commands.csv")
    q = np.stack([column("commands.csv", f"q{i}") for i in (1, 2, 3)], axis=1)
    sides = np.stack([column("commands.csv", f"dir.q{i}") for i in (1, 2, 3)], axis=1)
    wanted = np.stack([column("commands.csv", f"target.{c}") for c in "xyz"], axis=1)
    error = np.linalg.norm(positions(q, sides) - wanted, axis=1)
    assert np.sqrt((error**2).mean()) < SIGMA
    assert yaml.safe_load(Path("p.yaml").read_text())["parameters"]


def test_a_plan_that_is_filled_in_raises_no_questions() -> None:
    """Where approaches begin is for the control: no note that columns are not used."""
    done = run("check", FOLDER / "delta.yaml", FOLDER / "measured.csv")
    assert done.code == 0 and "approach" not in done.err and "79 rows" in done.err
