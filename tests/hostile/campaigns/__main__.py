"""`python -m tests.hostile.campaigns [PART ...]`: how campaigns that lie, and honest ones, end; a line for each.

PART: of the names of campaigns. Exit code 1 if one that lies ends `converged`, or an honest one with exit code 1.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterable

from tests.hostile.campaigns.honest import HONEST
from tests.hostile.campaigns.listed import LIES, UNTELLABLE, Lie
from tests.hostile.campaigns.run import End, ended, told


def _line(mark: str, name: str, end: End, seconds: float) -> None:
    reasons = "; ".join(end.reasons)
    print(f"{mark:8} {name}: {end.status} (exit {end.code}, {seconds:.1f} s) | {reasons[:240]}", flush=True)


def _lies(lies: Iterable[Lie]) -> list[tuple[Lie, End]]:
    """Campaigns that lie, tried; what is not as expected is marked."""
    out = []
    for lie in lies:
        began = time.process_time()
        end = told(lie)
        mark = "" if end.status in lie.expected else "BELIEVED" if end.status == "converged" else "other"
        _line(mark, lie.name, end, time.process_time() - began)
        out.append((lie, end))
    return out


def main(parts: list[str]) -> int:
    """Prints all; the exit code."""

    def wanted(name: str) -> bool:
        return not parts or any(p in name for p in parts)

    lies = _lies(each for each in LIES if wanted(each.name))
    believed = sum(end.status == "converged" for _, end in lies)
    alarms, honest = 0, [h for h in HONEST if wanted(h.name)]
    for each in honest:
        began = time.process_time()
        end = ended(each.machine, (each.table(),))
        alarms += end.code != 0
        _line("ALARM" if end.code else "", each.name, end, time.process_time() - began)
    for lie, why in UNTELLABLE:
        if wanted(lie.name):
            _line("", f"cannot be told ({why}): {lie.name}", told(lie), 0.0)
    counts = Counter(end.status for _, end in lies)
    print(f"{len(lies)} campaigns that lie: {', '.join(f'{n} {s}' for s, n in counts.most_common())}; "
          f"{sum(e.status in lie.expected for lie, e in lies)} as expected, {believed} believed")  # fmt: skip
    print(f"{len(honest)} honest campaigns: {alarms} alarms")
    return int(believed > 0 or alarms > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
