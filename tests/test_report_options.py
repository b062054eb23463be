"""`pkmcal report` refuses options that say nothing, and pages that are there already."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import SCISSORS, SHOPFLOOR, run


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--tolerance", "5 kg"), "--tolerance"),
        (("--tolerance", "-5 um"), "--tolerance"),
        (("--circle-feed", "0"), "--circle-feed"),
        (("-o", "-", "--json"), "--json"),
        (("-o", "sheet.pdf"), "a sheet is an HTML page"),
        (("--after", "-"), "stdin"),
    ],
)
def test_bad_options(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], message: str) -> None:
    monkeypatch.chdir(tmp_path)
    done = run("report", SCISSORS, SHOPFLOOR, *arguments)
    assert done.code == 2 and message in done.err
    assert list(tmp_path.iterdir()) == []


def test_a_page_is_not_replaced_unasked(tmp_path: Path) -> None:
    (tmp_path / "s.html").write_text("mine", encoding="utf-8")
    done = run("report", SCISSORS, SHOPFLOOR, "-o", tmp_path / "s.html")
    assert done.code == 4 and "--force" in done.err and (tmp_path / "s.html").read_text(encoding="utf-8") == "mine"
