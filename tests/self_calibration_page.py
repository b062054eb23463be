"""The tables of docs/self-calibration.md."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tests import hangprinter_alone as real
from tests.self_calibration_cases import CASES, MIRRORED, OTHERS, Case, Summary, disagreement, summary

PAGE = Path(__file__).resolve().parents[1] / "docs" / "self-calibration.md"


def _table(titles: str, rows: list[list[str]]) -> str:
    head = [titles, "|".join("---" for _ in titles.split("|"))]
    return (
        "".join(f"| {line} |\n" for line in [head[0]])
        + f"|{head[1]}|\n"
        + "".join("| " + " | ".join(row) + " |\n" for row in rows)
    )


def line(case: Case, found: Summary) -> list[str]:
    """A row of the table of cases."""
    z, count = np.abs(found.scores), len(found.chi2_per_dof)
    sure = found.std[np.isfinite(found.std)]
    return [
        case.name,
        case.what,
        f"{found.converged} of {count}",
        f"{found.inside} of {len(z)}",
        f"{int(np.isnan(z).sum())}",
        f"{np.nanmax(z):.2f}",
        f"{np.sqrt(np.nanmean(z**2)):.2f}",
        f"{found.chi2_per_dof.mean():.3f}",
        f"{np.median(sure):.1f} ({sure.min():.1f} to {sure.max():.1f})",
    ]


def cases(seeds: range) -> str:
    """The ten cases."""
    every, rows = [], []
    for case in CASES.values():
        every.append(summary(case, seeds))
        rows.append(line(case, every[-1]))
        print(*rows[-1], sep=" | ", flush=True)
    total, inside = sum(len(s.scores) for s in every), sum(s.inside for s in every)
    titles = "case | machine | converged | within 3 std | not determined | largest | rms | chi-square per dof | std, mm"
    return f"{_table(titles, rows)}\nAll cases: {inside} of {total} within 3 std, {100 * inside / total:.2f} %.\n"


def inputs() -> str:
    """Other lines in force control."""
    rows = [
        [name, ", ".join(CASES[name].forced), ", ".join(other), f"{disagreement(name, 0, other):.4f}"]
        for name, other in [*((n, o) for n, others in OTHERS.items() for o in others), MIRRORED]
    ]
    return _table("case | in force control | instead | largest difference, std", rows)


def lonely() -> str:
    """The hangprinter by its motors alone."""
    every = {s: real.apart(s) for s in real.SESSIONS}
    names = list(dict.fromkeys(n for found in every.values() for n in found))
    rows = []
    for name in names:
        row = [name]
        for found in every.values():
            a, sa, b, sb, z = found[name]
            row += [f"{a:.2f} ({sa:.2f})", f"{b:.2f} ({sb:.2f})", f"{z:+.1f}"]
        rows.append(row)
    titles = " | ".join(["parameter", *(f"{s} alone | camera | difference" for s in real.SESSIONS)])
    return _table(titles, rows)


def few() -> str:
    """Every fifth position known."""
    rows = []
    for first in range(5):
        known, rms, good = real.withheld(first)
        rows.append([f"{first}, {first + 5} ...", str(known), f"{rms:.2f}", f"{good:.2f}"])
    return _table("known rows | number | rms of the others, mm | without line 19, mm", rows)


def renewed(page: str, tables: dict[str, str]) -> str:
    """The page with these tables between their markers."""
    for name, text in tables.items():
        block = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        page = block.sub(lambda m, text=text: m.group(1) + text + m.group(2), page)  # type: ignore[misc]
    return page


def write(seeds: range) -> None:
    """Measure, and write the page's tables."""
    tables = {"cases": cases(seeds), "inputs": inputs(), "alone": lonely(), "few": few()}
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8"), tables), encoding="utf-8")
