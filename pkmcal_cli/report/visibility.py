"""What a table would have shown of effects that are not found, and what it could not."""

from __future__ import annotations

from collections.abc import Sequence

from pkmcal_cli.base.plural import count
from pkmcal_cli.diagnosis.hypotheses import RELEASE, Hypothesis
from pkmcal_cli.diagnosis.visible_sizes import VisibleSizes
from pkmcal_cli.effects import catalogue
from pkmcal_cli.report.console import Reporter
from pkmcal_cli.report.detectable_sizes import sizes_text, worst_text
from pkmcal_cli.report.diagnosis_values import DiagnosisValues
from pkmcal_cli.report.number_format import detectable_size, handy
from pkmcal_cli.report.sentences import command, grouped

_SHOWN, _STDIN = 12, "<stdin>"


class VisibilityReport(DiagnosisValues):
    """What is told of effects that were not found."""

    def files(self) -> tuple[str, str]:
        """Machine and first table, as they are named on a command line."""
        files = self.machine.files[0][0], self.measured.files[0]
        return (files[0] if files[0] != _STDIN else "M.yaml"), (files[1] if files[1] != _STDIN else "MEAS.csv")

    def show_seen(self, to: Reporter) -> None:
        """How large effects would have been found, where nothing was: the worst place of every kind."""
        worst: dict[str, VisibleSizes] = {}
        for seen in self.diagnosis.detectable:
            kind = seen.hypothesis.effect
            if seen.tested and kind != RELEASE and (kind not in worst or _hardest(seen) > _hardest(worst[kind])):
                worst[kind] = seen
        if worst:
            rows = [(s.hypothesis.name, *sizes_text(self.model, s), worst_text(self.model, s)) for s in worst.values()]
            heads = ("effect", "smallest detectable", "detected in 80 %", "direction")
            to.say()
            title = "What would have been found (worst place of each kind)"
            to.table(title, heads, rows, folded=("direction",), spare=("smallest detectable",))

    def show_unseen(self, to: Reporter) -> None:
        """What these data could not have shown."""
        if self.diagnosis.not_testable:
            to.say()
        for line in grouped(self.diagnosis.not_testable):
            to.say(line)
        hidden = self.diagnosis.invisible
        if not hidden:
            return
        rows = []
        for i in hidden[:_SHOWN]:
            unit = self.unit(i.parameter)
            size = detectable_size(i.mdb, i.plausible, unit)
            needed = self.rows_needed(i)
            why = f"needs about {needed} such rows" if needed is not None else ""
            why = f"absorbed by {', '.join(i.absorbed_by)}" if i.absorbed_by else why
            rows.append((i.hypothesis.name, size, handy(i.plausible, unit), why or _meaning(i)))
        to.say()
        to.table("Effects that these data cannot show", ("effect", "smallest detectable", "plausible", "remark"), rows)
        if more := [i.hypothesis for i in hidden[_SHOWN:]]:
            to.say(f"and {count(len(more), 'more effect')} (sizes in --json): {by_effect(more)}")
        to.say(f"points that would show one: {command('plan', *self.files(), '--aim', 'EFFECT')}")


def _meaning(hidden: VisibleSizes) -> str:
    """What a number without a unit is a number of."""
    effect = catalogue().get(hidden.hypothesis.effect)
    pure = {p.name: p.text for p in effect.parameters if p.unit == "1"} if effect is not None else {}
    return pure.get(hidden.parameter.rpartition(".")[2], "")


def by_effect(hypotheses: Sequence[Hypothesis]) -> str:
    """Names of hypotheses with all places of an effect together: zero@X, Y; drift."""
    places: dict[str, list[str]] = {}
    for h in hypotheses:
        places.setdefault(h.name.removesuffix(h.at), []).append(h.at)
    return "; ".join(f"{kind}{', '.join(at)}" for kind, at in places.items())


def _hardest(seen: VisibleSizes) -> float:
    """Size at which it is detected, in standard deviations of its prior, in the worst direction."""
    return max(seen.numbers[seen.leading].detected, seen.worst.detected if seen.worst is not None else 0.0)
