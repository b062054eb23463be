"""The documentation keeps to the code: its tables are made from it, examples are read, commands show what is shown."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.model_tables import models
from docs.tables import BLOCK, PAGES, description, machine_files, renewed
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.tables.columns import columns_of
from tests.command import MACHINES, ROOT, run
from tests.pages import SHOWING, Shown, all_files, commands, done, fits, output, write

README, LANGUAGE = ROOT / "README.md", ROOT / "docs" / "machine-language.md"
ALL_PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), MACHINES / "README.md"]
COMMANDS = [(page, shown) for page in SHOWING for shown in commands(page.read_text(encoding="utf-8"))]
LONG = (
    "improve machines/hangprinter.yaml",
    "scissors-shopfloor.csv --method ",
    "report machines/triglide.yaml",
    "study machines/",
    "measured.csv -q -o",
    "machines/gantry.csv",
    "hangprinter_2022-04-12.csv --select",
    "stretched.yaml --grid",
    'scissors.yaml --grid "x=-200:200:4',
    "calibrate found.yaml",
)
"""Parts of commands that take long, whose work is that of others of these pages."""
SHOWN = [
    pytest.param(page, shown, marks=[pytest.mark.slow] if any(part in shown.line for part in LONG) else [])
    for page, shown in COMMANDS
]
FILES = all_files()
FAULTY = {shown.line.split()[-1] for _, shown in COMMANDS if any(" error[" in line for line in shown.output)}
VALUES = {"planted.yaml", "long-rod.yaml", "standing.yaml"}  # no machine but a parameter file
MADE = {"portal.yaml"}  # an overlay of what a command on its page writes


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_tables_are_up_to_date(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert len(BLOCK.findall(text)) == text.count("<!-- table: ") > 0
    assert renewed(text) == text, "run `python -m docs.tables`"


def test_every_model_of_the_machine_file_has_its_table() -> None:
    pages = (LANGUAGE, ROOT / "docs" / "effects.md")
    shown = {name for page in pages for _, name, _ in BLOCK.findall(page.read_text(encoding="utf-8"))}
    assert models().keys() <= shown


def test_every_section_of_the_machine_file_has_its_heading() -> None:
    headings = re.findall(r"^#+ `(\w+)`$", LANGUAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    plain = {"space", "gravity", "own_weight"}  # one value: the table of all keys tells
    assert models()["Machine"].model_fields.keys() - plain <= set(headings)


@pytest.mark.parametrize("file", machine_files(), ids=lambda f: str(f.stem))
def test_machine_files_say_what_they_are(file: Path) -> None:
    assert 20 < len(description(file)) < 130
    assert file.read_text(encoding="utf-8").startswith("# yaml-language-server: $schema=")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the commands of a page are run: the shipped machines, and the files that the page writes."""
    (tmp_path / "machines").symlink_to(MACHINES)
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    write(tmp_path, FILES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("page", "shown"), SHOWN, ids=lambda v: v.line[7:60] if isinstance(v, Shown) else v.stem)
def test_commands_show_what_the_page_shows(page: Path, shown: Shown, folder: Path) -> None:
    real = output(done(shown.line))
    assert fits(shown.output, real), "\n".join(real)


@pytest.mark.parametrize("name", FILES)
def test_examples_are_machines(name: str, folder: Path) -> None:
    if name not in FAULTY | VALUES | MADE:
        assert compile_machine(read_machine(folder / name)).model.parameters


def test_the_repeated_machine_is_the_same(folder: Path) -> None:
    """`each` writes out what the page writes by hand."""
    by_hand, repeated = (compile_machine(read_machine(folder / f)) for f in ("sliders.yaml", "sliders-each.yaml"))
    assert by_hand.model.reference_readings == pytest.approx(repeated.model.reference_readings)
    assert by_hand.mobility == repeated.mobility


def test_every_kind_of_column_is_told(folder: Path) -> None:
    _, _, part = LANGUAGE.read_text(encoding="utf-8").partition("## Columns of a measurement table")
    told = set(re.findall(r"`([\w.]+)`", part.partition("## Typical faults")[0]))
    columns = columns_of(read_machine(folder / "ceiling.yaml"))
    plain = {c.name for c in columns if c.role in ("label", "covariate") and not c.name.startswith("dir.")}
    assert plain | {"dir.ACTUATOR", "T.PART", "sigma.CHANNEL", "sigma.ACTUATOR", "NAME.force"} <= told


def test_the_first_command_of_the_readme_calibrates(folder: Path) -> None:
    (arguments,) = re.findall(r"\.venv/bin/pkmcal (.+)$", README.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert f"$ pkmcal {arguments}\n" in README.read_text(encoding="utf-8"), "its result is shown"


def test_a_page_lists_every_command() -> None:
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    listed = re.findall(r"^\| `pkmcal (\w+)", text, flags=re.MULTILINE)
    assert set(re.findall(r"^  ([a-z]+)  ", run("--help").out, flags=re.MULTILINE)) <= set(listed)


@pytest.mark.parametrize("page", ALL_PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        file, _, anchor = target.partition("#")
        other = (page.parent / file).resolve() if file else page
        assert other.exists(), target
        assert not anchor or anchor in anchors(other.read_text(encoding="utf-8")), target


def anchors(text: str) -> set[str]:
    """The anchors that headings make."""
    heads = re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


def test_data_tell_no_place_of_this_computer() -> None:
    for file in MACHINES.iterdir():
        text = file.read_text(encoding="utf-8")
        assert not any(place in text for place in ("/" + "work/", "/home" + "/", "/root" + "/")), file
