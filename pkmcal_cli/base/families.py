"""Families of things that are data: every module of a folder may hold members, found by looking."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable
from typing import TypeVar

Member = TypeVar("Member")


def members(package: str, folder: Iterable[str], kind: type[Member]) -> dict[str, Member]:
    """All members of a kind in the modules of a package, but for its `base`, by keyword in alphabetic order."""
    found: dict[str, Member] = {}
    for module in pkgutil.iter_modules(folder):
        if module.name != "base":
            every = vars(importlib.import_module(f"{package}.{module.name}")).values()
            found |= {getattr(each, "keyword"): each for each in every if isinstance(each, kind)}  # noqa: B009
    return dict(sorted(found.items()))
