"""Units: the table, texts, dimensions, the units of a file."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pkmcal_cli.units import file_units as u
from pkmcal_cli.units.file_units import FileUnits, UnitError, parse_unit, parse_value


@pytest.mark.parametrize(
    ("text", "factor", "dimension"),
    [
        ("mm", 1e-3, u.LENGTH),
        ("µm", 1e-6, u.LENGTH),
        ("kN/mm", 1e6, u.STIFFNESS),
        ("N*m/rad", 1.0, u.ROTATIONAL_STIFFNESS),
        ("N mm/rad", 1e-3, u.ROTATIONAL_STIFFNESS),
        ("N/mm/rad", 1e3, u.STIFFNESS / u.ANGLE),
        ("mm^4", 1e-12, u.SECOND_MOMENT),
        ("mm**2", 1e-6, u.AREA),
        ("mm ** 2", 1e-6, u.AREA),
        ("kg*mm**-3", 1e9, u.DENSITY),
        ("m²", 1.0, u.AREA),
        ("kg/m^3", 1.0, u.DENSITY),
        ("kg/(m*s^2)", 1.0, u.MODULUS),
        ("GPa mm²", 1e3, u.FORCE),
        ("1/K", 1.0, u.NUMBER / u.TEMPERATURE),
        ("in", 0.0254, u.LENGTH),
        ("inch", 0.0254, u.LENGTH),
        ("lbf", 0.45359237 * 9.80665, u.FORCE),
        ("lbf/in", 0.45359237 * 9.80665 / 0.0254, u.STIFFNESS),
        ("kg/in**3", 1 / 0.0254**3, u.DENSITY),
        ("deg", math.pi / 180, u.ANGLE),
        ("rev", 2 * math.pi, u.ANGLE),
        ("%", 0.01, u.NUMBER),
        ("s^-1", 1.0, u.NUMBER / u.TIME),
    ],
)
def test_units_are_read(text: str, factor: float, dimension: u.Dimension) -> None:
    unit = parse_unit(text)
    assert unit.to_si(1.0) == pytest.approx(factor, rel=1e-15)
    assert unit.dimension == dimension


@pytest.mark.parametrize("text", ["", "furlong", "Mm", "N/", "m^", "m^m", "(m", "m)", "2", "m+m", "m^99", "a" * 99])
def test_other_texts_are_no_units(text: str) -> None:
    with pytest.raises(UnitError):
        parse_unit(text)


def test_the_nearest_unit_is_named() -> None:
    with pytest.raises(UnitError) as caught:
        parse_unit("kN/mmm")
    assert caught.value.hint == "did you mean `mm`?"


@pytest.mark.parametrize(
    ("text", "fitting", "hint"),
    [
        ("mn", (u.LENGTH,), "use one of m, cm, mm, um, nm, km, in"),
        ("mn", (u.TIME,), "use one of s, ms, min, h"),
        ("MM", (u.LENGTH,), "did you mean `mm`?"),
        ("NM", (u.TORQUE,), "did you mean `Nm`?"),
        ("inches", (u.LENGTH,), "did you mean `inch`?"),
        ("minn", (u.LENGTH,), "use one of m, cm, mm, um, nm, km, in"),
        ("minn", (u.TIME,), "did you mean `min`?"),
        ("kN/minn", (u.STIFFNESS,), "use one of m, cm, mm, um, nm, km, in"),
        ("kNm/minn", (u.STIFFNESS,), None),
        ("sin", (u.NUMBER,), "write a plain number, or use one of %, ppm"),
    ],
)
def test_only_units_that_fit_are_suggested(text: str, fitting: tuple[u.Dimension, ...], hint: str | None) -> None:
    with pytest.raises(UnitError) as caught:
        parse_unit(text, fitting)
    assert caught.value.hint == hint


@given(
    st.sampled_from(["{}", "kN/{}", "{}*mm/rad", "kg/({}*s^2)", "{}^2", "1/{}"]),
    st.text("mnikgcsud", min_size=1, max_size=4),
    st.sampled_from([*u.DIMENSIONS.values(), u.NUMBER / u.LENGTH]),
)
def test_whatever_is_suggested_fits(form: str, name: str, dimension: u.Dimension) -> None:
    try:
        parse_unit(form.format(name), (dimension,))
    except UnitError as error:
        words = (error.hint or "").replace(",", " ").replace("`", " ").replace("?", " ").split()
        named = [word for word in words if word in u.UNITS or word == "inch"]
        assert named or error.hint is None
        for unit in named:
            assert parse_unit(form.format(unit)).dimension.fits(dimension)


@given(st.text(max_size=20))
def test_any_text_is_a_unit_or_a_unit_error(text: str) -> None:
    try:
        parse_unit(text)
    except UnitError as error:
        assert error.message


def test_values_are_rounded_once() -> None:
    number, unit = parse_value("0.1 mm")
    assert unit.to_si(number) == 1e-4
    assert parse_unit("mm").to_si(300) == 0.3
    assert parse_unit("deg").to_si(90) == math.pi / 2
    assert parse_unit("degC").to_si(20.0) == 293.15
    assert parse_unit("degC").difference.to_si(20.0) == 20.0


@given(st.floats(-1e6, 1e6), st.sampled_from(sorted(u.UNITS)))
def test_to_si_and_back(value: float, text: str) -> None:
    unit = u.UNITS[text]
    assert unit.from_si(unit.to_si(value)) == pytest.approx(value, rel=1e-12, abs=1e-9)


def test_derived_units_of_a_file() -> None:
    file = FileUnits.of({"length": "mm", "angle": "deg", "force": "kN"})
    shown = {name: file.unit(dimension).text for name, dimension in u.DIMENSIONS.items()}
    assert shown["stiffness"] == "kN/mm"
    assert shown["rotational_stiffness"] == "kN*mm/rad"
    assert shown["modulus"] == "kN/mm^2"
    assert shown["density"] == "kg/mm^3"
    assert shown["acceleration"] == "m/s^2"
    assert shown["angle"] == "deg"
    assert file.unit(u.STIFFNESS).to_si(1.0) == 1e6
    assert file.unit(u.SECOND_MOMENT).to_si(1.0) == 1e-12
    assert file.unit(u.STIFFNESS).format(50e6) == "50 kN/mm"


def test_a_file_unit_of_another_dimension_is_refused() -> None:
    with pytest.raises(UnitError, match="unit of angle, not of length"):
        FileUnits.of({"length": "deg"})


@pytest.mark.parametrize("dimension", u.DIMENSIONS.values())
@pytest.mark.parametrize(("length", "force"), [("cm", "MN"), ("in", "lbf")])
def test_derived_units_have_their_dimension(dimension: u.Dimension, length: str, force: str) -> None:
    file = FileUnits.of({"length": length, "mass": "g", "force": force, "time": "ms"})
    unit = file.unit(dimension)
    assert unit.dimension == dimension
    if unit.text != "1":
        assert parse_unit(unit.text).to_si(1.0) == pytest.approx(unit.to_si(1.0))
        assert parse_unit(unit.text).dimension == dimension
