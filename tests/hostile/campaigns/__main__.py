"""`python -m tests.hostile.campaigns [PART ...]`: how campaigns that lie, and honest ones, end."""

from __future__ import annotations

import sys
import time

from tests.hostile.campaigns.listed import LIES
from tests.hostile.campaigns.run import told


def main(parts: list[str]) -> int:
    """Prints a line for each; 1 if one that lies ends well, or not as expected."""
    bad = 0
    for lie in LIES:
        if parts and not any(p in lie.name for p in parts):
            continue
        began = time.perf_counter()
        end = told(lie)
        good = end.status in lie.expected and end.status != "converged"
        bad += not good
        mark = "ok " if good else "BAD"
        print(f"{mark} {lie.name}: {end.status} ({end.code}) {time.perf_counter() - began:.1f} s | "
              f"{'; '.join(end.reasons)[:300]}", flush=True)
    print(f"{len(LIES)} campaigns, {bad} not as expected")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
