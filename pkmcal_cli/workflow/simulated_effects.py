"""Every effect of the catalogue, simulated on a machine at its plausible size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.problem import Problem, design_problem
from pkmcal_cli.compiler.placed_effects import absence
from pkmcal_cli.diagnosis.hypotheses import Candidates, candidates_of
from pkmcal_cli.diagnosis.simulated_effects import UNLOADED, simulated_effects
from pkmcal_cli.effects import catalogue
from pkmcal_cli.loading.covariates import with_sides
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine, load_parameters
from pkmcal_cli.loading.nearby_poses import nearby_poses
from pkmcal_cli.loading.poses import failed_rows
from pkmcal_cli.loading.workspace_poses import usable_workspace
from pkmcal_cli.model.effect_sites import places
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Prediction, Request, predict
from pkmcal_cli.report.analysis_report import UNSTRAINED
from pkmcal_cli.report.console import Reporter, emit_json, enveloped
from pkmcal_cli.report.effects_report import Absent, EffectsReport
from pkmcal_cli.report.loads import Loads
from pkmcal_cli.report.provenance import provenance
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.workflow.arguments import one_stdin, selection
from pkmcal_cli.workflow.effects_request import EffectsRequest
from pkmcal_cli.workflow.pose_set import PoseSet, pose_set
from pkmcal_cli.workflow.unstrained import is_unstrained

_POSES = 30  # that are drawn where none are given


def run_simulated_effects(machine: str, request: EffectsRequest) -> int:
    """Simulate and show; 0. Raises PkmcalError."""
    one_stdin(machine, request.poses, request.parameters)
    to = Reporter(request.quiet)
    loaded = load_machine(machine, receptive=True)
    for fault in loaded.warnings:
        to.warn(fault)
    poses = _poses(loaded, request, to)
    loaded = loaded.for_sessions(poses.every.rows.named_sessions)
    model = loaded.model
    start = load_parameters(model, request.parameters)
    for text in start.remarks(bool(poses.every.rows.named_sessions)):
        to.warn(text)
    selected = _selected(model, request.select)
    candidates = candidates_of(model, selected, with_sides(poses.every.rows, model))
    values = np.append(start.values, candidates.model.nominal[len(model.parameters) :])
    problem, still, poses = _predicted(to, loaded.machine.file_units, candidates.model, values, poses)
    with to.step("what each effect does"):
        simulated = simulated_effects(candidates, problem, values, selected, still)
    report = EffectsReport(problem.model, len(problem), simulated, _absent(loaded, model, candidates))
    report.show(to)
    Loads.of(problem.model, values, problem.rows, poses.poses.row_origin, still.start).show(to)
    unstrained = is_unstrained(loaded, request.parameters, problem.rows)
    if unstrained and any(s.reason == UNLOADED for s in simulated):
        to.say(UNSTRAINED)
    if request.as_json:
        inputs = loaded.inputs | start.inputs | poses.inputs
        emit_json(enveloped("effects", "complete", report.json(), provenance(inputs)))
    return 0


def _poses(loaded: LoadedMachine, request: EffectsRequest, to: Reporter) -> PoseSet:
    """The poses that are asked for, else some of the workspace, or within reach where none is declared."""
    if request.poses is not None or request.grid is not None or usable_workspace(loaded) is not None:
        return pose_set(to, loaded, request.poses, request.grid)
    poses = nearby_poses(loaded.model, _POSES)
    to.notes([f"no poses given: {len(poses)} are drawn within reach of the reference configuration"])
    return PoseSet(every=poses, kept=np.arange(len(poses)), skipping="pose")


def _selected(model: Model, text: str) -> tuple[str, ...]:
    """Parameters that a calibration identifies: none where a machine declares none."""
    some = any(p.identify for p in model.parameters)
    return selection(model, text) if some or text != "auto" else ()


def _predicted(
    to: Reporter, units: FileUnits, model: Model, values: Array, poses: PoseSet
) -> tuple[Problem, Prediction, PoseSet]:
    """What is read at the poses that can be predicted, and these; others are told. Raises BadInput where none can."""
    still = predict(model, values, with_sides(poses.poses.rows, model), Request(forces=True))
    if reasons := {int(k): still.reason(int(k)) for k in np.nonzero(~still.solved)[0]}:
        if len(reasons) == len(poses.kept):
            raise failed_rows(poses.poses.row_origin, reasons, len(poses.poses))
        return _predicted(to, units, model, values, poses.without(reasons))
    poses.failed.show(to)
    rows, measured = with_sides(poses.poses.rows, model), poses.poses.measured
    if not np.isfinite(still.values).any():
        to.notes(["no sensor reads anything at these poses: coordinates of the TCP are shown instead"])
        unit_of = {"length": units.length.text, "angle": units.angle.text}
        model = tcp_model(model)
        model = replace(model, channels=tuple(replace(c, unit=unit_of[c.dimension]) for c in model.channels))
        still, measured = predict(model, values, rows, Request(forces=True), still.start), None
    problem = design_problem(model, rows, measured)
    return replace(problem, measured=problem.measured & np.isfinite(still.values)), still, poses


def _absent(loaded: LoadedMachine, model: Model, candidates: Candidates) -> tuple[Absent, ...]:
    """Effects that are not simulated, and why: no place, no column, there already."""
    nowhere = [
        Absent(e.keyword, "", absence(loaded.machine, model.sites, e))
        for e in catalogue().values()
        if not places(model.sites, e, ("SESSION",))
    ]
    lacking = [Absent(keyword, at, f"it needs {need}") for keyword, at, need in candidates.lacking]
    declared = [Absent(e.effect.keyword, e.at, "the machine file declares it") for e in model.effects]
    return (*nowhere, *lacking, *declared)
