"""`compare` tells each single change that explains all, with its size: planted in two slides and a tracker."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.comparison import Alone, Changes, Omnibus, Single, changed
from tests.command import run
from tests.two_slides import MACHINE, Slides


def test_changes_that_are_not_told_apart_have_their_sizes(tmp_path: Path) -> None:
    """The second slide moved on by 0.5 mm: the first back by as much has the same readings, of a tracker elsewhere."""
    machine, files = tmp_path / "m.yaml", [tmp_path / "one.yaml", tmp_path / "two.yaml"]
    machine.write_text(MACHINE, encoding="utf-8")
    for seed, (true, file) in enumerate(zip((Slides(), Slides().repaired()), files, strict=True)):
        table = true.table(file.with_suffix(".csv"), seed + 1)
        done = run("calibrate", machine, table, "-o", file, "-q", "--holdout", "none")
        assert done.code == 0, done.err
    done = run("compare", *files, "--json")
    one = done.json["alone"]
    assert one["explains"] and {one["name"], *(r["name"] for r in one["rivals"])} == {"x1", "x2"}
    found = {c["name"]: c for c in (one, *one["rivals"])}
    for name, true_change in (("x1", -0.5), ("x2", 0.5)):
        change = found[name]
        assert change["change"] == pytest.approx(true_change, abs=4 * change["std"]) and change["unit"] == "mm"
        assert change["std"] < 0.02
    (line,) = (each for each in done.err.splitlines() if each.startswith("or, not told from it, by another alone: "))
    assert done.json["named"] == ["x2"] and "explained by one parameter alone: x2 by 0.4" in done.err
    assert re.search(r" x1 by -0\.[\d]+\(\d+\) mm$", line), line  # the datum, which no fit identified


@pytest.mark.parametrize(
    ("p", "holms", "sufficient", "p_left", "names"),
    [
        (0.2, (1e-9, 1.0), ("a",), 0.5, ()),  # no alarm, no names
        (1e-9, (1e-9, 1e-3), ("a",), 1e-6, ("a", "b")),  # one alone is not enough
        (1e-9, (1e-9, 1e-3), ("a", "c"), 0.5, ("a",)),
        (1e-9, (1.0, 1e-3), ("a", "c"), 0.5, ("c", "d")),
        (1e-9, (1.0, 1.0), ("c",), 0.5, ("c", "d")),
        (1e-9, (1.0, 1.0), (), 1e-6, ()),
    ],
)
def test_what_is_named(
    p: float, holms: tuple[float, float], sufficient: tuple[str, ...], p_left: float, names: tuple[str, ...]
) -> None:
    tests, nothing = np.array(holms), np.zeros((2, 2))
    found = Changes(names=("a", "b"), values=np.zeros(2), covariance=nothing, null=nothing,
                    determined=np.ones(2, dtype=bool), p_values=tests, holm=tests)  # fmt: skip
    single = Alone("c", 1.0, 0.1, p_left, (Single("d", 2.0, 0.2, p_left),), sufficient)
    assert changed(found, single, Omnibus(5.0, 5, 50.0, p), 0.05) == names
