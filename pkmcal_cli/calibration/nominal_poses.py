"""Where the nominal machine is at the rows of a table: found once for it, its parts, and the models with effects."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.rotation import Array
from pkmcal_cli.model.model import Model
from pkmcal_cli.model.tool_channels import tcp_model
from pkmcal_cli.prediction import Rows, predict


@dataclass(frozen=True)
class NominalPoses:
    """At rows (N) of a model without instruments; `whole` and `within` (N,): of which table these rows are a part."""

    model: Model
    rows: Rows
    whole: NominalPoses | None = None
    within: slice | NDArray[np.intp] | None = None

    @cached_property
    def predicted(self) -> tuple[dict[str, Array], NDArray[np.bool_]]:
        """Coordinates (N,) of the tool point by name, m or rad, and rows (N,) that are predicted."""
        if self.whole is not None:
            coordinates, solved = self.whole.predicted
            return {name: x[self.within] for name, x in coordinates.items()}, solved[self.within]
        bare = tcp_model(self.model).with_options(())
        prediction = predict(bare, self.model.nominal, self.rows)
        return {c.name: prediction.values[:, k] for k, c in enumerate(bare.channels)}, prediction.solved

    def of(self, names: Collection[str]) -> dict[str, Array]:
        """Some coordinates (N,) by name, m or rad; none where they are not predicted in all rows."""
        coordinates, solved = self.predicted
        return {name: x for name, x in coordinates.items() if name in names} if solved.all() else {}

    def part(self, within: slice | NDArray[np.intp], rows: Rows) -> NominalPoses:
        """Of some of the rows, as `rows` has them."""
        return NominalPoses(self.model, rows, self, within)

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: a part goes without its table, with what is known of it."""
        known = self.predicted if self._known else None
        return _restored, (self.model, self.rows, known)

    @property
    def _known(self) -> bool:
        return "predicted" in self.__dict__ or (self.whole is not None and self.whole._known)

    def holds_for(self, model: Model, rows: Rows) -> bool:
        """Whether these are the poses of a model, perhaps with other effects, at the same rows."""
        if rows is not self.rows:
            return False
        nominal = dict(zip(model.names, model.nominal, strict=True)) if model is not self.model else None
        return nominal is None or all(
            nominal.get(n) == v for n, v in zip(self.model.names, self.model.nominal, strict=True)
        )


def _restored(
    model: Model, rows: Rows, known: tuple[dict[str, Array], NDArray[np.bool_]] | None
) -> NominalPoses:
    """As another process gets it."""
    poses = NominalPoses(model, rows)
    if known is not None:
        poses.__dict__["predicted"] = known
    return poses
