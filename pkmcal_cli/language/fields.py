"""Types of the fields of a machine: quantities of a dimension, points, axes, names."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import CoreSchema, core_schema

from pkmcal_cli.base.errors import did_you_mean
from pkmcal_cli.language.quantities import Measure, V, fault, kind_of
from pkmcal_cli.language.step_units import UNIT_SCHEMA, unit_definition, with_definition
from pkmcal_cli.units.dimensions import (
    ACCELERATION,
    ANGLE,
    AREA,
    BENDING_STIFFNESS,
    COUPLING_STIFFNESS,
    DENSITY,
    FORCE,
    LENGTH,
    MASS,
    MODULUS,
    NUMBER,
    ROTATIONAL_STIFFNESS,
    SECOND_MOMENT,
    STIFFNESS,
    TEMPERATURE,
    TIME,
    TORQUE,
    Dimension,
)
from pkmcal_cli.units.unit_text import UNITS, UnitError, parse_unit

Space = Literal["planar", "spatial"]
Direction = Literal["x", "y", "z", "rx", "ry", "rz"]
Letter = Literal["x", "y", "z", "-x", "-y", "-z"]

PLANAR: tuple[Direction, ...] = ("x", "y", "rz")
SPATIAL: tuple[Direction, ...] = ("x", "y", "z", "rx", "ry", "rz")


class Entity(BaseModel):
    """A frozen thing of the machine file; `shorthand` is the field that a bare value fills.

    noun: what a thing of this kind is called; for_others: it is there to be used by others; driven_by: keys of
    actuators that can have it as their target; in_own_unit: keys whose values may be in the unit that it defines;
    one_value: it is written as one value, not as a map; renamed: the present names of keys that were called otherwise.
    """

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, arbitrary_types_allowed=True,
        protected_namespaces=(), defer_build=True,  # that of the machine holds those of its parts
    )  # fmt: skip
    shorthand: ClassVar[str | None] = None
    noun: ClassVar[str] = ""
    for_others: ClassVar[bool] = False
    driven_by: ClassVar[tuple[str, ...]] = ()
    in_own_unit: ClassVar[tuple[str, ...]] = ()
    one_value: ClassVar[bool] = False
    renamed: ClassVar[Mapping[str, str]] = MappingProxyType({})

    @model_validator(mode="before")
    @classmethod
    def _expand_shorthand(cls, raw: Any) -> Any:
        return with_definition(raw, cls.in_own_unit) if isinstance(raw, dict | cls) else cls.expanded(raw)

    @classmethod
    def expanded(cls, raw: Any) -> Any:
        """The map that a bare value stands for; raises PydanticCustomError where it stands for none."""
        if cls.shorthand is not None and raw is not None:
            return {cls.shorthand: raw}
        raise fault("type", f"expected a map, found {kind_of(raw)}", _MAP)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        made = handler(schema)
        if cls.shorthand is None:
            return made
        resolved = handler.resolve_ref_schema(made)
        short = dict(resolved["properties"][cls.shorthand])
        short.pop("default", None)
        body = dict(resolved)
        resolved.clear()
        resolved["anyOf"] = [short, body]
        return made


_MAP = "write `key: value` pairs, in braces or on separate lines"
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def _check_name(name: str) -> str:
    if not NAME.fullmatch(name):
        hint = "start with a letter; use only letters, digits and `_`"
        if "{" in name:
            hint = "add `each: {i: [...]}` to this entry"
        if name == "<<":
            hint = "use `each` or `extends`; YAML 1.2 has no merge keys"
        raise fault("name", f"`{name}` is not a valid name", hint)
    return name


Name = Annotated[str, AfterValidator(_check_name)]


def _unit_of(*dimensions: Dimension) -> AfterValidator:
    def check(text: str) -> str:
        try:
            unit = parse_unit(text, dimensions)
        except UnitError as error:
            raise fault("unit", error.message, error.hint) from None
        if dimensions and unit.dimension not in dimensions:
            allowed = " or ".join(d.name for d in dimensions)
            example = ", ".join(u for u, at in UNITS.items() if at.dimension in dimensions)
            message = f"`{text}` is a unit of {unit.dimension}, not of {allowed}"
            raise fault("unit", message, f"use one of {example}")
        return text

    return AfterValidator(check)


UnitText = Annotated[str, _unit_of()]
_DEFINED_UNIT = (BeforeValidator(unit_definition), WithJsonSchema(UNIT_SCHEMA))
ReadingUnit = Annotated[str, *_DEFINED_UNIT, _unit_of(LENGTH, ANGLE)]
SensorUnit = Annotated[str, *_DEFINED_UNIT, _unit_of(LENGTH, ANGLE, FORCE, TORQUE, NUMBER)]


LengthUnit = Annotated[str, _unit_of(LENGTH)]
AngleUnit = Annotated[str, _unit_of(ANGLE)]
ForceUnit = Annotated[str, _unit_of(FORCE)]
MassUnit = Annotated[str, _unit_of(MASS)]
TimeUnit = Annotated[str, _unit_of(TIME)]
TemperatureUnit = Annotated[str, _unit_of(TEMPERATURE)]


@dataclass(frozen=True)
class Shape:
    """Marks a tuple of quantities: how many in the plane and in space; a scalar where 1 may be."""

    noun: str
    planar: tuple[int, ...]
    spatial: tuple[int, ...]

    def read(self, raw: Any, info: ValidationInfo) -> Any:
        """The raw value as a tuple of the right length; raises PydanticCustomError."""
        context = info.context if isinstance(info.context, dict) else {}
        space = context.get("space")
        counts = {"planar": self.planar, "spatial": self.spatial}.get(space or "", self.planar + self.spatial)
        if isinstance(raw, list):
            raw = tuple(raw)
        if isinstance(raw, dict) and set(raw) == {"at"}:
            raw = raw["at"]
        if raw is None or isinstance(raw, dict | bool):
            raise fault("type", f"{self._expectation(counts)}, found {kind_of(raw)}", _form(counts))
        if not isinstance(raw, tuple):
            if 1 in counts:
                return (raw,)
            raise fault("type", f"{self._expectation(counts)}, found {kind_of(raw)}", _form(counts))
        if len(raw) not in counts or (raw == () and 0 not in counts):
            where = f" in a {space} machine" if space in ("planar", "spatial") else ""
            raise fault("value", f"{self._expectation(counts)}{where}, found {len(raw)}", _form(counts))
        return raw

    def _expectation(self, counts: tuple[int, ...]) -> str:
        numbers = " or ".join(str(n) for n in sorted(set(counts)))
        return f"expected {self.noun} of {numbers} number{'' if numbers == '1' else 's'}"

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_before_validator_function(self.read, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        counts = {*self.planar, *self.spatial}
        item = {"type": ["number", "string"]}
        listed = {
            "type": "array", "items": item, "minItems": min(counts), "maxItems": max(counts),
        }  # fmt: skip
        return {"anyOf": [item, listed]} if 1 in counts else listed


def _form(counts: tuple[int, ...]) -> str:
    """What a tuple of so many numbers looks like."""
    return "write " + " or ".join({1: "a number", 2: "[x, y]", 3: "[x, y, z]"}[n] for n in sorted(set(counts)))


@dataclass(frozen=True)
class AxisLetterOr(Shape):
    """Marks an axis: a letter with or without sign, or a vector."""

    def read(self, raw: Any, info: ValidationInfo) -> Any:
        """A letter stays; anything else must be a vector."""
        letters = ("x", "y", "z", "-x", "-y", "-z")
        if isinstance(raw, str):
            if raw in letters:
                return raw
            raise fault("value", f"`{raw}` is not an axis", did_you_mean(raw, letters))
        return super().read(raw, info)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        kinds = {
            "letter": core_schema.str_schema(),
            "vector": handler.generate_schema(tuple[Number[Any], ...]),
        }
        either = core_schema.tagged_union_schema(kinds, discriminator=_letter_or_vector)
        return core_schema.with_info_before_validator_function(self.read, either)

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        letters = {"enum": ["x", "y", "z", "-x", "-y", "-z"]}
        return {"anyOf": [letters, super().__get_pydantic_json_schema__(schema, handler)]}


def _letter_or_vector(raw: Any) -> str:
    return "letter" if isinstance(raw, str) else "vector"


def _fixed(raw: Any, info: ValidationInfo) -> Any:
    """`true` fixes every direction, `false` or nothing none."""
    if raw is True:
        context = info.context if isinstance(info.context, dict) else {}
        return PLANAR if context.get("space") == "planar" else SPATIAL
    return () if raw is False or raw is None else raw


# --- quantities of a dimension -------------------------------------------------------------
Number = Annotated[V, Measure(NUMBER)]
Length = Annotated[V, Measure(LENGTH, plausible=(0.0, 50.0))]
Size = Annotated[V, Measure(LENGTH, plausible=(1e-5, 50.0), sign="+")]
SectionSize = Annotated[V, Measure(LENGTH, plausible=(1e-5, 2.0), sign="+")]
Angle = Annotated[V, Measure(ANGLE)]
Force = Annotated[V, Measure(FORCE, plausible=(0.0, 1e7))]
DriveForceValue = Annotated[V, Measure(FORCE, (TORQUE,), plausible=(0.0, 1e7))]
ForceLimit = Annotated[V, Measure(FORCE, (TORQUE,), plausible=(0.0, 1e7), sign="+")]
LeastForce = Annotated[V, Measure(FORCE, plausible=(0.0, 1e7), sign="0+")]
Mass = Annotated[V, Measure(MASS, plausible=(1e-4, 1e5), sign="+")]
Density = Annotated[V, Measure(DENSITY, plausible=(10.0, 25e3), sign="+")]
Modulus = Annotated[V, Measure(MODULUS, plausible=(1e8, 2e12), sign="+")]
Area = Annotated[V, Measure(AREA, plausible=(1e-10, 4.0), sign="+")]
SecondMoment = Annotated[V, Measure(SECOND_MOMENT, sign="+")]
AxialStiffness = Annotated[V, Measure(FORCE, plausible=(1.0, 1e12), sign="+")]
BendingStiffness = Annotated[V, Measure(BENDING_STIFFNESS, sign="+")]
LinearStiffness = Annotated[V, Measure(STIFFNESS, plausible=(1e1, 1e12), sign="+")]
RotationalStiffness = Annotated[V, Measure(ROTATIONAL_STIFFNESS, sign="+")]
TranslationCoupling = Annotated[V, Measure(STIFFNESS)]
MixedCoupling = Annotated[V, Measure(COUPLING_STIFFNESS)]
RotationCoupling = Annotated[V, Measure(ROTATIONAL_STIFFNESS)]
DriveStiffness = Annotated[V, Measure(STIFFNESS, (ROTATIONAL_STIFFNESS,), sign="+")]
Acceleration = Annotated[V, Measure(ACCELERATION, plausible=(0.0, 100.0))]
Travel = Annotated[V, Measure(LENGTH, (ANGLE,))]
_FIXED = {"anyOf": [{"type": "boolean"}, {"type": "array", "items": {"enum": list(SPATIAL)}}]}
Fixed = Annotated[tuple[Direction, ...], BeforeValidator(_fixed), WithJsonSchema(_FIXED)]
SigmaIs = Literal["stated", "exact", "unknown"]
SIGMA_IS = (
    "What the sigma is worth beside the scatter of the residuals: `stated` counts as 10 degrees of freedom, `unknown` "
    "as one; with `exact` the residuals change nothing"
)
Zero = Annotated[V | Literal["home"], Measure(LENGTH, (ANGLE,), words=("home",))]
Scale = Annotated[V, Measure(NUMBER, (LENGTH / ANGLE, ANGLE / LENGTH), sign="+-")]
Factor = Annotated[V, Measure(NUMBER, sign="+-")]
Multiple = Annotated[V, Measure(NUMBER, sign="+")]
Sigma = Annotated[V, Measure(LENGTH, (ANGLE,), sign="+")]
_MEASURED = (ANGLE, FORCE, TORQUE, STIFFNESS, ROTATIONAL_STIFFNESS, MASS, NUMBER)
SensorValue = Annotated[V, Measure(LENGTH, _MEASURED)]
SIGMA = Measure(LENGTH, _MEASURED, sign="+")
SensorSigma = Annotated[V, SIGMA]
Growth = Annotated[V, Measure(NUMBER, sign="0+")]
SensorScale = Annotated[V, Measure(NUMBER, (FORCE, TORQUE, LENGTH, ANGLE), sign="+-")]

# --- tuples of them ------------------------------------------------------------------------
Point = Annotated[tuple[Length[V], ...], Shape("a point", (2,), (3,))]
PointOrTravel = Annotated[tuple[Length[V], ...], Shape("a point or a travel", (1, 2), (1, 3))]
RotationVector = Annotated[tuple[Angle[V], ...], Shape("an angle or rotation vector", (1,), (3,))]
Gravity = Annotated[tuple[Acceleration[V], ...], Shape("a vector", (2,), (3,))]
ForceVector = Annotated[tuple[Force[V], ...], Shape("a vector", (2,), (3,))]
Torque = Annotated[V, Measure(TORQUE)]
Moment = Annotated[tuple[Torque[V], ...], Shape("a moment", (1,), (3,))]
Vector = Annotated[tuple[Number[V], ...], Shape("a vector", (2,), (3,))]
Axis = Annotated[Letter | tuple[Number[V], ...], AxisLetterOr("an axis", (2,), (3,))]
