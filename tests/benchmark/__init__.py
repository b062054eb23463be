"""The proof of the diagnosis: simulated campaigns with undeclared effects, each judged by fixed rules.

`python -m tests.benchmark > docs/diagnosis-benchmark.md`
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported: cases run side by side
