"""Settings of all tests: one thread for linear algebra, as matrices are small and tests run side by side; the same
random examples in every run, so that a result depends on the code alone; whole files in one process, the longest first.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy is imported

import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

from tests.checkout_package import use_checkout  # noqa: E402

use_checkout()
settings.register_profile("repeatable", derandomize=True, deadline=None)  # no timed tests
settings.load_profile("repeatable")

SHARING = (
    "test_commands_improve", "test_commands_diagnose", "test_commands_report", "test_docs", "test_pictures",
    "test_plots", "test_reference",
)  # fmt: skip
"""Files whose tests look at the same diagnoses (`computed_once`)."""
LONGEST = (
    *SHARING, "test_diagnosis_cases", "test_commands_odd", "test_spoilt_tables", "test_gross_faults",
    "test_commands_process", "test_commands_json", "test_far_causes", "test_effects", "test_commands_plan",
    "test_calibration_proof", "test_detection", "test_draw", "test_compare",
    "test_instrument_effects", "test_gates", "test_improve_kept", "test_commands_check", "test_hostile", "test_fuzz",
    "test_command_fuzz", "test_one_wrong_cell", "test_next_points", "test_commands_calibrate",
)  # fmt: skip
"""They begin, so that no process ends long after the others."""


@pytest.fixture(scope="module")
def unsized() -> Iterator[None]:
    """No sizes that effects would need to be seen: none is looked at."""
    from tests.unsized import UNSIZED

    with UNSIZED:
        yield


def pytest_collection_finish() -> None:
    """Thousands of tests and modules live to the end: looks for garbage need not go through them."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    order = {name: k for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: order.get(item.path.stem, len(order)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file's tests share what they compute, so a process gets whole files, in the order above."""
    from xdist.scheduler import LoadScopeScheduling

    class ByFile(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split("::")[0]
            return "sharing" if Path(file).stem in SHARING else file

    if config.getoption("dist") != "load":  # another distribution is asked for
        return None
    config.option.loadscopereorder = False
    return ByFile(config, log)
