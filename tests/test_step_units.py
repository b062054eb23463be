"""Drives and sensors that read steps or counts: the same machine, in another unit."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.model.model import Model
from pkmcal_cli.units.unit_text import UnitError, parse_unit
from tests.command import MACHINES, clean, column, run

BIGLIDE = (MACHINES / "biglide.yaml").read_text(encoding="utf-8")
TABLE = (MACHINES / "biglide.csv").read_text(encoding="utf-8")
STEP, COUNT = 1.25e-3, 5 / 4096  # mm
WIRE = "ground: {P8: [x8, y8], hook: [0, 0]}"


def written(folder: Path, name: str, *changes: tuple[str, str], table: str = TABLE) -> tuple[Path, Path]:
    text = BIGLIDE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    machine, data = folder / f"{name}.yaml", folder / f"{name}.csv"
    machine.write_text(text, encoding="utf-8")
    data.write_text(table, encoding="utf-8")
    return machine, data


def in_steps(header: str) -> str:
    """The shipped table with q1 in steps and q2 in counts, under a header."""
    lines = [line.split(",") for line in TABLE.splitlines()]
    rows = [[i, repr(float(a) / STEP), repr(float(b) / COUNT), *rest] for i, a, b, *rest in lines[1:]]
    return "\n".join([header, *(",".join(row) for row in rows)])


@pytest.mark.parametrize(
    "header",
    ["id,q1 [step],q2 [count],q3 [mm],x [mm],y [mm]", pytest.param("id,q1,q2,q3,x,y", marks=pytest.mark.slow)],
)
def test_a_table_in_steps_gives_the_same_calibration(header: str, tmp_path: Path) -> None:
    """Readings in steps of 1.25 um and in 4096 counts a turn of a screw of 5 mm; a sigma of 2 steps is 2.5 um."""
    sigma = ("q1: {moves: c1}", "q1: {moves: c1, sigma: 2.5 um}"), ("q2: {moves: c2}", "q2: {moves: c2, sigma: 5 um}")
    steps = (
        ("q1: {moves: c1}", "q1: {moves: c1, unit: {step: 1.25 um}, sigma: 2 step}"),
        ("q2: {moves: c2}", "q2: {moves: c2, unit: {count: 1/4096 rev}, scale: 5/4096, sigma: 4.096 count}"),
    )
    results = []
    for name, changes, table in (("mm", sigma, TABLE), ("steps", steps, in_steps(header))):
        done = clean(run("calibrate", *written(tmp_path, name, *changes, table=table), "--json", "--holdout", "none"))
        assert done.code == 0, done.err
        results.append(done.json)
    plain, counted = results
    for a, b in zip(plain["parameters"], counted["parameters"], strict=True):
        assert b["value"] == pytest.approx(a["value"], abs=1e-6 * a["std"])
        assert b["std"] == pytest.approx(a["std"], rel=1e-6)
    assert counted["chi2"] == pytest.approx(plain["chi2"], rel=1e-7)


def model(folder: Path, q1: str) -> Model:
    return load_machine(str(written(folder, "m", ("q1: {moves: c1}", f"q1: {{moves: c1, {q1}}}"))[0]), True).model


LAWS = {
    "unit: {step: 1.25 um}, sigma: 2 step, limits: [-4e5, 400000 step]": (2.5e-6, (-0.5, 0.5)),
    "unit: {step: 1.25 um}, sigma: 3 um, limits: [-500 mm, 0.5 m]": (3e-6, (-0.5, 0.5)),
    "unit: {step: 1.25 um}, ratio: -2, sigma: 2 step": (5e-6, (-np.inf, np.inf)),
    "unit: {step: 1.25 um}, ratio: -2, sigma: 3 um": (3e-6, (-np.inf, np.inf)),
    "unit: {count: 1/4096 rev}, scale: 5/4096, sigma: 0.5 count": (0.5 * COUNT * 1e-3, (-np.inf, np.inf)),
    "unit: {count: 1/4096 rev}, scale: 5/4096, sigma: 90 deg": (1.25e-3, (-np.inf, np.inf)),
    "unit: deg, scale: 5/360, sigma: 90 deg": (1.25e-3, (-np.inf, np.inf)),
}
"""Standard uncertainty of the travel (m), limits of the reading (m)."""


@pytest.mark.parametrize("law", LAWS)
def test_limits_and_sigma_in_steps_or_in_length(law: str, tmp_path: Path) -> None:
    """A sigma in steps, or in the dimension of the reading, is one of the reading: the travel has it times the gain."""
    sigma, limits = LAWS[law]
    actuator = model(tmp_path, law).actuators[0]
    assert actuator.sigma == pytest.approx(sigma, rel=1e-12)
    assert actuator.limits == pytest.approx(limits, rel=1e-12)


def test_a_period_in_counts(tmp_path: Path) -> None:
    """A turn of the screw, 4096 counts, is 5 mm of travel."""
    made = model(tmp_path, "unit: {count: 1/4096 rev}, scale: 5/4096, period: 4096 count")
    assert made.sites["command"]["q1"][0].period == pytest.approx(5e-3, rel=1e-12)


def test_sensors_in_counts(tmp_path: Path) -> None:
    """A draw wire of 10 um a pulse reads the distance of the point, its noise is stated in pulses."""
    wire = "wire: {kind: distance, at: tcp, to: hook, unit: {pulse: 10 um}, sigma: 3 pulse + 5 um/m}"
    more = ("ground: {P8: [x8, y8]}", WIRE), ("sensors:\n", f"sensors:\n  {wire}\n")
    machine, _ = written(tmp_path, "m", *more)
    table = tmp_path / "t.csv"
    done = clean(run("simulate", machine, "--grid", "x=200:400:3,y=200:300:3", "-o", table))
    assert done.code == 0, done.err
    assert "wire [pulse]" in table.read_text()
    far = np.hypot(column(table, "tracker.x"), column(table, "tracker.y"))
    assert column(table, "wire") == pytest.approx(far * 100, rel=1e-9)
    channel = load_machine(str(machine)).model.channels[0]
    assert (channel.sigma, channel.sigma_slope) == pytest.approx((30e-6, 5e-6), rel=1e-12)
    assert clean(run("calibrate", machine, table, "--holdout", "none")).code == 0


@pytest.mark.slow
def test_steps_are_shown_by_their_name(tmp_path: Path) -> None:
    """No output shows the definition in place of the unit."""
    steps = ("q1: {moves: c1}", "q1: {moves: c1, unit: {step: 1.25 um}, limits: [0, 80000]}")
    machine, table = written(tmp_path, "m", steps)
    plan = tmp_path / "plan.csv"
    grid = ("--grid", "x=160:400:4,y=160:300:4")
    for command in (
        ("check", machine),
        ("plan", machine, *grid, "--aim", "scale@q1", "--points", "1", "-o", plan),
        ("simulate", machine, *grid, "--json", "-o", tmp_path / "s.csv"),
        ("calibrate", machine, table, "--holdout", "2", "--json"),
        ("diagnose", machine, table, "--json"),
    ):
        done = clean(run(*command))
        assert "=1.25" not in done.out + done.err
    assert "step" in clean(run("check", machine)).err
    assert "q1 [step]" in plan.read_text() and "q1 [step]" in (tmp_path / "s.csv").read_text()
    assert "exceeds its limits (0 step to 80000 step)" in run("simulate", machine, *grid).err


def test_steps_in_headers_repetitions_and_pictures(tmp_path: Path) -> None:
    """A column of the machine file that names its unit, a unit behind a low line, scatter, an effect over the drive."""
    wire = "wire: {kind: distance, at: tcp, to: hook, unit: {pulse: 10 um}, sigma: 1 pulse}"
    more = ("ground: {P8: [x8, y8]}", WIRE), ("sensors:\n", f"sensors:\n  {wire}\n")
    law = "unit: {step: 1.25 um}, column: 'pos [step]', limits: [-4e5, 4e5]"
    machine, _ = written(tmp_path, "m", *more, ("q1: {moves: c1}", f"q1: {{moves: c1, {law}}}"))
    bent = tmp_path / "bent.yaml"
    bent.write_text(f"extends: {machine}\neffects: {{pitch_curve@q1: {{p2: 300 um}}}}\n")
    table = tmp_path / "t.csv"
    made = run("simulate", bent, "--grid", "x=160:400:9,y=160:300:5", "--noise", "declared", "-o", table)
    assert made.code == 0, made.err
    lines = [line for line in table.read_text().splitlines() if not line.startswith("#")]
    assert lines[0].startswith("id,pos [step],q2 [mm]")
    found = clean(run("diagnose", machine, table, "--plots", "-"))
    assert "pitch_curve" in found.err and "q1 [step]" in found.err
    first = lines[0].split(",").index("wire [pulse]")
    again = [
        ",".join(c if k != first else f"{float(c) + 1.5}" for k, c in enumerate(lines[r].split(","))) for r in (1, 2)
    ]
    table.write_text("\n".join([*lines, *again]))
    repeated = clean(run("calibrate", machine, table, "--json", "--holdout", "none"))
    assert repeated.code == 0, repeated.err
    assert {r["channel"]: r["unit"] for r in repeated.json["replicates"]}["wire"] == "pulse"
    table.write_text("\n".join([lines[0].replace("wire [pulse]", "wire_pulse"), *lines[1:]]))
    assert "did you mean `wire [pulse]`?" in clean(run("calibrate", machine, table, "--holdout", "none")).err


WRONG = {
    "unit: {}": ("expected one name with its size, found 0", "{step: 1.25 um}"),
    "unit: {step: 1 um, count: 2 um}": ("expected one name with its size, found 2", "{step: 1.25 um}"),
    "unit: {step: 3}": ("the size of `step` needs a unit, found `3`", "{step: 1.25 um}"),
    "unit: {step: 0 um}": ("the size `0 um` of a unit must be positive", "{step: 1.25 um}"),
    "unit: {step: -1 um}": ("the size `-1 um` of a unit must be positive", "{step: 1.25 um}"),
    "unit: {step: 1/0 um}": ("`1/0 um` is not the size of a unit", "{count: 1/4096 rev}"),
    "unit: {mm: 3 um}": ("`mm` is a unit already", "another word"),
    "unit: {st_p: 1 um}": ("`st_p` is not a name for a unit", "a word of letters"),
    "unit: {step: 1.25 N}": ("is a unit of force, not of length or angle", "use one of m,"),
    "unit: step": ("unknown unit `step`", "give its size: `unit: {step: 1.25 um}`"),
    "unit: step = 1.25 um": ("`step = 1.25 um` is not a unit", "{step: 1.25 um}"),
    "unit: {count: 1/4096 rev}": ("a reading in count needs `scale`, the travel per count", "(mm per count)"),
    "unit: {step: 1.25 um}, sigma: 2 stp": ("unknown unit `stp`", ""),
    "unit: {step: 1.25 um}, sigma: 0 step": ("must be positive", "sign"),
    "unit: {step: 1.25 um}, limits: [0, 8 rev]": ("`8 rev` is an angle; expected a length", "`step`"),
}


@pytest.mark.parametrize("law", WRONG)
def test_wrong_steps_are_told_once(law: str, tmp_path: Path) -> None:
    what, remedy = WRONG[law]
    machine, _ = written(tmp_path, "m", ("q1: {moves: c1}", f"q1: {{moves: c1, {law}}}"))
    done = clean(run("check", machine, "--json", "-q"))
    mine = [f for f in done.json["faults"] if what in f["message"] and remedy in (f["help"] or "")]
    assert done.code == 1 and len(mine) == 1 and len(done.json["faults"]) == 1, done.json["faults"]


def test_a_column_in_steps_of_another_machine(tmp_path: Path) -> None:
    """A unit of its own is known to its own column only."""
    machine, table = written(tmp_path, "m", table=in_steps("id,q1 [step],q2 [mm],q3 [mm],x [mm],y [mm]"))
    done = clean(run("calibrate", machine, table, "--holdout", "none"))
    assert done.code == 3 and "unknown unit `step` in column `q1 [step]`" in done.err


@pytest.mark.parametrize("size", ["1e999999999 um", "1" * 50 + " um", "nan um", "inf um", "1 " + "m*" * 60 + "m"])
def test_absurd_sizes_end_at_once(size: str) -> None:
    with pytest.raises(UnitError):
        parse_unit(f"step={size}")


def test_sizes_are_exact() -> None:
    assert parse_unit("count=1/4096 rev").factor == Fraction(2, 4096)
    assert parse_unit("step=1.25 um").factor == Fraction(125, 10**8)
    assert re.fullmatch("step=1.25 um", parse_unit("step=1.25 um").definition)


def test_set_values_in_steps_are_whole_and_their_error_is_stated(tmp_path: Path) -> None:
    """A step of 20 um: the drive with a unit of its own takes no part of it, the other any length."""
    machine, _ = written(tmp_path, "m", ("q1: {", "q1: {unit: {step: 20 um}, "))
    out, back = tmp_path / "c.csv", tmp_path / "s.csv"
    assert run("correct", machine, "--grid", "x=250:450:5,y=220:320:5", "-o", out).code == 0
    q1, q2 = column(out, "q1"), column(out, "q2")
    assert (q1 == np.round(q1)).all() and np.abs(q2 / 0.02 - np.round(q2 / 0.02)).max() > 0.3
    assert run("simulate", machine, out, "-o", back).code == 0
    for name in "xy":
        off = 1e3 * (column(back, f"{name}") - column(out, f"target.{name}"))
        assert column(out, f"after.{name}") == pytest.approx(off, abs=1e-6)
    assert 3 < np.abs(column(out, "after.x")).max() < 20
