"""The lowest versions that `pyproject.toml` allows, as requirements for pip.

`python -m tests.hostile.floors > low.txt; pip install -r low.txt; pip install --no-deps -e .; pytest -m smoke`
"""

from __future__ import annotations

import re
import tomllib

from tests.hostile.mutants import ROOT


def floors() -> list[str]:
    """`name==version` of every dependency, and of what tests need without linters and stubs."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    found = (re.fullmatch(r"([a-z0-9-]+)>=([\d.]+).*", text) for text in needed)
    return [f"{m[1]}=={m[2]}" for m in found if m and m[1] not in ("ruff", "mypy")]


if __name__ == "__main__":
    print("\n".join(floors()))
