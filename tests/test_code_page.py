"""The page that shows the way through the code: it fits on a screen, names every room, and every path on it exists."""

from __future__ import annotations

import re

from tests.command import ROOT
from tests.test_architecture import ROOMS

PAGE = (ROOT / "docs" / "code.md").read_text(encoding="utf-8")


def test_it_is_one_screen_and_linked() -> None:
    assert len(PAGE.splitlines()) <= 80
    assert "(docs/code.md)" in (ROOT / "README.md").read_text(encoding="utf-8").split("\n## ")[-1]


def test_every_room_is_there_in_its_order() -> None:
    table = PAGE.split("**The rooms**")[1].split("**To add")[0]
    assert re.findall(r"^\| `(\w+)/` \|", table, re.M) == [r for r in ROOMS if (ROOT / "pkmcal_cli" / r).is_dir()]


def test_at_most_eight_words_are_private() -> None:
    glossary = PAGE.split("**Glossary**")[1].split("The field's own:")[0]
    assert 0 < len(re.findall(r"\*[a-z ]+\* \(", glossary)) <= 8


def test_every_path_exists() -> None:
    paths = [p for p in re.findall(r"`([\w./-]+)`", PAGE) if re.search(r"/|\.(py|md|json)$", p) and "NAME" not in p]
    missing = [p for p in paths if not any((start / p).exists() for start in (ROOT, ROOT / "pkmcal_cli"))]
    assert len(paths) > 40 and missing == []
