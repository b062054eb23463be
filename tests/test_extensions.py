"""What is added to a copy of the package: an effect, a kind of sensor and a form that a control takes by one file each,
a subcommand by two, an element by one file and three edits.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import MACHINES, ROOT, TRIGLIDE, Done

EFFECT = '''"""Thermal growth that is not proportional."""

from pkmcal_cli.effects.effect import Effect, EffectParameter
from pkmcal_cli.units.measurands import Measurand

SQUARE = Effect(
    keyword="only_in_a_test",
    title="thermal growth of struts, quadratic",
    symbol="",
    source="second order of thermal expansion",
    enters="length",
    parameters=(EffectParameter(name="b", unit="um/(m*K*K)", range=10, text="growth by the square of temperature"),),
    formula=lambda at, b: b * at.length * at.temperature_rise**2,
    needs=("temperature",),
    cause="{at} grows more than in proportion.",
    result="The length of {at} follows the square of the temperature.",
    action="Measure at several temperatures.",
)
'''
SENSOR = '''"""A height gauge."""

from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.sensors.sensor_kind import SensorKind, as_read

HEIGHT = SensorKind(
    keyword="height",
    title="height of a point above the origin",
    instruments="height gauge",
    needs=("at",),
    may=("zero", "scale", "unit", "column"),
    variables=("place", "zero", "scale"),
    measurand=Measurand.DISTANCE,
    equation=lambda seen: [as_read(seen["place"][:, 1], seen)],
)
'''
FORMAT = '''"""Set values as plain lines."""

from pkmcal_cli.correction.export_case import Draft, ExportCase, Format


def _draft(case: ExportCase) -> Draft:
    lines = [" ".join(f"{1e3 * v:.3f}" for v in row) for row in case.corrected]
    return Draft(commands=case.corrected, values=case.values, texts=lambda remarks: {"": "\\n".join([*lines, ""])})


PLAIN = Format(keyword="plain", title="plain lines", sources=(), suffix=".txt", draft=_draft)
'''
ELEMENT = '''"""A tie whose strain is quadratic in the chord: e = (|delta|^2 - L^2) / 2 per metre."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from pkmcal_cli.base.rotation import Array, dot
from pkmcal_cli.elements.element import Element, LinkGeometry, add_scaled_identity


@dataclass(frozen=True)
class TieElement(Element):
    """Green's strain of the chord; stiffness k (N/m)."""

    uses_triads: ClassVar[bool] = False

    @cached_property
    def strains(self) -> tuple[str, ...]:
        return ("green",)

    def evaluate(self, link: LinkGeometry, rest: Array) -> tuple[Array, Array]:
        return (dot(link.delta, link.delta)[..., None] - rest**2) / 2, link.delta[..., None, :]

    def add_curvature(self, out: Array, link: LinkGeometry, stress: Array) -> None:
        add_scaled_identity(out, stress[..., 0])
'''
EDITS = (
    ("language/members.py", "class Rope(Axial[V]", """class Tie(Entity, Generic[V]):
    \"\"\"A tie between two points.\"\"\"

    noun: ClassVar[str] = "tie"

    between: Two = Field(description="The two points that it connects")
    length: Size[V] = Field(description="Unstressed length")
    k: LinearStiffness[V] = Field(description="Stiffness (force/length)")


"""),
    (
        "language/machine.py", "    joints: dict[Name, Joint",
        '    ties: dict[Name, Tie[V]] = Field(default={}, description="Ties")\n',
    ),
    ("language/machine.py", "from pkmcal_cli.language.parts", "from pkmcal_cli.language.members import Tie\n"),
    ("compiler/members.py", "    add_joints(structure)\n", """    for name, tie in structure.machine.ties.items():
        ends = (structure.connection(tie.between[0]), structure.connection(tie.between[1]))
        structure.builder.link(TieElement(), name, ends, rest=[number(tie.length)],
                               stiffness=[number(tie.k)], rigid=[False])
"""),
    ("compiler/members.py", "from pkmcal_cli.compiler.structure",
     "from pkmcal_cli.compiler.coefficient_values import number\nfrom pkmcal_cli.elements.tie import TieElement\n"),
)  # fmt: skip
"""Of each file what goes before which line."""
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

from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.report.console import Reporter


def run_count(machine: str) -> int:
    """Tell the number; 0."""
    Reporter(False).say(f"{len(load_machine(machine).model.parameters)} parameters")
    return 0
'''
OVERLAY = f"""extends: {MACHINES / "triglide.yaml"}
sensors: {{gauge: {{kind: height, at: tcp, zero: 120, sigma: 5 um}}}}
effects: {{only_in_a_test@rod1: {{b: 4 um/(m*K*K)}}}}
"""
TIED = f"""extends: {MACHINES / "triglide.yaml"}
parameters: {{l3: 601, k3: {{nominal: 40000, range: 20000}}}}
bars: {{rod3: null}}
ties: {{tie: {{between: [B3, tcp], length: l3, k: k3}}}}
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package with one more member of each family, and a machine that has them."""
    folder = tmp_path_factory.mktemp("extended")
    package = folder / "pkmcal_cli"
    shutil.copytree(ROOT / "pkmcal_cli", package, ignore=shutil.ignore_patterns("__pycache__"))
    for file, text in (
        ("correction/formats/plain.py", FORMAT), ("effects/square.py", EFFECT), ("sensors/height.py", SENSOR),
        ("commands/count.py", COMMAND),
        ("workflow/count.py", WORK), ("../machine.yaml", OVERLAY), ("elements/tie.py", ELEMENT), ("../tied.yaml", TIED),
    ):  # fmt: skip
        (package / file).write_text(text, encoding="utf-8")
    for file, line, text in EDITS:
        code = (package / file).read_text(encoding="utf-8")
        assert code.count(line) == 1, (file, line)
        (package / file).write_text(code.replace(line, text + line), encoding="utf-8")
    return folder


ALL = """
import contextlib, io, json, sys
from pkmcal_cli import app

done = []
for words in json.load(sys.stdin):
    out, err, sys.argv = io.StringIO(), io.StringIO(), ["pkmcal", *words]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = app.run(words)
    done.append((code, out.getvalue(), err.getvalue()))
json.dump(done, sys.stdout)
"""


def ran(place: Path, *commands: str) -> list[Done]:
    """Commands one after the other, in a process that has the copy for its package."""
    words = json.dumps([command.split() for command in commands])
    done = subprocess.run(
        [sys.executable, "-c", ALL], input=words, cwd=place, env=os.environ | {"PYTHONPATH": str(place)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    found = [Done(*each) for each in json.loads(done.stdout)]
    assert not any(each.code for each in found), found
    return found


def test_a_subcommand_is_two_files(place: Path) -> None:
    helped, plain, more = ran(place, "--help", f"count {TRIGLIDE}", "count machine.yaml")
    assert "How many parameters" in helped.out
    assert int(more.err.split()[0]) == int(plain.err.split()[0]) + 1


def test_an_effect_and_a_kind_of_sensor_are_one_file_each(place: Path) -> None:
    """They are declared, simulated and identified."""
    check, effects, _ = ran(
        place, "check machine.yaml --json", "effects --json",
        f"simulate {TRIGLIDE} --grid x=200:700:6,y=160:390:6 -o poses.csv",
    )  # fmt: skip
    assert "gauge" in check.json["channels"]
    assert "only_in_a_test" in {e["effect"] for e in effects.json["effects"]}
    lines = [n for n in (place / "poses.csv").read_text(encoding="utf-8").splitlines() if not n.startswith("#")]
    warm = [f"{line},{'T [degC]' if k == 0 else 20 + k % 7}" for k, line in enumerate(lines)]
    (place / "warm.csv").write_text("\n".join([*warm, ""]), encoding="utf-8")
    (place / "unknown.yaml").write_text(OVERLAY.replace("b: 4 um", "b: 0 um"), encoding="utf-8")
    name = "only_in_a_test@rod1.b"
    _, fit, _ = ran(
        place, "simulate machine.yaml warm.csv --noise declared --seed 3 -o measured.csv --plot readings.svg",
        f"calibrate unknown.yaml measured.csv --select {name} --holdout none --json",
        "draw machine.yaml warm.csv --row 4 -o machine.svg",
    )  # fmt: skip
    (b,) = (p for p in fit.json["parameters"] if p["name"] == name)
    assert abs(b["value"] - 4) < 4 * b["std_by_data"] < 2
    assert "gauge" in (place / "readings.svg").read_text(encoding="utf-8")


def test_a_form_that_a_control_takes_is_one_file(place: Path) -> None:
    (done,) = ran(place, f"correct {TRIGLIDE} --grid x=300:400:3,y=200:300:2 --as plain")
    assert len(done.out.splitlines()) == 6 and "with `plain`" in done.err


def test_an_element_is_one_file_and_three_edits(place: Path) -> None:
    """A tie is declared, takes part in the equilibrium (the poses move), and its stiffness is identified."""
    assert len({file for file, _, _ in EDITS}) == 3
    (place / "unknown_tie.yaml").write_text(TIED.replace("nominal: 40000", "nominal: 30000"), encoding="utf-8")
    check, _, _, fit, schema, _ = ran(
        place, "check tied.yaml --json",
        # poses of a rod of 600 mm: one of 601 mm strains the machine
        f"simulate {TRIGLIDE} --grid x=300:600:5,y=200:350:5 -o untied.csv",
        "simulate tied.yaml untied.csv --noise declared --seed 5 -o tied.csv",
        "calibrate unknown_tie.yaml tied.csv --select k3 --holdout none --json --plot fit.svg",
        "schema", "draw tied.yaml untied.csv --forces -o tied.svg",
    )  # fmt: skip
    assert (check.json["degrees_of_freedom"], check.json["degree_of_redundancy"]) == (2, 1)
    (k3,) = (p for p in fit.json["parameters"] if p["name"] == "k3")
    assert abs(k3["value"] - 40_000) < 4 * k3["std_by_data"] < 8_000
    assert "ties" in schema.json["properties"]
    drawn = (place / "tied.svg").read_text(encoding="utf-8")
    assert 'id="member-tie"' in drawn and ">tie</text>" in drawn
    assert "k3" in (place / "fit.svg").read_text(encoding="utf-8")


def test_two_members_of_one_keyword_are_refused(tmp_path: Path) -> None:
    """Else the later module would silently replace what the catalogue has."""
    package = tmp_path / "pkmcal_cli"
    shutil.copytree(ROOT / "pkmcal_cli", package, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "effects" / "again.py").write_text(EFFECT.replace("only_in_a_test", "backlash"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", "from pkmcal_cli.effects import catalogue; catalogue()"],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert "`backlash` is in again.py and in reversal.py" in done.stderr
