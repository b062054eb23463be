"""Single rows that are off, before any fit, by more than any parameters could be: by least squares they spoil it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pkmcal_cli.base.plural import count
from pkmcal_cli.gross_errors.plausibility import GROSS
from pkmcal_cli.gross_errors.sample import Sample
from pkmcal_cli.units.unit_text import parse_unit

_FAR = 100.0  # times what errors of parameters and noise cause: fifty ranges of all together
_MOST = 0.25  # share of the rows; more are another mistake
_LISTED = 5
_RUN = 3  # rows; fewer follow one another by chance


def far_rows(sample: Sample, sessions: NDArray[np.intp], row_origin: Callable[[int], str]) -> tuple[str, ...]:
    """Such rows in words, where most of the others are off by no more than parameters explain.

    sessions (N,): number of the session of each row; one that is off as a whole is none of single rows.
    """
    residual = np.abs(sample.seen(sample.readings, sample.predicted) - sample.predicted)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(np.isfinite(residual) & (sample.prior_rms > 0), residual / sample.prior_rms, 0.0)
    each = relative.max(axis=1, initial=0.0)
    rows = np.nonzero((each > _FAR) & ~_whole_sessions(each > GROSS, sessions[sample.rows]))[0]
    if not 0 < len(rows) <= _MOST * len(each) or np.median(each) > GROSS:
        return ()
    worst = int(rows[each[rows].argmax()])
    k = int(relative[worst].argmax())
    channel = sample.part.model.channels[k]
    off = parse_unit(channel.unit).format(float(residual[worst, k]), 3)
    return (far_off_text(sample.rows[rows].tolist(), row_origin, f", `{channel.name}` by up to {off}"),)


def _whole_sessions(off: NDArray[np.bool_], sessions: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Rows (n,) of sessions of which most of the rows are off: something moved between them, a zero, a frame."""
    whole = [s for s in np.unique(sessions) if (some := off[sessions == s]).sum() > max(1, len(some) / 2)]
    return np.isin(sessions, whole)


def far_off_text(rows: Sequence[int], row_origin: Callable[[int], object], how: str = "") -> str:
    """Numbers of rows that the others contradict, in ascending order, in words, and the remedy; how: by how much."""
    listed = ", ".join(str(row_origin(row)) for row in rows[:_LISTED])
    more = f" and {len(rows) - _LISTED} more" if len(rows) > _LISTED else ""
    one = len(rows) == 1
    finding = f"{count(len(rows), 'row')} {'is' if one else 'are'} far from what the other rows predict"
    remedy = f"(`--loss tukey` down-weights {'it' if one else 'them'})"
    return f"{finding}: {listed}{more}{how} {remedy}{_in_a_run(rows)}"


def _in_a_run(rows: Sequence[int]) -> str:
    """What numbers of rows that follow one another, in ascending order, suggest in words; else nothing."""
    if len(rows) < _RUN or rows[-1] - rows[0] >= len(rows):
        return ""
    return "; they follow one another: was a drive referenced anew, or something moved? Then they are a session"
