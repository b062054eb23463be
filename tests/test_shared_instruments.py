"""Errors that several places of one instrument share."""

from __future__ import annotations

from pathlib import Path

import pytest

from pkmcal_cli.effects import catalogue
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.model.effect_sites import places, together
from pkmcal_cli.prediction import Rows, predict
from tests.command import MACHINES

BARS = """
ground: {b1: [300, -100], b2: [600, -100]}
sensors:
  "bar{i}": {each: {i: [1, 2]}, kind: distance, at: tcp, to: "b{i}", sigma: 3 um}
  tracker: null
groups: {bars: [bar1, bar2]}
"""


def test_one_instrument_at_several_places_errs_alike(tmp_path: Path) -> None:
    """Two places of a bar: what is the same at both, by `all` or by the group; a tracker beside them is another."""
    file = tmp_path / "m.yaml"
    whole = f"extends: {MACHINES / 'triglide-nonredundant.yaml'}{BARS}"
    for text, names in ((whole, {"all"}), (whole.replace("  tracker: null\n", ""), {"tracker", "bars"})):
        file.write_text(text, encoding="utf-8")
        made = load_machine(str(file), receptive=True).model
        scales = places(made.sites, catalogue()["meas_scale"], (), made.effect_groups)
        assert set(scales) == {"bar1", "bar2", *names}
        alike = "all" if "all" in names else "bars"
        assert set(places(made.sites, catalogue()["meas_zero"], (), made.effect_groups)) == {"bar1", "bar2", "all"}
        assert len(scales[alike]) == 2
        assert not together(made.sites, catalogue()["frame"], made.effect_groups), "each stands by itself"
        read = []
        for effect in ("", "effects: {meas_scale@bars: {s: 100 um/m}, meas_zero@bars: {o: 20 um}}\n"):
            file.write_text(text + effect, encoding="utf-8")
            made = load_machine(str(file)).model
            found = predict(made, made.nominal, Rows.at(made.reference_readings[None])).values[0]
            read.append({c.name: v for c, v in zip(made.channels, found, strict=True)})
        before, after = read
        for bar in ("bar1", "bar2"):
            assert after[bar] == pytest.approx(before[bar] * (1 + 100e-6) + 20e-6, abs=1e-12)
        assert all(after[c] == before[c] for c in before if not c.startswith("bar"))
