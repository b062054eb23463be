"""Families of things that are data: every module of a folder may hold members, found by looking."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterable
from typing import TypeVar

Member = TypeVar("Member")


def members(package: str, folder: Iterable[str], kind: type[Member]) -> dict[str, Member]:
    """All members of a kind in the modules of a package, by keyword in alphabetic order.

    Raises ValueError for two members of one keyword, with their modules.
    """
    out: dict[str, Member] = {}
    home: dict[str, str] = {}
    for module in pkgutil.iter_modules(folder):
        for each in vars(importlib.import_module(f"{package}.{module.name}")).values():
            if isinstance(each, kind):
                keyword = str(getattr(each, "keyword"))  # noqa: B009
                if out.setdefault(keyword, each) is not each:
                    raise ValueError(f"`{keyword}` is in {home[keyword]}.py and in {module.name}.py of {package}")
                home.setdefault(keyword, module.name)
    return dict(sorted(out.items()))
