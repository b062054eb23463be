"""Two slides on parallel rails, seen by one tracker that stands anywhere; what it reads by its own few lines.

    reading = R p + t: p a point in the axes of the machine, R and t the machine as the tracker sees it.

A shift of both zeros is not seen: `x1` is the datum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

MACHINE = """\
units: {length: mm, angle: deg, force: N}
space: planar
ranges: {length: 2, scale: 1e-3}
parameters: {x1: 0, x2: 0, h: 1000, s: 1}
datum: [x1]
guides: {low: {along: x}, high: {at: [0, h], along: x}}
bodies:
  one: {guide: low, at: 500, points: {A: [0, 0]}}
  two: {guide: high, at: 500, points: {B: [0, 0]}}
actuators:
  X1: {moves: one, zero: x1, limits: [0, 1000]}
  X2: {moves: two, zero: x2, scale: s, limits: [0, 1000]}
sensors: {tracker: {at: [A, B], reads: [x, y], sigma: 10 um, frame: fitted}}
tool_point: A
"""


@dataclass(frozen=True, kw_only=True)
class Slides:
    """A machine and its tracker: mm; turn: deg, of the machine's axes in those of the tracker."""

    x1: float = 0.4
    x2: float = -0.9
    h: float = 1000.3
    s: float = 1.0002
    shift: tuple[float, float] = (3000.0, -1500.0)
    turn: float = 40.0

    def table(self, path: Path, seed: int, rows: int = 30) -> Path:
        """A table of measurements with noise of 10 um."""
        rng = np.random.default_rng(seed)
        drives = rng.uniform(0.0, 1000.0, (rows, 2))
        places = [(drives[:, 0] + self.x1, np.zeros(rows)), (self.s * drives[:, 1] + self.x2, np.full(rows, self.h))]
        c, s = np.cos(np.radians(self.turn)), np.sin(np.radians(self.turn))
        columns = [drives]
        for x, y in places:
            seen = np.column_stack([c * x - s * y, s * x + c * y]) + self.shift
            columns.append(seen + 0.01 * rng.normal(size=seen.shape))
        heads = ["X1", "X2", *(f"{p}.{k}" for p in "AB" for k in "xy")]
        lines = [",".join(f"{h} [mm]" for h in heads)]
        lines += [",".join(f"{v:.6f}" for v in row) for row in np.hstack(columns)]
        path.write_text("\n".join([*lines, ""]), encoding="utf-8")
        return path

    def repaired(self) -> Slides:
        """The second slide taken off and put on again half a millimetre further, the tracker set up elsewhere."""
        return replace(self, x2=self.x2 + 0.5, shift=(-800.0, 2600.0), turn=-115.0)
