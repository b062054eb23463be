"""Under what circumstances the rows of a campaign are measured: poses, order, time, air, payload, directions."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .fast_pinned import Array
from .shop_plans import Plan, set_values

HOURS = 3600.0
REFERENCE = 20.0
"""degC at which thermal growth is zero."""
PAYLOADS = (0.0, 3.0, 6.0)
"""kg"""


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """How a campaign is measured.

    `sigma_factor`: true noise over stated noise. `noise`: "normal", "t4" (unit variance) or "ar1" (correlation 0.7
    of successive rows). `outliers`: share of the rows with a gross shift. `omit`: columns that the table lacks, by
    name or pattern ("T", "dir.*"). `sessions`: equal parts of the table, s1, s2, ... `ordering`: "randomised", or
    "sequential" (poses in serpentine order, directions those of the motion, payload in blocks). `repeated`: how
    many poses are measured twice, one right after the other. `parts`: parts with a thermometer of their own (T.PART).
    `payload`: a constant one in kg, None: 0, 3, 6 at random. `swing`, `warming`: of the air in K, `hours`: how long it
    takes. `errors`: true errors of the declared parameters over their prior. `extra`: weight of what the effects
    have beyond their named shape. `stream`: other poses, times and noise of the same machine on the same day.
    """

    sigma_factor: float = 1.0
    noise: str = "normal"
    outliers: float = 0.0
    omit: tuple[str, ...] = ()
    sessions: int = 2
    ordering: str = "randomised"
    repeated: int = 0
    parts: tuple[str, ...] = ()
    payload: float | None = None
    swing: float = 4.0
    warming: float = 1.5
    hours: float = 4.0
    errors: float = 1.0
    extra: float = 1.0
    stream: int = 0


@dataclass(frozen=True)
class Air:
    """Temperature of the hall: a sinus of `swing` K and `period` s about 20 degC, and `warming` K over `length` s."""

    swing: float
    warming: float
    length: float
    period: float
    phase: float

    def at(self, time: Array, lag: float = 0.0) -> Array:
        """Temperature (N,) in degC at times in s, of a body that follows the air with a first-order lag in s and has
        done so for long."""
        turn = 2 * np.pi / self.period
        wave = np.sin(turn * time + self.phase - np.arctan(turn * lag)) / np.hypot(1, turn * lag)
        felt: Array = REFERENCE + self.swing * wave + self.warming * ((time - lag) / self.length - 0.5)
        return felt

    def of_part(self, name: str, time: Array) -> Array:
        """Temperature (N,) in degC of a part with its own thermometer: late, and warmed by its own work."""
        own = np.random.default_rng(list(name.encode()))
        wave = np.sin(2 * np.pi * time / (self.period * own.uniform(0.5, 0.8)) + own.uniform(0, 6))
        felt: Array = self.at(time, own.uniform(300, 900)) + 1.5 * wave
        return felt


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """N rows: commanded `poses` (N, 3) and set values `q` (N, A) in m, `time` in s, `session` (N,) from 1,
    `temperature` in degC as logged, `payload` in kg, `direction` (N, A) +1 or -1, `part` temperatures in degC, the
    day's air, and the whole day's length in s."""

    poses: Array
    q: Array
    time: Array
    session: NDArray[np.intp]
    temperature: Array
    payload: Array
    direction: Array
    air: Air
    part: dict[str, Array] = field(default_factory=dict)


def random_poses(plan: Plan, rows: int, rng: np.random.Generator) -> Array:
    """Poses (rows, 3) in m, uniform over the workspace."""
    box = rng.uniform(plan.lower, plan.upper, size=(rows, len(plan.lower)))
    return np.pad(box, ((0, 0), (0, 3 - box.shape[1])))


def serpentine(poses: Array) -> Array:
    """The same poses in bands along the first axis, to and fro along the second."""
    bands = np.minimum((np.argsort(np.argsort(poses[:, 0])) * 12) // len(poses), 11)
    along = np.where(bands % 2 == 0, poses[:, 1], -poses[:, 1])
    return poses[np.lexsort((along, bands))]


def conditions(plan: Plan, seed: int, rows: int, scenario: Scenario) -> Conditions:
    """Draws the circumstances of `rows` rows; the day's air depends on the seed alone."""
    day, rng = np.random.default_rng([seed, 2]), np.random.default_rng([seed, 3, scenario.stream])
    length = scenario.hours * HOURS
    air = Air(scenario.swing, scenario.warming, length, length / day.uniform(2.2, 2.8), day.uniform(0, 2 * np.pi))
    repeated = scenario.repeated
    poses = random_poses(plan, rows - repeated, rng)
    if scenario.ordering == "sequential":
        poses = serpentine(poses)
    elif scenario.ordering != "randomised":
        raise ValueError(f"no ordering {scenario.ordering!r}")
    q = set_values(plan, poses)
    payload = rng.choice(PAYLOADS, size=len(poses))
    direction = rng.choice([-1.0, 1.0], size=q.shape)
    if scenario.ordering == "sequential":
        payload = np.array(PAYLOADS)[np.arange(len(poses)) * 3 // len(poses)]
        direction = np.sign(np.diff(q, axis=0, prepend=q[:1] - 1e-3))
    if scenario.payload is not None:
        payload = np.full(len(poses), scenario.payload)
    twice = np.ones(len(poses), int)
    twice[rng.permutation(len(poses))[:repeated]] += 1
    taken = np.repeat(np.arange(len(poses)), twice)
    time = np.round((np.arange(rows) + rng.uniform(0.3, 0.7, rows)) * length / rows, 1)
    return Conditions(
        poses=poses[taken],
        q=q[taken],
        time=time,
        session=1 + np.arange(rows) * scenario.sessions // rows,
        temperature=np.round(air.at(time), 3),
        payload=payload[taken],
        direction=direction[taken],
        air=air,
        part={name: np.round(air.of_part(name, time), 3) for name in scenario.parts},
    )
