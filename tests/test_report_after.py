"""The sheet with a table measured after correction: this table decides, and figures say whose commands they judge."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.command import run
from tests.json_schemas import faults_of
from tests.test_commands_report import PLAIN, Page, perfect


@pytest.mark.parametrize(("growth", "word", "code"), [(0.0, "confirmed", 0), (4e-3, "changed", 1)])
def test_a_second_table_decides_without_a_tolerance(tmp_path: Path, growth: float, word: str, code: int) -> None:
    """The same rows again, in x stretched by 4 per mille (0.8 mm, far beyond 10 um of noise) or not at all."""
    (tmp_path / "m.csv").write_text(perfect(1), encoding="utf-8")
    head, *rows = perfect(7).splitlines()
    cells = [row.split(",") for row in rows]
    stretched = [",".join([*c[:2], f"{float(c[2]) + growth * (float(c[2]) - 400):.6f}", c[3]]) for c in cells]
    (tmp_path / "after.csv").write_text("\n".join([head, *stretched]) + "\n", encoding="utf-8")
    asked = (PLAIN, tmp_path / "m.csv", "--after", tmp_path / "after.csv", "-o", tmp_path / "s.html", "--json", "-q")
    done = run("report", *asked)
    found = done.json
    assert faults_of("report", found) == [] and (done.code, found["verdict"]) == (code, word)
    assert found["after"]["compatible"] is (code == 0)
    size = re.fullmatch(
        r"position errors of (\S+) (mm|um) rms on 18 rows measured after correction, .*", found["headline"]
    )
    assert size is not None and (float(size[1]) * (1000 if size[2] == "mm" else 1) > 200) is (code == 1)
    words = " ".join(" ".join(Page((tmp_path / "s.html").read_text(encoding="utf-8")).words).split())
    assert "only if these set values were corrected" in words
    assert "Acceptance figures (after correction)" not in words
    assert "Predicted for the machine as built, if the control commands by the nominal parameters" in words
