"""The section `data` of parameter files: `compare` takes it as it was written, and with the values it was written for.

A digit more made a change of 5e23 mm, or a number that no JSON takes, of two files of the same rows.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from tests.campaign_tables import true_values, write_table
from tests.command import MACHINES, run

BIGLIDE = MACHINES / "biglide.yaml"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A parameter file of a Biglide."""
    folder = tmp_path_factory.mktemp("data")
    table = write_table(folder / "a.csv", "biglide", true_values("biglide", 5), 1, 40)
    assert run("calibrate", BIGLIDE, table, "-o", folder / "p.yaml", "-q", "--holdout", "none").code == 0
    return (folder / "p.yaml").read_text()


def compared(folder: Path, text: str, other: str) -> tuple[int, str]:
    (folder / "one.yaml").write_text(text)
    (folder / "other.yaml").write_text(other)
    done = run("compare", folder / "one.yaml", folder / "other.yaml", "--json")
    return done.code, done.err


@pytest.mark.parametrize("key", ["names", "scale", "root", "right", "left", "count", "worth"])
def test_a_digit_more_is_no_data(key: str, written: str, tmp_path: Path) -> None:
    head, section = written.split("\ndata:")
    at = re.search(rf"\n  {key}:[^\d]*\d" if key != "root" else r"\n    - \[[^\d]*\d", section)
    assert at is not None
    code, error = compared(tmp_path, f"{head}\ndata:{section[: at.end()]}1{section[at.end() :]}", written)
    assert code == 3 and "no complete section `data`" in error, error


def test_a_value_edited_by_hand_has_no_data(written: str, tmp_path: Path) -> None:
    edited = re.sub(r"l2: {value: (\d+)\.", r"l2: {value: \1.1", written)
    code, error = compared(tmp_path, written, edited)
    assert edited != written and code == 3 and "other.yaml: error" in error and "matches its values" in error


def test_a_unit_edited_by_hand_has_no_data(written: str, tmp_path: Path) -> None:
    edited = re.sub(r"(  l2: {.*unit: )mm", r"\1um", written)
    code, error = compared(tmp_path, written, edited)
    assert edited != written and code == 3 and "other.yaml: error" in error and "matches its values" in error


def test_another_program_may_format_it(written: str, tmp_path: Path) -> None:
    """What counts are numbers, not how they stand there."""
    again = yaml.safe_dump(yaml.safe_load(written), sort_keys=True)
    assert compared(tmp_path, again, written)[0] == compared(tmp_path, written, written)[0] == 0
