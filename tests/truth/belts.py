"""Router sled held by four belts, as a minimum of energy: two belts of given length, two of constant tension. SI.

Belt i: a rope from its anchor to the router, of natural length zero_i + R * ratio * q_i and stiffness EA over it. One
of constant tension F is held by its motor, whose reading is an output: its natural length is the distance over
1 + F / EA.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import dimensions as dim
from . import pinned
from .pinned import Array, DeadForce, Rods, State
from .pinned_machine import Parameters
from .self_measured import Sensing


class BeltRouter(Sensing):
    """Readings: `tape`, the distance to the router's place in the partner's row (nan without), and the lower belts."""

    name = "belt-router"
    method = "minimum of the potential energy of a point on elastic ropes"
    drives = dim.BELT_ROUTER_BELTS
    channels = ("tape", "BL", "BR")
    nominal = dim.BELT_ROUTER
    ranges = dim.BELT_ROUTER_RANGES
    sigma = dim.BELT_ROUTER_SIGMA
    units = dim.BELT_ROUTER_UNITS
    control = (
        "upper belts position-controlled, set values of the nominal machine, strain-free; lower belts pull with 60 N"
    )

    def anchors(self, p: Parameters) -> Array:
        """Anchors (4, 2) in m."""
        return np.array([[p[f"{n}x"], p[f"{n}y"]] for n in self.drives])

    def gains(self, p: Parameters) -> Array:
        """Belt (4,) in m per motor angle in rad."""
        return np.array([p["Rtop"], p["Rtop"], p["Rlow"], p["Rlow"]]) * dim.BELT_ROUTER_RATIO

    def at_zero(self, p: Parameters) -> Array:
        """Natural length (4,) of the belts at reading 0."""
        return np.array([p[f"zero{n}"] for n in self.drives])

    def inverse(self, places: ArrayLike, parameters: Parameters | None = None) -> Array:
        """Motor angles (N, 4) in rad with belts that just reach the places (N, 2)."""
        p = self.completed(parameters)
        reach = np.linalg.norm(np.atleast_2d(places)[:, None] - self.anchors(p), axis=2)
        out: Array = (reach - self.at_zero(p)) / self.gains(p)
        return out

    def solve(self, q: Array, p: Parameters, start: ArrayLike) -> pinned.Equilibrium:
        """Equilibrium of one row (4,) near a place (2,)."""
        natural = self.at_zero(p) + self.gains(p) * q
        held = np.array([False, False, True, True])
        ropes = Rods.of(
            body=np.zeros((4, 2)),
            base=self.anchors(p),
            drive=[-1] * 4,
            length=natural,
            stiffness=np.where(held, 0, p["EA"] / natural),
            tension=np.where(held, dim.BELT_ROUTER_PULL, 0),
            rope=~held,
        )
        weight = DeadForce(np.array([0, -dim.BELT_ROUTER_MASS * dim.BELT_ROUTER_GRAVITY, 0]), np.zeros(3))
        return pinned.minimise(ropes, State.at(start, np.zeros(0)), pinned.PLANAR_POINT, (weight,))

    def places(self, q: ArrayLike, p: Parameters) -> tuple[Array, Array]:
        """Router (N, 2) in m, and tensions (N, 4) in N. The start: where nominal belts of these lengths would meet."""
        places, tensions = [], []
        for row in np.atleast_2d(np.asarray(q, float)):
            found = self.solve(row, p, self.near(row))
            places.append(found.state.position[:2].astype(float))
            tensions.append(found.tension.astype(float))
        return np.array(places), np.array(tensions)

    def near(self, q: Array) -> Array:
        """Place (2,) of the nominal machine with stiff upper belts."""
        left, right, *_ = self.anchors(self.nominal)
        first, second, *_ = self.at_zero(self.nominal) + self.gains(self.nominal) * q
        width = right[0] - left[0]
        x = (first**2 - second**2 + width**2) / (2 * width)
        return np.array([left[0] + x, left[1] - np.sqrt(first**2 - x**2)])

    def read(self, q: ArrayLike, parameters: Parameters | None = None, partner: ArrayLike | None = None) -> Array:
        """Readings (N, 3) at motor angles (N, 4), of which the lower belts' do nothing."""
        p = self.completed(parameters)
        place, _ = self.places(q, p)
        other = np.full(len(place), -1) if partner is None else np.asarray(partner)
        tape = np.where(other < 0, np.nan, np.linalg.norm(place - place[other], axis=1))
        reach = np.linalg.norm(place[:, None] - self.anchors(p)[2:], axis=2)
        natural = reach / (1 + dim.BELT_ROUTER_PULL / p["EA"])
        return np.column_stack([tape, (natural - self.at_zero(p)[2:]) / self.gains(p)[2:]])
