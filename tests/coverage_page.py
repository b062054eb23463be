"""All of docs/coverage.md anew: `python -m tests.coverage_page` (hours)."""

from __future__ import annotations

import subprocess
import sys

PARTS = (
    ["tests.coverage_table"],
    ["tests.interval_coverage"],
    ["tests.scale_priors"],
    ["tests.tier_coverage", "--fresh"],
)

if __name__ == "__main__":
    for part in PARTS:
        subprocess.run([sys.executable, "-m", *part], check=True)
