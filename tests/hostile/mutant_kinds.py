"""What a mutant is: one line of the package changed, and the test that must fail then."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """`old` occurs exactly once in `file` (below `pkmcal_cli/`) and becomes `new`; `test`: a pytest node."""

    file: str
    old: str
    new: str
    test: str
