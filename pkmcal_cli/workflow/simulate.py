"""Simulation from poses to a measurement table, block by block."""

from __future__ import annotations

import os
from functools import partial

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.base.files import is_stream
from pkmcal_cli.csv_files.origin import SIMULATED, Origin
from pkmcal_cli.csv_files.writer import check_table, open_writer
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.workflow.arguments import one_stdin, present
from pkmcal_cli.workflow.plots import check_plot, write_plot
from pkmcal_cli.workflow.simulation import Simulation, SimulationRequest, checked, simulation


def run_simulation(request: SimulationRequest) -> int:
    """Simulate and write; returns the exit code (1 when rows could not be solved). Raises PkmcalError."""
    target = _target(request)
    to = Reporter(request.quiet)
    made = simulation(request, to)
    head = provenance(made.inputs, seed=request.seed, noise=request.noise, method=request.method)
    origin = Origin("simulated", SIMULATED, head)
    writing = open_writer(target, made.columns, made.inputs, origin=origin, force=request.force)
    with writing as writer, to.progress("row", _total(made, request)) as tick:
        made.run(writer, tick)
    made.tell(to)
    if request.plot is not None:
        write_plot(made.kept.picture(made.loaded), request.plot, made.inputs, to, force=request.force)
    if request.as_json:
        emit_json(enveloped("simulate", "incomplete" if made.code else "complete", made.json(), head))
    return made.code


def _total(made: Simulation, request: SimulationRequest) -> int | None:
    """How many rows there are, for who watches; None of a stream."""
    if made.source.grid is not None:
        return made.source.total
    if request.poses is None or not os.path.isfile(request.poses):
        return None
    with open(request.poses, "rb") as file:
        return sum(block.count(b"\n") for block in iter(partial(file.read, 1 << 20), b"")) or None


def _target(request: SimulationRequest) -> str:
    """The target, when the arguments go together. Raises UsageError and OutputError."""
    checked(request)
    target = "-" if request.output is None else request.output
    if request.as_json and is_stream(target):
        raise UsageError("--json and the table both write to stdout", hint="write the table with `-o OUT.csv`")
    one_stdin(request.machine, request.poses, request.parameters)
    inputs = present(request.machine, request.poses, request.parameters)
    check_table(target, inputs, force=request.force)
    check_plot(request.plot, inputs, target, force=request.force)
    return target
