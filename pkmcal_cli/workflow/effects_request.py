"""What `effects` is asked for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class EffectsRequest:
    """The arguments of `effects`."""

    machine: str | None
    poses: str | None
    simulate: bool
    grid: str | None
    parameters: str | None
    select: str
    as_json: bool
    quiet: bool
