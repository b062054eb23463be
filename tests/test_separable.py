"""What `diagnose` advises to separate causes works: `plan` reaches plausible sizes with it, and with nothing else."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from pkmcal_cli.diagnosis.experiment_design import covariance_of
from tests.command import MACHINES, clean, run

CASES = {
    "sag, which straightness contains": ("gantry", "gantry-bow", "straight@rail1.z: {n2: 22 um}", "sag@rail1.z", False),
    "an angle, which differs": ("triglide-nonredundant",) * 2 + ("backlash@q1: {b: 45 um}", "release gamma", True),
}
APPROACHES = patch("pkmcal_cli.workflow.approaches._TRIES", 1)
"""One random direction is tried for each candidate, not the best of several."""
_BACKWARDS = 6  # rows at the end of a table that are measured the other way round: all drives go the same way else


def _poses(name: str, folder: Path) -> Path:
    """The poses of a table that is shipped, the last of them backwards."""
    lines = (MACHINES / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    file = folder / "poses.csv"
    file.write_text("\n".join([*lines[:-_BACKWARDS], *lines[: -_BACKWARDS - 1 : -1]]) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("case", CASES)
def test_points_are_advised_where_they_separate(case: str, tmp_path: Path) -> None:
    name, poses, planted, rival, separable = CASES[case]
    machine, table, worn = MACHINES / f"{name}.yaml", tmp_path / "t.csv", tmp_path / "worn.yaml"
    worn.write_text(f"extends: {machine}\neffects: {{{planted}}}\n", encoding="utf-8")
    noise = ("--noise", "declared", "--seed", "1", "-o", table)
    assert run("simulate", worn, _poses(poses, tmp_path), *noise).code == 0
    told = clean(run("diagnose", machine, table)).err
    assert rival in told and ("Points like those that were measured do not separate" in told) is not separable
    advised = re.search(r"measure the points of: pkmcal (plan .*)", told)
    assert (advised is not None) is separable
    effect = planted.partition(":")[0]
    rivals = re.search(rf"{effect} \(\d+ %\), ([^(]+) \(", told)
    assert rivals is not None
    plan = ["plan", machine, table, "--aim", f"separate:{effect},{rivals[1]}"]
    with APPROACHES:
        done = run(*(shlex.split(advised[1]) if advised is not None else plan))
    assert done.code == 0 and ("cannot separate them at plausible sizes" in done.err) is not separable


def test_every_effect_that_the_data_cannot_show_is_named() -> None:
    """A suspected cause is looked for in this list, so none of it is left out, however long it is."""
    done = clean(run("diagnose", MACHINES / "gantry.yaml", MACHINES / "gantry.csv", "--json"))
    _, _, listed = done.err.partition("Effects that these data cannot show")
    names = set(re.findall(r"^(\S+@\S+)", listed.partition("\nand ")[0], re.M))
    for kind in listed.partition("in --json): ")[2].partition("\n")[0].split("; "):
        effect, _, places = kind.partition("@")
        names |= {f"{effect}@{place}" for place in places.split(", ")}
    hidden = {f"{i['effect']}@{i['at']}" for i in done.json["invisible"] if i["effect"] != "release"}
    assert len(hidden) > 12 and hidden == {name for name in names if not name.startswith("release")}


@pytest.mark.parametrize("size", [1.0, 1e4, 1e9])
def test_two_columns_that_are_one_are_no_failure(size: float) -> None:
    """Their difference is not determined, whatever the rounding; their sum is, as well as one column alone would be."""
    column = size * np.random.default_rng(0).normal(size=(50, 1))
    both = np.hstack([column, column])
    covariance = covariance_of(both.T @ both + 1e-9 * np.eye(2))
    assert np.isfinite(covariance).all()
    total, apart = np.array([1.0, 1.0]), np.array([1.0, -1.0])
    alone = float((column**2).sum())
    assert total @ covariance @ total == pytest.approx(1 / alone, rel=1e-3)
    assert apart @ covariance @ apart > 1e6 / alone


def test_what_is_determined_is_inverted_to_rounding() -> None:
    rows = np.random.default_rng(1).normal(size=(40, 4)) * [1.0, 1e5, 1e-6, 1e2]
    normal = rows.T @ rows
    size = np.sqrt(np.diag(normal))
    scaled = np.outer(size, size)
    np.testing.assert_allclose((covariance_of(normal) * scaled) @ (normal / scaled), np.eye(4), atol=1e-11)
