"""Tables of the machine file's keys, from the models that read it; used by `docs/tables.py`."""

from __future__ import annotations

import re
import types
from collections.abc import Iterator, Sequence
from typing import Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Le
from pydantic import AfterValidator, BeforeValidator
from pydantic.fields import FieldInfo

from pkmcal_cli.base.plural import count
from pkmcal_cli.elements.joint import JOINTS
from pkmcal_cli.expressions.analytic import ARGUMENTS, FUNCTIONS
from pkmcal_cli.expressions.parser import CONSTANTS, OPERATORS
from pkmcal_cli.language.fields import AxisLetterOr, Entity, Name, Shape
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.members import PLANAR_JOINTS
from pkmcal_cli.language.quantities import Measure, Quantity
from pkmcal_cli.sensors import sensor_kinds
from pkmcal_cli.units.dimensions import DIMENSIONS, NUMBER
from pkmcal_cli.units.file_units import SI
from pkmcal_cli.units.unit_text import UNITS

TEXTS = ("adjustable", "column", "extends", "note")
_SENSOR_KIND = " or ".join(f"`{kind}`" for kind in sensor_kinds())
"""Keys whose text is no name of a thing of the machine."""
SIGNS = {"+": " > 0", "0+": " >= 0", "+-": " not 0", "": ""}
Cells = tuple[str, ...]


def table(head: Cells, rows: Sequence[Cells]) -> str:
    """A Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("|" + "|".join(f" {cell} " if cell else " " for cell in line) + "|" for line in lines)


def models() -> dict[str, type[Entity]]:
    """The models of the machine file by name, the machine first."""
    found: dict[str, type[Entity]] = {}
    queue: list[type[Entity]] = [Machine]
    while queue:
        model = queue.pop(0)
        if found.setdefault(model.__name__, model) is model:
            queue += [
                m for f in model.model_fields.values() for m in _entities(f.annotation) if m.__name__ not in found
            ]
    return found


def _entities(annotation: Any) -> Iterator[type[Entity]]:
    if isinstance(annotation, type) and issubclass(annotation, Entity) and not annotation.one_value:
        yield annotation
    for part in get_args(annotation):
        yield from _entities(part)


def model_table(model: type[Entity]) -> str:
    """The keys of one model: value, unit of a bare number, default, meaning."""
    rows = [_row(name, about) for name, about in model.model_fields.items()]
    made = table(("key", "value", "unit", "default", "meaning"), rows)
    if model.shorthand is not None:
        made = f"A bare value sets `{model.shorthand}`.\n\n{made}"
    return made


def _row(name: str, about: FieldInfo) -> Cells:
    value = _value(name, about.annotation, tuple(about.metadata))
    unit = "" if about.annotation is float else _unit(about.annotation, tuple(about.metadata))
    return f"`{name}`", value, unit, _default(about), str(about.description)


def _default(about: FieldInfo) -> str:
    """As it would stand in the file; empty where leaving the key out has a meaning of its own."""
    if about.is_required():
        return "required"
    extra = about.json_schema_extra
    value = extra["default"] if isinstance(extra, dict) and "default" in extra else about.default
    if value in (None, "", (), {}) or (isinstance(value, float) and value == 0) or isinstance(value, Entity):
        return ""
    if isinstance(value, Quantity):
        return f"{value.number({}):g}"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, tuple):
        return "both " + _default_of(value[0])
    return f"`{value}`"


def _default_of(value: Entity) -> str:
    return f"`{getattr(value, value.shorthand or '')}`"


def _opened(annotation: Any, marks: tuple[Any, ...]) -> tuple[Any, tuple[Any, ...]]:
    """Without `| None` and `Annotated`, whose marks are added; of what is written as one value, its main field."""
    if isinstance(annotation, type) and issubclass(annotation, Entity) and annotation.one_value:
        field = annotation.model_fields[annotation.shorthand or ""]
        return _opened(field.annotation, (*marks, *field.metadata))
    if get_origin(annotation) in (Union, types.UnionType):
        rest = [part for part in get_args(annotation) if part is not types.NoneType]
        if len(rest) == 1:
            return _opened(rest[0], marks)
    if hasattr(annotation, "__metadata__"):
        return _opened(annotation.__origin__, (*marks, *annotation.__metadata__))
    return annotation, marks


def _value(name: str, annotation: Any, marks: tuple[Any, ...] = ()) -> str:
    """What may stand as a key's value, in words."""
    kind, marks = _opened(annotation, marks)
    measure = next((m for m in marks if isinstance(m, Measure)), None)
    shape = next((m for m in marks if isinstance(m, Shape)), None)
    if kind is float:
        return "number"
    if measure is not None:
        words = [d.name if d != NUMBER else "number" for d in measure.dimensions]
        told = "number" if words[0] == "number" else " or ".join(words)
        return told + SIGNS[measure.sign] + "".join(f", or `{w}`" for w in measure.words)
    if isinstance(shape, AxisLetterOr):
        return f"`x`, `y`, `z`, `-x`, `-y`, `-z` or {_counts(shape, 'number')}"
    if shape is not None:
        return _counts(shape, _value(name, get_args(kind)[0]))
    if kind is int:
        low = next(m.ge for m in marks if isinstance(m, Ge))
        high = next(m.le for m in marks if isinstance(m, Le))
        return f"whole number {low} to {high}"
    if kind is bool:
        return "`true`, `false`"
    if kind is str and name == "kind":
        return _SENSOR_KIND
    if kind is str:
        unit = name == "unit" or any(isinstance(m, AfterValidator) for m in marks)
        return "unit" if unit else "text" if name in TEXTS else "name"
    return _compound(name, kind, marks)


def _compound(name: str, kind: Any, marks: tuple[Any, ...]) -> str:
    """Words for things, lists, maps and choices."""
    parts, origin = get_args(kind), get_origin(kind)
    either = any(isinstance(m, BeforeValidator) for m in marks)
    if isinstance(kind, type) and issubclass(kind, Entity):
        words = re.sub(r"\B(?=[A-Z])", " ", kind.__name__).lower()
        return f"[{words}](#{name})"
    if origin is Literal:
        return ", ".join(f"`{word}`" for word in parts)
    if origin is tuple and name == "at":
        return "name, or list of names"
    if origin is tuple and parts[-1] is Ellipsis:
        return ("`true`, `false`, or " if either else "") + f"list of {_value(name, parts[0])}"
    if origin is tuple:
        return f"pair of: {_value(name, parts[0])}"
    if origin is dict:
        entry = _value(name, parts[1])
        if parts[0] is not Name and either:
            keyed = get_origin(parts[0]) is Literal
            return f"list of {_value(name, parts[0])}, or map to columns" if keyed else f"{entry}, or a map of these"
        return f"map of name to {entry}"
    raise TypeError(f"no words for {kind}")


def _counts(shape: Shape, item: str) -> str:
    """ "2 lengths (3 in space)" """

    def told(counts: tuple[int, ...]) -> str:
        return " or ".join(str(n) for n in counts)

    return f"{told(shape.planar)} {item}{'s' if shape.planar != (1,) else ''} ({told(shape.spatial)} in space)"


def _unit(annotation: Any, marks: tuple[Any, ...] = ()) -> str:
    """The unit of a bare number in a file without `units:`; the first of several dimensions."""
    kind, marks = _opened(annotation, marks)
    measure = next((m for m in marks if isinstance(m, Measure)), None)
    if measure is not None:
        units = [SI.unit(d).text for d in measure.dimensions] if measure.dimension != NUMBER else []
        return " or ".join(units)
    inner = [u for part in get_args(kind) if part is not Ellipsis and (u := _unit(part))]
    return inner[0] if inner and get_origin(kind) in (tuple, dict) else ""


def unit_table() -> str:
    """The units that there are."""
    rows: list[Cells] = []
    for name, dimension in DIMENSIONS.items():
        found = [f"`{u.text}`" for u in UNITS.values() if u.dimension == dimension]
        if found:
            rows.append((name.replace("_", " ") if dimension != NUMBER else "number", ", ".join(found)))
    return table(("quantity", "units"), rows)


def function_table() -> str:
    """What an expression may be made of."""
    rows: list[Cells] = [(f"`{operator}`", f"operator: {meaning}") for operator, meaning in OPERATORS.items()]
    for name in FUNCTIONS:
        low, high = ARGUMENTS.get(name, (1, 1))
        rows.append(
            (f"`{name}`", f"function of {count(low, 'argument') if low == high else f'{low} to {high} arguments'}")
        )
    rows += [(f"`{name}`", "constant") for name in CONSTANTS]
    return table(("name", "what it is"), rows)


def joint_table() -> str:
    """Joint types with the motions that they leave free, in the joint's own axes."""
    rows: list[Cells] = []
    for name, kind in JOINTS.items():
        free = [d for d in ("x", "y", "z", "rx", "ry", "rz") if d not in kind.blocked]
        if name == "universal":  # its row `rz` keeps the two axes at a right angle
            free = ["rx", "ry"]
        planar = "yes" if name in PLANAR_JOINTS else "no"
        rows.append((f"`{name}`", ", ".join(f"`{d}`" for d in free) or "none", planar))
    return table(("type", "free", "in the plane"), rows)
