"""How sure the TCP is after a calibration, at every position, as `correct` tells it of its set values.

The parameters' covariance carried to its coordinates, what shapes do not know between their knots, sides of approach
that nobody knows, and what the calibration left beyond noise. Where an instrument that may stand anywhere reads the
TCP, its readings are the coordinates: the base, in whose axes nobody measured, is known far worse than they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pkmcal_cli.base.errors import BadInput, Location, UsageError
from pkmcal_cli.base.rotation import Array
from pkmcal_cli.loading.evidence import Evidence
from pkmcal_cli.loading.load_machine import Start
from pkmcal_cli.loading.poses import RowOrigin
from pkmcal_cli.model.commanded import per_command
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Request, Rows, WarmStart, predict
from pkmcal_cli.prediction.unknown_shapes import between_knots
from pkmcal_cli.prediction.unknown_sides import side_sigma
from pkmcal_cli.report.number_format import finite, small_unit, three_digits
from pkmcal_cli.units.measurands import Measurand
from pkmcal_cli.units.unit_text import Unit


@dataclass(kw_only=True)
class ErrorMap:
    """Standard uncertainties of TCP coordinates, block by block; `covariance` (p, p) of `names`, SI.

    unexplained: what the calibration left beyond noise, of a coordinate, m, and of an orientation, rad; machine: the
    model with its own channels; file_unit: of lengths in the machine file.
    """

    machine: Model
    model: Model
    file_unit: Unit
    values: Array
    names: tuple[str, ...]
    covariance: Array
    unexplained: tuple[float, float] = (0.0, 0.0)
    rows: int = 0
    squares: float = 0.0  # of the position's uncertainty, m^2
    worst: tuple[float, str] = (0.0, "")

    @classmethod
    def of(cls, model: Model, start: Start, path: str | None, method: str, file_unit: Unit) -> ErrorMap:
        """From a parameter file; file_unit: of lengths in the machine file.

        Raises UsageError and BadInput where there is nothing to carry.
        """
        if path is None:
            raise UsageError(
                "--uncertainty needs a calibration", hint="add `-p PARAMS.yaml`, written by `calibrate -o`"
            )
        if method != "exact":
            raise UsageError("--uncertainty needs the exact method", hint="leave out `--method`")
        if start.covariance is None:
            message = (
                "this parameter file has no `correlations` with `std`, so the uncertainty of its values is unknown"
            )
            raise BadInput.single(message, Location(path), "write it with `pkmcal calibrate -o`", "parameters")
        names, matrix = start.covariance
        left = (start.evidence or Evidence({})).of_tool
        return cls(
            machine=model,
            model=tcp_model(model),
            file_unit=file_unit,
            values=start.values,
            names=names,
            covariance=matrix,
            unexplained=left,
        )

    @cached_property
    def columns(self) -> list[tuple[str, str]]:
        """Headers and units."""
        channels = list(self.model.channels)
        for k, j in self.read.items():
            channels[k] = self.machine.channels[j]
        return [(f"u.{c.name}", self._unit(c.dimension)) for c in channels]

    @cached_property
    def read(self) -> dict[int, int]:
        """Coordinates that an instrument with a fitted frame reads, by its channels; none where one is aligned."""
        machine, out = self.machine, dict[int, int]()
        if not {machine.channels[k].instrument for k in machine.measuring(Measurand.POSITION)} <= machine.fitted_frames:
            return {}
        for j, read in enumerate(machine.channels):
            for k, c in enumerate(self.model.channels):
                if (read.measurand, read.index, read.component) == (c.measurand, c.index, c.component):
                    out.setdefault(k, j)
        return out

    def _unit(self, dimension: str) -> str:
        return "um" if dimension == "length" else "urad"

    def cells(self, rows: Rows, start: WarmStart, places: Mapping[int, RowOrigin]) -> list[Array]:
        """Standard uncertainties (N,), SI, of each coordinate, of rows that are solved; there may be none."""
        if not places:
            return [np.zeros(0) for _ in self.columns]
        variance = self._variance(self.model, rows, start)
        if self.read:
            of_readings = self._variance(self.machine, rows, start)
            variance[:, list(self.read)] = of_readings[:, list(self.read.values())]
        turning = [c.measurand is Measurand.ORIENTATION for c in self.model.channels]
        u = np.hypot(np.sqrt(np.maximum(variance, 0.0)), np.where(turning, *self.unexplained[::-1]))
        self._count(u, places)
        return list(u.T)

    def _variance(self, model: Model, rows: Rows, start: WarmStart) -> Array:
        """Variances (N, C), SI, of the channels of a model, but for what is unexplained."""
        moved = side_sigma(model, rows, dict(zip(model.names, self.values.tolist(), strict=True)))
        request = Request(parameters=self.names, by_drive=moved is not None)
        prediction = predict(model, self.values, rows, request, start)
        assert prediction.jacobian is not None
        variance = np.einsum("ncp,pq,ncq->nc", prediction.jacobian, self.covariance, prediction.jacobian)
        variance = variance + between_knots(model, self.values, rows, start)
        if moved is not None:
            assert prediction.by_drive is not None
            variance += ((prediction.by_drive * (moved / per_command(model))[:, None, :]) ** 2).sum(axis=2)
        return np.asarray(variance)

    def _count(self, u: Array, places: Mapping[int, RowOrigin]) -> None:
        coordinates = self.model.measuring(Measurand.POSITION)
        size = np.sqrt((u[:, coordinates] ** 2).sum(axis=1))
        self.rows += len(size)
        self.squares += float((size**2).sum())
        if len(size) and float(size.max()) > self.worst[0]:
            self.worst = float(size.max()), str(places[int(size.argmax())])

    @property
    def _rms(self) -> float:
        return float(np.sqrt(self.squares / self.rows)) if self.rows else float("nan")

    @property
    def text(self) -> str:
        """The map in one sentence."""
        if not self.rows:
            return "uncertainty of the TCP position: not available (no position)"
        unit = small_unit(self.file_unit)
        rms, largest = (f"{three_digits(u / unit.scale)} {unit.text}" for u in (self._rms, self.worst[0]))
        where = self.worst[1]
        size = f"{rms} rms, largest {largest}"
        axes = dict.fromkeys(self.machine.channels[j].instrument for j in self.read.values())
        seen = f", in the axes of {' and '.join(axes)}" if axes else ""
        return (
            f"uncertainty of the TCP position from the calibration{seen}: {size} at "
            f"{where} (standard uncertainties; twice that for 95 %)"
        )

    def json(self) -> dict[str, Any]:
        """The same for JSON."""
        largest, where = self.worst
        return {"rms": finite(self._rms / 1e-6), "max": finite(largest / 1e-6), "at": where or None, "unit": "um"}
