"""Quantities: expressions, dimensions, complex steps, inference."""

from __future__ import annotations

import math
import pickle

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic_core import PydanticCustomError

from pkmcal_cli.expressions.parser import FUNCTIONS, UNIT_HINT, ExpressionError, names_of, parse_expression
from pkmcal_cli.language.binding import Binder, Slip
from pkmcal_cli.language.inference import Inference
from pkmcal_cli.language.quantities import Measure, Quantity, WrittenValue
from pkmcal_cli.units.file_units import ANGLE, AREA, FORCE, LENGTH, NUMBER, STIFFNESS, Dimension, FileUnits

MM = FileUnits.of({"length": "mm", "angle": "deg"})
KNOWN = {"l": LENGTH, "r": LENGTH, "g": ANGLE, "k": STIFFNESS, "s": NUMBER}
VALUES = {"l": 0.3, "r": 0.2, "g": 0.1, "k": 5e6, "s": 1.5}


def bound(text: str | float, dimension: Dimension = LENGTH) -> Quantity:
    draft = Measure(dimension).read(text)
    assert isinstance(draft, WrittenValue)
    return Binder(MM, KNOWN).bind(draft)


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        (300, LENGTH, 0.3),
        ("12 um", LENGTH, 12e-6),
        ("+12um", LENGTH, 12e-6),
        ("1e-4 rad", ANGLE, 1e-4),
        ("90", ANGLE, math.pi / 2),
        ("20/255/2", NUMBER, 20 / 255 / 2),
        ("20/4", LENGTH, 0.005),
        ("-l", LENGTH, -0.3),
        ("l + 5", LENGTH, 0.305),
        ("2*l - r/4", LENGTH, 0.55),
        ("r*cos(2*pi/3)", LENGTH, -0.1),
        ("r*cos(g)", LENGTH, 0.2 * math.cos(0.1)),
        ("100*cos(g)", LENGTH, 0.1 * math.cos(0.1)),
        ("r*g", LENGTH, 0.02),
        ("l*r/r", LENGTH, 0.3),
        ("sqrt(l**2 + r**2)", LENGTH, math.hypot(0.3, 0.2)),
        ("hypot(l, 200)", LENGTH, math.hypot(0.3, 0.2)),
        ("max(l, 400)", LENGTH, 0.4),
        ("abs(r - l)", LENGTH, 0.1),
        ("atan2(r, l)", ANGLE, math.atan2(0.2, 0.3)),
        ("asin(1) - g", ANGLE, math.pi / 2 - 0.1),
        ("l*r", AREA, 0.06),
        ("k*l*s", FORCE, 5e6 * 0.3 * 1.5),
        ("exp(log(s))", NUMBER, 1.5),
        ("l**1", LENGTH, 0.3),
        ("sqrt(l^2 + r^2)", LENGTH, math.hypot(0.3, 0.2)),
        ("-s^2", NUMBER, -2.25),
        ("-s**2", NUMBER, -2.25),
        ("(-s)^2", NUMBER, 2.25),
        ("2^3^2", NUMBER, 512.0),
        ("2**3^2", NUMBER, 512.0),
        ("2^-1*s", NUMBER, 0.75),
        ("12*s^2/3", NUMBER, 9.0),
    ],
)
def test_values(text: str | float, dimension: Dimension, value: float) -> None:
    made = bound(text, dimension)
    assert made.value(VALUES) == pytest.approx(value, rel=1e-14)
    assert isinstance(made.value(VALUES), float)
    assert made.dimension == dimension


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("g", "`g` is an angle; expected a length"),
        ("l*r", "`l*r` is an area; expected a length"),
        ("l + k", "cannot combine `l` (a length) with `k` (a stiffness)"),
        ("5*s", "`5*s` is a plain number; expected a length"),
        ("l*sin(r)", "`r` is a length; `sin` expects an angle"),
        ("exp(l)", "`l` is a length; `exp` expects a plain number"),
        ("2**l", "exponent `l` is a length"),
        ("l**s", "`l` is a length; its exponent must be a constant number"),
        ("12 kg", "`12 kg` is a mass; expected a length"),
        ("1/0", "`1/0` has no finite value"),
        ("9**9**9**9", "`9**9**9` has no finite value"),
        ("sqrt(-1)", "`sqrt(-1)` has no finite value"),
    ],
)
def test_slips(text: str, what: str) -> None:
    with pytest.raises(Slip) as caught:
        bound(text)
    assert caught.value.message == what


@pytest.mark.parametrize(
    "text",
    ["a//b", "a.b", "a[0]", "[a]", "lambda: 1", "a if b else c", "f'{a}'", "'a'", "a:=1", "not a", "a<b",
     "a@b", "~a", "1_000", "True", "None", "foo(1)", "sin", "sin()", "sin(1, 2)", "atan2(1)", "sin(*a)",
     "min(a=1)", "2(3)", "()", "a b", "a;b", "a\nb c", "1.2.3", "é", "", "__import__('os')", "1e999",
     "9" * 600, "(" * 300 + "1", "-" * 200 + "1", "+".join("a" * 200), "\x00", "a#b"],
)  # fmt: skip
def test_everything_else_is_refused(text: str) -> None:
    with pytest.raises(PydanticCustomError):
        draft = Measure(NUMBER).read(text)
        assert not isinstance(draft, WrittenValue), draft


@pytest.mark.parametrize(
    ("text", "dimension", "hint"),
    [
        ("1j", NUMBER, "write a plain number, or use one of %, ppm"),
        ("1 mn", LENGTH, "use one of m, cm, mm, um, nm, km, in"),
        ("1 furlong", STIFFNESS, "use a unit such as `N/mm`"),
        ("3 mm + 2", LENGTH, UNIT_HINT),
    ],
)
def test_a_unit_that_is_none_is_told_with_those_that_fit(text: str, dimension: Dimension, hint: str) -> None:
    with pytest.raises(Slip) as caught:
        bound(text, dimension)
    assert (caught.value.code, caught.value.hint) == ("unit", hint)


@given(st.text(max_size=40))
@settings(max_examples=300)
def test_any_text_is_an_expression_or_a_fault(text: str) -> None:
    try:
        tree = parse_expression(text)
    except ExpressionError as error:
        assert 0 <= error.offset <= max(len(text), 1)
    else:
        assert all(name.isidentifier() for name in names_of(tree))


@given(st.text(alphabet="ab12.+-*/(), esincorgx^pi", max_size=30))
@settings(max_examples=300)
def test_texts_like_expressions_never_crash(text: str) -> None:
    known = dict.fromkeys("abcdefghijklmnopqrstuvwxyz", NUMBER)
    try:
        draft = Measure(NUMBER).read(text)
    except PydanticCustomError:
        return
    assert isinstance(draft, WrittenValue)
    if not set(draft.names) <= set(known):
        return
    try:
        made = Binder(MM, known).bind(draft)
    except Slip:
        return
    assert isinstance(made.value(dict.fromkeys(known, 0.7)), float)


_LEAVES = st.sampled_from(["a", "b", "0.5", "3", "pi"])
TREES = st.recursive(
    _LEAVES,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda t: f"({t[0]}{t[1]}{t[2]})"),
        inner.map(lambda t: f"(-{t})"),
        inner.map(lambda t: f"({t})**2"),
        st.tuples(st.sampled_from(["sin", "cos", "atan", "abs"]), inner).map(lambda t: f"{t[0]}({t[1]})"),
        st.tuples(inner, inner).map(lambda t: f"hypot({t[0]}, {t[1]} + 4)"),
        st.tuples(inner, inner).map(lambda t: f"atan2({t[0]}, {t[1]})"),
        st.tuples(inner, inner).map(lambda t: f"max({t[0]}, {t[1]})"),
        inner.map(lambda t: f"sqrt(abs({t}) + 1)"),
    ),
    max_leaves=8,
)


@given(TREES, st.floats(0.1, 2.0), st.floats(-2.0, -0.1))
@example("(-atan2((a+b), (a+b)))", 1.0, -1.0)
@settings(max_examples=300, deadline=None)
def test_expressions_agree_with_python_and_complex_steps_with_differences(text: str, a: float, b: float) -> None:
    known = {"a": NUMBER, "b": NUMBER}
    draft = Measure(NUMBER).read(text)
    assert isinstance(draft, WrittenValue)
    inner = Binder(FileUnits(), known)
    try:
        made = inner.bind(draft, (NUMBER, ANGLE))
    except Slip:
        return
    value = made.number({"a": a, "b": b})
    if not math.isfinite(value):
        return
    space = {name: getattr(math, name, None) for name in FUNCTIONS} | {"abs": abs, "max": max, "pi": math.pi}
    assert value == pytest.approx(eval(text, {"__builtins__": {}}, {**space, "a": a, "b": b}), rel=1e-12, abs=1e-12)
    h = 1e-6
    up, down = made.number({"a": a + h, "b": b}), made.number({"a": a - h, "b": b})
    second = abs(up - 2 * value + down) / h
    step = made.value({"a": complex(a, 1e-40), "b": complex(b)})
    assert step.real == pytest.approx(value, rel=1e-12, abs=1e-12)
    if math.isfinite(up) and math.isfinite(down) and second < 1e-3 * (1 + abs(up - down) / (2 * h)):
        assert step.imag / 1e-40 == pytest.approx((up - down) / (2 * h), rel=1e-3, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "at", "slope"),
    [
        ("asin(a)", 0.5, 1 / math.sqrt(0.75)),
        ("acos(a)", 0.5, -1 / math.sqrt(0.75)),
        ("tan(a)", 0.5, 1 / math.cos(0.5) ** 2),
        ("sqrt(a)", 4.0, 0.25),
        ("log(a)", 4.0, 0.25),
        ("exp(a)", 1.0, math.e),
        ("a**3", -2.0, 12.0),
        ("a**-1", -2.0, -0.25),
        ("2**a", 2.0, 4 * math.log(2)),
        ("abs(a)", -2.0, -1.0),
        ("min(a, 3)", 2.0, 1.0),
        ("max(a, 3)", 2.0, 0.0),
        ("hypot(a, 3)", -4.0, -0.8),
        ("atan2(a, 1)", 2.0, 0.2),
        ("atan2(a, -1)", 0.5, -0.8),
        ("atan2(a, -1)", -0.5, -0.8),
        ("atan2(1, a)", 0.0, -1.0),
        ("atan2(-1, a)", 0.5, 0.8),
        ("1/a", 2.0, -0.25),
    ],
)
def test_derivatives_by_complex_step(text: str, at: float, slope: float) -> None:
    draft = Measure(NUMBER, (ANGLE,)).read(text)
    assert isinstance(draft, WrittenValue)
    made = Binder(FileUnits(), {"a": NUMBER}).bind(draft)
    for h in (1e-20, 1e-100):
        step = made.value({"a": complex(at, h)})
        assert step.imag / h == pytest.approx(slope, rel=1e-13, abs=1e-13)
        assert step.real == pytest.approx(made.number({"a": at}), rel=1e-14)


@pytest.mark.parametrize("text", ["sqrt(-s)", "log(-s)", "asin(3*s)", "1/(s - s)", "(-s)**0.5", "exp(s*1000)"])
def test_outside_the_domain_there_is_no_number(text: str) -> None:
    made = bound(text, NUMBER) if "asin" not in text else bound(text, ANGLE)
    assert math.isnan(made.number(VALUES))
    complex_values = {name: complex(value, 1e-30) for name, value in VALUES.items()}
    assert math.isnan(made.value(complex_values).real)


def test_quantities_are_values_that_can_be_sent() -> None:
    made = bound("r*cos(g) + 5")
    again = pickle.loads(pickle.dumps(made))
    assert again == made
    assert again.value(VALUES) == made.value(VALUES)
    assert made.names == ("r", "g")
    assert Quantity.constant(0.3, LENGTH).value({}) == 0.3


@pytest.mark.parametrize("raw", [True, None, [1], {"a": 1}, float("nan"), float("inf"), "1e400", "  "])
def test_no_quantities(raw: object) -> None:
    with pytest.raises(PydanticCustomError):
        Measure(LENGTH).read(raw)


@pytest.mark.parametrize(
    ("uses", "found"),
    [
        ([("a", LENGTH)], {"a": LENGTH}),
        ([("-a", LENGTH), ("2*b", ANGLE)], {"a": LENGTH, "b": ANGLE}),
        ([("a + 5 - b/2", LENGTH)], {"a": LENGTH, "b": LENGTH}),
        ([("a*cos(b)", LENGTH)], {"a": LENGTH, "b": ANGLE}),
        ([("a*b", AREA), ("b", LENGTH)], {"a": LENGTH, "b": LENGTH}),
        ([("a/b", NUMBER), ("b", LENGTH)], {"a": LENGTH, "b": LENGTH}),
        ([("sqrt(a**2 + b**2)", LENGTH)], {"a": LENGTH, "b": LENGTH}),
        ([("hypot(a, b)", LENGTH)], {"a": LENGTH, "b": LENGTH}),
        ([("atan2(a, b)", ANGLE), ("a", LENGTH)], {"a": LENGTH, "b": LENGTH}),
        ([("a*b", LENGTH)], {}),
        ([("asin(a/b)", ANGLE), ("b", LENGTH)], {"a": LENGTH, "b": LENGTH}),
        ([("a*pi/4", LENGTH)], {"a": LENGTH}),
        ([("5/a", STIFFNESS)], {"a": NUMBER / STIFFNESS}),
    ],
)
def test_inference(uses: list[tuple[str, Dimension]], found: dict[str, Dimension]) -> None:
    known: dict[str, Dimension] = {}
    Inference(known).run([(parse_expression(text), dimension) for text, dimension in uses])
    assert known == found


@given(TREES, st.sampled_from([LENGTH, ANGLE, NUMBER]))
@settings(deadline=None)
def test_inference_ends(text: str, dimension: Dimension) -> None:
    known: dict[str, Dimension] = {}
    Inference(known).run([(parse_expression(text), dimension)])
    assert set(known) <= {"a", "b"}
