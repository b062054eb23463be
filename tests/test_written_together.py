"""Several files that appear together: all or none, whatever fails on the way."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from pkmcal_cli.base.errors import OutputError
from pkmcal_cli.base.outputs import write_together

NAMES = ("first.txt", "second.txt", "third.txt")
MODES = {"first.txt": 0o640, "second.txt": 0o600, "third.txt": 0o644}


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def write(*, force: bool, within: Callable[[], None] = lambda: None) -> None:
    with write_together(NAMES, (), force=force) as files:
        for file in files:
            file.write(f"new {len(file.name)}")
        within()


def contents() -> dict[str, str]:
    return {p.name: p.read_text()[:3] for p in Path().iterdir()}


NEW, OLD = dict.fromkeys(NAMES, "new"), dict.fromkeys(NAMES, "old")


def old_files(names: tuple[str, ...] = NAMES) -> None:
    for name in names:
        Path(name).write_text("old")
        Path(name).chmod(MODES[name])


def modes() -> dict[str, int]:
    return {p.name: p.stat().st_mode & 0o777 for p in Path().iterdir()}


def test_all_appear_at_the_end() -> None:
    def nothing_yet() -> None:
        assert not any(Path(name).exists() for name in NAMES)

    write(force=False, within=nothing_yet)
    assert contents() == NEW


def test_all_are_replaced_with_their_modes_kept() -> None:
    old_files()
    write(force=True)
    assert contents() == NEW and modes() == MODES


def test_links_are_written_through() -> None:
    old_files()
    Path("folder").mkdir()
    Path("second.txt").rename("folder/real.txt")
    Path("second.txt").symlink_to("folder/real.txt")
    write(force=True)
    assert Path("second.txt").is_symlink() and Path("folder/real.txt").read_text().startswith("new")
    assert [p.name for p in Path("folder").iterdir()] == ["real.txt"]


@pytest.mark.parametrize("there", NAMES)
def test_without_force_none_is_there_before(there: str) -> None:
    old_files((there,))
    with pytest.raises(OutputError, match="the file already exists") as caught:
        write(force=False)
    assert caught.value.where == there and contents() == {there: "old"}


@pytest.mark.parametrize("meanwhile", NAMES)
def test_what_appears_meanwhile_stays_and_the_others_do_not_come(meanwhile: str) -> None:
    with pytest.raises(OutputError, match="the file already exists"):
        write(force=False, within=lambda: old_files((meanwhile,)))
    assert contents() == {meanwhile: "old"}


def no_links(*_: object) -> None:
    raise PermissionError(1, "Operation not permitted")


@pytest.mark.parametrize("meanwhile", NAMES)
def test_what_appears_meanwhile_stays_without_links_too(meanwhile: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a file system that has no links, as on many memory cards."""
    monkeypatch.setattr(os, "link", no_links)
    with pytest.raises(OutputError, match="the file already exists"):
        write(force=False, within=lambda: old_files((meanwhile,)))
    assert contents() == {meanwhile: "old"}


@pytest.mark.parametrize("at", [1, 2, 3])
def test_without_links_a_copy_comes_back(at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever of the three cannot be moved, what the earlier ones replaced is there again."""
    old_files()
    plain, calls = os.replace, 0

    def failing(source: Path, target: Path) -> None:
        nonlocal calls
        calls += 1
        if calls == at:
            raise OSError(28, "No space left on device")
        plain(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "link", no_links)
        patch.setattr(os, "replace", failing)
        with pytest.raises(OutputError, match="No space left on device"):
            write(force=True)
    assert contents() == OLD and modes() == MODES


def test_what_is_moved_is_on_the_disk_before_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    """A power cut leaves no later file without the earlier ones, and none without its text."""
    old_files()
    steps, sync, move = list[str](), os.fsync, os.replace

    def synced(descriptor: int) -> None:
        steps.append("folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "text")
        sync(descriptor)

    def moved(source: Path, target: Path) -> None:
        steps.append("move")
        move(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", moved)
    write(force=True)
    assert steps == [*["text"] * 3, *["move", "folder"] * 3]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_within_leaves_nothing(error: type[BaseException]) -> None:
    def fail() -> None:
        raise error

    old_files()
    with pytest.raises(error):
        write(force=True, within=fail)
    assert contents() == OLD and modes() == MODES


def test_two_results_in_one_file() -> None:
    Path("second.txt").symlink_to("first.txt")
    with pytest.raises(OutputError, match="several results would be written to this file"):
        write(force=True)
    assert list(Path().iterdir()) == [Path("second.txt")]


@pytest.mark.parametrize("force", [True, False])
@pytest.mark.parametrize("step", ["fsync", "replace", "link", "chmod"])
@pytest.mark.parametrize("at", range(1, 7))
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_disk_that_fails_at_any_step(
    force: bool, step: str, at: int, error: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All old or all new, and nothing left behind, whichever call of the system is the one that fails."""
    if force:
        old_files()
    before, plain, calls = contents(), getattr(os, step), 0

    def failing(*arguments: Any, **named: Any) -> Any:
        nonlocal calls
        calls += 1
        if calls == at:
            raise error
        return plain(*arguments, **named)

    with monkeypatch.context() as patch:
        patch.setattr(os, step, failing)
        try:
            write(force=force)
        except (OutputError, KeyboardInterrupt):
            assert calls >= at
    assert contents() in (before, NEW)
    assert not force or modes() == MODES
