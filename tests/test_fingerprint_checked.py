"""`-p` takes the values of a machine for this machine only: refused otherwise, reused on purpose, written by hand."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from tests.command import GRID, TRIGLIDE, TRIGLIDE_DATA, Done, clean, run


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


EFFECT = f"extends: {TRIGLIDE}\neffects: {{backlash@q3: {{}}}}\n"
TAKING = {
    "calibrate": [TRIGLIDE_DATA, "--select", "l1,l2", "--holdout", "none"],
    "simulate": [TRIGLIDE_DATA],
    "simulate --uncertainty": [TRIGLIDE_DATA, "--uncertainty"],
    "sensitivity": ["--grid", GRID],
    "observability": ["--grid", GRID],
    "plan": ["--grid", GRID],
}


@pytest.fixture(scope="module")
def parameters(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    """Parameter files of the Triglide, and of the Triglide with backlash."""
    folder = tmp_path_factory.mktemp("parameters")
    (folder / "effect.yaml").write_text(EFFECT)
    texts = []
    for machine, more in ((TRIGLIDE, ""), (folder / "effect.yaml", ",backlash@q3.b")):
        out = folder / "p.yaml"
        options = ["--select", f"l1,l2{more}", "--holdout", "none", "-o", out, "--force"]
        assert clean(run("calibrate", machine, TRIGLIDE_DATA, *options, "--holdout", "none")).code == 0
        texts.append(out.read_text(encoding="utf-8"))
    return texts[0], texts[1]


def taken(command: str, machine: str | Path, text: str) -> Done:
    Path("p.yaml").write_text(text, encoding="utf-8")
    return clean(run(*command.split(), machine, *TAKING[command], "-p", "p.yaml"))


def without(text: str) -> str:
    """A parameter file whose fingerprint has been deleted, which is one line."""
    lines = [line for line in text.splitlines(keepends=True) if not line.startswith("fingerprint:")]
    assert len(lines) == text.count("\n") - 1
    return "".join(lines)


@pytest.mark.parametrize("command", TAKING)
def test_every_command_refuses_values_of_another_machine(command: str, parameters: tuple[str, str]) -> None:
    """Values of the machine without an effect for that with it, and the other way round; one error, with the remedy."""
    Path("effect.yaml").write_text(EFFECT)
    bare, full = parameters
    line = 1 + full.splitlines().index(next(x for x in full.splitlines() if x.startswith("fingerprint: ")))
    improved = full[full.index('{"of": "') + 8 :].partition('"')[0]
    lacking = f"help: give `{improved}`, the machine file that declares `backlash@q3`; to use the other values, delete "
    lacking += "this line and the entries of these effects in `parameters`\n"
    whole = "help: use the machine that they belong to; to accept them anyway, delete this line\n"
    for machine, text, words, remedy in (
        (Path("effect.yaml"), bare, f"`{TRIGLIDE}`; `effect.yaml` differs (additional: effect `backlash@q3`)\n", whole),
        (TRIGLIDE, full, f"effect.yaml`; `{TRIGLIDE}` differs (missing: effect `backlash@q3`)\n", lacking),
    ):
        done = taken(command, machine, text)
        assert done.code == 3 and done.out == "" and done.err.count("error[") == 1
        assert "error[fingerprint]: these values belong to another machine, " in done.err and words in done.err
        assert done.err.endswith(remedy)
    assert f"p.yaml:{line}:1: " in done.err


def test_values_of_effects_without_a_fingerprint(parameters: tuple[str, str]) -> None:
    """They name the machine file that has them; correlations that are not whole are not passed over in silence."""
    text = without(parameters[1])
    done = taken("sensitivity", TRIGLIDE, text)
    assert done.code == 3 and "help: give the machine file with the effect `backlash@q3`, as `" in done.err
    assert "effect.yaml`, of which these values are; to use the other values" in done.err
    kept = [line for line in text.splitlines(keepends=True) if "backlash@q3.b" not in line]  # `names` too
    spoilt = taken("sensitivity", TRIGLIDE, "".join(kept))
    assert spoilt.code == 0 and "the uncertainties in this file are not used" in spoilt.err
    assert "are not used" not in taken("sensitivity", TRIGLIDE, parameters[0]).err


@pytest.mark.parametrize("command", TAKING)
def test_every_command_takes_values_of_its_machine(command: str, parameters: tuple[str, str]) -> None:
    Path("effect.yaml").write_text(EFFECT)
    for machine, text in zip((Path(TRIGLIDE), Path("effect.yaml")), parameters, strict=True):
        done = taken(command, machine, text)
        assert done.code == 0 and "fingerprint" not in done.err


@pytest.mark.parametrize("command", TAKING)
def test_values_are_reused_on_purpose(command: str, parameters: tuple[str, str]) -> None:
    """Without its fingerprint a file is taken as one that was written by hand, and this is said once."""
    Path("effect.yaml").write_text(EFFECT)
    done = taken(command, "effect.yaml", without(parameters[0]))
    assert done.code == 0
    assert done.err.count("note: p.yaml: no fingerprint: cannot check which machine these values belong to\n") == 1


def test_a_machine_that_was_changed_since(parameters: tuple[str, str]) -> None:
    text = Path(TRIGLIDE).read_text(encoding="utf-8")
    Path("t.yaml").write_text(text)
    assert run("calibrate", "t.yaml", TRIGLIDE_DATA, "--select", "l1", "--holdout", "none", "-o", "p.yaml").code == 0
    written = Path("p.yaml").read_text(encoding="utf-8")
    Path("t.yaml").write_text(text.replace("l1: 300", "l1: 300.5"))
    assert taken("sensitivity", "t.yaml", written).code == 0, "another nominal value"
    Path("t.yaml").write_text(text.replace("length: l1, k: k1", "length: l2, k: k1").replace("l2, k: k2", "l1, k: k2"))
    done = taken("sensitivity", "t.yaml", written)
    words = "these values belong to an earlier version of `t.yaml` (changed: bar `rod1`, bar `rod2`)\n"
    assert done.code == 3 and words in done.err


@pytest.mark.parametrize(
    "value",
    [
        "5", "[]", "text", "{of: 5}", "{of: a, bars: 5}", "{of: a, bars: {rod1: 5}}", "{of: a, bars: [rod1]}",
        '{of: a, bars: {"\\e[31m": "12345678"}}', "{bars: {rod1: {x: y}}}",
    ],
)  # fmt: skip
def test_what_is_no_fingerprint(value: str) -> None:
    done = taken("sensitivity", TRIGLIDE, f"fingerprint: {value}\nparameters: {{l1: 300}}\n")
    assert done.code == 3 and "p.yaml:1:1: error[fingerprint]: this is not the fingerprint of a machine" in done.err
    assert "\x1b" not in done.err


def test_an_empty_fingerprint_is_none() -> None:
    done = taken("sensitivity", TRIGLIDE, "fingerprint:\nparameters: {l1: 300}\n")
    assert done.code == 0 and "no fingerprint" in done.err


def test_a_long_difference_is_cut() -> None:
    bars = ", ".join(f'rod{k}: "12345678"' for k in range(1000))
    text = f"fingerprint: {{of: {'x' * 300}, bars: {{{bars}}}}}\nparameters: {{l1: 1}}\n"
    done = taken("sensitivity", TRIGLIDE, text)
    assert done.code == 3 and "and 994 more; " in done.err and len(done.err) < 2000


@pytest.mark.slow
def test_names_of_machines_are_shown_as_they_are() -> None:
    for name in ("a b: #.yaml", "\u6a5f \U0001f600.yaml", "line\u2028break.yaml", 'quo"te.yaml', "t\udcff.yaml"):
        Path(name).write_text(Path(TRIGLIDE).read_text(encoding="utf-8"))
        options = ["--select", "l1", "--holdout", "none", "-o", "p.yaml", "--force"]
        assert run("calibrate", name, TRIGLIDE_DATA, *options, "--holdout", "none").code == 0
        shown = yaml.safe_load(Path("p.yaml").read_text(encoding="utf-8"))["fingerprint"]["of"]
        assert shown == name.replace("\udcff", "?").replace("\u2028", "?")
        assert run("sensitivity", name, "-p", "p.yaml", "--grid", GRID).code == 0
