"""Unit slips are warned of, and machines that are in order are not."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.loading.machine_templates import names, template
from tests.command import MACHINES
from tests.hostile.unit_slips import SLIPS, warned
from tests.shipped import TABLES, machine_of

SPANS = (0.1, 0.5, 1.0, 3.0, 10.0)
DOUBTS = {"magnitude", "gravity-up"}
HERE = Path(__file__).parent


def doubts(file: Path) -> list[str]:
    try:
        return [w.text() for w in load_machine(str(file)).warnings if w.code in DOUBTS]
    except BadInput:
        return []


def test_of_the_slips_at_least_65_are_warned_of() -> None:
    found = [slip for slip in SLIPS if set(warned(slip)) & {*DOUBTS, "value"}]
    assert len(SLIPS) >= 70 and len(found) >= 65
    assert {kind for kind, n in Counter(s.kind for s in found).items() if n > 1} == {s.kind for s in SLIPS}


@pytest.mark.parametrize("machine", sorted({machine_of(t) for t in TABLES}), ids=lambda m: m.stem)
def test_no_shipped_machine(machine: Path) -> None:
    assert doubts(machine) == []


@pytest.mark.parametrize("kind", names())
def test_no_template_at_usual_spans(kind: str, tmp_path: Path) -> None:
    for span in SPANS:
        file = tmp_path / f"{span}.yaml"
        file.write_text(template(kind).scaled(span), encoding="utf-8")
        assert doubts(file) == [], span


@pytest.mark.parametrize(
    ("slip", "text"),
    [
        ("sigma: 10", "sigma of tracker = 10 mm: did you mean 10 um?"),
        ("E: 210", "E of steel = 210 N/mm^2: did you mean 210 GPa?"),
        ("gravity: [0, 0, 9.81]", "gravity points along +z: weight acts upwards"),
        ("gravity: [0, 9.4757]", "gravity points along +y: weight acts upwards"),
        ("orientation: 10", "sigma of tracker = 10 rad: did you mean 10 urad?"),
        ("turn: 2.0944", "turn of arm1 = 2.0944 deg: did you mean 2.0944 rad?"),
        ("mass: 10 g", "mass of platform = 10 g: did you mean 10 kg?"),
        ("Iy: 287", "Iy of tube = 287 mm^4: did you mean 287 cm^4?"),
        ("area: 19", "area of tube = 19 mm^2: did you mean 19 cm^2?"),
        ("rz: 5 Nmm/rad", "stiffness rz of rail2 = 5 Nmm/rad: did you mean 5 kNm/rad?"),
        ("kx: {nominal: 40 kN/m, range: 10 kN/m", "stiffness x of rail2 = 40 kN/m: did you mean 40 N/um?"),
        ("G: 800 GPa", "G of steel = 800 GPa is far outside the usual range"),
        ("control: force, force: 60 kN", "force of BL = 60 kN: did you mean 60 N?"),
        ("rx: [-8.5, 8.5]", "reaches to 8.5 rad, more than half a turn: did you mean 8.5 deg?"),
        ("x: [-0.08, 0.08], y: [-0.08, 0.08]", "workspace along x = 0.16 mm: did you mean 0.16 m?"),
        ("scale: 2", "range of sx = 2: did you mean 2 mm/m?"),
    ],
)
def test_the_guess(slip: str, text: str, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(next(s for s in SLIPS if s.new == slip).text(), encoding="utf-8")
    assert any(text in found for found in doubts(file)), doubts(file)


@pytest.mark.parametrize(
    ("machine", "old", "new"),
    [
        ("gantry", "area: 100**2 - 90**2, Iy: (100**4 - 90**4)/12", "area: 1030, Iy: 171 cm^4"),  # an I-beam
        ("gantry", "J: 5*95**3", "J: 1900*5**2/3"),  # the tube, slit
        ("gantry", "area: 100**2 - 90**2, Iy: (100**4 - 90**4)/12, Iz: (100**4 - 90**4)/12, J: 5*95**3",
         "area: 100, Iy: 100*0.5**2/12, Iz: 100*200**2/12, J: 200*0.5**3/3"),  # a leaf spring
        ("gantry", "E: 210 GPa, nu: 0.3", "E: 15 GPa, G: 30 GPa"),  # fibres at 45 degrees
        ("gantry", "E: 210 GPa, nu: 0.3", "E: 150 GPa, G: 4 GPa"),  # fibres along the beam
        ("gantry", "kx: {nominal: 40 kN/mm, range: 10 kN/mm", "kx: {nominal: 1 kN/mm, range: 1 kN/mm"),
        ("hexapod7", "z: [420, 580]", "z: [499.9, 500.1]"),  # a plane
    ],
)  # fmt: skip
def test_what_is_rare_and_right(machine: str, old: str, new: str, tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    text = (MACHINES / f"{machine}.yaml").read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    load_machine(str(file))
    assert doubts(file) == []


def test_a_fine_stage_has_an_instrument_that_tells_its_places_apart(tmp_path: Path) -> None:
    """A tenth of a millimetre of workspace is a slip beside a sigma of 3 um, and none beside 20 nm."""
    text = (MACHINES / "gantry.yaml").read_text(encoding="utf-8")
    text = text.replace("x: [150, 1350], y: [0, 1600]", "x: [750, 750.1], y: [800, 800.1]")
    for sigma, warnings in (("3 um", 1), ("20 nm", 0)):
        file = tmp_path / "m.yaml"
        file.write_text(text.replace("sigma: 3 um", f"sigma: {sigma}"), encoding="utf-8")
        assert len(doubts(file)) == warnings, sigma


@pytest.mark.parametrize(("unit", "turn", "warnings"), [
    ("mrad", "120 deg", 0), ("mrad", "2094.395102393195", 0), ("mrad", "2.0944", 1),
    ("rad", "400 deg", 0), ("rad", "400", 1),
])  # fmt: skip
def test_angles_that_state_their_unit_are_meant(unit: str, turn: str, warnings: int, tmp_path: Path) -> None:
    """As those that no slip makes: 120 deg in a file in mrad is 2094 mrad, which is no 2094 rad."""
    file = tmp_path / "m.yaml"
    file.write_text(
        f"units: {{length: mm, angle: {unit}}}\nspace: planar\nframes: {{f: {{turn: {turn}}}}}\n"
        "guides: {g: {frame: f}}\nbodies: {c: {guide: g, at: 0, points: {P: [300, 0]}}}\nactuators: {q: {moves: c}}\n"
        "sensors: {s: {at: P, reads: [x, y], sigma: 1 um, frame: machine}}\n"
    )
    assert len(doubts(file)) == warnings, doubts(file)
