"""Texts of machines for the tests, and short ways to read them."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine

TRIGLIDE = (Path(__file__).parent / "data" / "triglide.yaml").read_text()

SPOOLS = """
units: {length: mm, angle: deg, force: N}
space: spatial
gravity: [0, 0, -9.81]
ranges: {length: 50, force: 10000}
parameters:
  "{a}{c}": {each: {a: [A, A, B, B], c: [x, y, x, y], v: [0, -1500, 1300, 1200]}, nominal: "{v}"}
  R: {nominal: 75, range: 2, identify: false}
  EA: 20 kN
nodes: {"{a}": {each: {a: [A, B]}, at: ["{a}x", "{a}y", 100]}, tcp: {at: [0, 0, 0], mass: 2 kg}}
ropes: {"line{i}": {each: {i: [A, B]}, between: ["{i}", tcp], EA: EA}}
actuators:
  "{i}": {each: {i: [A, B]}, winds: "line{i}", radius: R, ratio: 20/255/2, column: "m_{i}_deg", sigma: 1 mm}
sensors: {camera: {at: tcp, reads: {x: x_mm, y: y_mm}, sigma: 0.1 mm, frame: machine}}
"""


def read(folder: Path, text: str, name: str = "m.yaml") -> Machine:
    file = folder / name
    file.write_text(text)
    return read_machine(file)


def faults(folder: Path, text: str) -> list[str]:
    """The head lines of the faults, without the file name."""
    with pytest.raises(BadInput) as caught:
        read(folder, text)
    return [f"{f.where.line}:{f.where.column} {f.code}: {f.what}" for f in caught.value.faults if f.where]


def warned(folder: Path, text: str) -> list[str]:
    return [w.what for w in read(folder, text).warnings]
