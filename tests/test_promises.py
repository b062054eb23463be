"""Every test that a promise names exists, and the page of figures is what was measured."""

from __future__ import annotations

import re
from importlib.util import find_spec

import pytest

from tests.command import ROOT
from tests.hostile import reliability

PROMISES = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`(tests/[\w/]+\.py(?:::\w+)?)`", PROMISES)))


@pytest.mark.parametrize("test", NAMED)
def test_the_test_of_a_promise_exists(test: str) -> None:
    file, _, name = test.partition("::")
    text = (ROOT / file).read_text(encoding="utf-8")
    assert re.search(rf"^def {name}\(" if name else r"^def ", text, re.MULTILINE), test


def test_every_promise_names_a_test() -> None:
    assert len(NAMED) > 25
    for row in re.findall(r"^\| (?!promise|file \||---)(.*) \|$", PROMISES, re.MULTILINE):
        assert "`tests/" in row.rpartition("|")[2], row


def test_the_page_of_figures_is_what_was_measured() -> None:
    assert reliability.PAGE.read_text(encoding="utf-8") == reliability.page(reliability.kept())


def test_every_check_has_a_command_and_no_figure_tells_a_fault() -> None:
    for name, check in reliability.CHECKS.items():
        assert find_spec(check.words[0]) is not None
        text = " ".join(reliability.kept().get(name, ()))
        assert not re.search(r"\b[1-9]\d* faults|Traceback|SURVIVED", text), name
