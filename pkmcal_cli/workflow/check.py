"""What a machine is, and every fault of machine and tables."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import BadInput
from ..influence import idle_parameters
from ..loading import LoadedMachine, load_machine
from ..report.console import Reporter, emit_json
from ..unit_text import parse_unit


def run_check(path: str, measurements: tuple[str, ...], as_json: bool, quiet: bool) -> int:
    """Show and emit; 0 without faults, 1 with faults in tables or idle parameters. Raises BadInput for the machine."""
    to = Reporter(quiet)
    try:
        loaded = load_machine(path)
    except BadInput as error:
        if as_json:
            emit_json({"ok": False, "faults": [f.text() for f in error.faults]})
        to.warn(error.text())
        return 1
    result = _describe(loaded)
    faults = _idle(loaded)
    warnings = [f.text() for f in loaded.warnings]
    _show(to, loaded, result)
    for text in warnings:
        to.warn(text)
    for text in faults:
        to.warn(text)
    if measurements:
        result["measurements"], told = _check_tables(loaded, measurements, to)
        faults += told
    result |= {"ok": not faults, "faults": faults, "warnings": warnings}
    if as_json:
        emit_json(result)
    to.say("no faults" if not faults else f"{len(faults)} faults")
    return 1 if faults else 0


def _idle(loaded: LoadedMachine) -> list[str]:
    """Parameters that act nowhere by structure, as texts of faults."""
    source = loaded.machine.source
    return [
        source.fault(
            "idle-parameter",
            f"parameter `{name}` acts nowhere: no pose, strained or not, depends on it",
            ("parameters", name),
            "take it out, or correct the place that uses it",
            at_key=True,
        ).text()
        for name in idle_parameters(loaded.model)
    ]


def _describe(loaded: LoadedMachine) -> dict[str, Any]:
    """Counts and parameters."""
    machine, found, model = loaded.machine, loaded.compiled.mobility, loaded.model
    return {
        "machine": machine.files[0][0],
        "space": machine.space,
        "nodes": len(machine.nodes),
        "bodies": len(machine.bodies),
        "elements": {k: len(getattr(machine, k)) for k in ("beams", "bars", "ropes", "joints")},
        "unknowns": model.exact.unknowns,
        "constraints": model.exact.constraints,
        "degrees_of_freedom": found.degrees_of_freedom,
        "actuators": found.actuators,
        "degree_of_redundancy": found.redundancy,
        "self_stress": found.self_stress,
        "free_motions": list(found.free_motions),
        "gaps": [{"element": g.element, "strain": g.strain, "value": g.value} for g in loaded.compiled.gaps[:10]],
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


def _show(to: Reporter, loaded: LoadedMachine, r: dict[str, Any]) -> None:
    elements = ", ".join(f"{n} {k}" for k, n in r["elements"].items() if n)
    to.say(f"{r['machine']}: {r['space']}, {r['nodes']} nodes, {r['bodies']} bodies, {elements}")
    to.say(
        f"{r['degrees_of_freedom']} degrees of freedom, {r['actuators']} actuators: {r['degree_of_redundancy']} times "
        f"redundant; {r['self_stress']} self-stresses that no drive causes"
    )
    to.say(f"{r['unknowns']} unknowns, {r['constraints']} constraints; channels {', '.join(r['channels']) or 'none'}")
    for motion in r["free_motions"]:
        to.say(f"free motion without load, held: {motion}")
    rows = [
        (p["name"], f"{p['nominal']:.8g}", f"+-{p['range']:.4g}", p["unit"], "" if p["identify"] else "not identified")
        for p in r["parameters"]
    ]
    to.table("Parameters", ("name", "nominal", "range", "unit", "remark"), rows)
    drives = [
        (a.name, f"{parse_unit(a.unit).from_si(float(q)):.6g}", a.unit, _role(d.redundant, d.force_controlled))
        for a, d, q in zip(loaded.model.actuators, loaded.model.layout.drives, loaded.model.drawn_readings, strict=True)
    ]
    to.table("Actuators at the drawing", ("name", "reading", "unit", "remark"), drives)


def _role(redundant: bool, forced: bool) -> str:
    words = ["redundant"] if redundant else []
    return ", ".join([*words, "force-controlled"] if forced else words)


def _check_tables(
    loaded: LoadedMachine, paths: tuple[str, ...], to: Reporter
) -> tuple[dict[str, Any], list[str]]:
    """Faults of tables: reading, rows that cannot be predicted, gross mistakes."""
    from ..calibration.residual import evaluate, problem_of
    from ..loading import load_measurements
    from .hints import measurement_hints

    try:
        measured = load_measurements(loaded, paths)
    except BadInput as error:
        to.warn(error.text())
        return {"rows": 0}, [f.text() for f in error.faults]
    to.notes(measured.notes)
    problem = problem_of(loaded.model, measured)
    evaluation = evaluate(problem, loaded.model.nominal)
    prediction = evaluation.prediction
    faults = [f"{measured.place(int(k))}: {prediction.reason(int(k))}" for k in np.nonzero(~prediction.solved)[0]]
    faults += list(measurement_hints(loaded, problem, loaded.model.nominal))
    for text in faults:
        to.warn(text)
    to.say(f"{len(problem)} rows, {problem.count} measured values, {len(measured.sessions)} sessions")
    return {"rows": len(problem), "values": problem.count, "sessions": list(measured.sessions)}, faults
