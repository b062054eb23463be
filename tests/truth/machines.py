"""The machines by name; see `planar`, `spatial`, `hexapod7` for the models and `dimensions` for the
numbers."""

from __future__ import annotations

from collections.abc import Callable

from .hexapod7 import Hexapod7
from .pinned_machine import Machine
from .planar import biglide, scissors, triglide
from .spatial import Hangprinter, delta4

__all__ = ["PINNED", "Hangprinter", "Hexapod7", "biglide", "delta4", "scissors", "triglide"]

PINNED: dict[str, Callable[[], Machine]] = {
    "triglide": triglide,
    "triglide-nonredundant": lambda: triglide(2),
    "biglide": biglide,
    "scissors": scissors,
    "delta4": delta4,
}
