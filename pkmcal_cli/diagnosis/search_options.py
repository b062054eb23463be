"""How a table is searched for causes."""

from __future__ import annotations

from dataclasses import dataclass

from pkmcal_cli.base.stages import Observer, unobserved
from pkmcal_cli.base.workers import ALONE, Workers
from pkmcal_cli.calibration.robust import Loss
from pkmcal_cli.diagnosis.alpha import Alpha


@dataclass(frozen=True, kw_only=True)
class SearchOptions:
    """False-alarm rate of the whole diagnosis, seed of the bootstrap, loss of the fits; who is told of the steps, who
    does those that can be done at once."""

    alpha: float
    seed: int
    loss: Loss = "squares"
    observe: Observer = unobserved
    workers: Workers = ALONE

    @property
    def parts(self) -> Alpha:
        """The false-alarm rate by what is tested."""
        return Alpha(self.alpha)
