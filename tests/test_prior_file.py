"""`calibrate --prior OLD.params.yaml`: few rows after a repair, what an earlier calibration knows besides."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.prior import prior_of_covariance
from tests.campaign_tables import MM, true_values, write_table
from tests.campaigns import shipped
from tests.command import MACHINES, run
from tests.truth import generate
from tests.two_slides import MACHINE as SLIDES
from tests.two_slides import Slides

BIGLIDE = str(MACHINES / "biglide.yaml")
REPAIRED = 0.12 * MM  # a new strut, off by more than its range


def tool_error(parameters: Path, true: Array) -> float:
    """rms of the predicted tool point over 60 poses, m, by the independent simulator at both sets of values."""
    plan, machine = shipped("biglide"), generate.campaigns()["biglide"].machine
    entries = yaml.safe_load(parameters.read_text())["parameters"]
    found = plan.model.nominal
    scale = {"mm": 1e-3, "N/mm": 1e3}
    for name, entry in entries.items():
        found[plan.model.names.index(name)] = entry["value"] * scale[entry["unit"]]
    poses, places = plan.positions[::2], list[Array]()
    for values in (found, true):
        given = plan.model.by_name(values)
        places.append(machine.forward(poses, {n: given.get(n, v) for n, v in machine.nominal.items()}).tcp[:, :2])
    return float(np.sqrt(((places[0] - places[1]) ** 2).sum(axis=1).mean()))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An old calibration with 60 rows: old.yaml."""
    monkeypatch.chdir(tmp_path)
    table = write_table(tmp_path / "old.csv", "biglide", true_values("biglide", 3), 1, 60)
    assert run("calibrate", BIGLIDE, table, "-o", "old.yaml", "-q", "--holdout", "none").code == 0
    return tmp_path


def test_six_points_after_a_repair_are_enough(folder: Path) -> None:
    """Against a full calibration of the repaired machine; six rows alone are far worse."""
    true = true_values("biglide", 3, l1=REPAIRED)
    six = write_table(folder / "six.csv", "biglide", true, 5, 6)
    full = write_table(folder / "full.csv", "biglide", true, 6, 60)
    assert run("calibrate", BIGLIDE, full, "-o", "full.yaml", "-q", "--holdout", "none").code == 0
    done = run("calibrate", BIGLIDE, six, "--prior", "old.yaml", "--loosen", "l1", "-o", "new.yaml", "--holdout=none")
    assert done.code == 0, done.err
    assert "loosened): l1" in done.err and "known by old.yaml" in done.err
    run("calibrate", BIGLIDE, six, "--prior", "ranges", "-o", "alone.yaml", "-q", "--holdout", "none")
    new, fully, alone, old = (tool_error(folder / f"{n}.yaml", true) for n in ("new", "full", "alone", "old"))
    assert new < 2.5 * fully and new < 8e-6 < 0.5 * alone and old > 50e-6, (new, fully, alone, old)
    verified = run("check", BIGLIDE, full, "-p", "new.yaml", "-q")
    assert verified.code == 0, verified.err  # and its uncertainties hold


def test_the_prior_counts_as_it_says(folder: Path) -> None:
    """The posterior of a linear problem: the sum of the informations, whatever unit parameters are in."""
    true = true_values("biglide", 3)
    six = write_table(folder / "six.csv", "biglide", true, 5, 6)
    assert run("calibrate", BIGLIDE, six, "--prior", "old.yaml", "-o", "new.yaml", "-q", "--holdout", "none").code == 0
    old, new = (yaml.safe_load((folder / n).read_text()) for n in ("old.yaml", "new.yaml"))
    sections = [dict(zip(s["names"], s["std"], strict=True)) for s in (old["correlations"], new["correlations"])]
    assert sections[0].keys() == sections[1].keys()  # what was held is identified now, by what is known of it
    assert all(sections[1][n] <= 1.02 * sections[0][n] for n in sections[0])
    wide = {n for n in sections[0] if sections[1][n] > 0.9 * sections[0][n]}
    assert {"k1", "k2"} <= wide  # six points tell nothing of stiffnesses


def test_names_without_partner_are_listed(folder: Path) -> None:
    """A machine with another parameter, without one of the old: no fingerprint is asked for."""
    (folder / "other.yaml").write_text(
        f"extends: {BIGLIDE}\nparameters: {{l3: null, leg: 300}}\nactuators: {{q3: {{offset: leg}}}}\n"
    )
    six = write_table(folder / "six.csv", "biglide", true_values("biglide", 3), 5, 6)
    done = run("calibrate", "other.yaml", six, "--prior", "old.yaml", "--holdout", "none")
    assert "without partner in old.yaml, known to their ranges: leg" in done.err
    assert "not in this machine, left out: l3" in done.err and "another machine" not in done.err


def test_a_prior_of_another_machine_is_told(folder: Path) -> None:
    """Its few names may mean something else here; so may those with values that this machine can hardly have."""
    slides = Slides().table(folder / "slides.csv", 1)
    (folder / "slides.yaml").write_text(SLIDES.replace("h: 1000", "l1: 1000").replace("[0, h]", "[0, l1]"))
    done = run("calibrate", "slides.yaml", slides, "--prior", "old.yaml", "--select", "x2,l1,s", "--holdout", "none")
    (line,) = (text for text in done.err.splitlines() if "another machine" in text)
    assert re.match(r"warning: prior: old.yaml is of another machine, `.*biglide.yaml`: here are 1 of its 12 p", line)
    assert "further from nominal here than their range: l1;" in line
    effect = "effects: {scale@q1: {s: {identify: true}}}\n"
    (folder / "near.yaml").write_text(f"extends: {BIGLIDE}\nparameters: {{l1: {{nominal: 305}}}}\n{effect}")
    six = write_table(folder / "six.csv", "biglide", true_values("biglide", 3), 5, 6)
    done = run("calibrate", "near.yaml", six, "--prior", "old.yaml", "--holdout", "none")
    assert "further from nominal here than their range: l1;" in done.err
    done = run("calibrate", "near.yaml", six, "--prior", "old.yaml", "--loosen", "l1", "--holdout", "none")
    assert "another machine" not in done.err


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["--loosen", "l1"], 2, "--loosen needs a prior"),
        (["--prior", "old.yaml", "--loosen", "m*"], 2, "no parameter `m*`"),
        (["--prior", "old.yaml", "--loosen", ","], 2, "names no parameter"),
        (["--prior", "none.yaml"], 3, "No such file"),
        (["--prior", "rangse"], 2, "not a valid value"),
        (["--prior", "plain.yaml"], 3, "no complete `correlations`"),
        (["--prior", "spoilt.yaml"], 3, "no complete `correlations`"),
        (["--prior", BIGLIDE], 3, "must have a finite `value`"),
    ],
)
def test_odd_priors(folder: Path, arguments: list[str], code: int, told: str) -> None:
    (folder / "plain.yaml").write_text("parameters: {l1: {value: 300, unit: mm}}\n")
    spoilt = (folder / "old.yaml").read_text().replace("    - [1, ", "    - [-1, ", 1)
    (folder / "spoilt.yaml").write_text(spoilt)  # what has a negative variance is no covariance
    done = run("calibrate", BIGLIDE, str(MACHINES / "biglide.csv"), *arguments, "--holdout", "none")
    assert done.code == code and told in done.err, done.err


def test_a_prior_is_its_covariance() -> None:
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4)) * [1e-3, 1.0, 1e3, 1e-6]
    covariance = root.T @ root
    prior = prior_of_covariance(("a", "b", "c", "d"), covariance, np.zeros(4))
    std = np.sqrt(np.diag(covariance))
    scaled = prior.rows * std
    assert np.linalg.inv(scaled.T @ scaled) == pytest.approx(covariance / np.outer(std, std), abs=1e-6)


@pytest.mark.slow
def test_a_prior_of_another_size_ends_early(tmp_path: Path) -> None:
    """An angle a thousand times too large, known to 1e-5 of itself: steps creep, and lead nowhere after 56."""
    gantry, all_rows = MACHINES / "gantry.yaml", (MACHINES / "gantry.csv").read_text().splitlines()
    five, old = tmp_path / "five.csv", tmp_path / "old.yaml"
    five.write_text("\n".join([line for line in all_rows if not line.startswith("#")][:6]) + "\n")
    assert run("calibrate", gantry, MACHINES / "gantry.csv", "-o", old, "-q", "--holdout", "none").code == 0
    content = yaml.safe_load(old.read_text())
    content["parameters"]["cl"]["value"] *= 1e3
    old.write_text(yaml.safe_dump(content))
    done = run("calibrate", gantry, five, "--prior", old, "--starts", "1", "--holdout", "none")
    steps = re.search(r"NOT CONVERGED in (\d+) steps", done.err)
    assert done.code == 1 and steps is not None and int(steps[1]) < 30, done.err
