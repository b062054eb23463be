"""Machines that are measured by sensors other than a TCP's: what they have in common. SI units."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from . import dimensions as dim
from .pinned import Array
from .pinned_machine import Parameters


class Sensing(ABC):
    """A machine and its sensors.

    `ranges`: of the parameters that the machine file identifies, the only ones with planted errors. `sigma`: of
    channels, and of drives (as travel) that are not exact. `units`: in the files, of what is not in mm. `control`: what
    the file says of its drives.
    """

    name: ClassVar[str]
    method: ClassVar[str]
    drives: ClassVar[tuple[str, ...]]
    channels: ClassVar[tuple[str, ...]]
    nominal: ClassVar[Parameters]
    ranges: ClassVar[Parameters]
    sigma: ClassVar[dim.Sigma]
    units: ClassVar[Mapping[str, str]]
    control: ClassVar[str] = "all drives position-controlled; set values of the nominal machine"

    def completed(self, parameters: Parameters | None) -> dict[str, float]:
        """Nominal values, replaced by the given ones."""
        unknown = set(parameters or {}) - set(self.nominal)
        if unknown:
            raise KeyError(f"{self.name} has no parameter {sorted(unknown)}")
        return {**self.nominal, **(parameters or {})}

    def unit(self, name: str) -> str:
        """Unit of a parameter, drive or channel in the files."""
        return self.units.get(name, "mm")

    def si_sigma(self, name: str) -> float:
        """Standard uncertainty of a channel, or of a drive as travel; 0 where it is exact."""
        number, unit = self.sigma.get(name, (0.0, "mm"))
        return number * dim.UNITS[unit]

    def gains(self, p: Parameters) -> Array:
        """Travel (drives,) per drive reading, m or rad per m or rad."""
        return np.ones(len(self.drives))

    @abstractmethod
    def inverse(self, places: ArrayLike, parameters: Parameters | None = None) -> Array:
        """Drive readings (N, drives) that put the tool at places, strain-free."""

    @abstractmethod
    def read(self, q: ArrayLike, parameters: Parameters | None = None, partner: ArrayLike | None = None) -> Array:
        """Readings (N, channels) without noise; `partner` (N,): the row that a distance leads to, -1: none."""
