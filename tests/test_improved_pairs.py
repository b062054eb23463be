"""A machine and its parameters that `improve` writes: no pair that does not fit is ever accepted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from pkmcal_cli.diagnosis.closed_loop import Improvement
from pkmcal_cli.workflow import improve as workflow
from tests.command import TRIGLIDE, clean, environment, run

pytestmark = pytest.mark.usefixtures("unsized")

MACHINE, VALUES = "better.yaml", "better.params.yaml"
IMPROVE = [
    "improve", "base.yaml", "meas.csv", "--validation", "apart.csv", "--only", "backlash@q1,backlash@q2", "-o", MACHINE,
    "--force", "-q",
]  # fmt: skip
Pair = tuple[str, str]


@dataclass(frozen=True)
class Made:
    """Texts of a base machine and its measurements, of an old and a new pair; what the loop found."""

    base: dict[str, str]
    old: Pair
    new: Pair
    found: Improvement


def pair() -> Pair:
    return Path(MACHINE).read_text(encoding="utf-8"), Path(VALUES).read_text(encoding="utf-8")


def lay(machine: str, values: str) -> None:
    Path(MACHINE).write_text(machine, encoding="utf-8")
    Path(VALUES).write_text(values, encoding="utf-8")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """The Triglide with backlash at a drive: improved by hand with another effect, then by `improve`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("made"))
        Path("base.yaml").write_text(Path(TRIGLIDE).read_text(encoding="utf-8"), encoding="utf-8")
        Path("true.yaml").write_text("extends: base.yaml\neffects: {backlash@q1: {}}\n")
        Path("true.params.yaml").write_text("parameters: {backlash@q1.b: 300 um}\n")
        grid = ["--grid", "x=200:700:6,y=200:350:5", "--noise", "declared", "-p", "true.params.yaml"]
        for seed, table in ((1, "meas.csv"), (2, "apart.csv")):
            assert clean(run("simulate", "true.yaml", *grid, "--seed", seed, "-o", table)).code == 0
        base = {name: Path(name).read_text(encoding="utf-8") for name in ("base.yaml", "meas.csv", "apart.csv")}
        Path(MACHINE).write_text("extends: base.yaml\neffects: {zero@q2: {}}\n")
        select = ["--select", "l1,l2,zero@q2.o", "--holdout", "none", "-o", VALUES]
        assert clean(run("calibrate", MACHINE, "meas.csv", *select)).code == 0
        old, kept, plain = pair(), [], workflow.improve
        patch.setattr(workflow, "improve", lambda *a, **k: kept.append(plain(*a, **k)) or kept[-1])
        assert clean(run(*IMPROVE)).code == 0
        return Made(base, old, pair(), kept[0])


@pytest.fixture(autouse=True)
def _folder(made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in made.base.items():
        Path(name).write_text(text, encoding="utf-8")


def accepted() -> bool:
    """Whether commands take the pair that stands there."""
    codes = {
        run("simulate", MACHINE, "meas.csv", "-p", VALUES, "-o", "out.csv", "--force").code,
        run("sensitivity", MACHINE, "-p", VALUES).code,
    }
    assert codes in ({0}, {3})
    return codes == {0}


def test_pairs_are_taken_and_mixed_ones_refused(made: Made) -> None:
    for machine, _ in (made.old, made.new):
        for _, values in (made.old, made.new):
            lay(machine, values)
            assert accepted() == ((machine, values) in (made.old, made.new))


def test_the_parameters_name_the_improved_machine(made: Made) -> None:
    """Neither the machine that was improved takes them, nor the improved one those of its base."""
    lay(*made.new)
    done = clean(run("sensitivity", "base.yaml", "-p", VALUES))
    words = (
        "these values belong to another machine, `better.yaml`; `base.yaml` differs (missing: effect `backlash@q1`)\n"
    )
    assert done.code == 3 and words in done.err and done.err.count("error[") == 1
    assert run("calibrate", "base.yaml", "meas.csv", "--select", "l1", "--holdout", "none", "-o", "p.yaml").code == 0
    done = clean(run("calibrate", MACHINE, "meas.csv", "-p", "p.yaml"))
    assert done.code == 3 and "`better.yaml` differs (additional: effect `backlash@q1`)\n" in done.err


def test_an_overlay_and_the_flat_machine_are_one(made: Made) -> None:
    lay(*made.new)
    Path("flat.yaml").write_text(made.base["base.yaml"] + "effects: {backlash@q1: {b: 100 um}}\n", encoding="utf-8")
    assert run("sensitivity", "flat.yaml", "-p", VALUES).code == 0


def test_improve_writes_parameters_first(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """And takes them back where the machine cannot follow."""
    lay(*made.old)
    before = {p.name: p.read_bytes() for p in Path().iterdir()}
    plain, moved = os.replace, []

    def second_fails(source: Path, target: Path) -> None:
        moved.append(Path(target).name)
        if len(moved) == 2:
            raise OSError(28, "No space left on device")
        plain(source, target)

    monkeypatch.setattr(workflow, "improve", lambda *_, **__: made.found)
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", second_fails)
        done = clean(run(*IMPROVE, "--json"))
    assert moved == [VALUES, MACHINE, VALUES]
    assert done.code == 4 and "No space left on device" in done.err and done.out == ""
    assert {p.name: p.read_bytes() for p in Path().iterdir()} == before
    assert clean(run(*IMPROVE)).code == 0 and pair()[0] == made.new[0] and accepted()


def test_a_base_that_is_edited_meanwhile(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """The values were found on another machine than the one that would be extended."""

    def edited(*_: object, **__: object) -> Improvement:
        text = made.base["base.yaml"].replace("length: l3, k: k3", "length: l3, k: k2")
        Path("base.yaml").write_text(text.replace("  k3: ", "  # k3: "), encoding="utf-8")
        return made.found

    monkeypatch.setattr(workflow, "improve", edited)
    done = clean(run(*IMPROVE))
    assert done.code == 3 and "base.yaml: error[file]: this file has changed since it was read" in done.err
    assert {p.name for p in Path().iterdir()} == set(made.base)


@pytest.mark.parametrize("there", [MACHINE, VALUES])
def test_neither_is_written_where_one_exists(there: str, made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workflow, "improve", lambda *_, **__: made.found)
    Path(there).write_text("mine")
    done = clean(run(*(a for a in IMPROVE if a != "--force")))
    assert done.code == 4 and f"{there}: error[output]: the file already exists" in done.err
    assert {p.name for p in Path().iterdir()} == {*made.base, there} and Path(there).read_text() == "mine"


def test_a_base_whose_name_must_be_quoted(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workflow, "improve", lambda *_, **__: made.found)
    for name in ("a: b #.yaml", "x - y.yaml", "null.yaml", "quo'te\".yaml", "\u6a5f.yaml"):
        Path("base.yaml").rename(name)
        assert clean(run("improve", name, *IMPROVE[2:])).code == 0
        assert accepted()
        Path(name).rename("base.yaml")
    Path("t\udcff.yaml").write_text(made.base["base.yaml"], encoding="utf-8")
    done = clean(run("improve", "t\udcff.yaml", *IMPROVE[2:]))
    assert done.code == 2 and "whose name is not printable\nhelp: rename the machine file" in done.err


def test_targets_behind_links(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """The written machine finds its base under the name of the link, and under its own."""
    monkeypatch.setattr(workflow, "improve", lambda *_, **__: made.found)
    Path("far/away").mkdir(parents=True)
    Path("near").symlink_to("far/away")
    assert clean(run(*IMPROVE[:3], "-o", "near/better.yaml", "-q")).code == 0
    assert run("sensitivity", "near/better.yaml", "-p", "near/better.params.yaml").code == 0
    Path("link.yaml").symlink_to("far/real.yaml")
    assert clean(run(*IMPROVE[:3], "-o", "link.yaml", "-q")).code == 0
    for name in ("link.yaml", "far/real.yaml"):
        assert run("sensitivity", name, "-p", "link.params.yaml").code == 0


@pytest.mark.parametrize("target", ["/dev/null", "-"])
def test_a_pair_is_two_files(target: str) -> None:
    done = clean(run("improve", "base.yaml", "meas.csv", "-o", target))
    assert done.code == 2 and "the machine and its parameters need two files" in done.err


KILLED = """
import os, signal, sys
step, at, after = sys.argv[1], int(sys.argv[2]), sys.argv[3] == "after"
plain, calls = getattr(os, step), 0
def dying(*arguments, **named):
    global calls
    calls += 1
    if calls == at and not after:
        os.kill(os.getpid(), signal.SIGKILL)
    done = plain(*arguments, **named)
    if calls == at:
        os.kill(os.getpid(), signal.SIGKILL)
    return done
setattr(os, step, dying)
from pkmcal_cli.base.outputs import write_together
machine, values = (open(file).read() for file in ("new.yaml", "new.params.yaml"))
with write_together(["better.params.yaml", "better.yaml"], (), force=True) as files:
    files[0].write(values)
    files[1].write(machine)
"""
BETWEEN = [("replace", 1, "after"), ("replace", 2, "before")]


@pytest.mark.parametrize(
    ("step", "at", "when"),
    [("fsync", 1, "after"), ("fsync", 2, "after"), ("link", 1, "after"), ("replace", 1, "before"), *BETWEEN,
     ("replace", 2, "after")],
)  # fmt: skip
def test_killed_between_two_steps(step: str, at: int, when: str, made: Made) -> None:
    """What stands there afterwards is the old pair, the new one, or one that commands refuse."""
    lay(*made.old)
    Path("new.yaml").write_text(made.new[0], encoding="utf-8")
    Path("new.params.yaml").write_text(made.new[1], encoding="utf-8")
    program = [sys.executable, "-c", KILLED, step, str(at), when]
    done = subprocess.run(program, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    if (step, at, when) in BETWEEN:
        assert pair() == (made.old[0], made.new[1]), "parameters come first"
        assert not accepted()
    else:
        assert pair() == (made.new if (step, at, when) == ("replace", 2, "after") else made.old)
        assert accepted()


def test_other_constants_of_the_same_effect_are_another_machine(made: Made) -> None:
    """Two runs of `improve` may find one effect, spread over other travels: its sizes mean other curves."""
    text = "extends: base.yaml\neffects: {pitch_curve@q1: {p2: {value: 10 um}, over: [0, %s]}}\n"
    pairs = []
    for end in ("500", "600"):
        Path(MACHINE).write_text(text % end)
        select = ["--select", "pitch_curve@q1.p2", "--holdout", "none", "-o", VALUES, "--force"]
        assert run("calibrate", MACHINE, "meas.csv", *select).code == 0
        pairs.append(pair())
    lay(pairs[0][0], pairs[1][1])
    assert not accepted()
    assert "changed: effect `pitch_curve@q1`" in run("sensitivity", MACHINE, "-p", VALUES).err
