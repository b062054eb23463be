"""The commands that a sheet prints run as they are printed; what it does not judge."""

from __future__ import annotations

import html
import re
import shlex
from pathlib import Path

import pytest

from tests.command import MACHINES, clean, run
from tests.test_commands_report import UNSEARCHED, circle, perfect


def test_commands_of_a_judged_sheet_run_as_they_are_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the options of the fit; after correction no set values are proposed again, but how to see changes later."""
    monkeypatch.chdir(tmp_path)
    for name, text in (("m.csv", perfect(1)), ("after.csv", circle(50.0)), ("LATER.csv", perfect(2))):
        Path(name).write_text(text, encoding="utf-8")
    files = ("triglide-nonredundant", "m.csv", "--after", "after.csv", "--select", "l1")
    clean(run("report", *files, "-o", "s.html", "-q"))
    page = Path("s.html").read_text(encoding="utf-8")
    printed = [html.unescape(line) for line in re.findall(r"pkmcal (?:calibrate|correct|check|plan) [^<]*", page)]
    assert [line.split()[1] for line in printed] == ["calibrate", "check"] and "--select l1" in printed[0]
    for line in printed:
        assert run(*shlex.split(line)[1:]).code == 0


@UNSEARCHED
def test_a_copy_of_a_row_is_no_slip_of_the_measurement(tmp_path: Path) -> None:
    """It is not used, as it adds nothing; the row that it is a copy of is judged."""
    rows = [line for line in (MACHINES / "triglide.csv").read_text().splitlines() if not line.startswith("#")][:17]
    (tmp_path / "m.csv").write_text("\n".join([*rows, rows[5], ""]), encoding="utf-8")
    done = clean(
        run("report", MACHINES / "triglide.yaml", tmp_path / "m.csv", "--tolerance", "100 um", "--json",
            "-o", tmp_path / "s.html")
    )  # fmt: skip
    assert "exact copy" in done.err and done.json["not_judged"] == []
