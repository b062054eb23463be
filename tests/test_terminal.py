"""On a terminal: progress after a second, faults with their parts apart, quiet where it is asked for."""

from __future__ import annotations

import contextlib
import io
import itertools
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console

from pkmcal_cli.base.stages import Observer, Stage
from pkmcal_cli.base.styles import styled, wants_styles
from pkmcal_cli.report import progress_bar as bars
from pkmcal_cli.report.progress_bar import Clock, counted_of, progress_bar, words
from tests.command import HANGPRINTER, HANGPRINTER_DATA, MACHINES, TRIGLIDE, TRIGLIDE_DATA, run
from tests.terminals import on_terminal, plain


def test_a_fault_has_its_parts_apart() -> None:
    text = "m.yaml:3:7: error[value]: `x` is wrong\nspace: x\n       ^\nhelp: write `y`"
    shown = styled(text)
    assert plain(shown) == text
    assert "\x1b[1mm.yaml:3:7: \x1b[0m" in shown and re.search(r"\x1b\[\d+mhelp:\x1b\[0m write", shown)
    assert styled("nothing of the kind") == "nothing of the kind"


@pytest.mark.parametrize("arguments", [("check", "nowhere.yaml"), ("calibrate", TRIGLIDE), ("chekc",)])
def test_errors_are_styled_on_terminals_alone(arguments: tuple[str, ...]) -> None:
    ((code, text),) = on_terminal(100, arguments)
    ((_, bare),) = on_terminal(100, arguments, NO_COLOR="1")
    assert code == run(*arguments).code and "\x1b[1;31merror[" in text
    assert "\x1b" not in bare and plain(text) == bare == run(*arguments).err
    assert not wants_styles(io.StringIO())


PLAIN = str(MACHINES / "triglide-nonredundant.yaml")
QUIET = [
    ("check", TRIGLIDE, TRIGLIDE_DATA), ("simulate", TRIGLIDE, "--grid", "x=300:400:2"), ("effects",),
    ("sensitivity", TRIGLIDE), ("observability", TRIGLIDE), ("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--holdout", "none"),
    ("correct", TRIGLIDE, "--grid", "x=300:400:2"), ("plan", PLAIN, "--grid", "x=300:500:4,y=250:300:3"),
    ("compare", TRIGLIDE, PLAIN, TRIGLIDE_DATA),
    ("new", "--from", str(MACHINES / "printer.cfg")),
]  # fmt: skip


@pytest.mark.slow
def test_quiet_is_quiet() -> None:
    """Also on a terminal, where others show progress."""
    for arguments, (code, text) in zip(QUIET, on_terminal(100, *[(*a, "-q") for a in QUIET]), strict=True):
        assert (code, text) == (0, ""), arguments


@pytest.mark.slow
def test_long_work_shows_step_and_remaining_time() -> None:
    options = ("--starts", "20", "--holdout", "none")
    ((code, text),) = on_terminal(100, ("calibrate", HANGPRINTER, HANGPRINTER_DATA, *options))
    assert code == 0
    assert re.search(r"start \d+ of 20 .*about \d+ s left", text)
    assert "about" not in run("calibrate", TRIGLIDE, TRIGLIDE_DATA, "--holdout", "none").err


def test_what_ends_within_a_second_shows_no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    assert bars._AFTER == 1.0
    monkeypatch.setattr(bars, "_AFTER", 0.2)

    def shown(seconds: float) -> str:
        out = io.StringIO()
        with progress_bar(Console(file=out, force_terminal=True, width=80)) as observe:
            observe(Stage("fold", 1, 4))
            time.sleep(seconds)
        return out.getvalue()

    assert shown(0.0) == "" and "fold 2 of 4" in plain(shown(0.6))


def test_remaining_time_is_that_of_the_largest_step() -> None:
    now = [0.0]
    clock = Clock(lambda: now[0])
    assert clock.left(Stage("fold", 0, 4)) == ""
    now[0] = 30.0
    assert clock.left(Stage("fold", 1, 4)) == "about 90 s left"
    assert words(Stage("fit", 3, inside=Stage("fold", 1, 4))) == "fold 2 of 4, fit: step 3"


@pytest.mark.slow
def test_steps_of_a_search_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rotation and the step in it; how long the rest takes, once a rotation is over. No clock takes part."""
    told: list[tuple[str, str]] = []
    seconds = itertools.count()

    @contextlib.contextmanager
    def recorded(_: object) -> Iterator[Observer]:
        clock = Clock(lambda: next(seconds))
        yield lambda stage: told.append((words(stage), clock.left(counted_of(stage))))

    monkeypatch.setattr(bars, "shown_on", lambda *_: True)
    monkeypatch.setattr(bars, "progress_bar", recorded)
    worn, table = tmp_path / "worn.yaml", tmp_path / "table.csv"
    worn.write_text(f"extends: {PLAIN}\neffects: {{backlash@q1: {{b: 300 um}}, backlash@q2: {{b: 200 um}}}}\n")
    grid = ("--grid", "x=200:700:6,y=200:350:5", "--noise", "declared", "--seed", "1", "-o", table)
    assert run("simulate", worn, *grid).code == 0
    told.clear()
    run("improve", PLAIN, table, "--only", "backlash@q1,backlash@q2")
    lines = [line for line, _ in told]
    assert any(line.startswith("all rows, ") for line in lines)
    assert any(line.startswith("rotation 2 of 5, search") for line in lines)
    assert any("effect 2 of 2" in line for line in lines)
    assert not any(left for line, left in told if line.startswith("rotation 1 of 5"))
    assert any(re.fullmatch(r"about \d+ s left", left) for line, left in told if line.startswith("rotation 5 of 5"))
