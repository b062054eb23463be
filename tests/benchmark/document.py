"""The document: what was reached, beside what was to be reached, and every miss."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from tests.benchmark.cases import LEVELS, TESTS
from tests.benchmark.counts import Share, median, of_test, table
from tests.benchmark.judge import RULES, Result
from tests.benchmark.reasons import REASONS, aliases
from tests.benchmark.summary import clear, reported, rows_of

HEAD = """# Diagnosis: what it finds, and what it misses

The benchmark diagnoses simulated campaigns with effects that the machine file does not declare, at the default
false-alarm rate of 0.5 %. The simulator (`tests/truth/`) shares neither code nor formulation with the engine: it
minimises energy, and its effects have their own shapes. Four machines alternate: the Triglide, the same machine without
redundancy, the Scissors, and a spatial delta with a redundant column. Each campaign has 192 poses in two sessions over
four hours, with 10 um noise (Scissors 0.5 um). A case is fully determined by its test and its number. Effects are drawn
by keyword, then by place. They are no larger than is plausible (the range in the catalogue), and not such that declared
parameters absorb them.

Written by `python -m tests.benchmark > docs/diagnosis-benchmark.md`; do not edit.
"""
BADLY = ("nothing", "sigma", "t4", "ar1", "rows")
"""Tests in which nothing is to be named."""


def document(results: Sequence[Result], note: str = "") -> str:
    """All of it; `note`: a sentence about the run."""
    parts = [
        HEAD,
        run_of(results, note),
        "## Results\n\n95 % intervals (Wilson) in brackets.\n",
        table(("test", "measure", "result", "target", "met"), (r.cells for r in rows_of(results))),
        "## What falls short, and why\n" + REASONS,
        "## Rules\n" + RULES,
        "## Outcomes by machine\n",
        outcomes(results),
        "## Power\n",
        power(results),
        "## Effects outside the catalogue\n",
        outside(results),
        "## Alias pairs\n",
        aliases(results),
        "## First findings\n\nTest `single`, by keyword; rows: planted, cells: first finding.\n",
        confusion(results),
        "## Sizes off by more than three standard deviations\n",
        sizes(results),
        "## Every miss\n\nNot listed: credible sets with the true effect if another effect has a cosine above 0.95.\n",
        *misses(results),
    ]
    return "\n".join(part for part in parts if part)


def run_of(results: Sequence[Result], note: str) -> str:
    """How many cases of each test were run, and what they cost."""
    counts = Counter(r.test for r in results)
    whole = sum(count for count, _ in TESTS.values())
    listed = ", ".join(f"{t} {counts[t]} of {n}" for t, (n, _) in TESTS.items())
    share = "all cases" if len(results) == whole else f"**a reduced run, {len(results)} of {whole} cases**"
    seconds = median([r.seconds for r in results])
    crashed = sum(r.outcome == "crash" for r in results)
    cost = f"Median time of a diagnosis {seconds:.2f} s, one core; {crashed} crashed. {note}".rstrip()
    return f"Run: {share} ({listed}). {cost}\n"


def outcomes(results: Sequence[Result]) -> str:
    """Counts of outcomes by test and machine."""
    rows = []
    for test in TESTS:
        mine = of_test(results, test)
        for machine in dict.fromkeys(r.machine for r in mine):
            here = [r for r in mine if r.machine == machine]
            found = Counter(r.outcome for r in here)
            words = ", ".join(f"{k} {n}" for k, n in found.most_common())
            rows.append((test, machine, len(here), words, sum(r.discrepancies > 0 for r in here)))
    return table(("test", "machine", "cases", "outcomes", "with a shape residue"), rows)


def power(results: Sequence[Result]) -> str:
    """Share of effects found by size."""
    every = of_test(results, "power")
    if not every:
        return ""
    rows = []
    for level in LEVELS:
        mine = [r for r in every if r.size == level]
        shares = (
            Share.of(mine, reported),
            Share.of(mine, lambda r: r.in_set),
            Share.of(mine, lambda r: r.outcome == "exact"),
        )
        rows.append((f"{level:g}", *shares))
    return table(("size in MDB", "anything reported", "true effect in a set", "exact"), rows)


def outside(results: Sequence[Result]) -> str:
    """What became of unknown effects, by kind."""
    rows = []
    for test in ("unknown", "small_unknown"):
        every = of_test(results, test)
        for keyword in sorted({_keyword(r) for r in every}):
            mine = [r for r in every if _keyword(r) == keyword]
            flagged = sum(bool(r.unknown) for r in mine)
            named = sum(bool(r.found) and not r.unknown for r in mine)
            rows.append((test, keyword, len(mine), flagged, named, len(mine) - flagged - named))
    return table(
        ("test", "effect", "cases", "flagged", "only named as catalogue effects", "nothing reported, or only bad rows"),
        rows,
    )


def confusion(results: Sequence[Result]) -> str:
    """First findings by planted keyword."""
    every = of_test(results, "single")
    named = {r.number: (r.found[0]["name"].partition("@")[0].split()[0] if r.found else "-") for r in every}
    rows = []
    for keyword in sorted({_keyword(r) for r in every}):
        mine = [r for r in every if _keyword(r) == keyword]
        right = Share.of(mine, lambda r: r.outcome == "exact")
        other = Counter(named[r.number] for r in mine if r.outcome != "exact")
        words = ", ".join(f"{k} {n}" for k, n in other.most_common())
        rows.append((keyword, len(mine), sum(map(clear, mine)), right.hits, words))
    return table(
        ("planted", "cases", "separable, above 1.5 MDB", "exact", "otherwise first named (`-`: nothing)"), rows
    )


def _keyword(r: Result) -> str:
    return str(r.planted[0]["name"].partition("@")[0])


def sizes(results: Sequence[Result]) -> str:
    """Parameters of exact cases whose estimate is far off, worst first."""
    every = [(e, n, r) for r in of_test(results, "single") for n, e in r.errors.items() if r.planted[0]["size"] >= 3]
    rows = [
        (f"{e:+.1f}", name, r.machine, r.number, f"{r.planted[0]['size']:.1f}", f"{r.planted[0]['own']:.4f}")
        for e, name, r in sorted(every, key=lambda found: -abs(found[0]))
        if abs(e) > 3
    ]
    head = (
        "error / std",
        "parameter",
        "machine",
        "case",
        "size in MDB",
        "cosine of the true effect with its hypothesis",
    )
    return table(head, rows)


def misses(results: Sequence[Result]) -> list[str]:
    """Cases that are not exact, one by one, with what explains them."""
    parts = []
    for test in TESTS:
        mine = [r for r in of_test(results, test) if missed(r)]
        if mine:
            rows = [(r.number, r.machine, _planted(r), r.outcome, _found(r), why(r)) for r in mine]
            parts.append(f"### {test}\n")
            parts.append(table(("case", "machine", "planted", "outcome", "found (evidence lnB; set)", "why"), rows))
    return parts


def missed(r: Result) -> bool:
    """Whether a case belongs on the list of misses."""
    if r.test == "rows":
        return r.rows["found"] < r.rows["bad"] or r.rows["lost"] > 0 or r.outcome != "exact"
    if r.test in BADLY:
        return reported(r)
    if "unknown" in r.test:
        return not r.unknown
    if r.outcome == "set" and r.test in ("single", "alias") and not r.planted[0]["separable"]:
        return False  # a set that holds the truth is right where another effect does the same
    return r.outcome != "exact" and r.test not in ("power", "no_temperature", "no_direction")


def _planted(r: Result) -> str:
    sizes = [f" {p['size']:.1f}" if "size" in p else f" {r.size:.1f} sigma" for p in r.planted]
    return ", ".join(p["name"] + s for p, s in zip(r.planted, sizes, strict=True)) or "-"


def _found(r: Result) -> str:
    named = []
    for f in r.found:
        members = ", ".join(f"{n} {w:.2f}" for n, w in f["set"][:4]) + (", ..." if len(f["set"]) > 4 else "")
        named.append(f"{f['name']} ({f['evidence']:.0f}; {members})")
    named += [f"unknown: {u[0]} (p {u[1]:.0e}) {u[2]}".strip() for u in r.unknown]
    if r.bad_rows:
        named.append(f"bad rows: {len(r.bad_rows)} ({r.rows['lost']} of them good)")
    return "; ".join(named) or "-"


def why(r: Result) -> str:
    """What is known of the cause: small, near a rival, of a shape of its own, moved by the calibration."""
    reasons = [reason for p in r.planted if "own" in p for reason in _reasons(p)]
    truths = {p["name"] for p in r.planted}
    for f in r.found:
        if f["name"] not in truths and f["name"] != f["set"][0][0]:
            reasons.append(f"{f['name']} is not the best of its own set")
    return "; ".join(reasons)


def _reasons(p: dict[str, Any]) -> Iterator[str]:
    """What is known of one planted effect."""
    if p["joint"] < 1.5:
        yield f"small: {p['joint']:.1f} MDB"
    if p.get("calibrated", 1.0) < p["own"] - 0.1:
        yield f"the calibration moves its signature: cosine {p['own']:.2f} falls to {p['calibrated']:.2f}"
    apart = p["size"] * max(1 - p["cosine"] ** 2, 0.0) ** 0.5
    if p["cosine"] > 0.7 and apart < 2.5:
        yield f"separated from {p['rival']} by {apart:.1f} MDB (cosine {p['cosine']:.3f})"
    beyond = p["size"] * max(1 - p["own"] ** 2, 0.0) ** 0.5
    if beyond > 0.7:
        yield f"different shape: {beyond:.1f} MDB of {p['name']} are outside its hypothesis (cosine {p['own']:.2f})"
