"""No result replaces what it is made from: any file that was read, by any name, even with --force."""

from __future__ import annotations

import builtins
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from pkmcal_cli.base.errors import OutputError
from pkmcal_cli.base.outputs import check_target
from tests.command import MACHINES, TRIGLIDE, Done, clean, environment, run

MACHINE = {"m.yaml", "mid.yaml", "root.yaml"}
COMMANDS: dict[str, tuple[list[str], set[str]]] = {
    "calibrate": (
        ["calibrate", "m.yaml", "a.csv", "b.csv", "--holdout", "h.csv", "-p", "p.yaml", "--select", "l1,l2"],
        MACHINE | {"a.csv", "b.csv", "h.csv", "p.yaml"},
    ),
    "simulate": (["simulate", "m.yaml", "a.csv", "-p", "p.yaml"], MACHINE | {"a.csv", "p.yaml"}),
    "plan": (["plan", "m.yaml", "a.csv", "-p", "p.yaml"], MACHINE | {"a.csv", "p.yaml"}),
    "improve": (["improve", "m.yaml", "a.csv", "--validation", "h.csv"], MACHINE | {"a.csv", "h.csv"}),
}
PAIRS = [(command, file) for command, (_, files) in COMMANDS.items() for file in sorted(files)]
WORK = ("calibration.calibrated", "plan.plan_of", "improve.improve", "simulation.predict")


@pytest.fixture(scope="module")
def texts() -> dict[str, str]:
    """A machine in three files, measurements in three, parameters."""
    tables = {}
    for k, name in enumerate(("a.csv", "b.csv", "h.csv")):
        grid = f"x={200 + k}:{700 + k}:4,y=200:350:6"
        tables[name] = clean(run("simulate", TRIGLIDE, "--grid", grid, "--noise", "declared", f"--seed={k}")).out
    return tables | {
        "root.yaml": Path(TRIGLIDE).read_text(encoding="utf-8"),
        "mid.yaml": "extends: root.yaml\nparameters: {l2: {range: 0.2}}\n",
        "m.yaml": "extends: mid.yaml\nparameters: {l1: {range: 0.2}}\n",
        "p.yaml": "parameters: {l1: 300.1}\n",
    }


@pytest.fixture(autouse=True)
def folder(texts: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the commands are run."""
    monkeypatch.chdir(tmp_path)
    for name, text in texts.items():
        Path(name).write_text(text, encoding="utf-8")
    return tmp_path


def files() -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path().iterdir()}


def refused(done: Done, target: str, before: dict[str, bytes]) -> None:
    clean(done)
    assert done.code == 4, done.err
    assert f"{target}: error[output]: this file is an input of the command" in done.err
    assert done.err.endswith("help: choose another name for the result\n") and done.out == ""
    assert files() == before, "nothing has changed, nothing is left behind"


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """The work does not begin."""

    def begun(*_: Any, **__: Any) -> None:
        raise AssertionError("the work has begun")

    for name in WORK:
        monkeypatch.setattr(f"pkmcal_cli.workflow.{name}", begun)


@pytest.mark.parametrize(("command", "file"), PAIRS)
@pytest.mark.usefixtures("no_work")
def test_no_file_that_is_read_is_replaced(command: str, file: str) -> None:
    before = files()
    arguments, _ = COMMANDS[command]
    refused(run(*arguments, "-o", file, "--force"), file, before)


@pytest.mark.parametrize("command", COMMANDS)
def test_these_are_all_files_that_are_read(command: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What this test finds opened, and what the command's result lists, is what the test above goes through."""
    opened: set[str] = set()
    plain = builtins.open

    def spy(file: Any, mode: str = "r", *more: Any, **named: Any) -> Any:
        path = Path(os.path.realpath(file)) if isinstance(file, str | Path) else Path()
        if path.parent == folder and "r" in mode:
            opened.add(path.name)
        return plain(file, mode, *more, **named)

    monkeypatch.setattr("builtins.open", spy)
    arguments, expected = COMMANDS[command]
    assert run(*arguments, "-o", "out.yaml").code in (0, 1)
    assert {name for name in opened if not name.endswith(".part")} == expected
    if command in ("calibrate", "simulate"):
        told = "out.yaml.provenance.yaml" if command == "simulate" else "out.yaml"
        text = Path(told).read_text(encoding="utf-8")
        assert all(f"{name}: " in text for name in expected), "with their sha256"


@pytest.mark.parametrize("name", ["./mid.yaml", "../{folder}/mid.yaml", "{path}/mid.yaml", "soft.yaml", "hard.yaml"])
@pytest.mark.usefixtures("no_work")
def test_names_do_not_count(name: str, folder: Path) -> None:
    Path("soft.yaml").symlink_to("mid.yaml")
    os.link("mid.yaml", "hard.yaml")
    before = files()
    target = name.format(folder=folder.name, path=folder)
    done = run("calibrate", "m.yaml", "a.csv", "-o", target, "--force")
    refused(done, target, before)
    assert "input of the command, `mid.yaml`" in done.err, "by the name under which it was read"


@pytest.mark.usefixtures("no_work")
def test_inputs_may_be_links_too(folder: Path) -> None:
    Path("link.csv").symlink_to("a.csv")
    before = files()
    refused(run("calibrate", "m.yaml", "link.csv", "-o", "a.csv", "--force"), "a.csv", before)


@pytest.mark.usefixtures("no_work")
def test_without_force_the_remedy_is_not_force() -> None:
    done = run("calibrate", "m.yaml", "a.csv", "-o", "a.csv")
    assert done.code == 4 and "--force" not in done.err and "input of the command" in done.err


@pytest.mark.usefixtures("no_work")
def test_the_parameters_of_an_improved_machine_are_a_target_too() -> None:
    Path("h.csv").rename("better.params.yaml")
    before = files()
    done = run("improve", "m.yaml", "a.csv", "--validation", "better.params.yaml", "-o", "better.yaml", "--force")
    refused(done, "better.params.yaml", before)


def test_a_file_that_comes_through_stdin(monkeypatch: pytest.MonkeyPatch) -> None:
    before, target = files(), ("-o", "a.csv", "--force")
    with Path("a.csv").open() as file:
        done = subprocess.run(
            [sys.executable, "-m", "pkmcal_cli", "simulate", "m.yaml", "-", *target],
            stdin=file, capture_output=True, text=True, env=environment(), check=False,
        )  # fmt: skip
    refused(Done(done.returncode, done.stdout, done.stderr), "a.csv", before)
    for command in ("calibrate", "plan"):
        with Path("a.csv").open() as file, monkeypatch.context() as patch:
            patch.setattr(sys, "stdin", file)
            refused(run(command, "m.yaml", "-", *target), "a.csv", before)


@pytest.mark.parametrize("name", ["-", "<stdin>"])
def test_stdin_is_its_file_as_argument_and_among_what_was_read(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("a.csv").open() as file:
        monkeypatch.setattr(sys, "stdin", file)
        check_target("new.csv", [name])
        with pytest.raises(OutputError, match=r"an input of the command, `<stdin>`"):
            check_target("a.csv", [name], force=True)


def test_pipes_and_devices_are_no_files() -> None:
    """`-o /dev/stdout` writes, though stdin and stdout may be one terminal."""
    with Path("a.csv").open() as file:
        done = subprocess.run(
            [sys.executable, "-m", "pkmcal_cli", "simulate", "m.yaml", "/dev/stdin", "-o", "/dev/stdout"],
            stdin=file, capture_output=True, text=True, env=environment(), check=False,
        )  # fmt: skip
    assert done.returncode == 0 and "\nid,q1 [mm],q2 [mm],q3 [mm],x [mm],y [mm]\n" in done.stdout
    check_target("/dev/null", ["/dev/null"], force=True)


def test_a_target_that_is_linked_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is looked at again before anything is written."""
    before = files()
    from pkmcal_cli.workflow import calibration

    plain = calibration.calibrated

    def slow(*arguments: Any, **named: Any) -> Any:
        os.link("h.csv", "new.yaml")
        return plain(*arguments, **named)

    monkeypatch.setattr(calibration, "calibrated", slow)
    done = run("calibrate", "m.yaml", "a.csv", "--holdout", "h.csv", "-o", "new.yaml", "--force", "-q")
    assert done.code == 4 and "input of the command, `h.csv`" in done.err
    assert files() == before | {"new.yaml": before["h.csv"]}


def test_pictures_replace_no_input() -> None:
    pytest.importorskip("matplotlib")
    plain = MACHINES / "triglide-nonredundant.yaml"
    rows = plain.with_suffix(".csv").read_text(encoding="utf-8").splitlines(keepends=True)
    Path("variance.svg").write_text("".join(rows[:230:10]), encoding="utf-8")
    before = files()
    done = clean(run("diagnose", plain, "variance.svg", "--plots", "."))
    assert done.code == 4 and "variance.svg: error[output]: this file is an input of the command" in done.err
    assert files() == before, "not one picture is drawn"


def test_an_existing_result_is_replaced_as_ever() -> None:
    Path("out.yaml").write_text("old")
    assert run("calibrate", "m.yaml", "a.csv", "-o", "out.yaml").code == 4
    assert run("calibrate", "m.yaml", "a.csv", "--select", "l1,l2", "-o", "out.yaml", "--force").code == 0
    assert "status: converged" in Path("out.yaml").read_text()
