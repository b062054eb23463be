"""Inches and pounds-force wherever units are read: the same machine, table, values and options as in mm and N."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.command import column, run

INCH = 25.4  # mm, exact since 1959
POUND = 0.45359237 * 9.80665  # N, exact

MACHINE = """
units: {length: LENGTH, angle: deg, force: FORCE}
space: planar
gravity: [0, -9.81]
ranges: {length: RANGE}
parameters: {l1: L1, l2: {nominal: L2, range: 3 mm}, k: {nominal: K, range: 10 N/mm}}
guides: {rail: {along: x}}
bodies: {c1: {guide: rail, at: 0}, c2: {guide: rail, at: 300 mm}}
nodes: {n: {at: [150 mm, 250 mm], mass: 20}}
bars: {b1: {between: [c1, n], length: l1, k: k}, b2: {between: [c2, n], length: l2, k: k}}
actuators: {q1: {moves: c1}, q2: {moves: c2}}
loads: {f: {at: n, force: [F, 0]}}
sensors: {t: {at: n, reads: [x, y], sigma: SIGMA, frame: machine}}
"""


def machine(**words: object) -> str:
    text = MACHINE
    for word, value in words.items():
        text = text.replace(word, str(value))
    return text


METRIC = machine(LENGTH="mm", FORCE="N", RANGE=1.27, L1=304.8, L2=330.2, K=17.5126835246476, F=44.482216152605,
                 SIGMA="0.0254 mm")  # fmt: skip
INCHES = machine(LENGTH="in", FORCE="lbf", RANGE=0.05, L1="12 inch", L2=13, K="100 lbf/in", F=10, SIGMA="0.001 in")
Q = [[0.0, 11.0], [1.0, 12.0], [2.0, 14.5], [-1.0, 9.0], [0.5, 13.0], [3.0, 12.0]]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("mm.yaml").write_text(METRIC)
    Path("in.yaml").write_text(INCHES)
    rows = "".join(f"{a},{b}\n" for a, b in Q)
    Path("in.csv").write_text("q1 [in],q2 [inch]\n" + rows)
    Path("bare.csv").write_text("q1,q2\n" + rows)
    Path("mm.csv").write_text("q1 [mm],q2 [mm]\n" + "".join(f"{a * INCH!r},{b * INCH!r}\n" for a, b in Q))
    return tmp_path


def simulated(*arguments: str) -> np.ndarray:  # type: ignore[type-arg]
    """x and y of all rows in mm."""
    done = run("simulate", *arguments, "--noise", "none", "-o", "out.csv", "--force")
    assert done.code == 0, done.err
    scale = INCH if "[in]" in Path("out.csv").read_text() else 1.0
    return scale * np.stack([column("out.csv", name) for name in ("x", "y")], axis=1)


@pytest.mark.parametrize("table", ["in.csv", "mm.csv"])
@pytest.mark.parametrize("file", ["in.yaml", "mm.yaml"])
def test_machine_and_table_in_any_of_the_units(folder: Path, file: str, table: str) -> None:
    assert simulated(file, table) == pytest.approx(simulated("mm.yaml", "mm.csv"), abs=1e-10)


def test_bare_numbers_of_a_table_are_in_the_unit_of_the_file(folder: Path) -> None:
    assert simulated("in.yaml", "bare.csv") == pytest.approx(simulated("mm.yaml", "mm.csv"), abs=1e-10)


def test_options_and_parameter_files_in_inches(folder: Path) -> None:
    Path("in.p.yaml").write_text("parameters: {l1: 12.1, l2: {value: 13.2, unit: inch}, k: 110 lbf/in}\n")
    Path("mm.p.yaml").write_text(f"parameters: {{l1: 307.34, l2: 335.28, k: {1.1 * POUND / INCH * 100!r}}}\n")
    inches = simulated("in.yaml", "--grid", "x=5:7:3,y=9in:250 mm:2", "-p", "in.p.yaml")
    metric = simulated("mm.yaml", "--grid", "x=5 inch:177.8:3,y=228.6:250:2", "-p", "mm.p.yaml")
    assert inches == pytest.approx(metric, abs=1e-10)


def test_identified_values_are_the_same(folder: Path) -> None:
    found = {}
    for unit in ("in", "mm"):
        plant = {"in": "l1: 12.05", "mm": f"l1: {12.05 * INCH!r}"}[unit]
        Path("plant.yaml").write_text(f"parameters: {{{plant}}}\n")
        run("simulate", f"{unit}.yaml", f"{unit}.csv", "-p", "plant.yaml", "--noise", "none", "-o", "m.csv", "--force")
        done = run("calibrate", f"{unit}.yaml", "m.csv", "--holdout", "none", "--select", "l1,l2", "--json")
        assert done.code == 0, done.err
        found[unit] = {p["name"]: (p["value"], p["std"], p["unit"]) for p in done.json["parameters"]}
    for name in ("l1", "l2"):
        (value, std, unit), (metric, metric_std, _) = found["in"][name], found["mm"][name]
        assert unit == "in" and value * INCH == pytest.approx(metric, abs=1e-6 * metric_std)
        assert std * INCH == pytest.approx(metric_std, rel=1e-6)
    assert found["in"]["l1"][0] == pytest.approx(12.05, abs=1e-7)


def lengths(text: str) -> list[tuple[float, str]]:
    """All lengths of a text, mm, each with its unit."""
    scale = {"um": 1e-3, "mm": 1.0, "in": INCH}
    found = re.findall(r"([0-9.]+)(?:\([0-9]+\))? (um|mm|in)\b", text)
    return [(float(number) * scale[unit], unit) for number, unit in found]


def test_errors_of_positions_are_told_in_inches(folder: Path) -> None:
    """What `correct`, an export, a map of uncertainties and a study say: the same lengths as beside millimetres."""
    told, area = {}, ("--within", "x=5in:7in,y=9in:9.9in")
    for unit in ("in", "mm"):
        plant = {"in": "l1: 12.05", "mm": f"l1: {12.05 * INCH!r}"}[unit]
        Path("plant.yaml").write_text(f"parameters: {{{plant}}}\n")
        run("simulate", f"{unit}.yaml", f"{unit}.csv", "-p", "plant.yaml", "--noise", "none", "-o", "m.csv", "--force")
        run("calibrate", f"{unit}.yaml", "m.csv", "--holdout", "none", "--select", "l1,l2", "-o", "p.yaml", "--force")
        Path("t.csv").write_text("x [in],y [in]\n6,9.5\n7,9.8\n5.5,9.9\n")
        of_file, out = (f"{unit}.yaml", "t.csv", "-p", "p.yaml"), ("-o", "o.csv", "--force")
        texts = [
            run("correct", *of_file, *out).err.partition("Predicted")[2],
            run("correct", *of_file, *out, "--as", "csv").err.partition("rms:")[2],
            run("simulate", *of_file, *out, "--uncertainty").err.partition("calibration")[2],
            run("study", f"{unit}.yaml", *area, "--points", "5", "--repeat", "2").err.partition("mean error")[2],
        ]
        told[unit] = [lengths(text) for text in texts]
    for inches, metric in zip(told["in"][:3], told["mm"][:3], strict=True):
        assert len(metric) > 1 and {unit for _, unit in inches} == {"in"}, inches
        assert [size for size, _ in inches] == pytest.approx([size for size, _ in metric], rel=0.01, abs=2e-7)
    assert {unit for _, unit in told["in"][3]} == {"in"}  # noise of its own: no equal numbers
