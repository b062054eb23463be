"""Set values of the machines of `pkmcal new`, in closed forms written from their kinematics, not from their files.

Each function returns the readings (A,) with which a machine of wrong dimensions is at a pose: lengths in mm, angles in
degrees, forces in N. `p`: parameters by name, in the units of the machine file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, fsolve, least_squares
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Parameters = Mapping[str, float]
G = 9.81


def _at(p: Parameters, name: str, axes: str = "xyz") -> Array:
    return np.array([p[name + a] for a in axes])


def _flat(angle: float) -> Array:
    """Radial and tangential unit vectors (2, 3) at an angle in rad about z."""
    return np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0]])


def hexapod(pose: Array, p: Parameters) -> Array:
    """Distances of the joints; pose (6,): mm, and a rotation vector in degrees."""
    turn = Rotation.from_rotvec(np.radians(pose[3:]))
    ends = [pose[:3] + turn.apply([p[f"p{i}x"], p[f"p{i}y"], p[f"p{i}z"]]) for i in range(1, 7)]
    base = [np.array([p[f"b{i}x"], p[f"b{i}y"], p[f"b{i}z"]]) for i in range(1, 7)]
    return np.array([np.linalg.norm(e - b) - p[f"o{i}"] for i, (e, b) in enumerate(zip(ends, base, strict=True), 1)])


def rrr(pose: Array, p: Parameters) -> Array:
    """Law of cosines in the triangle of motor, elbow and platform joint; pose (3,): mm, degrees."""
    c, s = np.cos(np.radians(pose[2])), np.sin(np.radians(pose[2]))
    q = []
    for i in (1, 2, 3):
        x, y = p[f"P{i}x"], p[f"P{i}y"]
        d = pose[:2] + np.array([c * x - s * y, s * x + c * y]) - _at(p, f"O{i}", "xy")
        far, crank, rod = float(np.hypot(*d)), p[f"crank{i}"], p[f"rod{i}"]
        inner = np.arccos((crank**2 + far**2 - rod**2) / (2 * crank * far))
        q.append(np.degrees(np.arctan2(d[1], d[0]) + inner) - p[f"zero{i}"])
    return (np.array(q) + 180) % 360 - 180


_COLUMNS = tuple(np.radians(120 * k) for k in range(3))


def _delta_gaps(pose: Array, turn: Array, travel: Array, p: Parameters) -> Array:
    """By how much the six rods (6,) are too short; pose (3,) mm, turn of the platform (3,) rad, readings (3,) mm."""
    missing = []
    for k, angle in enumerate(_COLUMNS):
        i = k + 1
        radial, tangent = _flat(angle + np.radians(p[f"turn{i}"]))
        rail = p[f"tilt{i}"] * radial + p[f"lean{i}"] * tangent + [0, 0, 1]
        foot = p[f"R{i}"] * radial + (travel[k] + p[f"stop{i}"]) * rail / np.linalg.norm(rail)
        out, side = _flat(angle)
        for s in (1, -1):
            end = pose + Rotation.from_rotvec(turn).apply(p["r"] * out + s * p["w"] * side)
            missing.append(np.linalg.norm(end - foot - s * p["w"] * tangent) - p[f"rod{i}"])
    return np.array(missing)


def delta(pose: Array, p: Parameters) -> Array:
    """Six rods of given lengths: three travels and the small turn of the platform, which is not wanted; pose (3,)."""
    guess = []
    for k, angle in enumerate(_COLUMNS):
        flat = pose[:2] - (p[f"R{k + 1}"] - p["r"]) * _flat(angle)[0, :2]
        guess.append(pose[2] + np.sqrt(p[f"rod{k + 1}"] ** 2 - flat @ flat))
    gaps = lambda u: _delta_gaps(pose, u[3:] / p["rod1"], u[:3], p)  # noqa: E731
    found: Array = fsolve(gaps, [*guess, 0, 0, 0], xtol=1e-14)
    assert np.abs(gaps(found)).max() < 1e-9 * p["rod1"]
    return found[:3]


def delta_pose(travel: Array, p: Parameters) -> Array:
    """The place (3,) of the platform at readings (3,), mm: the same rods, solved the other way round."""
    gaps = lambda u: _delta_gaps(u[:3], u[3:] / p["rod1"], travel, p)  # noqa: E731
    drop = np.sqrt(p["rod1"] ** 2 - (p["R1"] - p["r"]) ** 2)
    found: Array = fsolve(gaps, [0, 0, travel.mean() - drop, 0, 0, 0], xtol=1e-14)
    assert np.abs(gaps(found)).max() < 1e-9 * p["rod1"]
    return found[:3]


def cable(pose: Array, p: Parameters, pull: float) -> Array:
    """Balance of the load: three tensions carry its weight and the pull of the fourth; pose (3,)."""
    way = np.array([_at(p, f"A{i}") - pose[:3] for i in (1, 2, 3, 4)])
    far = np.linalg.norm(way, axis=1)
    unit = way / far[:, None]
    weight = np.array([0, 0, -p["m"] * G])
    upper = np.linalg.solve(unit[:3].T, -(weight + pull * unit[3]))
    assert (upper > 0).all()
    tension = np.array([*upper, pull])
    unstressed = far / (1 + tension / p["EA"])
    return np.array([(unstressed[i] - p[f"z{i + 1}"]) / p[f"s{i + 1}"] for i in range(4)])


_RODS = ((1, 1, 1), (2, 2, -1), (3, 3, -1), (4, 4, 1), (5, 1, 1))
"""Rod, its carriage, side on which its joint on the platform lies in y."""


def _scissors_joints(pose: Array, p: Parameters) -> tuple[Array, Array, Array]:
    """Joints A on the platform, B of carriages at 0, directions of their guides, each (5, 2); pose (3,): mm, rad."""
    turned = lambda a, v: np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) @ np.asarray(v)  # noqa: E731
    ends, starts, along = [], [], []
    for rod, carriage, up in _RODS:
        left = carriage < 3
        sign, turn = (-1, p["g1"]) if left else (1, p["g2"])
        ends.append(pose[:2] + turned(pose[2], [sign * p[f"xa{rod}"], up * p[f"ya{rod}"]]))
        own = [-sign * p[f"xb{rod}"], (-1 if rod == 5 else up) * p[f"yb{rod}"]]
        starts.append(np.array([sign * p["d1" if left else "d2"], 0.0]) + turned(turn, own))
        along.append(turned(turn, [0.0, 1.0]))
    return np.array(ends), np.array(starts), np.array(along)


def _scissors_travel(k: int, pose: Array, p: Parameters) -> float:
    """Travel at which a rod k (from 0) is unstressed, on the side of its carriage away from the other."""
    ends, starts, along = _scissors_joints(pose, p)
    to, u = ends[k] - starts[k], along[k]
    rod = p[f"l{_RODS[k][0]}"]
    side = 1 if _RODS[k][2] > 0 else -1
    return float(to @ u + side * np.sqrt(rod**2 - to @ to + (to @ u) ** 2))


def scissors(pose: Array, p: Parameters) -> Array:
    """Without any strain: the platform turns until rods 1 and 5 agree on carriage 1; pose (2,)."""
    both = lambda a: _scissors_travel(0, np.array([*pose, a]), p) - _scissors_travel(4, np.array([*pose, a]), p)  # noqa: E731
    angle = brentq(both, -0.05, 0.05, xtol=1e-15)
    return np.array([_scissors_travel(k, np.array([*pose, angle]), p) for k in range(4)])


def scissors_strained(q: Array, p: Parameters) -> Array:
    """Position (2,) of the platform where the strain energy of the five rods is least."""

    def strains(pose: Array) -> Array:
        ends, starts, along = _scissors_joints(np.array([pose[0], pose[1], pose[2] / p["d1"]]), p)
        travel = np.array([q[carriage - 1] for _, carriage, _ in _RODS])
        far = np.linalg.norm(ends - starts - travel[:, None] * along, axis=1)
        return np.array([np.sqrt(p[f"k{i + 1}"]) * (far[i] - p[f"l{i + 1}"]) for i in range(5)])

    found: Array = least_squares(strains, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac").x
    return found[:2]


def gantry(pose: Array, p: Parameters) -> Array:
    """Zeros, scales and lean of the ram, of a gantry without weight whose sides agree; pose (3,)."""
    size = p["size"]
    lean = Rotation.from_rotvec(np.radians([p["sqy"], p["sqx"], 0]))
    column, arm = lean.apply([0, 0, 1]), lean.apply([0, -0.08 * size, -0.1 * size])
    z = (pose[2] - 0.2 * size - arm[2]) / column[2]
    x, y, _ = pose - arm - z * column
    y = y * np.hypot(1.0, p["sq"])  # the rails run askew to the beam, which keeps its direction
    x = x - y * p["sq"] / np.hypot(1.0, p["sq"])
    travels = {"y1": y, "y2": y, "x0": x, "z0": z}
    scales = ("sy1", "sy2", "sx", "sz")
    return np.array([(at - p[zero]) / p[scale] for (zero, at), scale in zip(travels.items(), scales, strict=True)])


INVERSE: Mapping[str, Callable[..., Array]] = {"hexapod": hexapod, "rrr": rrr, "delta": delta, "scissors": scissors}
