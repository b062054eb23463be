"""Machines whose redundancy removes singularities, with closed forms of what their drives read at a pose.

Each is regular in the whole range of poses, while substructures of as many drives as freedoms are not. Bars are elastic
and nothing weighs, so the drives' readings at a pose are those of rigid bars; with errors of dimensions the pose is the
minimum of the bars' strain energy, found here by a general minimiser from the planted pose.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array

MM, DEG = 1e-3, np.pi / 180
HEAD = "units: {length: mm, angle: deg, force: N}\nranges: {length: 0.1, angle: 0.01}\n"


@dataclass(frozen=True, kw_only=True)
class Redundant:
    """A machine; `text(k)`: its file with drive k redundant; poses: translations (m), rotations (rad), half-ranges.

    bars (n, A): strains of the bars at poses (n, c) and drives' readings (n, A), times the root of their stiffness.
    """

    name: str
    drives: int
    text: Callable[[int], str]
    readings: Callable[[Array], Array]
    bars: Callable[[Array, Array], Array]
    home: tuple[float, ...]
    reach: tuple[float, ...]

    def sampled(self, rng: np.random.Generator, count: int, turn: float = np.inf) -> Array:
        """Poses (count, c) in the range; rotations up to `turn`, rad, if that is less."""
        reach = np.array(self.reach)
        reach[self.translations :] = np.minimum(reach[self.translations :], turn)
        return np.asarray(self.home) + rng.uniform(-1, 1, (count, len(self.home))) * reach

    def minimum(self, pose: Array, readings: Array) -> Array:
        """The pose of least strain energy near a pose (c,), all bars of one stiffness per length."""
        size = np.where(np.arange(len(pose)) < self.translations, 1.0, 0.3)

        def strained(x: Array) -> Array:
            return self.bars((x * size)[None], readings[None])[0]

        return np.asarray(least_squares(strained, pose / size, xtol=1e-15, ftol=1e-15, gtol=1e-15).x * size)

    @property
    def translations(self) -> int:
        """How many of the pose's coordinates are lengths."""
        return {2: 2, 3: 2 if self.name != "delta" else 3, 6: 3}[len(self.home)]


def _roles(count: int, redundant: int, entry: str) -> str:
    """The actuators of a machine, one of them redundant."""
    lines = []
    for i in range(1, count + 1):
        extra = ", redundant: true" if i == redundant else ""
        lines.append(f"  q{i}: {{{entry.format(i=i)}{extra}}}")
    return "actuators:\n" + "\n".join(lines) + "\n"


def _points(prefix: str, places: Sequence[Sequence[float]]) -> str:
    return ", ".join(f"{prefix}{i}: [{', '.join(f'{v / MM:.12g}' for v in p)}]" for i, p in enumerate(places, 1))


def _plane(pose: Array, points: Array) -> Array:
    """Platform points (n, k, 2) at planar poses (n, 3)."""
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    turn = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    return np.asarray(np.einsum("nij,kj->nki", turn, points) + pose[:, None, :2])


# --- a platform on four telescopic legs in the plane -----------------------------------------
CORNERS = np.array([[-0.5, -0.4], [0.5, -0.4], [0.5, 0.4], [-0.5, 0.4]])
PLATE = np.array([[-0.1, -0.06], [0.1, -0.06], [0.1, 0.06], [-0.1, 0.06]])
OFFSET = 0.1


def _four_legs(redundant: int) -> str:
    return (
        HEAD + f"space: planar\nground: {{{_points('B', CORNERS.tolist())}}}\n"
        f"bodies: {{plate: {{at: [0, 0], points: {{{_points('P', PLATE.tolist())}, tool: [0, 0]}}}}}}\n"
        'parameters: {"o{i}": {each: {i: [1, 2, 3, 4]}, nominal: 100}}\n'
        'bars: {"leg{i}": {each: {i: [1, 2, 3, 4]}, between: ["B{i}", "P{i}"], EA: 20 MN}}\n'
        + _roles(4, redundant, "drives: leg{i}, offset: o{i}")
        + "sensors: {t: {at: tool, reads: [x, y, rz], sigma: {position: 1 um, orientation: 1 urad}, frame: machine}}\n"
    )


def _leg_lengths(pose: Array) -> Array:
    return np.asarray(np.linalg.norm(_plane(pose, PLATE) - CORNERS, axis=2))


FOUR_LEGS = Redundant(
    name="four legs", drives=4, text=_four_legs,
    readings=lambda pose: _leg_lengths(pose) - OFFSET,
    bars=lambda pose, q: (_leg_lengths(pose) - OFFSET - q) / np.sqrt(q + OFFSET),  # energy EA/2 e^2 / L
    home=(0.0, 0.0, 0.0), reach=(0.2, 0.2, 25 * DEG),
)  # fmt: skip

# --- four cranks with a rod each: a 3-RRR with a fourth leg ------------------------------------
HUBS = np.array([[-0.4, -0.3], [0.4, -0.3], [0.4, 0.3], [-0.4, 0.3]])
SMALL = np.array([[-0.08, -0.05], [0.08, -0.05], [0.08, 0.05], [-0.08, 0.05]])
CRANK, ROD = 0.25, 0.3


def _crank_angles(pose: Array) -> Array:
    """Angles (n, 4) with every elbow on the left of its leg; nan out of reach, and where crank and rod are in line."""
    d = _plane(pose, SMALL) - HUBS
    size = np.linalg.norm(d, axis=2)
    elbow = (CRANK**2 + ROD**2 - size**2) / (2 * CRANK * ROD)  # cosine of the angle between crank and rod
    with np.errstate(invalid="ignore"):
        inner = np.arccos((CRANK**2 + size**2 - ROD**2) / (2 * CRANK * size))
    inner[np.abs(elbow) > 0.99] = np.nan
    return np.asarray(np.arctan2(d[..., 1], d[..., 0]) + inner)


HOME_ANGLES = _crank_angles(np.zeros((1, 3)))[0]


def _crank_readings(pose: Array) -> Array:
    turned = _crank_angles(pose) - HOME_ANGLES
    return np.asarray((turned + np.pi) % (2 * np.pi) - np.pi)


def _crank_rods(pose: Array, q: Array) -> Array:
    angle = HOME_ANGLES + q
    elbow = HUBS + CRANK * np.stack([np.cos(angle), np.sin(angle)], -1)
    return np.asarray(np.linalg.norm(_plane(pose, SMALL) - elbow, axis=2) - ROD)


def _four_cranks(redundant: int) -> str:
    arms = ""
    for i, ((x, y), a) in enumerate(zip(HUBS / MM, HOME_ANGLES / DEG, strict=True), 1):
        points = f"points: {{E{i}: [{CRANK / MM}, 0]}}"
        arms += f"  arm{i}: {{at: [{x:.12g}, {y:.12g}], turn: {a:.12g}, {points}}}\n"
    zeros = ", ".join(f"z{i}: {{nominal: {a / DEG:.12g}}}" for i, a in enumerate(HOME_ANGLES, 1))
    return (
        HEAD + f"space: planar\nground: {{{_points('O', HUBS.tolist())}}}\nparameters: {{r: 300, {zeros}}}\n"
        f"bodies:\n  plate: {{at: [0, 0], points: {{{_points('P', SMALL.tolist())}, tool: [0, 0]}}}}\n{arms}"
        'joints: {"hub{i}": {each: {i: [1, 2, 3, 4]}, between: ["O{i}", "arm{i}"], type: revolute}}\n'
        'bars: {"rod{i}": {each: {i: [1, 2, 3, 4]}, between: ["E{i}", "P{i}"], length: r, EA: 10 MN}}\n'
        + _roles(4, redundant, "turns: arm{i}, zero: z{i}")
        + "sensors: {t: {at: tool, reads: [x, y, rz], sigma: {position: 1 um, orientation: 1 urad}, frame: machine}}\n"
    )


FOUR_CRANKS = Redundant(
    name="four cranks", drives=4, text=_four_cranks, readings=_crank_readings, bars=_crank_rods,
    home=(0.0, 0.0, 0.0), reach=(0.12, 0.12, 25 * DEG),
)  # fmt: skip

# --- a hexapod with a seventh leg --------------------------------------------------------------
_BASE = np.array([[400, -45], [400, 45], [400, 75], [400, 165], [400, 195], [400, 285], [250, 240]])
_TOP = np.array([[150, -15], [150, 15], [150, 105], [150, 135], [150, 225], [150, 255], [100, 315]])


def _ring(polar: Array) -> Array:
    radius, angle = polar[:, 0] * MM, polar[:, 1] * DEG
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * radius], axis=1)


FEET, TOPS = _ring(_BASE), _ring(_TOP)


def _seven_lengths(pose: Array) -> Array:
    turn = Rotation.from_rotvec(pose[:, 3:]).as_matrix()
    tops = np.einsum("nij,kj->nki", turn, TOPS) + pose[:, None, :3]
    return np.asarray(np.linalg.norm(tops - FEET, axis=2))


def _seven_legs(redundant: int) -> str:
    return (
        HEAD + f"space: spatial\nground: {{{_points('B', FEET.tolist())}}}\n"
        f"bodies: {{plate: {{at: [0, 0, 500], points: {{{_points('P', TOPS.tolist())}, tool: [0, 0, 0]}}}}}}\n"
        'parameters: {"o{i}": {each: {i: [1, 2, 3, 4, 5, 6, 7]}, nominal: 100}}\n'
        'bars: {"leg{i}": {each: {i: [1, 2, 3, 4, 5, 6, 7]}, between: ["B{i}", "P{i}"], EA: 20 MN}}\n'
        + _roles(7, redundant, "drives: leg{i}, offset: o{i}")
        + "sensors:\n  t: {at: tool, reads: [x, y, z, rx, ry, rz], frame: machine, "
        "sigma: {position: 1 um, orientation: 1 urad}}\n"
    )


SEVEN_LEGS = Redundant(
    name="seven legs", drives=7, text=_seven_legs,
    readings=lambda pose: _seven_lengths(pose) - OFFSET,
    bars=lambda pose, q: (_seven_lengths(pose) - OFFSET - q) / np.sqrt(q + OFFSET),
    home=(0.0, 0.0, 0.5, 0.0, 0.0, 0.0), reach=(0.08, 0.08, 0.08, 17 * DEG, 17 * DEG, 17 * DEG),
)  # fmt: skip

# --- a linear delta with a fourth column -------------------------------------------------------
TOWERS = 0.2 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
ARM = 0.32
RISE = float(np.sqrt(ARM**2 - 0.2**2))


def _heights(pose: Array) -> Array:
    return np.asarray(pose[:, 2:] + np.sqrt(ARM**2 - ((pose[:, None, :2] - TOWERS) ** 2).sum(axis=2)))


def _delta_rods(pose: Array, q: Array) -> Array:
    flat = ((pose[:, None, :2] - TOWERS) ** 2).sum(axis=2)
    return np.asarray(np.sqrt(flat + (pose[:, 2:] - q) ** 2) - ARM)


def _four_columns(redundant: int) -> str:
    rails = "".join(f"  rail{i}: {{at: [{x / MM}, {y / MM}, 0], along: z}}\n" for i, (x, y) in enumerate(TOWERS, 1))
    return (
        HEAD + f"space: spatial\nparameters: {{l: 320}}\nguides:\n{rails}nodes: {{tip: [0, 0, 0]}}\n"
        f'bodies: {{"c{{i}}": {{each: {{i: [1, 2, 3, 4]}}, guide: "rail{{i}}", at: {RISE / MM:.12g},'
        ' points: {"C{i}": [0, 0, 0]}}}\n'
        'bars: {"rod{i}": {each: {i: [1, 2, 3, 4]}, between: ["C{i}", tip], length: l, EA: 5 MN}}\n'
        + _roles(4, redundant, "moves: c{i}")
        + "sensors: {t: {at: tip, reads: [x, y, z], sigma: 1 um, frame: machine}}\n"
    )


FOUR_COLUMNS = Redundant(
    name="delta", drives=4, text=_four_columns, readings=_heights, bars=_delta_rods,
    home=(0.0, 0.0, 0.0), reach=(0.08, 0.08, 0.1),
)  # fmt: skip

MACHINES = (FOUR_LEGS, FOUR_CRANKS, SEVEN_LEGS, FOUR_COLUMNS)
