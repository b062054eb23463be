"""Operators of expressions: which there are, and that `^` and `**` both mean power."""

from __future__ import annotations

import ast

import pytest
from hypothesis import given

from pkmcal_cli.expressions.parser import FUNCTIONS, ExpressionError, parse_expression
from pkmcal_cli.language.binding import Slip
from tests.test_quantities import TREES, bound


@pytest.mark.parametrize(
    "text", ["a // 2", "a % 2", "a == b", "a = b", "a & b", "a | b", "a < b", "a ^^ b", "a *** b", "a */ b", "not a"]
)
def test_a_wrong_operator_is_told_which_there_are(text: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse_expression(text)
    assert caught.value.hint is not None
    assert {"`+`", "`-`", "`*`", "`/`", "`^`", "`**`"} <= set(caught.value.hint.replace(",", " ").split())
    assert all(name in caught.value.hint for name in FUNCTIONS)


@pytest.mark.parametrize("power", ["^", "**", " ^ "])
def test_places_behind_a_power_are_those_in_the_text(power: str) -> None:
    text = f"  2*a{power}2 + b{power}3*nosuch(1)"
    with pytest.raises(ExpressionError) as caught:
        parse_expression(text)
    assert text[caught.value.offset :] == "nosuch(1)"
    text = f"  r{power}2/r + l{power}2*k/r"
    with pytest.raises(Slip, match="cannot combine") as slip:
        bound(text)
    assert slip.value.message.startswith(f"cannot combine `r{power}2/r` (a length)")
    assert text[slip.value.offset :] == f"l{power}2*k/r"


@given(TREES)
def test_both_signs_of_a_power_mean_the_same(text: str) -> None:
    assert ast.dump(parse_expression(text.replace("**", "^"))) == ast.dump(parse_expression(text))
