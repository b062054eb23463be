"""Unit slips that engineers make: one text of a shipped machine file written in another unit.

`python -m tests.hostile.unit_slips` tells which of them are warned of.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.loading.load_machine import load_machine
from tests.command import MACHINES


@dataclass(frozen=True)
class Slip:
    """`old` of a machine file, written as `new`."""

    kind: str
    machine: str
    old: str
    new: str

    def text(self) -> str:
        """The machine file with it."""
        text = (MACHINES / f"{self.machine}.yaml").read_text(encoding="utf-8")
        assert self.old in text, self
        return text.replace(self.old, self.new)


_SLIPS = {
    "sigma": [
        ("triglide", "sigma: 10 um", "sigma: 10"),
        ("biglide", "sigma: 10 um", "sigma: 10"),
        ("delta4", "sigma: 10 um", "sigma: 10"),
        ("gantry", "sigma: 3 um", "sigma: 3"),
        ("triglide", "sigma: 10 um", "sigma: 10 m"),
        ("triglide", "sigma: 10 um", "sigma: 1e-8"),
        ("biglide", "sigma: 10 um", "sigma: 1e-5 um"),
        ("five-bar", "ball, sigma: 1 um", "ball, sigma: 1"),
        ("hexapod7", "position: 5 um", "position: 5"),
        ("hangprinter", "sigma: 0.1 mm", "sigma: 0.1 m"),
    ],
    "angular sigma": [
        ("hexapod7", "orientation: 10 urad", "orientation: 10"),
        ("hexapod7", "orientation: 10 urad", "orientation: 10 mrad"),
        ("hexapod7", "orientation: 10 urad", "orientation: 1e-11"),
        ("five-bar", 'tip, zero: "elbow{i}", sigma: 5 arcsec', 'tip, zero: "elbow{i}", sigma: 5'),
        ("five-bar", 'zero: "zero{i}", sigma: 5 arcsec', 'zero: "zero{i}", sigma: 5'),
    ],
    "modulus": [
        ("hexapod7", "E: 210 GPa", "E: 210"),
        ("gantry", "E: 210 GPa", "E: 210"),
        ("hexapod7", "E: 210 GPa", "E: 210 MPa"),
        ("gantry", "E: 210 GPa", "E: 2.1e11"),
        ("hexapod7", "E: 210 GPa", "E: 0.21"),
    ],
    "stiffness": [
        ("triglide", "nominal: 50000, range: 5000, unit: N/mm", "nominal: 50, range: 5, unit: N/mm"),
        ("biglide", "nominal: 20000, range: 2000, unit: N/mm", "nominal: 20, range: 2, unit: N/mm"),
        ("delta4", "nominal: 20, unit: kN/mm", "nominal: 80, unit: N/mm"),
        ("delta4", "nominal: 20, unit: kN/mm", "nominal: 20, unit: N/mm"),
        ("gantry", "nominal: 50 kN/mm, range: 10 kN/mm", "nominal: 50 N/mm, range: 10 N/mm"),
        ("gantry", "nominal: 40 kN/mm, range: 10 kN/mm", "nominal: 40 N/mm, range: 10 N/mm"),
        ("triglide", "k1: {nominal: 50000, range: 5000, unit: N/mm", "k1: {nominal: 50000, range: 5000, unit: N/m"),
    ],
    "axial stiffness": [
        ("belt-router", "nominal: 100000, range: 20000, unit: N", "nominal: 20, range: 4, unit: N"),
        ("hangprinter", "nominal: 20000, range: 10000, unit: N", "nominal: 20, range: 10, unit: N"),
        ("belt-router", "nominal: 100000, range: 20000, unit: N", "nominal: 100, range: 20, unit: N"),
        ("hangprinter", "nominal: 20000, range: 10000, unit: N", "nominal: 20000, range: 10000, unit: MN"),
    ],
    "section": [
        ("hexapod7", "tube: [30, 20]", "tube: [0.03, 0.02]"),
        ("hexapod7", "tube: [30, 20]", "tube: [30 m, 20 m]"),
        ("hexapod7", "tube: [30, 20]", "round: 0.03"),
        ("hexapod7", "tube: [30, 20]", "square: 0.02"),
        ("gantry", "Iy: (100**4 - 90**4)/12", "Iy: 287"),
        ("gantry", "area: 100**2 - 90**2", "area: 19"),
        ("gantry", "J: 5*95**3", "J: 5*95**4"),
        ("gantry", "J: 5*95**3", "J: 5*95**2"),
        ("hexapod7", "tube: [30, 20]", "tube: [1.18, 0.79]"),
    ],
    "guide": [
        ("gantry", "kx: {nominal: 40 kN/mm, range: 10 kN/mm", "kx: {nominal: 40 kN/m, range: 10 kN/m"),
        ("gantry", "rz: 5 kNm/rad", "rz: 5 Nmm/rad"),
    ],
    "shear": [
        ("hexapod7", "G: 80 GPa", "G: 800 GPa"),
        ("hexapod7", "G: 80 GPa", "G: 0.8 GPa"),
    ],
    "force": [
        ("belt-router", "control: force, force: 60", "control: force, force: 60 kN"),
        ("belt-router", "control: force, force: 60", "control: force, force: 60000"),
    ],
    "workspace": [
        ("hexapod7", "rx: [-8.5 deg, 8.5 deg]", "rx: [-8.5, 8.5]"),
        ("hexapod7", "x: [-80, 80], y: [-80, 80]", "x: [-0.08, 0.08], y: [-0.08, 0.08]"),
        ("gantry", "x: [150, 1350], y: [0, 1600]", "x: [0.15, 1.35], y: [0, 1.6]"),
        ("gantry", "limits: [100, 1400]", "limits: [0.1, 1.4]"),
    ],
    "gravity": [
        ("hexapod7", "gravity: [0, 0, -9.81]", "gravity: [0, 0, 9.81]"),
        ("gantry", "gravity: [0, 0, -9.81]", "gravity: [0, 0, -9810]"),
        ("hexapod7", "gravity: [0, 0, -9.81]", "gravity: [0, 0, -9810]"),
        ("delta4", "gravity: [0, 0, -9.81]", "gravity: [0, 0, -0.00981]"),
        ("belt-router", "gravity: [0, -9.4757]", "gravity: [0, 9.4757]"),
        ("gantry", "gravity: [0, 0, -9.81]", "gravity: [0, 0, -1]"),
    ],
    "mass": [
        ("hexapod7", "mass: 10", "mass: 5000"),
        ("hexapod7", "mass: 10", "mass: 10 g"),
        ("gantry", "nominal: 20 kg, range: 1 kg", "nominal: 20000 kg, range: 1000 kg"),
        ("delta4", "mass: 2\n", "mass: 2000\n"),
        ("belt-router", "mass: 8}", "mass: 80000}"),
        ("hexapod7", "7850 kg/m^3", "7850000 kg/m^3"),
    ],
    "range": [
        ("triglide", "ranges: {length: 0.1,", "ranges: {length: 100,"),
        ("triglide", "ranges: {length: 0.1,", "ranges: {length: 1e-9,"),
        ("hexapod7", "ranges: {length: 0.1}", "ranges: {length: 100}"),
        ("biglide", "ranges: {length: 0.1,", "ranges: {length: 0.1 m,"),
        ("scissors", "length: 0.1, angle: 1e-4", "length: 0.1, angle: 1"),
        ("delta4", "angle: 1e-4 rad", "angle: 100"),
        ("gantry", "ranges: {length: 0.2,", "ranges: {length: 0.2 nm,"),
        ("gantry", "scale: 2e-4", "scale: 2"),
        ("scissors", "force: kN", "force: N"),
    ],
    "angle": [
        ("triglide", "gamma: {nominal: 0,", "gamma: {nominal: 1.5708,"),
        ("five-bar", "turn: 114.55", "turn: 2.0944"),
        ("delta4", "a: [0, 90, 180, 270]", "a: [0, 1.5708, 3.1416, 4.7124]"),
        ("hexapod7", "    mass: 10", "    mass: 10\n    turn: [0, 0, 30]"),
    ],
}
SLIPS = tuple(Slip(kind, *each) for kind, those in _SLIPS.items() for each in those)


def warned(slip: Slip) -> list[str]:
    """Codes of what is said of it; errors count too."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "slip.yaml"
        file.write_text(slip.text(), encoding="utf-8")
        try:
            loaded = load_machine(str(file))
        except BadInput as error:
            return [f.code for f in error.faults]
    return [w.code for w in loaded.warnings]


if __name__ == "__main__":
    silent = [slip for slip in SLIPS if not set(warned(slip)) & {"magnitude", "gravity-up", "drawing", "value"}]
    for each in silent:
        print(f"not warned of: {each.kind}: {each.machine}: {each.new!r}")
    print(f"{len(SLIPS) - len(silent)} of {len(SLIPS)} slips are warned of")
    sys.exit(len(silent) > len(SLIPS) - 65)
