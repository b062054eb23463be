"""Machines whose probes just touch a plane that is not where the machine file has it."""

from __future__ import annotations

from pathlib import Path

from tests.command import MACHINES, Done, clean, run

UM = 1e-6
DELTA = f"""
extends: {MACHINES / "delta4.yaml"}
tool_point: platform
parameters:
  {{pz: {{nominal: -560, range: 5}}, pa: {{nominal: 0.02, range: 0.02, unit: rad}},
   pb: {{nominal: -0.03, range: 0.02, unit: rad}}}}
frames: {{bed: {{at: [10, 20, pz], turn: [pa, pb, 0]}}}}
sensors:
  tracker: null
  probe: {{kind: touch, at: platform, offset: [5, 6, -70], surface: bed, reading: 0, sigma: 8 um}}
"""
PLANTED = {"pz": -0.5588, "pa": 0.0226, "pb": -0.0275}
FLAT = f"""
extends: {MACHINES / "triglide-nonredundant.yaml"}
parameters: {{h: {{nominal: 150, range: 2}}, t: {{nominal: 0.05, range: 0.02, unit: rad}}}}
frames: {{bed: {{at: [0, h], turn: t}}}}
sensors:
  probe: {{kind: touch, at: tcp, surface: bed, reading: 0, sigma: 5 um}}
"""
ALONE = "tool_point: tcp\n" + FLAT.lstrip() + "  tracker: null\n"
GRID = ("--grid", "x=250:650:9,y=180:320:3")


def written(folder: Path, text: str, name: str = "m") -> Path:
    file = folder / f"{name}.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def rows_of(table: Path) -> list[str]:
    return [line for line in table.read_text(encoding="utf-8").splitlines() if line and not line.startswith("#")]


def ok(*command: object, code: int = 0) -> Done:
    done = clean(run(*command))  # type: ignore[arg-type]
    assert done.code == code, (done.code, done.err)
    return done
