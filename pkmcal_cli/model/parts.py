"""What a compiled machine has besides its structure: parameters, actuators, channels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.units.measurands import Measurand

_ROUNDING = 1e-9  # of a tension


@dataclass(frozen=True, kw_only=True)
class ModelParameter:
    """A parameter in SI: `range` is the half-width about nominal, two standard deviations of the prior.

    `session`: the session in whose rows it holds, "" in all; `per_session`: each session of a table has its own;
    `kind`: by which ranges are judged together, default the dimension; `fixed`: exact, and never identified;
    `stated`: whether its range is of the machine file, not of the catalogue of effects.
    """

    name: str
    nominal: float
    range: float
    bounds: tuple[float, float]
    unit: str  # for display
    dimension: str
    identify: bool
    per_session: bool = False
    session: str = ""
    kind: str = ""
    fixed: bool = False
    stated: bool = True

    @property
    def shared_name(self) -> str:
        """The name without its session."""
        return self.name.removesuffix(f"[{self.session}]")

    def of_session(self, session: str) -> ModelParameter:
        """Its instance for a session."""
        return replace(self, name=f"{self.name}[{session}]", per_session=False, session=session)


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """A drive seen from the control: position = value of its coefficient at reading zero + gain * reading."""

    name: str
    gain_coefficient: int
    limits: tuple[float, float]
    force_limit: float  # N or N m; infinite: none stated
    sigma: float  # standard uncertainty of the position, m or rad of travel (a spool's: of its line); nan: none
    unit: str
    dimension: str
    force_coefficient: int  # constant force of a force-controlled drive where no column gives it, N or N m
    sigma_is: str = "stated"  # what sigma is worth: "stated", "exact" or "unknown"


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One measured quantity.

    index: the point, rotation or drive; component: which of its coordinates.
    """

    name: str
    measurand: Measurand
    index: int
    component: int
    sigma: float  # SI; nan where none is declared
    unit: str
    dimension: str
    sigma_slope: float = 0.0  # growth of sigma with distance or length, a linear sum
    sigma_per_length: float = 0.0  # the same in quadrature
    once: float = nan  # what was measured once, on the bench, SI
    known: float = nan  # what is read in every row in which it touches, SI
    instrument: str = ""  # sensor or drive
    sigma_is: str = "stated"


@dataclass(frozen=True)
class LeastTension:
    """A rope that has to be taut; `member`: group and place there of its cable, `weight` times whose tension it bears.

    tension: N.
    """

    name: str
    member: tuple[int, int]
    weight: float
    tension: float

    def missed(self, tensions: Array, lacking: float = 0.0) -> NDArray[np.bool_]:
        """Which tensions (N,), N, are below it by more than rounding, and than a share of it that may be lacking."""
        return np.asarray(tensions < (1.0 - max(lacking, _ROUNDING)) * self.tension)
