"""On terminals of 80, 100 and 120 columns no table loses a number or a unit, and what is hidden is said."""

from __future__ import annotations

import re
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pkmcal_cli.report.table_layout import columns_of, laid_out
from tests.command import MACHINES
from tests.command import run as piped
from tests.terminals import on_terminal, plain

WIDTHS = (80, 100, 120)
UNITS = r"(?:kN/mm|N/mm|N m|um|mm|nm|urad|mrad|rad|deg|kN|N|J|m|1)"
VALUE = re.compile(rf"(?<![\w.])[-+]{{0,2}}\d[\d.]*(?:e[-+]?\d+)?(?:\(\d+\))? {UNITS}(?:\^2)?(?![\w/])")
HIDDEN = re.compile(r"^not shown in (\d+) columns: (.*) \(widen the terminal, or use --json\)$", re.MULTILINE)


def shipped(machine: str, table: str | None = None) -> tuple[str, str]:
    return str(MACHINES / f"{machine}.yaml"), str(MACHINES / f"{table or machine}.csv")


ROPES, PLANAR, FIVE = shipped("hangprinter", "hangprinter_2021-12-16"), shipped("triglide"), shipped("five-bar")
SHOP, ROUTER = shipped("scissors", "scissors-shopfloor"), shipped("belt-router")
QUICK: dict[str, list[tuple[str, ...]]] = {
    "check": [PLANAR, ROPES, ROUTER],
    "simulate": [(PLANAR[0], "--grid", "x=300:400:2"), (ROUTER[0], ROUTER[1])],
    "sensitivity": [(PLANAR[0],), (FIVE[0],), (SHOP[0], "--channel", "x")],
    "observability": [PLANAR, FIVE],
    "calibrate": [(*PLANAR, "--holdout", "none"), (*FIVE, "--holdout", "none", "--starts", "1")],
    "correct": [(PLANAR[0], "--grid", "x=300:400:2"), (SHOP[0], "--grid", "x=0:50:2,y=0:50:2")],
    "plan": [FIVE, (PLANAR[0], "--grid", "x=300:600:4,y=200:350:3")],
    "compare": [(PLANAR[0], str(MACHINES / "triglide-nonredundant.yaml"), PLANAR[1])],
    "effects": [(SHOP[0],), (), (PLANAR[0], "--grid", "x=300:400:2", "--simulate")],
}
FIRST = {name: several[:1] for name, several in QUICK.items()}
LONG: dict[str, list[tuple[str, ...]]] = {"diagnose": [SHOP, FIVE], "improve": [SHOP, ROPES]}


def tables_of(text: str) -> list[list[str]]:
    """Lines that belong to tables: those after a bold header, to the next line that is none."""
    out: list[list[str]] = []
    inside = False
    for line in text.splitlines():
        bold = line.startswith("\x1b[1m")
        if bold and not inside:
            out.append([])
        inside = bold or (inside and plain(line).strip() != "" and not line.startswith("\x1b"))
        if inside:
            out[-1].append(plain(line))
    return out


def check(commands: dict[str, list[tuple[str, ...]]], width: int) -> None:
    """Every command on a terminal of this width, beside the same one where nothing bounds the width."""
    cases = [(name, *arguments) for name, several in commands.items() for arguments in several]
    shown = on_terminal(width, *cases)
    assert len(shown) == len(cases)
    for case, (code, text) in zip(cases, shown, strict=True):
        wide = piped(*case)
        assert code == wide.code in (0, 1), text
        lines = [line for table in tables_of(text) for line in table]
        assert case[0] == "simulate" or lines, case
        assert not any("\u2026" in line for line in lines), case
        sentences = set(wide.err.splitlines())  # which the terminal folds itself
        own = [line for line in lines if len(line) > width and line not in sentences]
        assert own == [], case
        lost = Counter(VALUE.findall(wide.err)) - Counter(VALUE.findall(plain(text)))
        hidden = HIDDEN.findall(plain(text))
        assert all(int(told) == width for told, _ in hidden)
        assert not lost or hidden, (case, lost)


def test_no_table_loses_a_number() -> None:
    """One case of each command where there is least room."""
    check(FIRST, min(WIDTHS))


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_nor_does_another_case(width: int) -> None:
    check(QUICK, width)


@pytest.mark.slow
@pytest.mark.parametrize("width", WIDTHS)
def test_no_table_of_a_search_loses_a_number(width: int) -> None:
    check(LONG, width)


def test_what_is_hidden_is_named() -> None:
    ((_, text),) = on_terminal(80, ("calibrate", *PLANAR, "--holdout", "none"))
    assert [told for _, told in HIDDEN.findall(plain(text))] == ["criterion before, criterion after"]
    assert "criterion before" not in plain(text).split("not shown")[0]


def test_colours_are_left_out_where_they_are_not_wanted() -> None:
    ((_, text),) = on_terminal(80, ("check", PLANAR[0]), NO_COLOR="1")
    assert not re.search(r"\x1b\[[0-9;]*3[0-7]m", text)


NAMES = st.text("abcdefgh@_.1", min_size=1, max_size=40)
NUMBERS = st.tuples(st.floats(-1e6, 1e6), st.sampled_from(["mm", "um", "kN/mm", ""])).map(
    lambda pair: f"{pair[0]:.4g} {pair[1]}".strip()
)
WORDS = st.lists(st.one_of(st.text("abcdef", min_size=1, max_size=9), NUMBERS), max_size=8).map(" ".join)


@settings(deadline=None, max_examples=200)
@given(
    rows=st.lists(st.tuples(NAMES, *[NUMBERS] * 6, WORDS), min_size=1, max_size=4),
    width=st.integers(40, 140),
    spare=st.lists(st.sampled_from(["two", "three"]), unique=True),
)
def test_numbers_stay_whole_at_any_width(
    rows: list[tuple[str, ...]], width: int, spare: list[str]
) -> None:
    heads = ("name", "one", "two", "three", "four is long", "five", "six", "remark")
    laid = laid_out(columns_of(heads, rows, 1, ("remark",)), width, 1, spare)
    text = "\n".join(laid.lines)
    assert max(map(len, laid.lines)) <= width
    assert set(laid.hidden) <= set(spare)
    for row in rows:
        for head, cell in zip(heads[1:7], row[1:7], strict=True):
            assert head in laid.hidden or re.search(rf"(?<!\S){re.escape(cell)}(?!\S)", text), (head, cell)
        for part in row[7].split():
            assert part in text


def test_columns_that_all_name_their_row_are_shown_too() -> None:
    rows = [("a_long_name_of_a_run", "2021-12-16T10:30", "another_long_name")]
    laid = laid_out(columns_of(("run", "date", "machine"), rows, 3, ()), 24, 3)
    shown = "".join("".join(laid.lines).split())
    assert [part for part in ("2021-12-16T10:30", "date", "machine") if part not in shown] == []


@pytest.mark.parametrize("width", [40, 60])
def test_the_catalogue_is_shown_on_narrow_terminals(width: int) -> None:
    ((code, text),) = on_terminal(width, ("effects",))
    assert code == 0 and plain(text).count("backlash") >= 1 and "acts on" in plain(text)
    assert all(len(line) <= width for table in tables_of(text) for line in table if "`" not in line and ":" not in line)


def test_folded_texts_keep_all_their_letters() -> None:
    name = "thermal_expansion@strut_of_the_left_arm.alpha_per_kelvin"
    laid = laid_out(columns_of(("name", "value"), [(name, "12.5 um")], 1, ()), 30, 1)
    assert "".join(line[:20].strip() for line in laid.lines[1:]) == name and "12.5 um" in laid.lines[1]
