"""`--plot FILE`: a picture of a result, beside what a command writes otherwise."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from pkmcal_cli.base.errors import UsageError
from pkmcal_cli.pictures.picture import Picture, check_picture, write_picture
from pkmcal_cli.report.console import Reporter


@dataclass(frozen=True)
class Plot:
    """A picture to be written; inputs: names of all that was read; tables: files that its title names."""

    file: str
    inputs: Collection[str]
    force: bool
    tables: Sequence[str] = ()

    def write(self, picture: Picture, to: Reporter) -> None:
        """Write the picture and tell. Raises OutputError."""
        write_plot(picture, self.file, self.inputs, to, force=self.force)


def check_plot(plot: str | None, inputs: Collection[str], *outputs: str | None, force: bool) -> None:
    """Before the work: the picture can be written, and is no other result's file. Raises UsageError, OutputError."""
    check_picture(plot, inputs, force=force)
    if plot is None:
        return
    for other in outputs:
        if other is not None and os.path.realpath(other) == os.path.realpath(plot):
            raise UsageError(
                f"--plot: `{plot}` is already used for another result", hint="choose another name for the picture"
            )


def write_plot(picture: Picture, plot: str, inputs: Collection[str], to: Reporter, *, force: bool) -> None:
    """Write the picture and tell. Raises OutputError."""
    write_picture(picture, plot, inputs, force=force)
    to.say(f"written: {plot}")
