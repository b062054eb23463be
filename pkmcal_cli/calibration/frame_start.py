"""Where instruments of unknown pose stand, roughly: the rigid motion from nominal to measured positions.

Kabsch 1976: the best rotation between two sets of points, by a singular value decomposition. Where coordinates are
missing, Gauss-Newton's method from the motions that turn axes onto axes. Where places tell no rotation (there are none,
or the point hardly moves, as in the middle of an orienting machine), orientations do.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import permutations, product

import numpy as np

from pkmcal_cli.base.rotation import Array, best_motion, best_rotation, exp, log, skew
from pkmcal_cli.calibration.fitted_frames import fitted_frames, frame_motion
from pkmcal_cli.model.effect_sites import PlacedEffect
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.observed import PlacedSensor
from pkmcal_cli.prediction import Rows, predict

_FEWEST = 3  # points that fix a pose
_SPARE = 2  # readings more than a pose has freedoms, where some coordinates are missing
_STEPS = 30  # of Gauss-Newton's method, which takes some ten
_STILL = 1e-6  # sizes of the machine: points that move less tell no rotation
_MOVED = 1e-2  # sizes of the machine, or rad: by which an instrument was moved, and no error of geometry moves it


def with_frames(model: Model, rows: Rows, readings: Array) -> Model:
    """The model with nominal poses of fitted frames that suit readings (N, C), nan where nothing was measured.

    Sensors of which rows give too few coordinates stay where they are.
    """
    nominal, known = model.nominal, model.by_name(model.nominal)
    fitted = [
        e for e in fitted_frames(model) if not any(known[n] for n in e.parameters)
    ]  # the machine file says where others stand
    if not fitted:
        return model
    predicted = predict(model, nominal, rows).values
    for effect in fitted:
        in_session = rows.columns.get(f"session.{effect.session}")
        seen = readings if in_session is None else np.where(in_session[:, None] > 0, readings, np.nan)
        for name, value in _pose(model, effect, predicted, seen).items():
            nominal[model.names.index(name)] = value
    return model.with_nominal(nominal)


def _pose(model: Model, effect: PlacedEffect, predicted: Array, readings: Array) -> dict[str, float]:
    """Values of the frame's parameters by name; none where too little was measured."""
    axes = 2 if model.topology.planar else 3
    sensors = [sensor for sensor in model.sensors if sensor.name == effect.at]
    pairs = [_places(sensor, axes, predicted, readings) for sensor in sensors]
    here, there = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    motion = _motion_of(here, there) if _spread(here) > _STILL * model.length else None
    motion = motion or _motion_by_orientations(sensors, predicted, readings, here, there)
    if motion is None:
        return {}
    rotation, shift = motion
    full = np.eye(3)
    full[:axes, :axes] = rotation
    vector = log(full[None])[0]
    by_axis = {f"t{c}": float(v) for c, v in zip("xyz", shift, strict=False)}
    by_axis |= {f"r{c}": float(v) for c, v in zip("xyz", vector, strict=True)}
    tail = f"[{effect.session}]"
    by_short = {name.removesuffix(tail).rpartition(".")[2]: name for name in effect.parameters}
    return {by_short[short]: value for short, value in by_axis.items() if short in by_short}


def _places(sensor: PlacedSensor, axes: int, predicted: Array, readings: Array) -> tuple[Array, Array]:
    """Places (n, d) where a point is predicted and where it was measured, nan in coordinates that were not."""
    channels = [channel for channel, _ in sorted(sensor.places, key=lambda pair: pair[1])]
    if len(channels) < axes:
        return np.zeros((0, axes)), np.zeros((0, axes))
    known = np.isfinite(readings[:, channels]).any(axis=1) & np.isfinite(predicted[:, channels]).all(axis=1)
    return predicted[known][:, channels], readings[known][:, channels]


def _spread(here: Array) -> float:
    """How far points (n, d) lie beside the line, or in the plane the point, about which they tell no rotation, m."""
    if len(here) < 2:
        return 0.0
    sizes = np.linalg.svd(here - here.mean(axis=0), compute_uv=False)
    return float(sizes[here.shape[1] - 2] / np.sqrt(len(here)))


def _motion_by_orientations(
    sensors: Sequence[PlacedSensor], predicted: Array, readings: Array, here: Array, there: Array
) -> tuple[Array, Array] | None:
    """Rotation (d, d) that brings predicted orientations closest to measured ones, and shift (d,) of their middle.

    None where no orientation was measured whole.
    """
    axes = here.shape[1]
    pairs = [_orientations(sensor, axes, predicted, readings) for sensor in sensors]
    turned, seen = (np.concatenate(parts)[:, :axes, :axes] for parts in zip(*pairs, strict=True))
    if not len(turned):
        return None
    columns = turned.transpose(0, 2, 1).reshape(-1, axes), seen.transpose(0, 2, 1).reshape(-1, axes)
    rotation = best_rotation(*columns)
    left = there - here @ rotation.T
    known = np.isfinite(left).any(axis=0)
    return rotation, np.array([np.nanmean(left[:, k]) if known[k] else 0.0 for k in range(axes)])


def _orientations(sensor: PlacedSensor, axes: int, predicted: Array, readings: Array) -> tuple[Array, Array]:
    """Rotation matrices (n, 3, 3) that are predicted of a body and that were measured, of rows that read all angles."""
    pairs = sorted(sensor.rotates, key=lambda pair: pair[1])
    if len(pairs) < axes * (axes - 1) // 2:
        return np.zeros((0, 3, 3)), np.zeros((0, 3, 3))
    channels = [channel for channel, _ in pairs]
    known = np.isfinite(readings[:, channels]).all(axis=1) & np.isfinite(predicted[:, channels]).all(axis=1)
    padding = (0, 0), (3 - len(channels), 0)
    here, there = (exp(np.pad(values[known][:, channels], padding)) for values in (predicted, readings))
    return here, there


def _motion_of(here: Array, there: Array) -> tuple[Array, Array] | None:
    """Rotation (d, d) and shift (d,) that bring points `here` (n, d) closest to `there` (n, d), nan where not known.

    None where too little is known.
    """
    whole = np.isfinite(there).all(axis=1)
    if whole.sum() >= _FEWEST:
        return best_motion(here[whole], there[whole])
    axes = here.shape[1]
    freedoms = axes * (axes + 1) // 2
    if len(here) < _FEWEST or np.isfinite(there).sum() < freedoms + _SPARE:
        return None
    ends = [end for begin in _axes_onto_axes(axes) if (end := _nearest_motion(begin, here, there)) is not None]
    left, rotation, shift = min(ends, key=lambda end: end[0], default=(np.inf, np.eye(axes), np.zeros(axes)))
    return (rotation, shift) if np.isfinite(left) else None


def _axes_onto_axes(axes: int) -> Iterator[Array]:
    """The rotations (d, d) that turn coordinate axes onto coordinate axes: 24 in space, 4 in the plane."""
    for order in permutations(range(axes)):
        for signs in product((1.0, -1.0), repeat=axes):
            rotation = np.eye(axes)[list(order)] * np.array(signs)[:, None]
            if np.linalg.det(rotation) > 0:
                yield rotation


def _nearest_motion(rotation: Array, here: Array, there: Array) -> tuple[float, Array, Array] | None:
    """Sum of squares left, rotation and shift where Gauss-Newton's method ends; None where the motion is not unique."""
    axes, known = here.shape[1], np.isfinite(there)
    shift = np.zeros(axes)
    for _ in range(_STEPS):
        turned = here @ rotation.T
        by_turn = -skew(np.pad(turned, ((0, 0), (0, 3 - axes))))[:, :axes, 3 - axes * (axes - 1) // 2 :]
        columns = np.concatenate([by_turn, np.broadcast_to(np.eye(axes), (len(here), axes, axes))], axis=2)[known]
        step, _, rank, _ = np.linalg.lstsq(columns, (there - turned - shift)[known], rcond=1e-9)
        if rank < columns.shape[1]:
            return None
        about = np.pad(step[:-axes], (3 - len(step[:-axes]), 0))
        rotation, shift = exp(about[None])[0][:axes, :axes] @ rotation, shift + step[-axes:]
    left = (there - here @ rotation.T - shift)[known]
    return float(left @ left), rotation, shift


def at_frames(values: Array, declared: Model, placed: Model) -> Array:
    """Parameter values (P,) with the poses of frames that `placed` found, where they are as declared."""
    nominal = declared.nominal
    return np.where(values == nominal, placed.nominal, values)


def moved_instruments(values: Array, declared: Model, placed: Model, selected: Collection[str]) -> list[str]:
    """Names of instruments whose frames are held, at values (P,), far from where their readings put them.

    `placed`: the model with the poses that `with_frames` found; what the machine file states is not doubted.
    """
    index, moved = {n: k for k, n in enumerate(placed.names)}, []
    for effect in fitted_frames(placed):
        at = [index[n] for n in effect.parameters]
        if set(selected).isdisjoint(effect.parameters) and (placed.nominal[at] != declared.nominal[at]).any():
            (held, shift), (seen, shifted) = (frame_motion(effect, v[at]) for v in (values, placed.nominal))
            angle = float(np.linalg.norm(log(exp(held[None]).transpose(0, 2, 1) @ exp(seen[None]))))
            if max(float(np.linalg.norm(shifted - shift)) / placed.length, angle) > _MOVED:
                moved.append(effect.name)
    return moved
