"""Why cases are missed, in the document: what the rules cannot show in a column."""

from __future__ import annotations

from collections.abc import Sequence

from tests.benchmark.counts import of_test, table
from tests.benchmark.followup import ENOUGH, LADDER
from tests.benchmark.judge import Result

REASONS = f"""
- **Clearances.** Without the clearance, a calibration strains other joints than those that the clearance strains, so
  the score may vanish ("the calibration moves its signature" below). In a trial, fits with graduated smoothing of the
  sign found most such cases, but one such fit per joint costs more than the rest of a diagnosis.
- **Different shapes.** The true curves have a ripple of 18 % of their size, and harmonics instead of polynomials. With
  two and three large effects, the ripple of one can exceed a small effect at another place.
- **Steps near a change of session** (unknown effects): in these data, a step within three rows of the change cannot be
  distinguished from a new set-up.
- **Sigma 20 % too small**: the tests are then based on an estimate of sigma, which is itself uncertain.
- **Alias pairs.** On these machines most pairs are the same everywhere: the scale of a drive and a turn of its
  carriage, the scale of all drives and that of the instrument, the temperature of base and tool where nothing turns. No
  pose can separate them. `plan --aim separate:` reports this, and what else would separate them (a calibrated length, a
  sensor on each part). These pairs count only if it predicts a difference of {ENOUGH:g} MDB with {LADDER[0]} to
  {LADDER[-1]} further points.
- **Time**: with a clearance or wind-up, the sign of the forces changes from step to step, and fits take up to 20 steps
  instead of four to eight.
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
            f"{r.predicted:.2f}" if r.points else "already one name",
            ("yes" if r.solved else "no") if r.points else "",
        )
        for r in of_test(results, "alias")
    ]
    headers = (
        "case", "machine", "planted", "MDB", "closest rival", "cosine", "further points", "separated by, MDB", "solved"
    )  # fmt: skip
    return table(headers, rows) if rows else ""
