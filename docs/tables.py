"""Rewrites the tables between `<!-- table: NAME -->` and `<!-- end -->` from the code and the machine files.

`python -m docs.tables` (from the repository's folder); a test fails while a table is stale.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path
from typing import Any, get_args

import yaml

from docs import message_table, model_tables
from docs.model_tables import table
from pkmcal_cli.base.plural import count
from pkmcal_cli.compiler import compile_machine
from pkmcal_cli.effects import ENTRIES, STAGES, EffectParameter, catalogue
from pkmcal_cli.elements.joint import JOINTS
from pkmcal_cli.language.instruments import KINDS, Actuator
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.machine_yaml import read_machine
from pkmcal_cli.report.outputs.keys import COMMON, keys_of
from pkmcal_cli.report.outputs.schema import all_outputs
from pkmcal_cli.sensors import sensor_kinds

ROOT = Path(__file__).resolve().parents[1]
MACHINES = ROOT / "machines"
_ALL = (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), MACHINES / "README.md")
PAGES = tuple(sorted(page for page in _ALL if "<!-- table: " in page.read_text(encoding="utf-8")))
"""Pages with tables that are made."""
BLOCK = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def description(file: Path) -> str:
    """The first sentence of the comment at the head of a machine file."""
    lines = file.read_text(encoding="utf-8").splitlines()
    head = takewhile(lambda line: line.startswith("#"), lines)
    comment = [line.removeprefix("#").strip() for line in head if "yaml-language-server" not in line]
    return " ".join(comment).split(". ")[0].rstrip(".")


def machine_files() -> list[Path]:
    """The shipped machines, by name."""
    return sorted(f for f in MACHINES.glob("*.yaml") if "." not in f.stem)


def data_files(machine: str) -> list[Path]:
    """The measurements of a machine: tables of its name, or of its name and more, unless another machine has that."""
    others = {f.stem for f in machine_files()} - {machine}
    found = (f for f in MACHINES.glob("*.csv") if re.fullmatch(rf"{re.escape(machine)}([_-].*)?", f.stem))
    return sorted(f for f in found if f.stem not in others)


def _drives(file: Path) -> str:
    """ "planar, 2 degrees of freedom, 3 drives" """
    machine = read_machine(file)
    found = compile_machine(machine).mobility
    return f"{machine.space}, {count(found.degrees_of_freedom, 'degree')} of freedom, {count(found.actuators, 'drive')}"


def machines() -> str:
    """The shipped machines."""
    rows = []
    for file in machine_files():
        rows.append((f"`{file.name}`", description(file), _drives(file), _measured(file)))
    return table(("machine file", "description", "space, degrees of freedom, drives", "measurements"), rows)


def _measured(file: Path) -> str:
    """Names of a machine's tables, whether they are real, and under which licence."""
    data = data_files(file.stem)
    if not data:
        return ""
    names = ", ".join(f"`{f.name}`" for f in data)
    if _provenance(data[0]) is not None:
        return f"{names}, simulated"
    licence = file.with_suffix(".LICENSE.txt")
    title = licence.read_text(encoding="utf-8").splitlines()[0]
    return f"{names}, real ({title}: `{licence.name}`)"


def _provenance(data: Path) -> dict[str, Any] | None:
    beside = data.with_name(data.name + ".provenance.yaml")
    return yaml.safe_load(beside.read_text(encoding="utf-8")) if beside.exists() else None


def measurements() -> str:
    """The files of measurements: how many rows, what noise, from which seeds."""
    rows = []
    for file in (f for m in machine_files() for f in data_files(m.stem)):
        count = len(file.read_text(encoding="utf-8").splitlines()) - 1
        made = _provenance(file)
        if made is None:
            rows.append((f"`{file.name}`", str(count), "real", "", ""))
            continue
        noise = ", ".join(f"{kind} {sigma}" for kind, sigma in made["noise"]["standard_deviation"].items())
        seeds = f"{made['seed']['errors']}, {made['seed']['noise']}"
        rows.append((f"`{file.name}`", str(count), made["kind"], noise, seeds))
    return table(("file", "rows", "data", "noise (standard deviation)", "seeds of errors, noise"), rows)


def kinds() -> str:
    """What a machine can be made of."""
    members = [f"{Machine.model_fields[s].description}" for s in ("beams", "bars", "ropes")]
    joints = [f"`{name}`" for name in JOINTS]
    drives = [f"{kind}: `{key}` a {_lower(Actuator, key)}" for key, kind in KINDS.items()]
    control = Actuator.model_fields["control"].annotation
    words = " or ".join(get_args(control))
    rows = [
        ("members", "; ".join(text[0].lower() + text[1:] for text in members)),
        ("joints", ", ".join(joints) + "; ideal, or with stiffness by direction"),
        ("actuators", "; ".join(drives) + f"; in {words} control, ideal or with a stiffness"),
        (
            "sensors",
            ", ".join(f"`{k}`" for k in sensor_kinds()) + "; readings of drives that are not position-controlled",
        ),
    ]
    return table(("section", "kinds"), rows)


def instruments() -> str:
    """Which instrument goes where: kinds of sensors."""
    rows = [
        (
            k.instruments,
            f"`{k.keyword}`",
            k.title,
            ", ".join(f"`{n}`" for n in k.needs),
            ", ".join(f"`{n}`" for n in k.may),
        )
        for k in sensor_kinds().values()
    ]
    rows.append(
        (
            "encoder of a force-controlled or passive drive",
            "",
            "the drive's reading",
            "`control`, `sigma` of the actuator",
            "",
        )
    )
    return table(("instrument", "`kind`", "what it reads", "required besides `sigma`", "optional keys"), rows)


def _lower(model: type[Actuator], key: str) -> str:
    text = str(model.model_fields[key].description).partition(" (")[0]
    return text[0].lower() + text[1:]


def plausible(parameter: EffectParameter) -> str:
    """The plausible range, with that of drives that turn where it differs."""
    text = f"+-{parameter.range:g} {parameter.unit if parameter.unit != '1' else ''}".rstrip()
    turning = f" (turning: +-{parameter.range_in(True):g} {parameter.rotary})" if parameter.rotary else ""
    return text + turning


def effects() -> str:
    """The catalogue of effects."""
    rows = [
        (
            f"`{e.keyword}`",
            e.title + (f" ({e.symbol})" if e.symbol else ""),
            f"{STAGES[e.enters]}: {ENTRIES[e.enters]}",
            "; ".join(f"`{p.name}` {p.text}, {plausible(p)}" for p in e.parameters),
            ", ".join(e.needs),
            e.source,
        )
        for e in catalogue().values()
    ]
    head = ("keyword", "effect", "where it enters", "parameters and plausible range", "needs", "source")
    return table(head, rows)


TABLES: dict[str, Callable[[], str]] = {
    "machines": machines,
    "measurements": measurements,
    "kinds": kinds,
    "instruments": instruments,
    "effects": effects,
    "units": model_tables.unit_table,
    "functions": model_tables.function_table,
    "joints": model_tables.joint_table,
    "machine_messages": message_table.machine_messages,
    "table_messages": message_table.table_messages,
    "result_messages": message_table.result_messages,
    "message_texts": message_table.message_texts,
}


def json_keys(name: str) -> str:
    """Keys of an output: of every one, or `COMMAND`, or `COMMAND_2` for the second part of what it writes."""
    command, _, part = name.partition("_")
    keys = keys_of(COMMON) if command == "every" else all_outputs()[command].parts[int(part or 1) - 1]
    return table(("key", "meaning"), [(f"`{key.path}`", key.meaning) for key in keys])


def rows_of(name: str) -> str:
    """The first rows of a shipped table, `-` of its name written `_`; where rows have partners, one that has."""
    file = next(f for f in MACHINES.glob("*.csv") if f.stem.replace("-", "_") == name)
    head, *rows = (line.split(",") for line in file.read_text(encoding="utf-8").splitlines())
    partners = [row for row in rows if "to" in head and row[head.index("to")]]
    return table(tuple(head), [tuple(row) for row in (*rows[:3], *partners[:1])])


def made(name: str) -> str:
    """The table of this name; a model's name stands for its keys, `json_COMMAND` for those of an output, `rows_FILE`
    for the first rows of a shipped table.
    """
    if name.startswith("json_"):
        return json_keys(name.removeprefix("json_"))
    if name.startswith("rows_"):
        return rows_of(name.removeprefix("rows_"))
    return TABLES[name]() if name in TABLES else model_tables.model_table(model_tables.models()[name])


def renewed(text: str) -> str:
    """A page with its tables made anew."""
    return BLOCK.sub(lambda found: f"{found[1]}{made(found[2])}\n{found[3]}", text)


def main() -> None:
    """Rewrite the pages."""
    for page in PAGES:
        page.write_text(renewed(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
