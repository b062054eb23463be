"""The rows of the table of results: what is measured in each test, what was to be reached."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmark.cases import SURE
from tests.benchmark.counts import Share, median, of_test
from tests.benchmark.followup import ENOUGH
from tests.benchmark.judge import Result

FAMILIES = ("two", "three")

LARGE, FAR_APART = 2.0, 0.9
"""Size in MDB, and cosine with the nearest other hypothesis, of single effects that must hardly ever be missed."""

EXACT = 0.999
"""Cosine above which two effects do the same for every practical purpose."""


@dataclass(frozen=True)
class Row:
    """One line of the table; `met`: None where nothing was run or nothing is demanded."""

    test: str
    measure: str
    reached: str
    demanded: str
    met: bool | None

    @property
    def cells(self) -> tuple[str, str, str, str, str]:
        """As text."""
        return self.test, self.measure, self.reached, self.demanded, {True: "yes", False: "no", None: ""}[self.met]


def at_least(test: str, measure: str, share: Share, least: float) -> Row:
    """A share that is to be large."""
    met = share.value >= least if share.cases else None
    return Row(test, measure, str(share), f"at least {100 * least:g} %", met)


def at_most(test: str, measure: str, share: Share, most: float) -> Row:
    """A share that is to be small."""
    met = share.value <= most if share.cases else None
    return Row(test, measure, str(share), f"at most {100 * most:g} %", met)


def clear(r: Result) -> bool:
    """A single effect that must be named: above 1.5 MDB, without a near rival."""
    return bool(r.planted[0]["size"] > SURE and r.planted[0]["separable"])


def own_discrepancy(r: Result) -> bool:
    """Whether what a single effect does is clearly nearest to its own hypothesis, for all its shape of its own."""
    return bool(r.planted[0]["own"] > max(0.9, r.planted[0]["cosine"] + 0.02))


def far_apart(r: Result) -> bool:
    """A single effect that is large, and that no other hypothesis is near to."""
    return bool(r.planted[0]["size"] >= LARGE and r.planted[0]["cosine"] < FAR_APART)


def reported(r: Result) -> bool:
    """Whether anything is reported."""
    return bool(r.found or r.unknown or r.bad_rows)


def lone_wrong(r: Result) -> bool:
    """Whether a machine's effect is named alone that was not planted, and nothing is said to be unknown."""
    truths = {p["name"] for p in r.planted}
    wrong = [
        f for f in r.found if not f["measurement"] and not truths & {n for n, _ in f["set"]} and len(f["set"]) == 1
    ]
    return bool(wrong) and not r.unknown


def rows_of(results: Sequence[Result]) -> list[Row]:
    """All lines."""
    parts = (_plain, _single, _several, _rows, _unknown, _missing, _noise, _held_out, _sizes, _alias, _time)
    return [row for part in parts for row in part(results)]


def _plain(results: Sequence[Result]) -> list[Row]:
    share = Share.of(of_test(results, "nothing"), reported)
    stepwise = Share.of(of_test(results, "nothing"), lambda r: not r.others.get("stepwise", True))
    return [
        at_most("nothing missing", "anything reported", share, 0.01),
        Row("", "the same cases, by stepwise BIC instead", str(stepwise), "", None),
    ]


def _single(results: Sequence[Result]) -> list[Row]:
    every = of_test(results, "single")
    named = [r for r in every if r.found]
    large = [r for r in every if r.planted[0]["size"] > SURE]
    exact = Share.of([r for r in every if clear(r)], lambda r: r.outcome == "exact")
    wrong = Share.of(every, lambda r: r.outcome == "wrong element")
    near = Share.of([r for r in every if clear(r) and own_discrepancy(r)], lambda r: r.outcome == "exact")
    apart = Share.of([r for r in every if far_apart(r)], lambda r: r.outcome == "exact")
    return [
        at_least("single effect", "exact, of those above 1.5 MDB and separable", exact, 0.97),
        at_least("", "exact, of those of at least 2 MDB whose nearest rival's cosine is below 0.9", apart, 0.99),
        Row("", "the same, where the true effect is closest to its own hypothesis", str(near), "", None),
        *_baselines([r for r in every if clear(r)]),
        at_least("", "true effect in the 95 % set, of all cases with a named effect", Share.of(named, _held), 0.98),
        at_least("", "the same, of all cases above 1.5 MDB", Share.of(large, _held), 0.98),
        at_most("", "wrong element", wrong, 0.0),
    ]


def _baselines(results: Sequence[Result]) -> list[Row]:
    """What simpler ways reach in the same cases."""
    rows = []
    for way, words in (("correlation", "correlation with the residual"), ("stepwise", "stepwise BIC")):
        judged = [r for r in results if way in r.others]
        share = Share(sum(r.others[way] for r in judged), len(judged))
        rows.append(Row("", f"the same cases, by {words} instead", str(share), "", None))
    return rows


def _held(r: Result) -> bool:
    return r.in_set


def _several(results: Sequence[Result]) -> list[Row]:
    found = {t: Share.of(of_test(results, t), lambda r: r.outcome == "exact") for t in FAMILIES}
    return [
        at_least(f"{t} effects", "all found and nothing else", found[t], a)
        for t, a in zip(FAMILIES, (0.95, 0.85), strict=True)
    ]


def _rows(results: Sequence[Result]) -> list[Row]:
    every = of_test(results, "rows")
    total = {k: sum(r.rows[k] for r in every) for k in ("bad", "found", "good", "lost")}
    named = Share.of(every, lambda r: bool(r.found or r.unknown))
    return [
        at_least("bad rows", "bad rows found", Share(total["found"], total["bad"]), 0.98),
        at_most("", "good rows lost", Share(total["lost"], total["good"]), 0.001),
        Row("", "cases with something else reported", str(named), "", None),
    ]


def _unknown(results: Sequence[Result]) -> list[Row]:
    every = of_test(results, "unknown")
    large = [r for r in every if r.size > 2]
    small = of_test(results, "small_unknown")
    catalogue = Share.of(every, lambda r: bool(r.found) and not r.unknown)
    return [
        at_least("unknown effects", "flagged, of those above twice the noise", Share.of(large, _flagged), 0.9),
        at_most("", "only named as catalogue effects", catalogue, 0.05),
        Row(
            "small unknown effects",
            "flagged, of those with 0.2 to 1 times the noise",
            str(Share.of(small, _flagged)),
            "",
            None,
        ),
        Row(
            "",
            "only named as catalogue effects",
            str(Share.of(small, lambda r: bool(r.found) and not r.unknown)),
            "",
            None,
        ),
    ]


def _flagged(r: Result) -> bool:
    return bool(r.unknown)


def _missing(results: Sequence[Result]) -> list[Row]:
    both = of_test(results, "no_temperature", "no_direction")
    rows = [at_most("missing columns", "a single wrong name of the machine", Share.of(both, lone_wrong), 0.05)]
    for test, word in (("no_temperature", "temperature"), ("no_direction", "direction")):
        mine = of_test(results, test)
        rows.append(Row("", f"without {word}: flagged as unknown", str(Share.of(mine, _flagged)), "", None))
        named = Share.of(mine, lambda r: any(f["measurement"] for f in r.found) and not r.unknown)
        rows.append(Row("", f"without {word}: only named as an error of the measurement", str(named), "", None))
    return rows


def _noise(results: Sequence[Result]) -> list[Row]:
    def timeless(r: Result) -> bool:
        return bool(r.found or r.bad_rows or any(u[0] != "time" for u in r.unknown))

    return [
        at_most(
            "sigma stated 20 % too small", "anything reported", Share.of(of_test(results, "sigma"), reported), 0.02
        ),
        at_most("t4 noise", "anything reported", Share.of(of_test(results, "t4"), reported), 0.02),
        at_most("AR(1) noise", "a report other than `time`", Share.of(of_test(results, "ar1"), timeless), 0.05),
    ]


def _held_out(results: Sequence[Result]) -> list[Row]:
    every = [r.held_out for r in of_test(results, "single", *FAMILIES) if r.held_out]
    ratio = [h["after"] / h["floor"] for h in every]
    better = Share(sum(h["after"] < h["before"] for h in every), len(every))
    text = f"median {median(ratio):.3f}, largest {max(ratio, default=np.nan):.3f}; {len(every)} cases"
    before, after = (1e6 * median([h[k] for h in every]) for k in ("before", "after"))
    noise = [h["after"] / h["noise"] for h in every]
    noises = f"median {median(noise):.2f}, 90 % below {np.quantile(noise, 0.9) if noise else np.nan:.2f}"
    met = median(ratio) <= 1.15 if every else None
    return [
        Row(
            "held-out error",
            "after, divided by that with the planted effects declared from the start",
            text,
            "1.15",
            met,
        ),
        Row(
            "",
            "after, divided by the effect of noise alone on the parameters (the true shape adds to it)",
            noises,
            "",
            None,
        ),
        at_least("", "better than before", better, 0.99),
        Row("", "median before and after, against true readings", f"{before:.2f} um, {after:.2f} um", "", None),
    ]


def _sizes(results: Sequence[Result]) -> list[Row]:
    sure = [r for r in of_test(results, "single") if r.errors and r.planted[0]["size"] >= 3]
    every = np.array([e for r in sure for e in r.errors.values()])
    true = np.array([e for r in sure if r.planted[0]["own"] > 0.999 for e in r.errors.values()])
    value = float(np.sqrt((every**2).mean())) if len(every) else float("nan")
    text = f"{value:.2f} ({len(every)} parameters, median size {median(list(abs(every))):.2f})"
    pure = f"{np.sqrt((true**2).mean()):.2f} ({len(true)} parameters)" if len(true) else "not run"
    met = 0.9 <= value <= 1.15 if len(every) else None
    return [
        Row("size of the effect", "rms of error / std, of exact cases with 3 MDB or more", text, "0.9 to 1.15", met),
        Row("", "the same, where the true shape is the catalogue's (cosine above 0.999)", pure, "", None),
    ]


def _alias(results: Sequence[Result]) -> list[Row]:
    every = of_test(results, "alias")
    lone = Share.of(every, lambda r: not r.in_set and any(len(f["set"]) == 1 for f in r.found) and not r.unknown)

    asked = [r for r in every if r.points]
    told = [r for r in asked if r.predicted >= ENOUGH]
    rest = [r for r in asked if r.predicted < ENOUGH]
    points = f" ({int(np.median([r.points for r in told]))} points, median)" if told else ""
    enough = f"solved with the further points that `plan` calls sufficient{points}"
    exact = Share.of(rest, lambda r: r.planted[0]["cosine"] > EXACT)
    return [
        at_most("alias pairs", "a single wrong name", lone, 0.0),
        Row("", "true effect in the set of a finding", str(Share.of(every, _held)), "", None),
        at_least("", enough, Share.of(told, lambda r: r.solved), 0.95),
        Row("", "`plan` reports that 384 points are not sufficient", str(Share(len(rest), len(asked))), "", None),
        Row("", "of these, with a cosine above 0.999", str(exact), "", None),
        Row("", "of these, solved with 384 points nevertheless", str(Share.of(rest, lambda r: r.solved)), "", None),
    ]


def _time(results: Sequence[Result]) -> list[Row]:
    mine = [r.seconds for r in results if r.machine == "scissors" and r.seconds]
    text = f"median {median(mine):.2f} s, largest {max(mine, default=np.nan):.2f} s"
    met = max(mine) < 5 if mine else None
    return [Row("time", "whole diagnosis, 192 rows, 110 hypotheses, Scissors, one core", text, "under 5 s", met)]
