"""Fits that converge and are not to be believed: exit 1, in the file that is written, and where it is read."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from tests.command import MACHINES, Done, clean, run
from tests.in_ci import in_ci

pytestmark = pytest.mark.usefixtures("unsized")

MACHINE, TABLE = MACHINES / "triglide-nonredundant.yaml", MACHINES / "triglide-nonredundant.csv"
Rows = list[list[str]]


def spoilt(folder: Path, change: Callable[[list[str], Rows], None]) -> Path:
    """The shipped table, its cells changed; 60 of its rows."""
    lines = [line for line in TABLE.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    head, *rows = csv.reader(lines)
    rows = rows[:: len(rows) // 60]
    change(head, rows)
    file = folder / "m.csv"
    file.write_text("\n".join(",".join(row) for row in [head, *rows]) + "\n", encoding="utf-8")
    return file


def calibrated(table: Path, *more: object) -> Done:
    return clean(run("calibrate", MACHINE, table, "--holdout", "none", "--json", *more))


def drifting_far(head: list[str], rows: Rows) -> None:
    """The line of x is 40 mm off at every second pose, that of y follows: nothing of the machine explains it."""
    rng = np.random.default_rng(0)
    for row in rows:
        for name in ("x [mm]", "y [mm]"):
            k = head.index(name)
            row[k] = repr(float(row[k]) + 40.0 * float(rng.normal()))


def one_far(head: list[str], rows: Rows) -> None:
    k = head.index("y [mm]")
    rows[17][k] = repr(float(rows[17][k]) + 1.0)


def turned(head: list[str], rows: Rows) -> None:
    """All readings of x are 5 mm more: fifty ranges of anything that could shift them."""
    k = head.index("x [mm]")
    for row in rows:
        row[k] = repr(float(row[k]) + 5.0)


def out_of_reach(head: list[str], rows: Rows) -> None:
    """In 20 of 77 rows a drive is where no leg closes: a machine that was measured was not there."""
    k = head.index("q1 [mm]")
    for row in rows[::3][:20]:
        row[k] = repr(float(row[k]) + 900.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (drifting_far, "of the machine's size"),
        (one_far, "far from what the other rows predict"),
        (turned, "ranges off nominal"),
        (out_of_reach, "20 of 77 rows, in which the machine was measured, cannot be predicted"),
    ],
)
def test_a_result_that_nobody_should_believe(
    change: Callable[[list[str], Rows], None], words: str, tmp_path: Path
) -> None:
    table, file = spoilt(tmp_path, change), tmp_path / "p.yaml"
    done = calibrated(table, "-o", file, "--starts", "1")
    assert done.code == 1 and done.json["status"] == "implausible"
    assert any(words in reason for reason in done.json["implausible"]), done.json["implausible"]
    assert "IMPLAUSIBLE" in done.err and words in done.err
    written = yaml.safe_load(file.read_text(encoding="utf-8"))["provenance"]
    assert written["status"] == "implausible" and "accepted" not in written
    assert written["implausible"] == done.json["implausible"]
    again = run("sensitivity", MACHINE, "-p", file)
    reasons = "; ".join(done.json["implausible"])
    assert f"warning: {file}: the fit ended with status `implausible`: {reasons}" in again.err


def scaled(head: list[str], rows: Rows) -> None:
    """One drive counts 2 % too much."""
    k = head.index("q1 [mm]")
    for row in rows:
        row[k] = repr(1.02 * float(row[k]))


@pytest.mark.parametrize("change", [turned, scaled])
def test_nothing_is_held_out_of_a_fit_that_nobody_should_use(
    change: Callable[[list[str], Rows], None], tmp_path: Path
) -> None:
    """A mistake that shows at once, and one that only the fit shows; who asks for it, or accepts the fit, has it."""
    table = spoilt(tmp_path, change)
    plain, asked, accepted = (
        clean(run("calibrate", MACHINE, table, "--json", "--starts", "1", *more))
        for more in ((), ("--holdout", "2"), ("--accept",))
    )
    assert plain.json["status"] == "implausible" and plain.code == 1
    assert plain.json["heldout"]["after"] is None and "implausible; `--holdout 5`" in plain.json["heldout"]["reason"]
    for done in (asked, accepted):
        assert done.json["status"] == "implausible" and done.json["heldout"]["after"] is not None


@pytest.mark.parametrize(
    "change", in_ci(["out_of_reach"], [drifting_far, out_of_reach], lambda change: str(change.__name__))
)
def test_diagnose_is_not_clean_either(change: Callable[[list[str], Rows], None], tmp_path: Path) -> None:
    """Where it finds no cause it says why the calibration is not to be believed, as `calibrate` does."""
    table = spoilt(tmp_path, change)
    done = clean(run("diagnose", MACHINE, table, "--json"))
    assert done.code == 1 and done.json["verdict"] == "implausible" and not done.json["effects"]
    assert done.json["implausible"] == calibrated(table, "--starts", "1").json["implausible"]
    assert all(f"because: {reason}" in done.err for reason in done.json["implausible"])


def test_diagnose_names_a_shift_that_calibrate_only_doubts(tmp_path: Path) -> None:
    done = clean(run("diagnose", MACHINE, spoilt(tmp_path, turned), "--json"))
    assert done.code == 1 and done.json["verdict"] == "measurement_fault" and not done.json["effects"]
    shift = re.search(r"shifted by `x` (\S+) mm", done.err)
    assert shift and abs(float(shift[1]) - 5.0) < 0.1, "which is how well lengths and places are known"


def constant(head: list[str], rows: Rows) -> None:
    """The instrument repeats the first y."""
    k = head.index("y [mm]")
    for row in rows:
        row[k] = rows[0][k]


def in_inches(head: list[str], rows: Rows) -> None:
    """x in inches under a heading of millimetres."""
    k = head.index("x [mm]")
    for row in rows:
        row[k] = repr(float(row[k]) / 25.4)


def shuffled(head: list[str], rows: Rows) -> None:
    """Readings belong to other rows."""
    move_readings(head, rows, np.random.default_rng(7).permutation(len(rows)))


def late(head: list[str], rows: Rows) -> None:
    """Readings are those of the row before."""
    move_readings(head, rows, np.roll(np.arange(len(rows)), 1))


def move_readings(head: list[str], rows: Rows, source: NDArray[np.intp]) -> None:
    """Readings of each row are taken from another."""
    places = [head.index(name) for name in ("x [mm]", "y [mm]")]
    old = [[row[k] for k in places] for row in rows]
    for row, other in zip(rows, source, strict=True):
        for k, value in zip(places, old[other], strict=True):
            row[k] = value


def some_gross(head: list[str], rows: Rows) -> None:
    """One row in thirteen is 20 mm off."""
    k = head.index("y [mm]")
    for row in rows[::13]:
        row[k] = repr(float(row[k]) + 20.0)


@pytest.mark.parametrize(
    "change", [constant, pytest.param(in_inches, marks=pytest.mark.slow), shuffled, late, some_gross]
)
def test_no_table_that_lies_is_good(change: Callable[[list[str], Rows], None], tmp_path: Path) -> None:
    done = calibrated(spoilt(tmp_path, change), "--starts", "1")
    assert done.code == 1 and done.json["status"] in ("implausible", "not_converged")


def test_it_can_be_accepted_which_is_recorded_and_repeated(tmp_path: Path) -> None:
    table, file = spoilt(tmp_path, turned), tmp_path / "p.yaml"
    done = calibrated(table, "-o", file, "--starts", "1", "--accept")
    assert done.code == 0 and done.json["status"] == "implausible" and done.json["verdict"] == "accepted"
    assert done.err.count("IMPLAUSIBLE, but accepted (`--accept`), and converged in") == 1
    assert "because: " in done.err and "do not use" not in done.err
    reasons = yaml.safe_load(file.read_text(encoding="utf-8"))["provenance"]["accepted"]
    assert reasons == done.json["implausible"]
    again = run("sensitivity", MACHINE, "-p", file)
    assert f"note: {file}: implausible, but accepted: {'; '.join(reasons)}" in again.err
    assert "warning" not in again.err


@pytest.mark.parametrize("accept", [False, True])
def test_whoever_reads_the_file_is_told_as_by_p(accept: bool, tmp_path: Path) -> None:
    table, file = spoilt(tmp_path, turned), tmp_path / "p.yaml"
    calibrated(table, "-o", file, "--starts", "1", *(["--accept"] if accept else []))
    (told,) = (line for line in run("sensitivity", MACHINE, "-p", file).err.splitlines() if str(file) in line)
    assert told.startswith("note: " if accept else "warning: ") and "ranges off nominal" in told
    assert told in calibrated(TABLE, "--prior", file).err
    good = tmp_path / "good.yaml"
    calibrated(TABLE, "-o", good)
    both = run("compare", file, good)
    assert told in both.err and str(good) not in "".join(x for x in both.err.splitlines() if x.startswith("warning"))


def test_a_robust_loss_does_without_the_row(tmp_path: Path) -> None:
    done = calibrated(spoilt(tmp_path, one_far), "--loss", "tukey")
    assert done.code == 0 and done.json["status"] == "converged" and done.json["implausible"] == []


def three_far(head: list[str], rows: Rows) -> None:
    """By 200 mm: what a robust loss leaves out is most of the rms."""
    k = head.index("y [mm]")
    for row in rows[7::20]:
        row[k] = repr(float(row[k]) + 200.0)


def test_what_a_robust_loss_leaves_out_is_no_reason(tmp_path: Path) -> None:
    done = calibrated(spoilt(tmp_path, three_far), "--loss", "tukey")
    assert done.code == 0 and done.json["implausible"] == [] and done.json["after"]["position"]["rms"] > 20


def test_what_is_large_but_explained_is_plausible() -> None:
    """One anchor of the hangprinter is nine ranges off; chi-square is 28 times what it should be.

    The radii of its spools are held: they explain it within their ranges, and are named.
    """
    machine, table = MACHINES / "hangprinter.yaml", MACHINES / "hangprinter_2021-12-16.csv"
    done = clean(run("calibrate", machine, table, "--holdout", "none", "--json"))
    assert done.code == 0 and done.json["status"] == "converged" and done.json["chi2_per_dof"] > 20
    assert done.json["uncertainty"]["held_explain"] == ["R_high", "R_low"]
    again = clean(run("calibrate", machine, table, "--holdout", "none", "--json", "--select", "auto,R_high,R_low"))
    assert again.json["chi2_per_dof"] < 1.6 and again.json["uncertainty"]["held_explain"] == []


@pytest.mark.slow
def test_improve_says_it_too(tmp_path: Path) -> None:
    table = spoilt(tmp_path, turned)
    done = clean(run("improve", MACHINE, table, "--json"))
    assert done.code == 1 and any("ranges off nominal" in reason for reason in done.json["implausible"])


def test_a_doubt_stays_with_the_values_that_are_kept(tmp_path: Path) -> None:
    """One parameter from good rows, the others from a fit that is not to be believed: neither is the result."""
    bad, new = tmp_path / "bad.yaml", tmp_path / "new.yaml"
    calibrated(spoilt(tmp_path, turned), "-o", bad)
    kept = calibrated(TABLE, "--select", "l1", "-p", bad, "-o", new)
    assert kept.code == 1 and kept.json["status"] == "implausible"
    assert any("values that are kept of " in reason and "l2" in reason for reason in kept.json["implausible"])
    again = run("simulate", MACHINE, TABLE, "-p", new)
    assert "values that are kept of " in again.err
    every = calibrated(TABLE, "-p", bad)
    assert not any("values that are kept of " in reason for reason in every.json["implausible"])
    accepted = calibrated(spoilt(tmp_path, turned), "-o", bad, "--force", "--accept")
    assert accepted.code == 0
    told = calibrated(TABLE, "--select", "l1", "-p", bad).json["implausible"]
    assert not any("values that are kept of " in reason for reason in told)
