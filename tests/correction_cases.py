"""Machines that are measured, calibrated and corrected, and what an independent simulator says of the commands."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.optimize import fsolve

from tests.command import Done, run, table
from tests.support import MACHINES
from tests.truth import pinned
from tests.truth.machines import Hexapod7, biglide, scissors
from tests.truth.pinned import Array, DeadForce, Rods
from tests.truth.pinned_machine import Machine, Parameters

Forward = Callable[[Array], tuple[Array, Array]]
"""Tool coordinates (N, c) and strain energies (N,) of the true machine at set values (N, A), SI."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A machine file, its true machine, and a measurement of it.

    nominal: set values (N, A) of the nominal machine at poses (N, c); columns of the drives and coordinates with units;
    sigma: of a length, times `noise` of each coordinate; poses: where it is measured; scale: from SI to the columns'
    units.
    """

    text: str
    forward: Forward
    nominal: Callable[[Array], Array]
    drives: Sequence[str]
    coordinates: Sequence[str]
    sigma: float
    poses: Array
    scale: Array = field(default_factory=lambda: np.array(1e3))
    noise: Array = field(default_factory=lambda: np.array(1.0))

    def calibrated(self, folder: Path, seed: int = 1) -> Path:
        """The parameter file of a calibration with noise."""
        (folder / "machine.yaml").write_text(self.text, encoding="utf-8")
        set_values = self.nominal(self.poses)
        true = self.forward(set_values)[0]
        noise = self.sigma * self.noise * np.random.default_rng(seed).normal(size=true.shape)
        every = np.hstack([1e3 * set_values, self.scale * (true + noise)])
        (folder / "measured.csv").write_text(csv_text([*self.drives, *self.coordinates], every), encoding="utf-8")
        done = run("calibrate", folder / "machine.yaml", folder / "measured.csv", "-q", "--holdout", "none",
                   "-o", folder / "p.yaml", "--force")  # fmt: skip
        assert done.code == 0, done.err
        return folder / "p.yaml"

    def corrected(self, folder: Path, targets: Array, *options: str) -> tuple[Array, Done]:
        """Commands (N, A) in m for targets (N, c), by the parameters in the folder."""
        (folder / "targets.csv").write_text(csv_text(self.coordinates, self.scale * targets), encoding="utf-8")
        done = run("correct", folder / "machine.yaml", folder / "targets.csv", "-p", folder / "p.yaml",
                   "-o", folder / "commands.csv", "--force", "--json", *options)  # fmt: skip
        found = table(folder / "commands.csv")
        return np.stack([1e-3 * np.asarray(found.numbers[d.split(" ")[0]]) for d in self.drives], axis=1), done


def csv_text(names: Sequence[str], values: Array) -> str:
    """A table of numbers."""
    out = io.StringIO()
    np.savetxt(out, values, fmt="%.12g", delimiter=",", header=",".join(names), comments="")
    return out.getvalue()


def rms(error: Array) -> float:
    """Root mean square of the length of errors (N, c)."""
    return float(np.sqrt((np.asarray(error, float) ** 2).sum(axis=1).mean()))


def off(machine: Machine, size: float, seed: int, names: Sequence[str]) -> dict[str, float]:
    """True parameters: named ones off by up to `size`."""
    rng = np.random.default_rng(seed)
    return {**machine.nominal, **{n: machine.nominal[n] + size * rng.uniform(-1, 1) for n in names}}


def pinned_forward(machine: Machine, parameters: Parameters, loads: Sequence[DeadForce] = ()) -> Forward:
    """Of a machine of pinned rods."""

    def forward(q: Array) -> tuple[Array, Array]:
        found = machine.forward(q, parameters, loads=loads)
        return found.tcp[:, : len(machine.channels)], found.energy

    return forward


def least_energy(forward: Forward, target: Array, start: Array, last: float) -> float:
    """Least strain energy (J) of a machine with one redundant drive, the last, with its tool point at a target.

    The energy is quadratic in the last set value to within strains; three values of it, `last` m apart, give the least.
    """
    energies = []
    for shift in (-last, 0.0, last):
        held = start[-1] + shift

        def missed(q: Array, held: float = held) -> Array:
            return 1e6 * (forward(np.append(q, held)[None])[0][0] - target)

        q = fsolve(missed, start[:-1], xtol=1e-13)
        energies.append(float(forward(np.append(q, held)[None])[1][0]))
    low, middle, high = energies
    bend = low - 2 * middle + high
    return middle - (high - low) ** 2 / (8 * bend)


# --- a planar point on two carriages and a redundant telescopic leg, with a load -----------------
PUSH = (600.0, -1500.0)


def planar_leg() -> Case:
    """The Biglide, lengths off by up to 0.26 mm, a dead force on its tool point."""
    machine, push = biglide(), DeadForce(np.array([*PUSH, 0.0]), np.zeros(3))
    names = ("l1", "l2", "l3", "xb1r", "yb1r", "xb2r", "yb2r", "x8", "y8")
    rng = np.random.default_rng(3)
    return Case(
        text=f"extends: {MACHINES}/biglide.yaml\nranges: {{length: 0.4}}\n"
        f"loads: {{push: {{at: tcp, force: [{PUSH[0]} N, {PUSH[1]} N]}}}}\n"
        "sensors: {tracker: {sigma: 2 um}}\n",
        forward=pinned_forward(machine, off(machine, 0.26e-3, 11, names), [push]),
        nominal=lambda poses: machine.inverse(poses),
        drives=("q1 [mm]", "q2 [mm]", "q3 [mm]"), coordinates=("x [mm]", "y [mm]"), sigma=2e-6,
        poses=rng.uniform((0.2, 0.2), (0.5, 0.35), (100, 2)),
    )  # fmt: skip


# --- the Scissors -------------------------------------------------------------------------------------
NINE = ("g1", "g2", "xa1", "l3", "xa2", "ya1", "l4", "ya2", "ya4")


def scissors_nine() -> Case:
    """The Scissors with the paper's nine parameters off as much as there: 0.13 mm rms at its 80 points.

    Everything else is exact; the grid encoder has 0.2 um of noise ("sub-micron").
    """
    machine = scissors()
    lengths = off(machine, 0.16e-3, 5, [n for n in NINE if n[0] != "g"])
    true = {**lengths, **{n: off(machine, 1.6e-4, 6, ["g1", "g2"])[n] for n in ("g1", "g2")}}
    fixed = ", ".join(f"{n}: {{fixed: true}}" for n in machine.nominal if n not in NINE)
    grid = np.stack(np.meshgrid(np.linspace(-0.2, 0.2, 10), np.linspace(-0.2, 0.2, 8)), -1).reshape(-1, 2)
    return Case(
        text=f"extends: {MACHINES}/scissors.yaml\nparameters: {{{fixed}}}\nsensors: {{grid: {{sigma: 0.2 um}}}}\n",
        forward=pinned_forward(machine, true), nominal=lambda poses: machine.inverse(poses),
        drives=tuple(f"q{i} [mm]" for i in (1, 2, 3, 4)), coordinates=("x [mm]", "y [mm]"), sigma=0.2e-6, poses=grid,
    )  # fmt: skip


# --- a point in space on four telescopic legs, or five ropes, with weight ---------------------------------
FEET = np.array([[0, 0, 1.2], [1.0, 0, 1.2], [1.0, 1.0, 1.2], [0, 1.0, 1.2]])
MASS, LEG_OFFSET, LEG_EA = 100.0, 0.3, 20e6


def _feet(parameters: Array) -> Array:
    return FEET + parameters[:12].reshape(4, 3)


def four_legs() -> Case:
    """Feet and legs off by up to 0.4 mm; a payload of 100 kg."""
    rng = np.random.default_rng(8)
    true = 0.4e-3 * rng.uniform(-1, 1, 16)
    weight = DeadForce(np.array([0, 0, -MASS * 9.81]), np.zeros(3))

    def forward(q: Array) -> tuple[Array, Array]:
        places, energies = [], []
        for row in q:
            length = LEG_OFFSET + true[12:] + row
            rods = Rods.of(
                body=np.zeros((4, 3)), base=_feet(true), drive=[-1] * 4, length=length, stiffness=LEG_EA / length
            )
            found = pinned.minimise(
                rods, pinned.State.at((0.5, 0.5, 0.6), np.zeros(0)), pinned.SPATIAL_POINT, (weight,)
            )
            places.append(found.state.position.astype(float))
            energies.append(found.energy)
        return np.array(places), np.array(energies)

    feet = "".join(f"  F{i}: [fx{i}, fy{i}, fz{i}]\n" for i in (1, 2, 3, 4))
    numbers = "".join(
        f"  fx{i}: {1e3 * x:g}\n  fy{i}: {1e3 * y:g}\n  fz{i}: {1e3 * z:g}\n  o{i}: {1e3 * LEG_OFFSET:g}\n"
        for i, (x, y, z) in enumerate(FEET, 1)
    )
    legs = "".join(f"  leg{i}: {{between: [F{i}, tcp], EA: 20 MN}}\n" for i in (1, 2, 3, 4))
    drives = "".join(
        f"  q{i}: {{drives: leg{i}, offset: o{i}{', redundant: true' * (i == 4)}}}\n" for i in (1, 2, 3, 4)
    )
    return Case(
        text="units: {length: mm, angle: deg, force: N}\nspace: spatial\ngravity: [0, 0, -9.81]\n"
        "ranges: {length: 0.4}\n"
        f"parameters:\n{numbers}ground:\n{feet}nodes: {{tcp: {{at: [500, 500, 600], mass: {MASS}}}}}\nbars:\n{legs}"
        f"actuators:\n{drives}sensors: {{t: {{at: tcp, reads: [x, y, z], sigma: 2 um, frame: machine}}}}\n",
        forward=forward,
        nominal=lambda poses: np.linalg.norm(poses[:, None] - FEET, axis=2) - LEG_OFFSET,
        drives=tuple(f"q{i} [mm]" for i in (1, 2, 3, 4)), coordinates=("x [mm]", "y [mm]", "z [mm]"), sigma=2e-6,
        poses=rng.uniform((0.3, 0.3, 0.45), (0.7, 0.7, 0.8), (80, 3)),
    )  # fmt: skip


# --- seven bending legs -----------------------------------------------------------------------------------
THRUST = (800.0, -600.0, -8000.0)


def seven_legs() -> Case:
    """The hexapod with a seventh leg, all lengths off by up to 0.1 mm, a dead force on its platform."""
    machine = Hexapod7(pieces=4)
    rng = np.random.default_rng(21)
    true = {n: v + 0.1e-3 * rng.uniform(-1, 1) for n, v in machine.nominal.items()}
    push = DeadForce(np.array(THRUST), np.zeros(3))

    def forward(q: Array) -> tuple[Array, Array]:
        found = machine.forward(q, true, loads=(push,))
        return found.tcp, found.energy

    low, high = np.array([-0.08, -0.08, 0.42, -0.15, -0.15, -0.15]), np.array([0.08, 0.08, 0.58, 0.15, 0.15, 0.15])
    return Case(
        text=f"extends: {MACHINES}/hexapod7.yaml\n"
        f"loads: {{push: {{at: platform, force: [{', '.join(f'{f} N' for f in THRUST)}]}}}}\n"
        "sensors: {tracker: {sigma: {position: 1 um, orientation: 2 urad}}}\n",
        forward=forward, nominal=lambda poses: machine.inverse(poses),
        drives=tuple(f"q{i} [mm]" for i in range(1, 8)),
        coordinates=("x [mm]", "y [mm]", "z [mm]", "rx [rad]", "ry [rad]", "rz [rad]"),
        sigma=1e-6, poses=rng.uniform(low, high, (80, 6)), scale=np.array([1e3, 1e3, 1e3, 1, 1, 1]),
        noise=np.array([1, 1, 1, 2, 2, 2]),
    )  # fmt: skip
