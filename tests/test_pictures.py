"""Pictures of a diagnosis: files that a browser reads, the same on the terminal, and the numbers behind them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

from pkmcal_cli.diagnosis.panels import driver_panel, field_map, nearest_rivals
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.diagnosis.waterfall import waterfall
from pkmcal_cli.pictures.parts import composed
from pkmcal_cli.pictures.picture import drawn
from pkmcal_cli.pictures.scatter import Cloud, scatter_part
from pkmcal_cli.pictures.titles import Titles
from pkmcal_cli.units.unit_text import UNITS
from tests.benchmark.setting import diagnosed
from tests.command import SCISSORS, SHOPFLOOR, run
from tests.computed_once import run_once
from tests.truth.campaigns import Planted, campaign, unit

UM = 1e-6


@cache
def shop() -> Diagnosis:
    """A backlash and a growth of rods on the Scissors."""
    planted = [unit("scissors", "backlash", "q3", 4).scaled(0.6), unit("scissors", "thermal_strut", "rod2", 4)]
    return diagnosed(campaign("scissors", planted, 4), 4)


@cache
def warm_scale() -> Diagnosis:
    """A scale of the Scissors that grows by 20 um/(m K) with the temperature."""
    planted = Planted(keyword="thermal_screw", at="q2", values={"a": 20e-6, "o": 0.0})
    return diagnosed(campaign("scissors", [planted], 4), 4)


# --- numbers -------------------------------------------------------------------------------
def test_a_panel_shows_what_was_planted() -> None:
    """Backlash of 12 um: measured displacements lie at -6 and +6 um by the side of approach, as noise allows."""
    finding = next(f for f in shop().findings if f.hypothesis.name == "backlash@q3")
    panel = driver_panel(shop(), finding)
    assert panel is not None and panel.side is not None and panel.unit == "mm"
    expected = -0.5 * 12 * UM * panel.side
    assert panel.fitted == pytest.approx(expected, abs=1 * UM)
    z = (panel.measured - expected) / panel.noise
    assert 0.7 < np.sqrt((z**2).mean()) < 1.4
    assert (panel.band > 0).all() and panel.band.max() < 2 * UM


def test_the_waterfall_goes_down_to_noise() -> None:
    sizes = [s.noise for s in waterfall(shop())]
    assert len(sizes) == 4 and sizes == sorted(sizes, reverse=True)
    assert sizes[-1] == pytest.approx(1.0, abs=0.1)


def test_each_effect_found_has_one_rival_that_is_another_effect() -> None:
    near = nearest_rivals(shop())
    assert sorted(n.name for n in near) == sorted(f.hypothesis.name for f in shop().findings)
    for n in near:
        effect, at = n.name.split("@")
        assert 0 <= n.cosine <= 1 and n.rival != n.name
        assert not (n.rival.startswith(f"{effect}@") and {at, n.rival.split("@")[1]} & {"all", "each"})


def test_growth_along_a_travel_is_shown_as_a_slope() -> None:
    """A scale that grows by 20 um/(m K): displacements per kelvin over the travel are a line of just this slope."""
    found = warm_scale()
    finding = next(f for f in found.findings if f.hypothesis.effect == "thermal_screw")
    panel = driver_panel(found, finding)
    assert panel is not None and panel.per_kelvin and panel.curve and panel.name == "q2"
    assert panel.displaced_in.text == "um/K" and panel.quantity == "displacement per kelvin"
    slope = np.polyfit(panel.x, panel.fitted, 1)
    assert slope[0] == pytest.approx(20e-6, rel=0.1)
    assert np.ptp(panel.fitted - np.polyval(slope, panel.x)) < 0.01 * np.ptp(panel.fitted)
    by_rows = np.polyfit(panel.x, panel.measured, 1, w=1 / panel.noise)
    assert by_rows[0] == pytest.approx(20e-6, rel=0.1)


def test_no_curve_runs_through_rows_of_different_poses() -> None:
    """What is fitted jumps from row to row where it is no function of what drives it."""
    finding = next(f for f in shop().findings if f.hypothesis.name == "backlash@q3")
    panel = driver_panel(shop(), finding)
    assert panel is not None and panel.curve
    jumping = replace(panel, side=None)  # both shells as one
    assert not jumping.curve
    x = np.linspace(0, 1, 80)
    waves = replace(panel, side=None, x=x, fitted=np.sin(2 * np.pi * 3 * x))
    assert waves.curve


@pytest.mark.slow
def test_the_map_of_something_smooth_is_where_it_is() -> None:
    """A smooth field is mapped, and explains cells that it has not seen; noise does not."""
    found = diagnosed(campaign("scissors", [unit("scissors", "smooth_field", "grid", 3).scaled(6)], 3), 3)
    field, quiet = field_map(found), field_map(shop())
    assert field is not None and quiet is not None
    assert field.explained > 0.2 > quiet.explained
    sizes = np.linalg.norm(field.vectors, axis=1)
    assert sizes[field.largest] == sizes.max()


# --- files ---------------------------------------------------------------------------------
def test_files_are_pictures(tmp_path: Path) -> None:
    done = run_once("diagnose", SCISSORS, SHOPFLOOR, "--plots", tmp_path / "new")
    names = {"errors-xy", "effect-backlash@q3", "effect-thermal_strut@all", "variance", "ambiguity"}
    assert done.code == 1 and {f.stem for f in (tmp_path / "new").iterdir()} == names
    for file in (tmp_path / "new").iterdir():
        text = file.read_text(encoding="utf-8")
        assert ET.fromstring(text).tag.endswith("svg") and file.name in done.err
    errors = (tmp_path / "new" / "errors-xy.svg").read_text(encoding="utf-8")
    assert "calibrated: 8.2" in errors and "with effects found: 0.6" in errors and "2 sigma" in errors
    assert "the same, arrows 10 x" in errors
    assert all("scissors.yaml: diagnosis" in f.read_text() for f in (tmp_path / "new").iterdir())
    assert all("scissors-shopfloor.csv, 20" in f.read_text() for f in (tmp_path / "new").iterdir())


@pytest.mark.slow
def test_pictures_are_the_same_every_time(tmp_path: Path) -> None:
    for folder in ("new", "again"):
        assert run("diagnose", SCISSORS, SHOPFLOOR, "--plots", tmp_path / folder, "-q").code == 1
    for file in (tmp_path / "again").iterdir():
        assert file.read_bytes() == (tmp_path / "new" / file.name).read_bytes()


def test_what_colours_say_is_not_cut_off() -> None:
    """The lowest part of a picture has room for the name of its colours, unit included."""
    flat = np.array([[0.0, 0.0], [1.0, 0.1]])
    cloud = Cloud("standard uncertainty of the position", flat, np.array([1e-6, 2e-6]), UNITS["um"])
    part = scatter_part([cloud], ("x", "y"), UNITS["mm"])
    with drawn(composed("map", Titles("m.yaml", "map", ""), "a map", [part])) as figure:
        figure.canvas.draw()
        (label,) = [t for t in figure.findobj(Text) if "uncertainty" in t.get_text()]
        box = label.get_window_extent()
        assert label.get_text().split()[-1] == "[um]" and box.y0 >= 0 and box.y1 <= figure.bbox.height


def test_the_terminal_shows_them_too() -> None:
    done = run_once("diagnose", SCISSORS, SHOPFLOOR, "--plots", "-")
    assert "residuals, times the stated noise" in done.err
    assert "backlash@q3: displacement [um]; o from above, + from below, * fitted" in done.err
    assert "T [degC]" in done.err and max(len(line) for line in done.err.split("logarithmic")[1].splitlines()) < 80


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    done = run("diagnose", SCISSORS, SHOPFLOOR, "--plots", tmp_path / "file" / "in")
    assert done.code in (2, 4) and "file" in done.err and "Traceback" not in done.err
