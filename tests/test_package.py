"""What is installed: the wheel has both packages, machines and schemas; plain and editable installs work anywhere."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
import setuptools
import yaml

from tests.command import MACHINES, ROOT, clean, run

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
DATA = {f.name for f in MACHINES.iterdir() if f.is_file()}
_OLD = int(setuptools.__version__.split(".")[0]) < 77
builds = pytest.mark.skipif(_OLD, reason="setuptools >= 77.0.3 builds the package; `pip install '.[test]'` has it")

ASKED = """
import pkmcal, pkmcal_cli, sys
print(pkmcal.__file__); print(pkmcal_cli.__file__); print(pkmcal.shipped("machine.schema.json"))
print(",".join(pkmcal.machines()))
found = pkmcal.calibrate("scissors", pkmcal.shipped("scissors.csv"), holdout="none")
print(found.status, type(found).__module__)
from pkmcal_cli.base.errors import BadInput
print(pkmcal.BadInput is BadInput, "pkmcal_cli.api" in sys.modules)
try:
    import pkmcal_cli.api
except ImportError as error:
    print("ImportError")
"""


def test_every_package_is_listed() -> None:
    """All folders with code, and that of the templates (else a build warns); the door is there once."""
    listed = PROJECT["tool"]["setuptools"]["packages"]
    folders = {f.parent.relative_to(ROOT).as_posix().replace("/", ".") for f in (ROOT / "pkmcal_cli").rglob("*.py")}
    assert set(listed) == (folders - {"pkmcal_cli.api"}) | {"pkmcal", "pkmcal_machines", "pkmcal_cli.templates"}
    assert len(listed) == len(set(listed))


def test_the_licence_is_that_of_the_project() -> None:
    project = PROJECT["project"]
    assert project["license"] == "MIT" and project["authors"] == [{"name": "the pkmcal developers"}]
    assert "Copyright (c) 2026 the pkmcal developers" in (ROOT / "LICENSE").read_text(encoding="utf-8")
    kept = [f for pattern in project["license-files"] for f in ROOT.glob(pattern)]
    assert {f.name for f in kept} == {"LICENSE", "hangprinter.LICENSE.txt"}


def test_the_changelog_begins_with_this_version() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    first = re.search(r"^## ([0-9.]+)", text, flags=re.MULTILINE)
    assert first is not None and first[1] == PROJECT["project"]["version"]


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a build needs of the checkout, elsewhere: a build leaves files behind."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    for name in ("pkmcal_cli", "machines"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def built(checkout: Path, how: str, target: Path) -> Path:
    """The wheel that a build backend makes without network: build_wheel or build_editable."""
    code = f"import sys; from setuptools.build_meta import {how}; print({how}(sys.argv[1]))"
    done = subprocess.run(
        [sys.executable, "-c", code, str(target)], cwd=checkout, env=plain(), capture_output=True, text=True,
        check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return target / done.stdout.split()[-1]


def plain() -> dict[str, str]:
    """The environment of somebody who has no checkout on the path, where compiled modules stay beside their sources."""
    gone = ("PYTHONPATH", "PYTHONHOME", "PYTHONPYCACHEPREFIX", "PYTHONDONTWRITEBYTECODE")
    return {k: v for k, v in os.environ.items() if k not in gone}


def installed(wheel: Path, folder: Path) -> Path:
    """A throw-away environment with a wheel in it; its Python. Dependencies are those of the tests' environment."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True, timeout=60)
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--disable-pip-version-check", str(wheel)], env=plain(), check=True, timeout=120)
    code = "import sysconfig; print(sysconfig.get_path('purelib'))"
    own = subprocess.run([python, "-c", code], capture_output=True, text=True, check=True, timeout=60).stdout.strip()
    (Path(own) / "dependencies.pth").write_text(f"{dependencies(folder)}\n", encoding="utf-8")
    return python


def dependencies(folder: Path) -> Path:
    """A folder of links to the packages of the tests' environment, without the pkmcal that is installed there."""
    links = folder / "dependencies"
    links.mkdir()
    places = [Path(place) for place in sys.path if Path(place).name == "site-packages"]
    for entry in (e for place in places for e in place.iterdir()):
        if "pkmcal" not in entry.name and not (links / entry.name).exists():
            (links / entry.name).symlink_to(entry)
    return links


def asked(python: Path, *arguments: str, cwd: Path) -> list[str]:
    done = subprocess.run(
        [python, *arguments], cwd=cwd, env=plain(), capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@builds
def test_the_wheel_works_without_the_checkout(checkout: Path, tmp_path: Path) -> None:
    wheel = built(checkout, "build_wheel", tmp_path)
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {n.removeprefix("pkmcal_machines/") for n in names if n.startswith("pkmcal_machines/")} == DATA
    assert {"pkmcal/py.typed", "pkmcal_cli/py.typed", "pkmcal/__init__.py"} <= set(names)
    assert not [n for n in names if n.startswith("pkmcal_cli/api")]
    licences = {Path(n).name for n in names if ".dist-info/licenses/" in n}
    assert licences == {"LICENSE", "hangprinter.LICENSE.txt"}
    python = installed(wheel, tmp_path / "env")
    door, code, schema, machines, status, same, twice = asked(python, "-c", ASKED, cwd=tmp_path)
    assert all(str(tmp_path / "env") in place for place in (door, code, schema))
    assert set(machines.split(",")) == {f.stem for f in MACHINES.glob("*.yaml") if "provenance" not in f.name}
    assert (status, same, twice) == ("converged pkmcal.calibration", "True False", "ImportError")
    shown = asked(python.with_name("pkmcal"), "schema", cwd=tmp_path)
    assert '"$schema"' in "".join(shown[:4])
    checked = asked(python.with_name("pkmcal"), "check", "scissors", "--json", cwd=tmp_path)
    assert '"ok": true' in "".join(checked)


@pytest.mark.slow
@builds
def test_an_editable_install_is_the_checkout(checkout: Path, tmp_path: Path) -> None:
    python = installed(built(checkout, "build_editable", tmp_path), tmp_path / "env")
    door, code, schema, _, status, same, twice = asked(python, "-c", ASKED, cwd=tmp_path)
    assert Path(door).parent.samefile(checkout / "pkmcal_cli" / "api")
    assert Path(code).parent.samefile(checkout / "pkmcal_cli")
    assert Path(schema).samefile(checkout / "machines" / "machine.schema.json")
    assert (status, same, twice) == ("converged pkmcal.calibration", "True False", "ImportError")


def test_a_shipped_machine_is_called_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = clean(run("check", "triglide", "--json"))
    assert done.code == 0 and done.json["ok"]
    Path("triglide").mkdir()  # what is there goes before
    assert clean(run("check", "triglide")).code == 3


def test_a_file_that_is_not_there_may_be_shipped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands of the documentation name `machines/...`, which only a checkout has; nothing is taken silently."""
    monkeypatch.chdir(tmp_path)
    done = clean(run("check", "machines/triglide.yaml"))
    assert done.code == 3 and str(MACHINES / "triglide.yaml") in done.err
    done = clean(run("calibrate", "triglide", "machines/triglide.csv"))
    assert done.code == 3 and str(MACHINES / "triglide.csv") in done.err
    assert "help" not in clean(run("check", "nothing.yaml")).err
    assert "did you mean `scissors`" in clean(run("check", "scissor")).err


def test_several_machines_are_checked_one_after_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the hook of pre-commit calls it: all files at once; the fault of one is told, and counts."""
    monkeypatch.chdir(tmp_path)
    good = [str(MACHINES / f"{name}.yaml") for name in ("triglide", "scissors")]
    Path("bad.yaml").write_text("space: planar\nnodes: {a: [0, 0]}\nguides: {g: {fro: [0, 0]}}\n", encoding="utf-8")
    done = clean(run("check", *good))
    assert done.code == 0 and done.err.count("no faults") == 2
    done = clean(run("check", "--quiet", good[0], "bad.yaml", good[1]))
    assert done.code == 1 and "bad.yaml:3" in done.err and "triglide" not in done.err
    for more in (["--json"], [str(MACHINES / "triglide.csv")], ["-p", "p.yaml"]):
        assert clean(run("check", *good, *more)).code == 2


def test_the_hook_is_that_command() -> None:
    (hook,) = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    assert hook["entry"].split()[:2] == ["pkmcal", "check"] and hook["language"] == "python"
    shipped = [f"machines/{f.name}" for f in MACHINES.glob("*.yaml")]
    taken = [f for f in shipped if re.search(hook["files"], f) and not re.search(hook["exclude"], f)]
    assert sorted(taken) == sorted(f for f in shipped if not f.endswith(".provenance.yaml"))
