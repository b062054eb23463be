"""Numbers that no machine has: not positive, exchanged, beyond computing; each is refused at its place in the file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.command import Done, clean, run
from tests.support import model

MACHINE = """
units: {length: mm, angle: deg, force: N}
space: spatial
gravity: [0, 0, -9.81]
ranges: {length: 1, stiffness: 1000, scale: 0.1, modulus: 1 GPa, mass: 1, force: 100}
parameters: {l: 500, b: 5, one: 1, F: {nominal: 20 MN, range: 1 MN}}
ground: {B1: [l, 0, 0], B2: [-250, 433, 0], B3: [-250, -433, 0], top: [0, b, 2000]}
nodes: {tcp: {at: [0, 0, 800], mass: 5}}
bars: {leg1: {between: [B1, tcp], EA: 20 MN, mass: 1 kg}, leg2: {between: [B2, tcp], EA: F}}
beams:
  leg3:
    between: [B3, tcp]
    ends: [spherical, spherical]
    section: strut
    material: steel
sections:
  strut: {tube: [30, 20]}
materials:
  steel: {E: 210 GPa, density: 7850 kg/m^3}
ropes: {rope: {between: [tcp, top], EA: 20 kN}}
actuators:
  q1: {drives: leg1, offset: 600}
  q2: {drives: leg2, offset: 600}
  q4: {winds: rope, radius: 20, ratio: one/5, zero: home, unit: deg, redundant: true}
sensors:
  tracker: {at: tcp, reads: [x, y, z], sigma: 10 um, frame: machine}
  current: {kind: force, drive: q4, unit: "1", scale: 120 N, sigma: 0.1}
"""

GRID = ("--grid", "x=-50:50:2,y=-20:20:2")


def faults(folder: Path, *changes: tuple[str, str]) -> str:
    """What `check` says of the machine with changes; every other command refuses it too."""
    text = MACHINE
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file = folder / "m.yaml"
    file.write_text(text)
    done = clean(run("check", file, "-q"))
    assert done.code in (1, 3) and done.err.startswith(f"{file}:"), done.err
    for command in (("simulate", file, *GRID), ("observability", file, *GRID, "--json"), ("check", file, "--json")):
        again = clean(run(*command))
        assert again.code in (1, 3) and again.code != 0
    return done.err.replace(f"{file}:", "")


def told(err: str) -> list[str]:
    """The head lines."""
    return [line for line in err.splitlines() if re.match(r"\d+:\d+: ", line)]


def test_the_machine_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(MACHINE)
    done: Done = clean(run("check", file))
    assert done.code == 0 and "no faults" in done.err, done.err
    assert run("simulate", file, *GRID).code == 0


SECTIONS = {
    "exchanged": ("tube: [20, 30]", "[outer, inner]", "exchange"),
    "no wall": ("tube: [20, 20]", "no wall", "[outer, inner]"),
    "exchanged, inner an expression": ("tube: [20, b*6]", "inner diameter 30 mm", "exchange"),
    "underflow of d^4": ("tube: [1e-14, 1e-15]", "too small", "1e-40"),
    "no area": ("area: 0", "must be positive", ""),
    "negative moment": ("area: 100, Iy: -5", "must be positive", ""),
}


@pytest.mark.parametrize("name", SECTIONS)
def test_sections(tmp_path: Path, name: str) -> None:
    section, *words = SECTIONS[name]
    found = faults(tmp_path, ("tube: [30, 20]", section))
    assert all(word in found for word in words), found
    assert told(found)[0].startswith("17:"), "in the line of the section"


POSITIVE = {
    "E": (("E: 210 GPa", "E: -210 GPa"), "19:", "must be positive"),
    "nu below -1": (("E: 210 GPa", "E: 210 GPa, nu: -1.5"), "19:", "Poisson"),
    "nu of -1": (("E: 210 GPa", "E: 210 GPa, nu: -one"), "19:", "Poisson"),
    "nu above a half": (("E: 210 GPa", "E: 210 GPa, nu: 0.6"), "19:", "Poisson"),
    "G": (("E: 210 GPa", "E: 210 GPa, G: 0"), "19:", "must be positive"),
    "density of 0": (("density: 7850", "density: 0"), "19:", "must be positive"),
    "EA of an expression": (("EA: 20 MN, mass", "EA: F*(one - 2), mass"), "9:", "must be positive"),
    "mass of 0": (("mass: 5", "mass: 0"), "8:", "must be positive"),
    "mass below 0": (("mass: 1 kg", "mass: -1 kg"), "9:", "must be positive"),
    "mass of a parameter": (("mass: 5", "mass: m"), "8:", "must be positive"),
    "radius of 0": (("radius: 20", "radius: 0"), "24:", "must be positive"),
    "ratio of 0": (("ratio: one/5", "ratio: 0*one"), "24:", "must not be 0"),
    "ratio that comes out as 0": (("ratio: one/5", "ratio: one - 1"), "24:", "must not be 0"),
    "scale of a drive": (("offset: 600}\n  q2", "offset: 600, scale: 0}\n  q2"), "22:", "must not be 0"),
    "scale of a sensor": (("scale: 120 N", "scale: 0"), "27:", "must not be 0"),
    "scale of a force": (
        ("redundant: true}", "redundant: true, control: force, force: {column: f, otherwise: 40, scale: 0}}"),
        "24:", "must not be 0",
    ),
    "leg that is negative at reading 0 beside the spring of its drive": (
        ("drives: leg1, offset: 600", "drives: leg1, offset: -600, stiffness: 1000 kN/mm"), "9:", "be positive"),
    "gain that vanishes": (("ratio: one/5", "ratio: 1e-30*one, scale: 1e-30"), "24:", "too small"),
}  # fmt: skip


@pytest.mark.parametrize("name", POSITIVE)
def test_what_must_be_positive_or_not_zero(tmp_path: Path, name: str) -> None:
    change, place, word = POSITIVE[name]
    more = (("one: 1,", "one: 1, m: 0 kg,"),) if "mass: m" in change[1] else ()
    found = faults(tmp_path, change, *more)
    assert told(found)[0].startswith(place), found
    assert word in found and "help: " in found


@pytest.mark.parametrize("nu", ["0.5", "0", "-0.99"])
def test_every_ratio_of_a_stable_material(tmp_path: Path, nu: str) -> None:
    """Rubber has one half, cork none; foams have it negative."""
    file = tmp_path / "m.yaml"
    file.write_text(MACHINE.replace("E: 210 GPa", f"E: 210 GPa, nu: {nu}"))
    assert clean(run("check", file)).code == 0


BEYOND = {
    "length": (("l: 500", "l: 1e308"), "6:"),
    "range": (("l: 500", "l: {nominal: 500, range: 1e308}"), "6:"),
    "default range": (("length: 1,", "length: 1e300,"), "5:"),
    "bounds": (("l: 500", "l: {nominal: 500, bounds: [0, 1e308]}"), "6:"),
    "tiny": (("b: 5,", "b: 1e-308,"), "6:"),
    "tube": (("tube: [30, 20]", "tube: [1e308, 20]"), "17:"),
    "stiffness by its unit": (("EA: 20 MN, mass", "EA: 1e305 MN, mass"), "9:"),
    "expression": (("EA: 20 MN, mass", "EA: F*1e60, mass"), "9:"),
    "constant expression": (("EA: 20 MN, mass", "EA: 1e30*1e30, mass"), "9:"),
    "sigma": (("sigma: 10 um", "sigma: 1e-308"), "26:"),
    "gravity": (("gravity: [0, 0, -9.81]", "gravity: [0, 0, -1e300]"), "4:"),
    "effect": (("ropes:", "effects: {backlash@q1: {b: 1e300}}\nropes:"), "20:"),
    "std of an effect": (("ropes:", "effects: {backlash@q1: {b: {value: 0, std: 1e-300}}}\nropes:"), "20:"),
    "unit without end": (("EA: 20 MN, mass", "EA: 1 km^9*km^9/m^9/m^9*N, mass"), "9:"),
}


@pytest.mark.parametrize("name", BEYOND)
def test_numbers_beyond_what_can_be_computed(tmp_path: Path, name: str) -> None:
    change, place = BEYOND[name]
    found = faults(tmp_path, change)
    assert told(found)[0].startswith(place), found
    assert re.search(r"too (large|small) ", found), found
    assert "help: " in found


@pytest.mark.parametrize("text", ["cos(pi/2)**3", "sin(pi)**4*l", "0"])
def test_what_is_zero_but_for_rounding_is_a_place(tmp_path: Path, text: str) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(MACHINE.replace("[l, 0, 0]", f'[l, "{text}", 0]'))
    assert run("check", file).code == 0


def test_a_range_that_vanishes(tmp_path: Path) -> None:
    found = faults(tmp_path, ("l: 500", "l: {nominal: 500, range: 1e-30*1e-30}"))
    assert told(found) == ["6:39: error[range]: the range of `l` must be positive"]


def test_a_product_that_is_too_large(tmp_path: Path) -> None:
    """Of numbers that are not, each by itself: the beam is named."""
    found = faults(tmp_path, ("E: 210 GPa", "E: 1e39 Pa"), ("tube: [30, 20]", "tube: [100000, 20]"))
    assert told(found)[0].startswith("11:3: error[value]: stiffness of `leg3` (elongation) is 8.3"), found
    assert "too large to compute with" in found and len(told(found)) == 1, "one fault, not one for every strain"


def test_all_of_them_are_told_at_once(tmp_path: Path) -> None:
    found = faults(tmp_path, ("tube: [30, 20]", "tube: [20, 30]"), ("E: 210 GPa", "E: 210 GPa, nu: 2"))
    assert len(told(found)) == 2


IMPOSSIBLE = {
    "stiffness@leg1: {k: 1000}": "`k` of `stiffness@leg1` cannot be 1000",
    "self_weight@all: {w: -1}": "`w` of `self_weight@all` cannot be -1",
    "self_weight@all: {w: -2}": "`w` of `self_weight@all` cannot be -2",
    "thermal_strut@leg1: {a: 11 um/(m*K), lag: -5 min}": "`lag` of `thermal_strut@leg1` cannot be -5",
    "pitch@q1: {c: 5 um, period: 0}": "`period` of `pitch@q1` must be positive",
    "clearance@leg1: {c: 5 um, smooth: -1 N}": "`smooth` of `clearance@leg1` must be positive",
}
"""Masses and stiffnesses that effects would make zero, negative or infinite, and constants that divide."""


@pytest.mark.parametrize("entry", IMPOSSIBLE)
def test_effects_that_cannot_be(tmp_path: Path, entry: str) -> None:
    found = faults(tmp_path, ("ropes:", f"effects: {{{entry}}}\nropes:"))
    assert IMPOSSIBLE[entry] in found and told(found)[0].startswith("20:") and "help: " in found


def test_fits_keep_to_what_can_be() -> None:
    """Bounds in SI where none are given: no negative lag, some weight and some stiffness left."""
    effects = "effects: {stiffness@leg1: {}, self_weight@all: {}, thermal_strut@leg1: {}}\n"
    bounds = {p.name: p.bounds for p in model(MACHINE + effects).parameters}
    assert bounds["thermal_strut@leg1.lag"] == (0.0, 60e3)
    assert bounds["self_weight@all.w"][0] == pytest.approx(-0.999)
    assert bounds["stiffness@leg1.k"] == (-20.0, 20.0)
    assert bounds["thermal_strut@leg1.a"] == (-np.inf, np.inf)
