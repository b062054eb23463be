"""docs/messages.md has every code that the program can show, and none besides; what it shows is there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.message_codes import messages
from docs.message_table import NEVER, meanings
from pkmcal_cli.base.errors import PkmcalError
from tests.command import MACHINES, ROOT, run

PAGE = (ROOT / "docs" / "messages.md").read_text(encoding="utf-8")


def test_the_page_has_all_codes_and_no_others() -> None:
    codes = set(messages()) - NEVER
    assert codes == set(meanings())
    assert set(re.findall(r"^\| `([a-z-]+)` \|", PAGE, flags=re.MULTILINE)) == codes


def test_every_cause_has_a_remedy() -> None:
    for code, (cause, remedy) in meanings().items():
        assert len(cause) > 15 and len(remedy) > 5 and not remedy.endswith("."), code


def test_no_error_is_without_a_code_of_its_own() -> None:
    """The code of the base class is never shown: it is raised by no one."""
    assert PkmcalError.default_code in NEVER
    raised = [f for f in (ROOT / "pkmcal_cli").rglob("*.py") if "raise PkmcalError(" in f.read_text(encoding="utf-8")]
    assert raised == []


def test_codes_that_are_written_in_other_ways_are_found_too() -> None:
    """Everything in the source that stands where codes stand, found by another way: calls in words."""
    pattern = re.compile(r"""(?:Fault|fault|Flaw|_fault)\(\s*"([a-z]+(?:-[a-z]+)*)",""")
    files = (ROOT / "pkmcal_cli").rglob("*.py")
    found = {code for f in files for code in pattern.findall(f.read_text(encoding="utf-8"))}
    assert len(found) > 40 and found <= set(messages())


BAD = {
    "a.yaml": "a: [",
    "b.yaml": "space: planar\nspace: planar\n",
    "c.yaml": "spice: planar\n",
    "d.yaml": "extends: nowhere.yaml\n",
    "e.yaml": "extends: triglide.yaml\nnodes: {alone: [0, 0]}\n",
    "f.yaml": "extends: triglide.yaml\nbars: {rod1: {k: 3 kN}}\n",
    "g.yaml": "extends: triglide.yaml\nactuators: {q3: {redundant: false}}\n",
    "h.yaml": "extends: triglide.yaml\nparameters: {l3: 7}\n",
    "i.csv": "q1,q2,q3,x,y\n1,2,3,4\n",
    "j.csv": "",
    "k.csv": "q1,q2,q3\n1,2,3\n",
    "l.csv": "q1,q2,q3,x,y\n1,2,a,4,5\n",
    "m.csv": "q1 [kg],q2,q3,x,y\n1,2,3,4,5\n",
    "n.csv": "q1,q2,q3,x,y\n1,,3,4,5\n",
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_shown_is_on_the_page(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "triglide.yaml").write_text((MACHINES / "triglide.yaml").read_text())
    (tmp_path / name).write_text(BAD[name])
    done = run("check", "triglide.yaml", name) if name.endswith("csv") else run("check", name)
    codes = set(re.findall(r"(?:error|warning)\[([^\]]*)\]", done.err))
    assert done.code in (1, 3) and codes and codes <= set(meanings()), done.err
