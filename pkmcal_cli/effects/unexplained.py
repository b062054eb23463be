"""What is there but has no name: a displacement with a free shape over the travel or over time, `unexplained@PLACE`.

The shape is a Gaussian process with Matern's covariance of smoothness 3/2 (Rasmussen and Williams 2006, eq. 4.17): a
spread, a width, and values at knots between which it is the conditional mean. Its parameters are weights w of shapes
that are independent and of unit variance before anything is measured: the values at the knots are F w with F F^T the
covariance there. To this come a level and a slope of its own, since data rarely tell these from parameters. Beyond the
knots the shape falls back to where this line ends, and its uncertainty grows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

from pkmcal_cli.effects.effect import Effect, EffectParameter, Entry, Inputs

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

UNEXPLAINED = "unexplained"
ENTRIES: tuple[Entry, ...] = ("command", "guide")
"""Where a displacement without a name can enter."""
OVER_TIME = ":time"
"""After the name of a drive: the shape is one over time."""
_JITTER = 1e-8  # of the variance at the knots, against rounding
_LINE = 3.0  # variance of a shape's level, and of its rise to either end, in squares of its spread
Axis = Literal["travel", "time"]


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeShape:
    """A shape over an axis: `knots` (K,) m, rad or s, rising; `spread` m or rad; `width` as the knots.

    values (K,), covariance (K, K): what is known of it at the knots; None: nothing yet.
    """

    knots: tuple[float, ...]
    spread: float
    width: float
    values: Array | None = None
    covariance: Array | None = None

    @cached_property
    def prior(self) -> Array:
        """Covariance (K, K) at the knots before anything is measured."""
        import numpy as np

        knots = np.array(self.knots)
        return np.asarray(self.spread**2 * (self._correlation(knots) + _JITTER * np.eye(len(knots))))

    @cached_property
    def _modes(self) -> tuple[Array, Array]:
        """F (K, K) with F F^T the prior and F diag(s^2) F^T what is known; s (K,)."""
        import numpy as np
        from scipy.linalg import eigh

        if self.covariance is None:
            return np.asarray(np.linalg.cholesky(self.prior)), np.ones(len(self.knots))
        variances, vectors = eigh(self.covariance, self.prior)  # vectors^T prior vectors = 1
        return self.prior @ vectors, np.sqrt(np.clip(variances, 0.0, 1.0))

    @property
    def factor(self) -> Array:
        """F (K, K): values at the knots of weights; prior F F^T."""
        return self._modes[0]

    @property
    def known_std(self) -> Array:
        """Standard uncertainty (K,) of the weights by what is known of the shape; 1 where nothing is."""
        return self._modes[1]

    @cached_property
    def weights(self) -> Array:
        """Weights (K,) of what is known of the shape."""
        import numpy as np

        values = np.zeros(len(self.knots)) if self.values is None else self.values
        return np.asarray(np.linalg.solve(self.factor, values))

    def basis(self, x: Any) -> Any:
        """The shape (N, K) at x (N,), real or complex, of unit weights."""
        import numpy as np

        return self.spread**2 * self._correlation(np.asarray(x)) @ np.linalg.solve(self.prior, self.factor)

    def missing_variance(self, x: Array) -> Array:
        """Variance (N,) at x (N,) that the values at the knots do not know of."""
        import numpy as np

        variance = 1.0 + _LINE * (1.0 + self._share(x) ** 2)
        return np.asarray(np.maximum(variance * self.spread**2 - (self.basis(x) ** 2).sum(axis=1), 0.0))

    def _correlation(self, x: Any) -> Any:
        """Correlation (N, K) of the shape at x (N,) with that at the knots."""
        import numpy as np

        distance = np.asarray(x)[:, None] - np.array(self.knots)
        scaled = np.sqrt(3.0) / self.width * np.where(distance.real < 0, -distance, distance)
        line = _LINE * (1.0 + self._share(x)[:, None] * self._share(self.knots))
        return line + (1.0 + scaled) * np.exp(-scaled)

    def _share(self, x: Any) -> Any:
        """Places x (N,) on -1 ... 1 between the first knot and the last, at the end of it beyond."""
        import numpy as np

        first, last = self.knots[0], self.knots[-1]
        share = (2 * np.asarray(x) - first - last) / (last - first)
        return np.where(np.abs(share.real) > 1.0, np.sign(share.real), share)


@dataclass(frozen=True, kw_only=True)
class Unexplained(Effect):
    """A displacement with a free shape over an axis."""

    shape: FreeShape
    axis: Axis

    def at(self, inputs: Inputs) -> Array:
        """Place (N,) of the rows on the axis, m, rad or s."""
        return inputs.time if self.axis == "time" else inputs.travel


def unexplained(enters: Entry, shape: FreeShape, axis: Axis = "travel") -> Unexplained:
    """The displacement of an entry that has a shape and no name."""

    def formula(inputs: Inputs, *weights: Any) -> Any:
        if all(isinstance(w, float) and w == 0.0 for w in weights):
            return 0.0
        import numpy as np

        return shape.basis(inputs.time if axis == "time" else inputs.travel) @ np.array(weights)

    over = "time" if axis == "time" else "the travel"
    return Unexplained(
        keyword=UNEXPLAINED,
        title=f"unexplained deviation over {over}",
        symbol="",
        source="Gaussian process, Rasmussen and Williams 2006, eq. 4.17",
        enters=enters,
        parameters=tuple(_weight(k) for k in range(1, len(shape.knots) + 1)),
        formula=formula,
        cause=f"Something moves {{at}} by an amount that depends on {over}; no effect of the catalogue has its shape.",
        result=f"Positions deviate along {over} as the curve shows.",
        action="Find its cause; until then it can be compensated for where it was measured.",
        needs=("time",) if axis == "time" else (),
        common=False,
        shape=shape,
        axis=axis,
    )


def _weight(number: int) -> EffectParameter:
    return EffectParameter(name=f"w{number}", unit="1", range=2.0, text=f"weight of shape {number}")


def even_knots(low: float, high: float, spacing: float, most: int) -> tuple[float, ...]:
    """Knots from low to high at distances of about `spacing`."""
    import numpy as np

    count = min(max(int(np.ceil((high - low) / spacing)) + 1, 3), most)
    return tuple(float(x) for x in np.linspace(low, high, count))


def place_and_axis(at: str) -> tuple[str, Axis]:
    """The drive or guide, and the axis of a shape there, whatever session it belongs to: `q2:time[monday]`."""
    place = at.partition("[")[0]
    return (place.removesuffix(OVER_TIME), "time") if place.endswith(OVER_TIME) else (place, "travel")
