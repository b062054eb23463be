"""What changed parameters do to the tool point, all over the workspace."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.errors import BadInput
from pkmcal_cli.base.listener import Listener
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.calibration.comparison import Estimate
from pkmcal_cli.loading.known_parameters import KnownParameters
from pkmcal_cli.loading.load_machine import LoadedMachine, load_machine
from pkmcal_cli.loading.workspace_poses import workspace_poses
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.model.workspace import Workspace
from pkmcal_cli.prediction import Prediction, Request, predict
from pkmcal_cli.report.comparison import ToolChange
from pkmcal_cli.units.file_units import FileUnits
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.workflow.run_folder import INPUTS

_POSES = 200


def tool_change(
    machine: str | None, files: Sequence[str], known: Sequence[KnownParameters], changes: Estimate, to: Listener
) -> ToolChange | str:
    """Of the positions of the tool point, or its orientations where it only turns, or why it cannot be told.

    Raises BadInput for a machine that was named.
    """
    loaded = load_machine(machine) if machine is not None else _machine(files, known)
    if loaded is None:
        return "the machine file is not found, or has changed; name it with `--machine M.yaml`"
    model = loaded.model
    names = [n for n in changes.names if n in model.names]
    if not names:
        return "no parameter that the machine has was identified in all files"
    workspace = model.workspace or _measured(model, known)
    if workspace is None or not model.tool_motion.shown:
        return "the machine declares no `workspace`, and not all files say where they measured with each of its drives"
    try:
        poses, _ = workspace_poses(loaded, workspace, _POSES, to)
    except BadInput:
        return "the machine reaches no pose of its workspace"
    values = model.nominal
    for name, value in known[0].values.items():
        if name in model.names:
            values[model.names.index(name)] = value
    tool = tcp_model(model)
    prediction = predict(tool, values, poses.rows, Request(parameters=tuple(names)))
    good, over = prediction.solved, "workspace"
    if model.workspace is None:
        good, over = good & _within(tool, prediction.values, known), "measured travel"
    if not good.any():
        return "no pose of the workspace can be predicted"
    return _change(tool, prediction, good, changes, names, over=over, units=loaded.machine.file_units)


def _change(
    tool: Model,
    prediction: Prediction,
    good: NDArray[np.bool_],
    changes: Estimate,
    names: list[str],
    *,
    over: str,
    units: FileUnits,
) -> ToolChange:
    """By derivatives of poses with respect to parameters `names`, of good rows (N,)."""
    turns = tool.tool_motion.only_turns
    columns = tool.measuring(Measurand.ORIENTATION if turns else Measurand.POSITION)
    assert prediction.jacobian is not None
    jacobian = prediction.jacobian[good][:, columns]  # (n, c, k)
    keep = [changes.names.index(n) for n in names]
    move = jacobian @ changes.values[keep]
    spread, chance = (_sizes(jacobian, m[np.ix_(keep, keep)]) for m in (changes.covariance, changes.null))
    size = np.sqrt((move**2).sum(axis=1))
    worst = int(np.argmax(size))
    axes = dict(zip((tool.channels[k].name for k in columns), prediction.values[good][worst, columns], strict=True))
    return ToolChange(
        rms=float(np.sqrt((size**2).mean())),
        rms_by_chance=float(np.sqrt((chance**2).mean())),
        largest=float(size[worst]),
        std=float(spread[worst]),
        where={axis: float(v) for axis, v in axes.items()},
        count=int(good.sum()),
        over=over,
        alone=names[0] if changes.alone else None,
        turns=turns,
        file_unit=units.angle if turns else units.length,
    )


def _sizes(jacobian: Array, covariance: Array) -> Array:
    """Standard uncertainties (n,) of positions or orientations by a covariance of parameters."""
    return np.asarray(np.sqrt(np.maximum(np.einsum("ncp,pq,ncq->n", jacobian, covariance, jacobian), 0.0)))


def _measured(model: Model, known: Sequence[KnownParameters]) -> Workspace | None:
    """Where no workspace is declared: the travel of the drives in which all files measured."""
    ranges = []
    for actuator in model.actuators:
        ends = [k.evidence.measured.get(actuator.name) for k in known if k.evidence is not None]
        both = [e for e in ends if e is not None]
        if len(both) < len(known):
            return None
        ranges.append((max(e[0] for e in both), min(e[1] for e in both)))
    drives = np.array(ranges)
    if (drives[:, 0] >= drives[:, 1]).any():
        return None
    return Workspace.of_drives(drives)


def _within(tool: Model, values: Array, known: Sequence[KnownParameters]) -> NDArray[np.bool_]:
    """Poses (N, c) between the coordinates that the tool point had in all files: with drives at both ends of their
    travel it may be far beyond these, and next to a singular pose."""
    inside = np.ones(len(values), dtype=bool)
    for evidence in (k.evidence for k in known if k.evidence is not None):
        for k, channel in enumerate(tool.channels):
            low, high = evidence.reached.get(channel.name, (-np.inf, np.inf))
            inside &= (values[:, k] >= low) & (values[:, k] <= high)
    return inside


def _machine(files: Sequence[str], known: Sequence[KnownParameters]) -> LoadedMachine | None:
    """The machine of which a parameter file says it is, if it is where it was, or beside the file."""
    for file, k in zip(files, known, strict=True):
        if k.fingerprint is None or not k.fingerprint.of:
            continue
        name, folder = k.fingerprint.of, os.path.dirname(file)
        base = os.path.basename(name)
        kept = sorted(str(p) for p in Path(folder, INPUTS).rglob("*.yaml") if p.name == base)
        for path in (*kept, name, os.path.join(folder, base)):
            if not os.path.isfile(path):
                continue
            try:
                loaded = load_machine(path)
            except BadInput:
                continue
            if loaded.model.fingerprint.difference(k.fingerprint) is None:
                return loaded
    return None
