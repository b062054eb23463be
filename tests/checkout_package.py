"""`import pkmcal` of this checkout, whatever is installed: the folder `pkmcal_cli/api` under its installed name."""

from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

_FOLDER = Path(__file__).resolve().parents[1] / "pkmcal_cli" / "api"


class _Checkout(PathFinder):
    """Finds the package, and leaves all else to others."""

    @classmethod
    def find_spec(cls, fullname: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        if fullname != "pkmcal":
            return None
        return spec_from_file_location(fullname, _FOLDER / "__init__.py", submodule_search_locations=[str(_FOLDER)])


def use_checkout() -> None:
    """From here on, this process imports it from the checkout."""
    if not any(finder is _Checkout for finder in sys.meta_path):
        sys.meta_path.insert(0, _Checkout)
