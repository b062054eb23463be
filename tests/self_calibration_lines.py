"""Machines that measure themselves: a point on four belts in the plane or on four lines in space.

The readings are those of a minimum of energy (`tests.truth.pinned`, no code of the engine).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import root
from scipy.spatial.transform import Rotation

from pkmcal_cli.base.rotation import Array
from tests.truth import pinned
from tests.truth.pinned import DeadForce, Rods, State

MM, REV = 1e-3, 2 * np.pi
DIGITS = 7
TAPE, CAMERA, BENCH = 0.2 * MM, 0.3 * MM, 0.5 * MM


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """A machine of four lines, and what is measured of it. Lengths in mm, forces in N.

    anchors: as drawn; low, high: corners of the grid of places, counts of it; wide: range of the anchors; zero: line
    out at reading 0, its range (0: known), None: homed at `home` with just taut lines; forced: lines in force control
    and their pull; free_radius: range of the drums' radius; spans: marks of which distances are measured; known: rows
    whose pose is measured; benches: pairs of anchors whose distance is measured; taper: widths of the places at their
    lowest and highest z, in those of the corners.
    """

    name: str
    what: str
    anchors: Mapping[str, tuple[float, ...]]
    low: tuple[float, ...]
    high: tuple[float, ...]
    counts: tuple[int, ...]
    forced: Mapping[str, float]
    wide: float = 20.0
    zero: tuple[float, float] | None = None
    sigma: float = 0.3
    EA: float = 1e5
    weight: tuple[float, ...] = ()
    mass: float = 0.0
    radius: float = 25.0
    free_radius: float = 0.0
    spans: int = 0
    known: int = 0
    benches: tuple[tuple[str, str], ...] = ()
    datum: tuple[str, ...] = ()
    seed: int = 0
    home: tuple[float, ...] = ()
    taper: tuple[float, float] = (1.0, 1.0)

    @property
    def axes(self) -> str:
        """Names of the coordinates."""
        return "xyz"[: len(self.low)]

    @property
    def lines(self) -> tuple[str, ...]:
        """Names of the lines."""
        return tuple(self.anchors)

    @property
    def gain(self) -> float:
        """Line in m per revolution of the motor."""
        return self.radius * MM * REV / 10

    def load(self) -> DeadForce:
        """Its weight."""
        return DeadForce(self.mass * np.array([*self.weight, 0.0, 0.0, 0.0][:3]), np.zeros(3))

    def centre(self) -> Array:
        """Where the point is drawn, and homed, in m."""
        return np.array(self.home or np.add(self.low, self.high) / 2) * MM


# --- truth -----------------------------------------------------------------------------------------------------------


@cache
def truth(case: Case, seed: int) -> dict[str, float]:
    """True parameters, SI: uniform within the ranges, what is held as datum too."""
    rng = np.random.default_rng([case.seed, 1, seed])
    out = {}
    for line, at in case.anchors.items():
        for axis, value in zip(case.axes, at, strict=True):
            out[f"{line}{axis}"] = (value + rng.uniform(-case.wide, case.wide)) * MM
    for line in case.lines if case.zero else ():
        out[f"zero{line}"] = (case.zero[0] + case.zero[1] * rng.uniform(-1, 1)) * MM
    out["R"] = (case.radius + case.free_radius * rng.uniform(-1, 1)) * MM
    return out


def relative_to(case: Case, true: dict[str, float], held: tuple[str, ...]) -> dict[str, float]:
    """The same machine, moved until the coordinates `held` are as drawn: turned about home, or shifted and turned.

    With a weight it turns about the vertical only, and in the plane, where that is no axis, not at all.
    """
    if not held:
        return true
    anchors, pivot, size = _anchors(case, true), case.centre(), len(case.low)
    names = [f"{n}{a}" for n in case.lines for a in case.axes]
    places = [names.index(name) for name in held]
    drawn = np.array([v for at in case.anchors.values() for v in at]) * MM
    turns = [False, False, True] if case.weight or size == 2 else [True] * 3
    free = np.array([*turns, *[case.zero is not None] * size])
    free[2] &= not (case.weight and size == 2)

    def moved(x: Array) -> Array:
        motion = np.zeros(len(free))
        motion[free] = x
        turn = Rotation.from_rotvec(motion[:3]).as_matrix()[:size, :size]
        return np.asarray((anchors - pivot) @ turn.T + pivot + motion[3:]).ravel()

    found = root(lambda x: (moved(x) - drawn)[places], np.zeros(int(free.sum())), tol=1e-14)
    assert free.sum() == len(held) and np.abs(found.fun).max() < 1e-9
    return true | dict(zip(names, moved(found.x).tolist(), strict=True))


def places(case: Case) -> Array:
    """Places (N, d) in m that the machine is sent to: a grid; then marks on a ring."""
    grid = np.meshgrid(*(np.linspace(a, b, n) for a, b, n in zip(case.low, case.high, case.counts, strict=True)))
    middle, size = np.add(case.low, case.high) / 2, np.subtract(case.high, case.low) / 2
    turn = 2 * np.pi * np.arange(case.spans) / max(case.spans, 1)
    ring = np.tile(middle, (case.spans, 1))
    ring[:, 0] += 0.95 * size[0] * np.cos(turn)
    ring[:, 1] += 0.95 * size[1] * np.sin(turn)
    if len(middle) == 3:
        ring[:, 2] += 0.9 * size[2] * np.cos(2 * turn)
    out = np.vstack([np.stack([g.ravel() for g in grid], axis=1), ring])
    if len(middle) == 3:
        width = np.interp(out[:, 2], [case.low[2], case.high[2]], case.taper)
        out[:, :2] = middle[:2] + (out[:, :2] - middle[:2]) * width[:, None]
    return out * MM


def partner(case: Case) -> Array:
    """The row (N,) to which a distance is measured, -1 without: of each mark the one that is 5/12 of the ring on."""
    first = int(np.prod(case.counts))
    step = max(5 * case.spans // 12, 1)
    marks = first + (np.arange(case.spans) + step) % max(case.spans, 1)
    return np.concatenate([np.full(first, -1), marks]).astype(int)


def known_rows(case: Case) -> Array:
    """Rows (k,) whose pose is measured, spread evenly over the grid."""
    return np.linspace(0, int(np.prod(case.counts)) - 1, case.known).round().astype(int)


def _anchors(case: Case, p: dict[str, float]) -> Array:
    return np.array([[p[f"{n}{a}"] for a in case.axes] for n in case.lines])


def _at_zero(case: Case, p: dict[str, float]) -> Array:
    """Natural length (4,) of the lines at reading 0, m."""
    if case.zero:
        return np.array([p[f"zero{n}"] for n in case.lines])
    return np.asarray(np.linalg.norm(_anchors(case, p) - case.centre(), axis=1))


@cache
def simulated(case: Case, seed: int) -> tuple[Array, Array]:
    """True places (N, d) in m and natural lengths (N, 4) of the lines; those in force control follow the point."""
    true = truth(case, seed)
    drawn = {f"{n}{a}": v * MM for n, at in case.anchors.items() for a, v in zip(case.axes, at, strict=True)}
    drawn |= {f"zero{n}": case.zero[0] * MM for n in case.lines if case.zero}
    anchors, out = _anchors(case, true), []
    pull = np.array([case.forced.get(n, 0.0) for n in case.lines])
    held = np.array([n in case.forced for n in case.lines])
    share = true["R"] / (case.radius * MM)
    for place in places(case):
        wound = np.linalg.norm(_anchors(case, drawn) - place, axis=1) - _at_zero(case, drawn)
        natural = _at_zero(case, true) + share * wound
        flat = np.zeros((4, len(place)))
        stiffness = np.where(held, 0, case.EA / natural)
        lines = Rods.of(flat, anchors, [-1] * 4, natural, stiffness, tension=np.where(held, pull, 0), rope=~held)
        freedoms = pinned.PLANAR_POINT if len(place) == 2 else pinned.SPATIAL_POINT
        found = pinned.minimise(lines, State.at(place, np.zeros(0)), freedoms, (case.load(),))
        if not (found.tension > 0).all():
            raise ValueError(f"{case.name}: a slack line at {place}: {found.tension.astype(float)}")
        true_place = found.state.position[: len(place)].astype(float)
        reach = np.linalg.norm(anchors - true_place, axis=1)
        out.append((true_place, np.where(held, reach / (1 + pull / case.EA), natural)))
    return np.array([a for a, _ in out]), np.array([b for _, b in out])


# --- files -----------------------------------------------------------------------------------------------------------


def machine_text(case: Case, bench: Mapping[tuple[str, str], float], forced: Mapping[str, float] | None = None) -> str:
    """The machine file with what was measured on the bench, m; `forced`: other lines in force control, their pulls."""
    force = case.forced if forced is None else forced
    lines = ["units: {length: mm, angle: deg, force: N}", f"space: {'planar' if len(case.low) == 2 else 'spatial'}"]
    lines += [f"datum: [{', '.join(case.datum)}]"] if case.datum else []
    lines += [f"gravity: {list(case.weight)}"] if case.weight else []
    lines += ["parameters:"]
    for n, at in case.anchors.items():
        lines += [f"  {n}{a}: {{nominal: {v}, range: {case.wide}}}" for a, v in zip(case.axes, at, strict=True)]
        if case.zero:
            free = f"range: {case.zero[1]}" if case.zero[1] else "fixed: true"
            lines += [f"  zero{n}: {{nominal: {case.zero[0]}, {free}}}"]
    free = f"range: {case.free_radius}" if case.free_radius else "fixed: true"
    lines += [f"  R: {{nominal: {case.radius}, {free}}}", "ground:"]
    lines += [f"  {n}: [{', '.join(n + a for a in case.axes)}]" for n in case.lines]
    mass = f", mass: {case.mass}" if case.weight else ""
    lines += [f"nodes: {{tool: {{at: {[float(v) for v in case.centre() / MM]}{mass}}}}}", "ropes:"]
    lines += [f"  line{n}: {{between: [{n}, tool], EA: {case.EA}}}" for n in case.lines] + ["actuators:"]
    for n in case.lines:
        control = f", redundant: true, control: force, force: {force[n]}" if n in force else ""
        zero = f"zero{n}" if case.zero else "home"
        drum = f"winds: line{n}, radius: R, ratio: 1/10, zero: {zero}, unit: rev, sigma: {case.sigma}"
        lines += [f"  {n}: {{{drum}{control}}}"]
    return "\n".join([*lines, *_sensors(case, bench)]) + "\n"


def _sensors(case: Case, bench: Mapping[tuple[str, str], float]) -> list[str]:
    lines = [f"  tape: {{kind: span, at: tool, sigma: {TAPE / MM}}}"] if case.spans else []
    if case.known:
        reads = ", ".join(f"{a}: {a}_mm" for a in case.axes)
        lines += [f"  camera: {{kind: tcp, at: tool, reads: {{{reads}}}, sigma: {CAMERA / MM}, frame: machine}}"]
    for (a, b), reading in bench.items():
        apart = ", ".join(f"{b}{c} - {a}{c}" for c in case.axes)
        lines += [f"  {a}{b}: {{kind: bench, of: 'hypot({apart})', reading: {reading / MM:.6f}, sigma: {BENCH / MM}}}"]
    return ["sensors:", *lines] if lines else []


@dataclass(frozen=True)
class Measured:
    """What was measured: the table, and the distances of anchors on the bench in m."""

    table: str
    bench: dict[tuple[str, str], float]


def measured(case: Case, seed: int) -> Measured:
    """Readings of all encoders, distances, poses with normal noise."""
    true, (place, natural) = truth(case, seed), simulated(case, seed)
    rng = np.random.default_rng([case.seed, 2, seed])
    gain = true["R"] * REV / 10
    turns = (natural - _at_zero(case, true)) / gain
    turns += rng.normal(size=turns.shape) * case.sigma * MM / case.gain
    other = partner(case)
    tape = np.linalg.norm(place - place[other], axis=1) + rng.normal(size=len(place)) * TAPE
    seen = place + rng.normal(size=place.shape) * CAMERA
    known = set(known_rows(case).tolist())
    header = ["id", *case.lines, *(["tape", "to"] if case.spans else [])]
    header += [f"{a}_mm" for a in case.axes] if case.known else []
    rows = []
    for k in range(len(place)):
        cells = [str(k + 1), *(f"{v:.{DIGITS}f}" for v in turns[k])]
        if case.spans:
            cells += [f"{tape[k] / MM:.{DIGITS}f}", str(other[k] + 1)] if other[k] >= 0 else ["", ""]
        if case.known:
            cells += [f"{v / MM:.{DIGITS}f}" if k in known else "" for v in seen[k]]
        rows.append(",".join(cells))
    bench = {}
    for a, b in case.benches:
        apart = np.linalg.norm([true[f"{b}{c}"] - true[f"{a}{c}"] for c in case.axes])
        bench[a, b] = float(apart + rng.normal() * BENCH)
    return Measured("\n".join([",".join(header), *rows]) + "\n", bench)
