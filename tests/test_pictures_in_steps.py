"""Pictures of set values that are counts and steps: in the unit in which the drive is set."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pkmcal
import pytest

from tests.drawn import figure_of

STAGE = """
units: {length: mm, angle: deg}
space: spatial
ranges: {length: 1}
parameters: {x0: 0, y0: 0, z0: 0, w0: 0}
frames: {base: {at: [x0, y0, z0]}}
guides: {long: {frame: base, along: x}, short: {body: cross, along: y}, high: {body: ram, along: z}}
bodies: {cross: {guide: long, at: 0}, ram: {guide: short, at: 0}, quill: {guide: high, at: 0, points: {tip: [0, 0, 0]}}}
actuators:
  X: {moves: cross, unit: {count: 1/4096 rev}, scale: 5/4096}
  Y: {moves: ram, zero: w0}
  Z: {moves: quill, unit: {step: 1.25 um}}
sensors: {tracker: {at: tip, reads: [x, y, z], sigma: 5 um, frame: machine}}
"""
OFF = {"x0": 0.3, "y0": 0.2, "z0": -0.5}  # mm


def test_changes_of_set_values_are_in_the_units_of_the_drives(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(STAGE)
    (tmp_path / "t.csv").write_text("x,y,z\n0,0,0\n10,20,5\n-30,5,8\n")
    known = ", ".join(f"{n}: {{value: {v}, std: 0.001, unit: mm}}" for n, v in OFF.items())
    (tmp_path / "p.yaml").write_text(f"parameters: {{{known}}}\n")
    made = pkmcal.correct(tmp_path / "m.yaml", tmp_path / "t.csv", parameters=tmp_path / "p.yaml")
    with figure_of(made._picture()) as (figure, _):
        shown = {
            ax.get_ylabel(): {line.get_label(): np.asarray(line.get_ydata()) for line in ax.lines}
            for ax in figure.axes
            if "set value" in ax.get_ylabel()
        }
    panels = {f"change of set value [{unit}]" for unit in ("um", "count", "step")}
    assert set(shown) == panels
    assert shown["change of set value [um]"]["Y"] == pytest.approx(-200.0)
    whole = round(-0.3 / 5 * 4096)  # a drive takes whole counts
    assert shown["change of set value [count]"]["X"] == pytest.approx(whole)
    assert shown["change of set value [step]"]["Z"] == pytest.approx(0.5 / 0.00125)
