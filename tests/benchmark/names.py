"""Whether a name is that of a planted effect."""

from __future__ import annotations

from collections.abc import Collection

from pkmcal_cli.diagnosis.hypotheses import Hypothesis
from pkmcal_cli.diagnosis.run_diagnosis import Diagnosis
from pkmcal_cli.effects import catalogue
from tests.benchmark.draw import Drawn

SHAPED = ("command", "guide", "carriage", "length")


def names_of(drawn: Drawn, d: Diagnosis) -> set[str]:
    """The names under which a planted effect may be reported."""
    return {drawn.name, d.same.get(drawn.name, drawn.name)}


def in_set(drawn: Drawn, d: Diagnosis, truths: Collection[str]) -> bool:
    """Whether a planted effect is in the credible set of a finding: by its name, or in a group of effects that all
    were planted."""
    names = {n for f in d.findings for r in f.rivals for n in covered(r.hypothesis, truths)}
    names |= {s.named.name for s in d.named_shapes if s.named is not None}
    return bool(names & names_of(drawn, d))


def covered(hypothesis: Hypothesis, truths: Collection[str]) -> set[str]:
    """What a hypothesis names: each member of a group whose members have values of their own, if all were planted."""
    members = {m.name for m in hypothesis.members}
    return members if members and members <= set(truths) else {hypothesis.name}


def is_residue(name: str, drawn: Drawn) -> bool:
    """Whether a further finding belongs to the shape of a planted effect."""
    keyword, _, at = name.partition("@")
    mine, other = catalogue().get(drawn.planted.keyword), catalogue().get(keyword)
    if mine is None or other is None or at != drawn.planted.at:
        return False
    return mine.enters in SHAPED and (mine.enters, mine.needs) == (other.enters, other.needs)
