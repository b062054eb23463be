"""docs/python.md: every example is run, in the order of the page, and shows what it shows."""

from __future__ import annotations

import doctest
import os
from pathlib import Path

import pkmcal
import pytest

from tests.command import ROOT
from tests.pages import blocks

PAGE = ROOT / "docs" / "python.md"
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.IGNORE_EXCEPTION_DETAIL


def test_the_examples_show_what_the_page_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = "\n".join(blocks(PAGE.read_text(encoding="utf-8"), "python"))
    example = doctest.DocTestParser().get_doctest(text, {}, PAGE.name, str(PAGE), 0)
    assert len(example.examples) > 30
    told: list[str] = []
    result = doctest.DocTestRunner(optionflags=FLAGS).run(example, out=told.append)
    assert result.failed == 0, "".join(told)
    assert os.listdir(tmp_path) == [], "functions write no files"


def test_the_page_names_what_there_is() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in pkmcal.__all__:
        if callable(getattr(pkmcal, name)) and name[0].islower():
            assert f"pkmcal.{name}(" in text, name
