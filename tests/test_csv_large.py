"""A million rows: written and read with bounded memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

TRIGLIDE = Path(__file__).parent / "data" / "triglide.yaml"
NAMES = ("q1", "q2", "q3", "x", "y", "T")

CODE = """
import resource, sys
import numpy as np
from pkmcal_cli.csv_files.writer import open_writer
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.measurements import read_measurements

task, path, machine, *names = sys.argv[1:]
if task == "write":
    rng = np.random.default_rng(0)
    with open_writer(path, [(name, None) for name in names], ()) as writer:
        for _ in range(100):
            writer.write(list(rng.normal(size=(len(names), 10_000))))
else:
    found = read_measurements([path], read_machine(machine))
    assert len(found) == found.line[-1] - 1 == 1_000_000
    assert np.isfinite(found.actuators).all() and np.isfinite(found.readings).all()
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


@pytest.mark.slow
def test_a_million_rows(tmp_path: Path) -> None:
    def megabytes(task: str) -> float:
        command = [sys.executable, "-c", CODE, task, str(tmp_path / "big.csv"), str(TRIGLIDE), *NAMES]
        return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    assert megabytes("write") < 150
    assert megabytes("read") < 300
