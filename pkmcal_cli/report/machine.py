"""What a machine is: counts, mobility, parameters, drives."""

from __future__ import annotations

from typing import Any

from pkmcal_cli.base.plural import count
from pkmcal_cli.compiler import Compiled
from pkmcal_cli.language.machine import Machine
from pkmcal_cli.language.sections import nouns, sections_with
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.units.unit_text import parse_unit

_GAPS = 10  # gaps of the drawing that are listed


def machine_json(machine: Machine, compiled: Compiled) -> dict[str, Any]:
    """Counts and parameters."""
    found, model = compiled.mobility, compiled.model
    passive = sum(a.control == "passive" for a in machine.actuators.values())
    return {
        "machine": machine.files[0][0],
        "space": machine.space,
        "nodes": len(machine.nodes),
        "bodies": len(machine.bodies),
        "elements": {k: len(getattr(machine, k)) for k in sections_with("between")},
        "unknowns": model.exact.unknowns,
        "constraints": model.exact.constraints,
        "degrees_of_freedom": found.degrees_of_freedom,
        "actuators": found.actuators - passive,
        "passive": passive,
        "degree_of_redundancy": found.redundancy - passive,
        "self_stress": found.self_stress,
        "free_motions": list(found.free_motions),
        "gaps": [{"element": g.element, "strain": g.strain, "value": g.value} for g in compiled.gaps[:_GAPS]],
        "channels": [c.name for c in model.channels],
        "parameters": [
            {
                "name": p.name,
                "nominal": parse_unit(p.unit or "1").from_si(p.nominal),
                "range": p.range / parse_unit(p.unit or "1").scale,
                "unit": p.unit or "1",
                "identify": p.identify,
            }
            for p in model.parameters
        ],
    }


def show_machine(to: Reporter, machine: Machine, compiled: Compiled, r: dict[str, Any]) -> None:
    """The same in words and tables."""
    numbers = {"node": r["nodes"], "body": r["bodies"]} | {nouns()[k]: n for k, n in r["elements"].items()}
    parts = ", ".join(count(n, word) for word, n in numbers.items() if n)
    to.say(f"{r['machine']}: {r['space']}, {parts}")
    redundancy = r["degree_of_redundancy"]
    redundant = f"{count(redundancy, 'time')} redundant" if redundancy > 0 else "not redundant"
    stress = f"; {count(r['self_stress'], 'self-stress')} that no drive causes" if r["self_stress"] else ""
    freedom = count(r["degrees_of_freedom"], "degree") + " of freedom"
    passive = f", {count(r['passive'], 'passive drive')}" if r["passive"] else ""
    to.say(f"{freedom}, {count(r['actuators'], 'actuator')}: {redundant}{passive}{stress}")
    system = f"{count(r['unknowns'], 'unknown')}, {count(r['constraints'], 'constraint')}"
    to.say(f"{system}; channels {', '.join(r['channels']) or 'none'}")
    for motion in r["free_motions"]:
        to.say(f"free motion without load, held: {motion}")
    rows = [
        (p["name"], f"{p['nominal']:.8g}", f"+-{p['range']:.4g}", p["unit"], "" if p["identify"] else "not identified")
        for p in r["parameters"]
    ]
    to.table("Parameters", ("name", "nominal", "range", "unit", "remark"), rows)
    model = compiled.model
    drives = []
    for a, d, reading in zip(model.actuators, model.layout.drives, model.drawn_readings, strict=True):
        shown = f"{parse_unit(a.unit).from_si(float(reading)) + 0.0:.6g}"
        drives.append((a.name, shown, a.unit, _role(d.redundant, machine.actuators[a.name].control)))
    to.table("Actuators at the drawing", ("name", "reading", "unit", "remark"), drives)


def _role(redundant: bool, control: str) -> str:
    words = {"position": [], "force": ["force-controlled"], "passive": ["passive"]}[control]
    return ", ".join(["redundant", *words] if redundant and control != "passive" else words)
