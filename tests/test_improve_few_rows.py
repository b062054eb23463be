"""`improve` with few rows: effects that are named are confirmed, each pose left out in turn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.command import clean, run
from tests.computed_once import run_once
from tests.test_first_machines import ROUTER

pytestmark = pytest.mark.usefixtures("unsized")

ONLY = ("--only", "scale@lTL,scale@lTR")


@pytest.fixture(scope="module")
def few(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Eight poses of the router, of which an upper belt is scaled by 1.2 mm/m."""
    folder = tmp_path_factory.mktemp("few")
    machine, faulty, poses, table = (folder / n for n in ("router.yaml", "faulty.yaml", "poses.csv", "t.csv"))
    machine.write_text(ROUTER.replace("sigma: 0.3 mm", "sigma: 0.05 mm").replace("sigma: 1 mm", "sigma: 0.1 mm"))
    faulty.write_text(f"extends: {machine}\neffects: {{scale@lTL: {{s: 1200 um/m}}}}\n")
    rng = np.random.default_rng(2)
    places = zip(rng.uniform(600, 3400, 8), rng.uniform(500, 2500, 8), strict=True)
    poses.write_text("\n".join(["x,y,z", *(f"{x:.1f},{y:.1f},0" for x, y in places)]) + "\n")
    assert clean(run("simulate", faulty, poses, "--noise", "declared", "--seed", "4", "-o", table)).code == 0
    return machine, table


def test_named_effects_are_confirmed(few: tuple[Path, Path], tmp_path: Path) -> None:
    done = clean(run_once("improve", *few, *ONLY, "-o", tmp_path / "b.yaml", "--json"))
    assert done.code == 0, done.err
    (step,) = done.json["steps"]
    assert (step["effect"], step["at"], step["accepted"]) == ("scale", "lTL", True)
    assert done.json["rotations"] == 8, "each pose in turn"


def test_improve_takes_limits_of_the_rows_that_report(few: tuple[Path, Path]) -> None:
    limits = ("--fail-above", "heldout 0.5 mm", "--fail-above", "std:Nowhere 1 mm")
    assert clean(run("improve", *few, *ONLY, *limits)).code == 2
    limits = ("--fail-above", "heldout 0.5 mm", "--fail-above", "heldout 1 um", "--format", "github")
    done = clean(run_once("improve", *few, *ONLY, *limits, "--json", "-q"))
    kept, missed = done.json["gates"]
    assert done.code == 1 and done.json["failures"] == [] and kept["kept"] and not missed["kept"]
    first = next(iter(done.json["after"].values()))
    assert missed["value"] == pytest.approx(1e3 * first["rms"]), "of the report rows"
    assert f"::error file={few[1]},title=above::" in done.err


def test_without_names_few_rows_are_refused(few: tuple[Path, Path]) -> None:
    done = clean(run("improve", *few))
    assert done.code == 3 and "measure 20 rows or more" in done.err and "name what to look for (`--only`)" in done.err


@pytest.mark.parametrize(
    ("names", "message", "remedy"),
    [
        ("scale@lTLL", "this machine has no effect `scale@lTLL`", "did you mean `scale@lTL`?"),
        ("drift@tape", "this table cannot show `drift@tape`", "column `time`"),
        (" , ", "--only names no effect", "zero@all"),
    ],
)
def test_wrong_names_are_told(few: tuple[Path, Path], names: str, message: str, remedy: str) -> None:
    done = clean(run("improve", *few, "--only", names))
    assert done.code == 2 and message in done.err and remedy in done.err
