"""What `diagnose` advises to separate causes works: `plan` reaches plausible sizes with it, and with nothing else."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from tests.command import MACHINES, clean, run

CASES = {
    "sag, which straightness contains": ("gantry", "gantry-bow", "straight@rail1.z: {n2: 22 um}", "sag@rail1.z", False),
    "a load, which acts otherwise": ("triglide-nonredundant",) * 2 + ("backlash@q1: {b: 45 um}", "tool_load", True),
}


@pytest.mark.parametrize("case", CASES)
def test_points_are_advised_where_they_separate(case: str, tmp_path: Path) -> None:
    name, poses, planted, rival, separable = CASES[case]
    machine, table, worn = MACHINES / f"{name}.yaml", tmp_path / "t.csv", tmp_path / "worn.yaml"
    worn.write_text(f"extends: {machine}\neffects: {{{planted}}}\n", encoding="utf-8")
    noise = ("--noise", "declared", "--seed", "1", "-o", table)
    assert run("simulate", worn, MACHINES / f"{poses}.csv", *noise).code == 0
    told = clean(run("diagnose", machine, table)).err
    assert rival in told and ("Points like those that were measured do not separate" in told) is not separable
    advised = re.search(r"measure the points of: pkmcal (plan .*)", told)
    assert (advised is not None) is separable
    effect = planted.partition(":")[0]
    rivals = re.search(rf"{effect} \(\d+ %\), ([^ ]+) \(", told)
    assert rivals is not None
    plan = ["plan", machine, table, "--aim", f"separate:{effect},{rivals[1]}"]
    done = run(*(shlex.split(advised[1]) if advised is not None else plan))
    assert done.code == 0 and ("cannot separate them at plausible sizes" in done.err) is not separable


def test_every_effect_that_the_data_cannot_show_is_named() -> None:
    """A suspected cause is looked for in this list, so none of it is left out, however long it is."""
    done = clean(run("diagnose", MACHINES / "gantry.yaml", MACHINES / "gantry.csv", "--json"))
    _, _, listed = done.err.partition("Effects that these data cannot show")
    names = set(re.findall(r"^(\S+@\S+)", listed.partition("\nand ")[0], re.M))
    for kind in listed.partition("in --json): ")[2].partition("\n")[0].split("; "):
        effect, _, places = kind.partition("@")
        names |= {f"{effect}@{place}" for place in places.split(", ")}
    hidden = {f"{i['effect']}@{i['at']}" for i in done.json["invisible"] if i["effect"] != "release"}
    assert len(hidden) > 12 and hidden == {name for name in names if not name.startswith("release")}
