"""What machine files may say of probes that just touch."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import clean, column, run
from tests.touch_machines import ALONE, FLAT, GRID, ok, rows_of, written

WRONG = {
    "kind: touch, at: tcp, surface: bed, reading: h, sigma: 1 um": ("not a parameter", "the parameter of `zero`"),
    "kind: touch, at: tcp, surface: bed, reading: 3 N, sigma: 1 um": ("`3 N` is a force; expected a length", "`mm`"),
    "kind: touch, at: tcp, surface: bed, reading: x, sigma: 1 um": ("unknown parameter `x`", "declare it"),
    "kind: distance, at: tcp, to: B1, reading: h, sigma: 1 um": ("not a parameter", "the parameter of `zero`"),
    "kind: angle, at: c1, to: tcp, reading: 0, sigma: 1 mrad": ("`angle` has no `reading`", "delete it"),
    "kind: span, at: tcp, reading: 0, sigma: 1 um": ("`span` has no `reading`", "delete it"),
    "kind: touch, at: tcp, to: B1, sigma: 1 um": ("`touch` has no `to`", "kinds with `to`: `angle`, `distance`"),
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_readings_are_told(text: str, tmp_path: Path) -> None:
    machine = written(tmp_path, FLAT + f"  other: {{{text}}}\n")
    what, remedy = WRONG[text]
    faults = clean(run("check", machine, "--json", "-q")).json["faults"]
    assert any(what in f["message"] and remedy in (f["help"] or "") for f in faults), faults


def test_a_probe_that_reads_0_has_no_scale(tmp_path: Path) -> None:
    machine = written(tmp_path, ALONE + "effects: {meas_scale@probe: {s: 1 um/m}}\n")
    done = clean(run("check", machine))
    assert "`meas_scale` cannot be placed at `probe`: it always reads 0" in done.err
    assert "drift, frame" in done.err


def test_a_reading_in_steps(tmp_path: Path) -> None:
    """A trigger at 12 counts of 1 um, as a scanning probe in trigger mode has it."""
    text = ALONE.replace("reading: 0", "unit: {count: 1 um}, reading: 12 count")
    machine, made = written(tmp_path, text), tmp_path / "made.csv"
    ok("simulate", machine, *GRID, "-o", made)
    assert column(made, "probe") == pytest.approx(12, abs=1e-9)
    plain, bare = written(tmp_path, ALONE.replace("reading: 0", "zero: 12 um, reading: 0"), "plain"), tmp_path / "b.csv"
    bare.write_text("\n".join(",".join(line.split(",")[:3]) for line in rows_of(made)))
    fits = [ok("calibrate", m, bare, "--select", "h,t", "--json").json["parameters"] for m in (machine, plain)]
    assert [p["value"] for p in fits[0]] == pytest.approx([p["value"] for p in fits[1]], rel=1e-12)
