"""A family grows by one file: an effect, a kind of sensor and a subcommand, added to a copy of the package."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.command import MACHINES, ROOT

EFFECT = '''"""Thermal growth that is not proportional."""

from pkmcal_cli.effects.base import Effect, EffectParameter

SQUARE = Effect(
    keyword="thermal_square",
    title="thermal growth of struts, quadratic",
    symbol="",
    source="second order of thermal expansion",
    port="length",
    parameters=(EffectParameter(name="b", unit="um/(m*K*K)", range=10, text="growth by the square of temperature"),),
    formula=lambda at, b: b * at.length * at.warmth**2,
    needs=("temperature",),
    cause="{at} grows more than in proportion.",
    result="The length of {at} follows the square of the temperature.",
    action="Measure at several temperatures.",
)
'''
SENSOR = '''"""A height gauge."""

from pkmcal_cli.sensors.base import SensorKind, as_read

HEIGHT = SensorKind(
    keyword="height",
    title="height of a point above the origin",
    instruments="height gauge",
    needs=("at",),
    may=("zero", "scale", "unit", "column"),
    sees=("place", "zero", "scale"),
    quantity="distance",
    law=lambda seen: [as_read(seen["place"][:, 1], seen)],
)
'''
COMMAND = '''"""`pkmcal count`."""

from typing import Annotated

import typer

from pkmcal_cli.commands._options import MachineFile


def count(machine: MachineFile) -> None:
    """How many parameters has this machine?"""
    from pkmcal_cli.workflow.count import run_count

    raise typer.Exit(run_count(machine))
'''
WORK = '''"""Counts parameters."""

from pkmcal_cli.loading.machine import load_machine
from pkmcal_cli.report.console import Reporter


def run_count(machine: str) -> int:
    """Tell the number; 0."""
    Reporter(False).say(f"{len(load_machine(machine).model.parameters)} parameters")
    return 0
'''
OVERLAY = f"""extends: {MACHINES / "triglide.yaml"}
sensors: {{gauge: {{kind: height, at: tcp, zero: 120, sigma: 5 um}}}}
effects: {{thermal_square@rod1: {{b: 4 um/(m*K*K)}}}}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package with one more member of each family, and a machine that has them."""
    folder = tmp_path_factory.mktemp("extended")
    package = folder / "pkmcal_cli"
    shutil.copytree(ROOT / "pkmcal_cli", package, ignore=shutil.ignore_patterns("__pycache__"))
    for file, text in (
        ("effects/square.py", EFFECT), ("sensors/height.py", SENSOR), ("commands/count.py", COMMAND),
        ("workflow/count.py", WORK), ("../machine.yaml", OVERLAY),
    ):  # fmt: skip
        (package / file).write_text(text, encoding="utf-8")
    return folder


def ran(place: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [sys.executable, "-m", "pkmcal_cli", *arguments],
        cwd=place, env=os.environ | {"PYTHONPATH": str(place)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done


def test_a_subcommand_is_two_files(place: Path) -> None:
    assert "How many parameters" in ran(place, "--help").stdout
    plain = ran(place, "count", str(MACHINES / "triglide.yaml")).stderr
    assert int(ran(place, "count", "machine.yaml").stderr.split()[0]) == int(plain.split()[0]) + 1


def test_an_effect_and_a_kind_of_sensor_are_one_file_each(place: Path) -> None:
    """They are declared, simulated and identified."""
    found: dict[str, Any] = json.loads(ran(place, "check", "machine.yaml", "--json").stdout)
    assert "gauge" in found["channels"]
    assert "thermal_square" in {e["effect"] for e in json.loads(ran(place, "effects", "--json").stdout)["effects"]}
    grid = "x=200:700:6,y=160:390:6"
    ran(place, "simulate", str(MACHINES / "triglide.yaml"), "--grid", grid, "-o", "poses.csv")
    lines = [n for n in (place / "poses.csv").read_text(encoding="utf-8").splitlines() if not n.startswith("#")]
    warm = [f"{line},{'T [degC]' if k == 0 else 20 + k % 7}" for k, line in enumerate(lines)]
    (place / "warm.csv").write_text("\n".join([*warm, ""]), encoding="utf-8")
    ran(place, "simulate", "machine.yaml", "warm.csv", "--noise", "declared", "--seed", "3", "-o", "measured.csv")
    (place / "unknown.yaml").write_text(OVERLAY.replace("b: 4 um", "b: 0 um"), encoding="utf-8")
    names = "thermal_square@rod1.b"
    fit = json.loads(ran(place, "calibrate", "unknown.yaml", "measured.csv", "--select", names, "--json").stdout)
    (b,) = (p for p in fit["parameters"] if p["name"] == names)
    assert abs(b["value"] - 4) < 4 * b["std"] < 2
