"""The commands that a sheet prints run as they are printed."""

from __future__ import annotations

import html
import re
import shlex
from pathlib import Path

import pytest

from tests.command import clean, run
from tests.test_commands_report import circle, perfect


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
