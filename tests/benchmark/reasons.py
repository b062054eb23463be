"""Why cases are missed, in the document: what the rules cannot show in a column."""

from __future__ import annotations

from collections.abc import Sequence

from tests.benchmark.counts import of_test, table
from tests.benchmark.followup import ENOUGH, LADDER
from tests.benchmark.judge import Result

REASONS = f"""
- **Clearances.** The joints that a calibration without the clearance strains are not those that the clearance strains,
  so the score may vanish ("the calibration moves its signature" below). Fits with graduated smoothing of the sign found
  most such cases in a trial, but one for every joint costs more than the rest of a diagnosis.
- **Own shapes.** The truth's curves have a ripple of 18 % of their size and harmonics instead of polynomials. With two
  and three large effects the ripple of one can exceed a small effect at another place.
- **Steps beside a change of session** (unknown effects): a step within three rows of it is a new set-up, in every
  respect that the data show.
- **Sigma 20 % too small**: tests then stand on an estimate of sigma, which is uncertain itself.
- **Alias pairs.** On these machines most are the same everywhere: the scale of a drive and a turn of its carriage, the
  scale of all drives and that of the instrument, the temperature of base and tool, where nothing turns. No pose tells
  them apart; `plan --separate` says so, and what else would (a calibrated length, a sensor on each part). Only where it
  predicts a difference of {ENOUGH:g} MDB with {LADDER[0]} to {LADDER[-1]} further points are these counted.
- **Time**: where a clearance or wind-up is met, the sign of forces turns from step to step, and fits take up to 20
  steps instead of four to eight.
"""


def aliases(results: Sequence[Result]) -> str:
    """What further points can do for alias pairs."""
    rows = [
        (
            r.number,
            r.machine,
            r.planted[0]["name"],
            f"{r.planted[0]['size']:.1f}",
            r.planted[0]["rival"],
            f"{r.planted[0]['cosine']:.4f}",
            r.points or "",
            f"{r.predicted:.2f}" if r.points else "one name already",
            ("yes" if r.solved else "no") if r.points else "",
        )
        for r in of_test(results, "alias")
    ]
    headers = (
        "case", "machine", "planted", "MDB", "most like it", "cosine", "further points", "then apart by, MDB", "solved"
    )  # fmt: skip
    return table(headers, rows) if rows else ""
