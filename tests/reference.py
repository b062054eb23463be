"""Writes the outputs that `tests/test_reference.py` compares with: `python -m tests.reference [PART_OF_NAME ...]`.

A change that moves them is committed with them, and says which keys moved and why.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

from tests.reference_cases import CASES, OUTPUTS
from tests.reference_compare import differences


def main(parts: list[str]) -> None:
    """Write the outputs of the cases whose names contain one of some parts, all without any, and tell what moved."""
    if unknown := [part for part in parts if not any(part in case.name for case in CASES)]:
        raise SystemExit(f"no output is called so: {', '.join(unknown)}")
    OUTPUTS.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            if parts and not any(part in case.name for part in parts):
                continue
            found = case.output(Path(folder))
            before = json.loads(case.file.read_text(encoding="utf-8")) if case.file.exists() else {}
            moved = differences(before, found) if before else ["is new"]
            for line in moved:
                print(f"{case.name}: {line}")
            if moved:
                case.file.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
