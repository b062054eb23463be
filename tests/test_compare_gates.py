"""`compare --fail-above`: limits for what the last parameter file keeps of its fit, as `calibrate` said it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from pkmcal_cli.loading.kept_errors import KeptErrors
from pkmcal_cli.units.unit_text import parse_unit
from tests.command import MACHINES, Done, clean, run

MACHINE, DATA = (str(MACHINES / f"triglide-nonredundant.{end}") for end in ("yaml", "csv"))


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A parameter file, and what `calibrate` said beside it."""
    file = tmp_path_factory.mktemp("fits") / "new.yaml"
    done = run("calibrate", MACHINE, DATA, "-o", file, "--json")
    assert done.code == 0, done.err
    return file, done.json


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same without held-out rows and with a single parameter."""
    file = tmp_path_factory.mktemp("fits") / "old.yaml"
    assert run("calibrate", MACHINE, DATA, "-o", file, "-q", "--holdout", "none", "--select", "l1").code == 0
    return file


def compared(first: Path, last: Path, *limits: str, form: tuple[str, ...] = ("--json",)) -> Done:
    words = (word for limit in limits for word in ("--fail-above", limit))
    return clean(run("compare", first, last, *words, *form))


def test_limits_are_held_against_what_the_fit_said(calibrated: tuple[Path, dict[str, Any]], bare: Path) -> None:
    file, said = calibrated
    l1 = next(p for p in said["parameters"] if p["name"] == "l1")
    figures = {
        "heldout": (1e3 * said["heldout"]["rms_after"], " um"),
        "fitted": (1e3 * said["after"]["position"]["rms"], " um"),
        "fitted:position": (1e3 * said["after"]["position"]["rms"], " um"),
        "chi2": (said["chi2_per_dof"], ""),
        "std:l1": (1e3 * l1["std"], " um"),
    }
    kept = compared(file, file, *(f"{name} {value * 1.001:.9g}{unit}" for name, (value, unit) in figures.items()))
    assert kept.code == 0
    values = [gate["value"] for gate in kept.json["gates"]]
    assert values == pytest.approx([value for value, _ in figures.values()], rel=1e-5), "files keep six digits"
    limits = [f"{name} {value * 0.999:.9g}{unit}" for name, (value, unit) in figures.items()]
    missed = compared(bare, file, *limits, form=("-q",))
    assert missed.code == 1 and missed.err.count(f"{file}: error[above]: ") == len(limits)


def test_the_last_file_counts(calibrated: tuple[Path, dict[str, Any]], bare: Path) -> None:
    """Nothing was held out for it, which is no limit kept."""
    told = compared(calibrated[0], bare, "heldout 1 m", "std:l2 1 m", form=("-q",)).err
    assert "heldout (nothing was held out): unknown, so the limit of 1 m is missed" in told
    assert "standard uncertainty of l2: unknown" in told, "not identified"
    assert "unknown" not in compared(bare, calibrated[0], "heldout 1 m", "std:l2 1 m", form=("-q",)).err


def test_a_file_without_errors_says_so(calibrated: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    lines = calibrated[0].read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("errors:"))
    section = 1 + next(k for k, line in enumerate(lines[first + 1 :]) if not line.startswith(" "))
    old = tmp_path / "old.yaml"
    old.write_text("\n".join([*lines[:first], *lines[first + section :], ""]))
    done = compared(calibrated[0], old, "chi2 4", "fitted 1 m", "heldout 1 m", form=("-q",))
    assert done.code == 1 and done.err.count("its file does not say; write it again with `pkmcal calibrate -o`") == 3


@pytest.mark.parametrize(
    ("limit", "told"),
    [
        ("std:l9 5 um", "has no parameter `l9`"),
        ("std:l1 5 N", "`l1` is not measured in N"),
        ("heldout 5 N", 'help: give `--fail-above` as "heldout 20 um" (position)'),
        ("fitted:orientation 5 mrad", "no orientations were measured"),
        ("change 5 N", "is no change of the tool point"),
        ("chi2 5 um", "is not a number"),
    ],
)
def test_what_is_no_limit_is_refused(limit: str, told: str, calibrated: tuple[Path, dict[str, Any]]) -> None:
    done = compared(calibrated[0], calibrated[0], limit)
    assert done.code == 2 and told in done.err and "help:" in done.err


def test_small_errors_are_numbers_to_every_reader() -> None:
    """To readers of YAML 1.1, 1e-06 is a text."""
    small = KeptErrors({"position": (1e-9, parse_unit("mm"))}, {"position": (2e-15, parse_unit("mm"))}, 1e-12)
    section = yaml.safe_load("\n".join(small.lines()))["errors"]
    assert section["fitted"]["position"]["rms"] == pytest.approx(1e-6) and section["chi2_per_dof"] == 1e-12
    assert section["heldout"]["position"]["rms"] == pytest.approx(2e-12)


def test_errors_that_nobody_wrote_are_told_by_place(calibrated: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    lines = [line for line in calibrated[0].read_text().splitlines() if not line.startswith(("errors:", "  chi2_per"))]
    lines = [line for line in lines if not line.startswith(("  fitted:", "  heldout:"))]
    bad = tmp_path / "bad.yaml"
    more = ["errors:", "  chi2_per_dof: -1", "  fitted: {position: {rms: x, unit: mm}, angle: {rms: 1, unit: ell}}"]
    bad.write_text("\n".join([*lines, *more, "  heldout: 3", ""]))
    done = compared(calibrated[0], bad, "chi2 1")
    at = len(lines)
    assert done.code == 3 and all(f"bad.yaml:{at + k}:" in done.err for k in (2, 3, 4)), done.err
    assert "`heldout` must be a map" in done.err and "unknown unit `ell`" in done.err
