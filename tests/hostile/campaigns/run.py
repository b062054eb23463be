"""How `calibrate` ends on a campaign."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.command import MACHINES, clean, run
from tests.hostile.campaigns.listed import Lie
from tests.hostile.campaigns.sheet import Sheet


@dataclass(frozen=True)
class End:
    """Status (`failed`: not converged, `error`: refused), exit code, reasons in words."""

    status: str
    code: int
    reasons: tuple[str, ...] = ()


def ended(machine: str, tables: Sequence[Sheet]) -> End:
    """`calibrate` with its defaults, but without rows held out."""
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"m{k + 1}.csv" for k in range(len(tables))]
        for file, table in zip(files, tables, strict=True):
            file.write_text(table.text(), encoding="utf-8")
        done = clean(run("calibrate", MACHINES / f"{machine}.yaml", *files, "--holdout", "none", "--json"))
    if done.code == 3:
        return End("error", 3, tuple(done.err.splitlines()[-3:]))
    found = done.json
    status = "failed" if found["status"] in ("not_converged", "nothing_identifiable") else found["status"]
    return End(status, done.code, (*found["implausible"], *found["incomplete"], f"chi2/dof {found['chi2_per_dof']}"))


def told(lie: Lie) -> End:
    """How a campaign that lies ends."""
    return ended(lie.machine, lie.tables())
