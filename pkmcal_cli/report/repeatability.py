"""Noise by repeated poses, in words."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.base.plural import count
from pkmcal_cli.calibration.replicates import ReplicateNoise
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.number_format import readable
from pkmcal_cli.units.unit_text import parse_unit

_MORE = "more scatter than stated in {}: sigma is too small, or the poses do not repeat (reversal, drift)"
_FEWEST = 4  # degrees of freedom from which on an estimate of noise is worth a line
_LESS = "less scatter than stated in {}: sigma is too large or includes more than noise, or readings were averaged"


def show_replicates(to: Reporter, noises: Sequence[ReplicateNoise]) -> None:
    """One line for channels with repeated poses enough, and one for those whose stated sigma does not fit."""
    noises = [n for n in noises if n.degrees_of_freedom >= _FEWEST]
    if noises:
        to.say(f"repeated poses: noise of {'; '.join(_words(n) for n in noises)}")
    for large, words in ((True, _MORE), (False, _LESS)):
        names = [n for n in noises if n.doubtful and (n.std > n.sigma) == large]
        if names:
            channels = ", ".join(f"`{n.channel}` (p = {n.p_value:.2g})" for n in names)
            to.say(words.format(channels))


def _words(noise: ReplicateNoise) -> str:
    unit = parse_unit(noise.unit)
    std, sigma = readable(noise.std, unit), readable(noise.sigma, unit)
    freedom = count(noise.degrees_of_freedom, "degree")
    return f"{noise.channel} {std} ({freedom} of freedom), stated {sigma}"
