"""What a machine is: counts, mobility, parameters, drives."""

from __future__ import annotations

from typing import Any

import numpy as np

from pkmcal_cli.base.plural import count
from pkmcal_cli.compiler import Compiled
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.sections import nouns, sections_with
from pkmcal_cli.language.tool_point import tool_point_of
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_motion import DIRECTIONS
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.limitations import limitations
from pkmcal_cli.report.number_format import finite, nominal_number, to_digits
from pkmcal_cli.units.unit_text import parse_unit

_GAPS = 10  # gaps of the reference configuration that are listed


def machine_json(machine: Machine, compiled: Compiled) -> dict[str, Any]:
    """Counts and parameters."""
    mobility, model = compiled.mobility, compiled.model
    passive, tool = sum(a.control == "passive" for a in machine.actuators.values()), tool_point_of(machine)
    return {
        "machine": machine.files[0][0],
        "space": machine.space,
        "nodes": len(machine.nodes),
        "bodies": len(machine.bodies),
        "elements": {k: len(getattr(machine, k)) for k in sections_with("between")},
        "unknowns": model.exact.unknowns,
        "constraints": model.exact.constraints,
        "degrees_of_freedom": mobility.degrees_of_freedom,
        "actuators": mobility.actuators - passive,
        "passive": passive,
        "degree_of_redundancy": mobility.redundancy - passive,
        "self_stress": mobility.self_stress,
        "free_motions": list(mobility.free_motions),
        "gaps": [{"element": g.element, "strain": g.strain, "value": g.value} for g in compiled.gaps[:_GAPS]],
        "channels": [c.name for c in model.channels],
        "tool_point": tool.name if tool is not None else None,
        "workspace": _workspace(machine, model),
        "limitations": limitations(machine, model),
        "parameters": [
            {
                "name": p.name,
                "nominal": parse_unit(p.unit or "1").from_si(p.nominal),
                "range": p.range / parse_unit(p.unit or "1").scale,
                "unit": p.unit or "1",
                "identify": p.identify,
                "fixed": p.fixed,
            }
            for p in model.parameters
        ],
    }


def _spread(parameter: dict[str, Any]) -> str:
    """The range, "" where it is exact."""
    return "" if parameter["fixed"] else f"+-{to_digits(parameter['range'], 4)}"


def _remark(parameter: dict[str, Any]) -> str:
    """Whether a parameter is exact, or not identified."""
    if parameter["fixed"]:
        return "exact"
    return "" if parameter["identify"] else "not identified"


def show_machine(to: Reporter, machine: Machine, compiled: Compiled, r: dict[str, Any], *, tables: bool) -> None:
    """The same in words, and in tables of parameters, drives and workspace if these are wanted."""
    numbers = {"node": r["nodes"], "body": r["bodies"]} | {nouns()[k]: n for k, n in r["elements"].items()}
    parts = ", ".join(count(n, word) for word, n in numbers.items() if n)
    to.say(f"{r['machine']}: {r['space']}, {parts}")
    redundancy = r["degree_of_redundancy"]
    redundant = f"degree of redundancy: {redundancy}" if redundancy > 0 else "not redundant"
    if not r["degrees_of_freedom"] and not machine.actuators:
        redundant = "a frame"
    stress = f"; {count(r['self_stress'], 'self-stress')} not caused by a drive" if r["self_stress"] else ""
    freedom = count(r["degrees_of_freedom"], "degree") + " of freedom"
    passive = f", {count(r['passive'], 'passive drive')}" if r["passive"] else ""
    to.say(f"{freedom}, {count(r['actuators'], 'actuator')}{passive}; {redundant}{stress}")
    system = f"{count(r['unknowns'], 'unknown')}, {count(r['constraints'], 'constraint')}"
    to.say(f"{system}; channels: {', '.join(r['channels']) or 'none'}")
    tool = tool_point_of(machine)
    to.say(tool.text if tool is not None else "tool point: none")
    for limit in r["limitations"]:
        to.say(f"not possible without {limit['lacking']}: {', '.join(limit['rules_out'])}; {limit['remedy']}")
    for motion in r["free_motions"]:
        to.say(f"free motion without load (held fixed): {motion}")
    if tables:
        _show_tables(to, machine, compiled, r)


def _show_tables(to: Reporter, machine: Machine, compiled: Compiled, r: dict[str, Any]) -> None:
    """Parameters, drives and workspace."""
    rows = [
        (p["name"], nominal_number(p["nominal"], p["range"]), _spread(p), p["unit"], _remark(p))
        for p in r["parameters"]
    ]
    if rows:
        to.table("Parameters", ("name", "nominal", "range", "unit", "remark"), rows)
    model = compiled.model
    drives = []
    for a, d, reading in zip(model.actuators, model.topology.drives, model.reference_readings, strict=True):
        shown = f"{parse_unit(a.unit).from_si(float(reading)) + 0.0:.6g}"
        drives.append((a.name, shown, parse_unit(a.unit).text, _role(d.redundant, machine.actuators[a.name].control)))
    if drives:
        to.table("Actuators in the reference configuration", ("name", "reading", "unit", "remark"), drives)
    limits = [(w["name"], *(_end(w[k]) for k in ("low", "high")), w["unit"]) for w in r["workspace"]]
    if limits:
        to.table("Workspace" + _round(machine), ("name", "low", "high", "unit"), limits)


def _workspace(machine: Machine, model: Model) -> list[dict[str, Any]]:
    """What the workspace limits: coordinates of the tool point, by box and cylinder, and drives."""
    if model.workspace is None:
        return []
    units, (low, high) = machine.file_units, model.workspace.bounds
    coordinate_units = [units.angle if c.startswith("r") else units.length for c in DIRECTIONS]
    ends = [*zip(DIRECTIONS, low, high, coordinate_units, strict=True)]
    ends += [(a.name, *model.workspace.drives[k], parse_unit(a.unit)) for k, a in enumerate(model.actuators)]
    return [
        {"name": name, "low": finite(unit.from_si(one)), "high": finite(unit.from_si(other)), "unit": unit.text}
        for name, one, other, unit in ends
        if np.isfinite([one, other]).any()
    ]


def _end(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _round(machine: Machine) -> str:
    """What of the workspace the table of its limits does not show."""
    return "" if machine.workspace is None or machine.workspace.cylinder is None else ", within its cylinder"


def _role(redundant: bool, control: str) -> str:
    words = {"position": [], "force": ["force-controlled"], "passive": ["passive"]}[control]
    return ", ".join(["redundant", *words] if redundant and control != "passive" else words)
