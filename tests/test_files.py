"""Written tables and files: exact, whole or absent."""

from __future__ import annotations

import csv
import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from pkmcal_cli.base.errors import BadInput, OutputError
from pkmcal_cli.base.files import open_input, sha256
from pkmcal_cli.base.outputs import check_target, write_text
from pkmcal_cli.base.shipped import missing_hint
from pkmcal_cli.csv_files.origin import Origin
from pkmcal_cli.csv_files.writer import open_writer
from tests.command import TRIGLIDE, run
from tests.csv_tables import read_table, write_table


@settings(deadline=None)
@given(values=st.lists(st.floats(allow_infinity=False), min_size=1, max_size=20))
def test_floats_come_back_exactly(values: list[float], tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "round.csv"
    write_table(path, [("x", None, np.array(values)), ("n", None, np.arange(len(values)))], force=True)
    assert np.array_equal(read_table(path).numbers["x"], values, equal_nan=True)


def test_written_table(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    columns = [
        ("id", None, ["a", "b;c", 'd"e,f']),
        ("x", "mm", np.array([0.0015, np.nan, -3.0])),
        ("q1", "deg", np.array([np.pi, 0.0, -np.pi / 2])),
        ("n", None, np.array([1, 2, 3])),
    ]
    write_table(path, columns, origin=Origin("made", "first\nsecond", {"seed": 3}), digits=12)
    expected = 'id,x [mm],q1 [deg],n\na,1.5,180.0,1\nb;c,,0.0,2\n"d""e,f",-3000.0,-90.0,3\n'
    assert path.read_text() == expected
    back = read_table(path)
    assert back.units == (None, "mm", "deg", None)
    assert back.texts["id"] == ("a", "b;c", 'd"e,f')
    told = yaml.safe_load(path.with_name("out.csv.provenance.yaml").read_text())
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert told == {
        "data": "out.csv", "sha256": digest, "kind": "made", "note": "first\nsecond", "provenance": {"seed": 3}
    }  # fmt: skip


def test_one_column_with_gaps_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    write_table(path, [("x", None, np.array([1.0, np.nan, 2.0]))])
    assert np.array_equal(read_table(path).numbers["x"], [1, np.nan, 2], equal_nan=True)


def test_infinite_numbers_are_not_written(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="infinite"):
        write_table(tmp_path / "out.csv", [("x", "mm", np.array([np.inf]))])
    assert list(tmp_path.iterdir()) == []


def test_blocks_are_appended(tmp_path: Path) -> None:
    with open_writer(tmp_path / "out.csv", [("x", "mm"), ("id", None)], ()) as writer:
        for start in range(3):
            writer.write([np.array([start, start + 0.5]), [f"p{start}", "q"]])
    rows = list(csv.reader((tmp_path / "out.csv").open()))
    assert rows[0] == ["x [mm]", "id"]
    assert [row[0] for row in rows[1:]] == ["0.0", "500.0", "1000.0", "1500.0", "2000.0", "2500.0"]


def test_to_stdout(capsys: pytest.CaptureFixture[str]) -> None:
    write_table("-", [("x", "mm", np.array([1.0]))], origin=Origin("made", "first\nsecond", {"seed": 3}))
    assert capsys.readouterr().out == "# first\n# second\n# provenance:\n#   seed: 3\nx [mm]\n1000.0\n"


# --- files --------------------------------------------------------------------------------------------------


def test_a_file_appears_whole(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with write_text(target, ()) as file:
        file.write("half")
        assert not target.exists()
    assert target.read_text() == "half"
    assert [p.name for p in tmp_path.iterdir()] == ["a.txt"]
    umask = os.umask(0)
    os.umask(umask)
    assert target.stat().st_mode & 0o777 == 0o666 & ~umask


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_or_not_at_all(tmp_path: Path, error: type[BaseException]) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(error), write_text(target, (), force=True) as file:
        file.write("half")
        raise error
    assert target.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 1


def test_nothing_is_overwritten_without_force(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    target.chmod(0o640)
    with pytest.raises(OutputError, match="exists") as caught, write_text(target, ()):
        raise AssertionError
    assert caught.value.exit_code == 4
    assert "use `--force` to replace it" in caught.value.text()
    with write_text(target, (), force=True) as file:
        file.write("new")
    assert target.read_text() == "new"
    assert target.stat().st_mode & 0o777 == 0o640


def test_a_file_that_appears_meanwhile_stays(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    with pytest.raises(OutputError, match="exists"), write_text(target, ()) as file:
        file.write("mine")
        target.write_text("theirs")
    assert target.read_text() == "theirs"
    assert len(list(tmp_path.iterdir())) == 1


def test_links_are_written_through(tmp_path: Path) -> None:
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("real.txt")
    with write_text(tmp_path / "link.txt", (), force=True) as file:
        file.write("new")
    assert (tmp_path / "real.txt").read_text() == "new"
    assert (tmp_path / "link.txt").is_symlink()


def test_targets_are_checked_before_the_work(tmp_path: Path) -> None:
    check_target("-", ())
    check_target("/dev/null", ())
    check_target(tmp_path / "a.csv", ())
    (tmp_path / "b.csv").touch()
    with pytest.raises(OutputError, match="exists"):
        check_target(tmp_path / "b.csv", ())
    check_target(tmp_path / "b.csv", (), force=True)
    with pytest.raises(OutputError, match="the folder does not exist"):
        check_target(tmp_path / "no" / "a.csv", ())
    with pytest.raises(OutputError, match="this is a folder"):
        check_target(tmp_path, (), force=True)


def test_devices_are_written_directly() -> None:
    with write_text("/dev/null", ()) as file:
        file.write("x")
    assert Path("/dev/null").is_char_device()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_disk_is_an_output_error() -> None:
    with pytest.raises(OutputError, match="cannot be written"), write_text("/dev/full", ()) as file:
        file.write("x" * 100_000)


def test_sha256(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"abc")
    expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert sha256(tmp_path / "a") == expected
    with pytest.raises(BadInput):
        sha256(tmp_path / "b")


def test_a_pipe_whose_reader_has_gone() -> None:
    code = (
        "import numpy as np; from tests.csv_tables import write_table\n"
        "from pkmcal_cli.base.errors import OutputError\n"
        "try: write_table('-', [('x', 'mm', np.ones(200_000))])\n"
        "except OutputError as error: raise SystemExit(error.exit_code)\n"
    )
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline() == b"x [mm]\n"
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 4


def test_a_file_that_is_not_there_is_guessed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a slip of its name, of its own kind first; what is shipped is named where nothing lies beside it."""
    monkeypatch.chdir(tmp_path)
    for name in ("portal.yaml", "portals.csv"):
        (tmp_path / name).write_text("space: planar\n")
    assert missing_hint("portl.yaml") == "did you mean `portal.yaml`?"
    assert missing_hint("portal.csv") == "did you mean `portals.csv`?"
    assert "brings one of this name" in (missing_hint("somewhere/triglide.csv") or "")
    assert missing_hint("triglid") == "did you mean `triglide`, which is shipped?"
    assert missing_hint("quite-another.yaml") is None


def test_a_table_in_the_place_of_a_machine_is_told(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("q1 [mm],x [mm]\n1,2\n")
    done = run("calibrate", str(tmp_path / "t.csv"), TRIGLIDE)
    assert done.code == 3 and "name the machine file first, then tables" in done.err


def test_devices_that_may_never_end_are_not_read() -> None:
    """An empty one ends; so do pipes, whatever they are called."""
    for name in ("/dev/zero", "/dev/urandom"):
        with pytest.raises(BadInput, match="a device, not a file"), open_input(name):
            pass
    ends = os.pipe()
    os.write(ends[1], b"x")
    os.close(ends[1])
    for name, content in (("/dev/null", b""), (f"/dev/fd/{ends[0]}", b"x")):
        with open_input(name) as file:
            assert file.read() == content
    os.close(ends[0])
