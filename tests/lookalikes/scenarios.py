"""The scenarios by name: how a campaign of a seed is drawn, and what it is in a line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tests.truth.look_alikes.bent_rail import bent_rail
from tests.truth.look_alikes.forgotten_belts import forgotten_belts
from tests.truth.look_alikes.head import head
from tests.truth.look_alikes.leaning_delta import leaning_delta
from tests.truth.look_alikes.look_alike import LookAlike
from tests.truth.look_alikes.shop_floor import drifting_drive, odd_rows
from tests.truth.look_alikes.spools import spools


@dataclass(frozen=True)
class Scenario:
    """A campaign by its seed, and its words."""

    draw: Callable[[int], LookAlike]
    words: str


SCENARIOS = {
    "leaning-delta": Scenario(
        leaning_delta, "delta printer, 285 heights to 14 um at five levels: all three rails lean by some 1.5 mrad"
    ),
    "forgotten-belts": Scenario(
        forgotten_belts, "four belts that measure themselves: 150 mm forgotten in each, upper drums 0.4 % too small"
    ),
    "spools": Scenario(
        spools, "four lines on spools, four sessions with zeros of their own: two wrong radii, and line that builds up"
    ),
    "head": Scenario(head, "tripod head that reads z, rx, ry in ten poses: one screw has a wrong pitch"),
    "bent-rail": Scenario(bent_rail, "gantry whose right rail, on guides that yield, is bent by 70 to 110 um"),
    "drifting-drive": Scenario(
        drifting_drive, "Triglide, one drive of which drifts while the shop warms: time goes with temperature"
    ),
    "odd-rows": Scenario(
        odd_rows, "Scissors, two of 70 rows written down wrongly; in every other table lost motion of a drive besides"
    ),
}
