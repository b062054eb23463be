"""The hostile checks that fit a normal run: mutants are killed, file operations fail whole, attacks do nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import MACHINES, environment, run
from tests.hostile import file_operations
from tests.hostile.broken_disk import HOWS
from tests.hostile.file_commands import COMMANDS, prepare
from tests.hostile.guarded_run import MARK
from tests.hostile.mutants import MUTANTS, ROOT, changed, outcomes

IN_CI = (
    tuple(m for m in MUTANTS if m.test.startswith("tests/test_survivors.py::"))[:3]
    + tuple(m for m in MUTANTS if m.test.startswith("tests/test_elements.py::"))[:7]
)


def test_every_mutant_applies_and_names_tests_that_exist() -> None:
    """Its text occurs exactly once, and what is left is a program."""
    assert len(MUTANTS) >= 60
    for mutant in MUTANTS:
        file = ROOT / "pkmcal_cli" / mutant.file
        compile(changed(mutant, file.read_text(encoding="utf-8")), mutant.file, "exec")
        for test in mutant.test.split():
            path, _, name = test.partition("::")
            assert f"def {name.partition('[')[0]}" in (ROOT / path).read_text(encoding="utf-8"), test


def test_ten_mutants_are_killed() -> None:
    assert len(IN_CI) == 10
    assert {how for _, how in outcomes(IN_CI)} == {"killed"}


@pytest.mark.slow
def test_every_mutant_is_killed() -> None:
    assert {how for _, how in outcomes(MUTANTS)} == {"killed"}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    prepare(folder)
    return folder


@pytest.mark.parametrize("command", [name for name, each in COMMANDS.items() if each.fast])
def test_a_file_operation_that_fails_leaves_no_torn_file(command: str, inputs: Path) -> None:
    count, faults = file_operations.faults(command, inputs)
    assert count >= 7 * len(HOWS) and not faults


@pytest.mark.parametrize("command", [name for name, each in COMMANDS.items() if not each.fast and not each.before])
def test_the_others_are_commands_that_end_well(command: str, inputs: Path, tmp_path: Path) -> None:
    """Disturbing all their operations takes an hour; a command line that is refused would be found only then."""
    done = run(*(word.format(o=tmp_path, i=inputs, m=MACHINES) for word in COMMANDS[command].command.split()))
    assert done.code == 0, done.err


@pytest.mark.slow
@pytest.mark.parametrize("command", [name for name, each in COMMANDS.items() if not each.fast])
def test_nor_of_any_other_command(command: str, inputs: Path) -> None:
    count, faults = file_operations.faults(command, inputs)
    assert count >= 7 * len(HOWS) and not faults


def _attacked(*arguments: str) -> str:
    """In a process of its own: an audit hook stays as long as its process."""
    command = [sys.executable, "-m", "tests.hostile.attacks", *arguments]
    done = subprocess.run(command, cwd=ROOT, env=environment(), capture_output=True, text=True, check=False)
    assert not done.returncode, done.stdout + done.stderr[-1000:]
    return done.stdout


def test_attacks_run_nothing_and_write_nowhere_else() -> None:
    assert int(_attacked("24").split()[0]) >= 100


@pytest.mark.slow
def test_nor_do_all_attacks() -> None:
    assert int(_attacked().split()[0]) >= 2000


@pytest.mark.parametrize("act", [
    f"eval({MARK!r} + '=0' if False else repr({MARK!r}))", "os.system('true')", "subprocess.run(['true'])",
    "socket.socket()", "open(os.path.join(out, '..', 'x'), 'w')", "os.mkdir(os.path.join(out, '..', 'x'))",
    "open('/etc/passwd')", f"exec('{MARK} = 1')", "os.rename(out, out + '2')",
])  # fmt: skip
def test_the_guard_sees_what_is_forbidden(act: str, tmp_path: Path) -> None:
    """Else the attacks would prove nothing."""
    (tmp_path / "out").mkdir()
    code = (
        "import os, socket, subprocess, sys\nfrom pathlib import Path\nfrom tests.hostile.guarded_run import Guard\n"
        f"out = {str(tmp_path / 'out')!r}\nguard = Guard((), (Path(out),))\n"
        f"open(os.path.join(out, 'fine'), 'w').close()\nguard.on = True\n"
        f"open(os.path.join(out, 'fine'), 'w').close()\nassert not guard.found, guard.found\n{act}\nguard.on = False\n"
        "assert guard.found\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, env=environment(), capture_output=True, text=True)
    assert not done.returncode, done.stderr
