"""Files of older and newer releases: taken as they are, or refused with the release that wrote them."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

import pytest
import yaml

from tests.command import MACHINES, run

BIGLIDE, DATA = MACHINES / "biglide.yaml", MACHINES / "biglide.csv"
NEWER = "pkmcal 99.0"


@cache
def parameters() -> str:
    done = run("calibrate", BIGLIDE, DATA, "-o", "-")
    assert done.code == 0
    return done.out


def written_by(release: str) -> str:
    return re.sub(r"program: pkmcal \S+", f"program: {release}", parameters(), count=1)


def used(text: str, folder: Path) -> tuple[int, str]:
    file = folder / "p.yaml"
    file.write_text(text, encoding="utf-8")
    done = run("simulate", BIGLIDE, DATA, "-p", file, "-o", "-")
    return done.code, done.err + done.out


def readings(out: str) -> str:
    return "\n".join(line for line in out.splitlines() if line[:1].isdigit())


def test_parameters_of_a_release_with_nothing_new_are_taken(tmp_path: Path) -> None:
    code, out = used(written_by(NEWER), tmp_path)
    assert code == 0 and readings(out) == readings(used(parameters(), tmp_path)[1]) != ""


@pytest.mark.parametrize(("old", "new"), [
    ("parameters:\n", "uncertainty_model: 2\nparameters:\n"),
    ("  l1: {value:", "  l1: {spread: 3, value:"),
])  # fmt: skip
def test_what_a_newer_release_added_is_refused_with_its_name(old: str, new: str, tmp_path: Path) -> None:
    """Passed over, it could change what the values mean."""
    text = written_by(NEWER)
    assert text.count(old) == 1
    code, err = used(text.replace(old, new), tmp_path)
    assert code == 3 and "unknown key" in err and f"written by {NEWER}" in err
    code, err = used(parameters().replace(old, new), tmp_path)
    assert code == 3 and "unknown key" in err and "written by" not in err


def test_parameters_of_an_older_release_without_the_later_sections_are_taken(tmp_path: Path) -> None:
    """Values alone, as the first release wrote them: the same predictions."""
    values = {name: {k: e[k] for k in ("value", "unit") if k in e}
              for name, e in yaml.safe_load(parameters())["parameters"].items()}  # fmt: skip
    code, out = used(yaml.safe_dump({"parameters": values}), tmp_path)
    assert code == 0 and readings(out) == readings(used(parameters(), tmp_path)[1])


def test_a_fingerprint_of_another_form_is_told(tmp_path: Path) -> None:
    code, err = used(re.sub(r"(?m)^fingerprint: .*$", "fingerprint: v9-abc", parameters()), tmp_path)
    assert code == 3 and "this is not the fingerprint of a machine" in err


def test_a_key_of_a_newer_machine_language_is_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    for key in ("version: 2", "hydraulics: {}"):
        file.write_text(f"{key}\n{BIGLIDE.read_text(encoding='utf-8')}", encoding="utf-8")
        done = run("check", file)
        assert done.code and f"`{key.partition(':')[0]}`" in done.err and "unknown key" in done.err


def test_a_state_of_another_form_or_release_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "state.json"
    study = ("study", BIGLIDE, "--points", "5", "--repeat", "2", "--validation", "1", "--within", "x=300:600,y=200:300",
             "--state", file)  # fmt: skip
    assert run(*study).code == 0
    state = json.loads(file.read_text())
    assert state["form"] == "pkmcal/state/1"
    file.write_text(json.dumps(state | {"form": "pkmcal/state/2"}))
    done = run(*study)
    assert done.code == 3 and "pkmcal/state/2" in done.err and "reads `pkmcal/state/1`" in done.err
    file.write_text(json.dumps(state | {"asked": state["asked"] | {"version": "99.0"}}))
    done = run(*study)
    assert done.code == 3 and "version was 99.0" in done.err


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    assert run("calibrate", BIGLIDE, DATA, "--run", tmp_path / "runs").code == 0
    (folder,) = (tmp_path / "runs").iterdir()
    return folder


def changed(folder: Path, **more: object) -> None:
    record = yaml.safe_load((folder / "run.yaml").read_text(encoding="utf-8"))
    (folder / "run.yaml").write_text(yaml.safe_dump(record | more, sort_keys=False), encoding="utf-8")


def test_a_run_of_another_release_is_listed_and_its_parameters_are_compared(kept: Path) -> None:
    changed(kept, versions={"program": NEWER}, mood="good")
    done = run("compare", kept.parent, "--json")
    assert done.code == 0 and done.json["runs"][0]["intact"] is True


def test_a_run_without_what_a_sheet_needs_is_told(kept: Path) -> None:
    changed(kept, asked=None)
    done = run("report", kept, "-o", kept.parent / "r.html")
    assert done.code == 3 and "no measurements to report" in done.err and not (kept.parent / "r.html").exists()


def test_a_record_that_names_a_file_elsewhere_is_refused(kept: Path) -> None:
    """A folder that was sent by somebody reads no other file."""
    record = yaml.safe_load((kept / "run.yaml").read_text(encoding="utf-8"))
    for elsewhere in (str(BIGLIDE), "../../../m.yaml", "inputs/../../x.yaml"):
        inputs = {name: entry | {"file": elsewhere} for name, entry in record["inputs"].items()}
        changed(kept, inputs=inputs)
        done = run("report", kept, "-o", kept.parent / "r.html")
        assert done.code == 3 and "outside its folder" in done.err


def test_every_json_output_says_its_version() -> None:
    """`pkmcal/NAME/N`: who reads it can refuse another."""
    done = run("check", BIGLIDE, "--json")
    assert re.fullmatch(r"pkmcal/check/\d+", done.json["schema"])
    schema = json.loads(run("schema", "--output", "check").out)
    assert schema["properties"]["schema"]["const"] == done.json["schema"]
