"""`compare` of three or more files: lines and steps, whatever time lies between them; the change of the tool point."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pkmcal_cli.calibration.comparison import changes, likely_changes, omnibus
from pkmcal_cli.calibration.data_sets import common
from pkmcal_cli.loading.data_information import DataInformation
from tests.campaign_tables import MM
from tests.command import run
from tests.test_compare import SCISSORS, calibrated, compared, dated, table

DAYS = tuple(f"2026-05-{day:02d}T08:00:00+00:00" for day in (1, 11, 21, 31))
AFTERNOON = tuple(f"2026-05-01T16:{minute}:00+00:00" for minute in ("01", "03", "03", "07"))


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def files(dates: tuple[str, ...], **grown: tuple[float, ...]) -> list[str]:
    """Calibrations of Scissors at dates, parameters grown by so much, m."""
    out = []
    for k, date in enumerate(dates):
        more = {name: sizes[k] for name, sizes in grown.items()}
        rows = table(f"t{k}", k, machine="scissors", **more)
        out.append(dated(calibrated(f"p{k}", rows, machine=SCISSORS), date))
    return out


def test_files_of_one_afternoon_have_the_step_of_files_of_weeks() -> None:
    """Tables of long ago that are calibrated one after the other: dates are those of the calculations."""
    grown = {"l3": (0.0, 0.0, 0.1 * MM, 0.1 * MM)}
    close, apart = compared(*files(AFTERNOON, **grown)), compared(*files(DAYS, **grown))
    for found in (close.json, apart.json):
        assert found["since"] == "p2.yaml" and found["per"] is None and found["named"] == ["l3"]
        assert found["alone"]["change"] == pytest.approx(0.1, rel=0.05)
        assert found["tool_point"]["alone"] == "l3" and found["tool_point"]["rms"] < 1000
    assert close.json["parameters"] == apart.json["parameters"]
    assert "calculated within a day" in close.err and "within a day" not in apart.err
    assert "changed from C on" in close.err and "change from C on" in close.err


def test_a_trend_of_files_of_one_afternoon_is_told_over_the_files() -> None:
    grown = {"l4": (0.0, 0.03 * MM, 0.06 * MM, 0.09 * MM)}
    close, apart = compared(*files(AFTERNOON, **grown)), compared(*files(DAYS, **grown))
    changed = [next(p for p in done.json["parameters"] if p["name"] == "l4") for done in (close, apart)]
    assert [done.json["per"] for done in (close, apart)] == [None, "day"]
    assert changed[0]["determined"] and changed[0]["change"] == pytest.approx(30 * changed[1]["change"])
    assert changed[0]["p_value"] == changed[1]["p_value"]
    assert close.json["tool_point"] == apart.json["tool_point"]  # the whole change in both
    assert "change, A to D" in close.err and " per day" not in close.err.replace("changes per day", "")
    assert "change per day" in apart.err and "change of the tool point from A to D" in apart.err


def weak(seed: int) -> DataInformation:
    """Of four parameters a linear problem of unit noise determines two; of a half range of the others it sees 0.2."""
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(40, 4)) * np.array([2.0, 2.0, 0.2, 0.2]) / np.sqrt([1, 1, 40, 40])
    upper = np.linalg.qr(np.column_stack([jacobian, rng.normal(size=40)]), mode="r")
    return DataInformation(
        names=("a", "b", "c", "d"), scale=np.ones(4), root=upper[:4, :4], right=upper[:4, 4],
        left=float(upper[4, 4] ** 2), count=40, worth=1e-6,
    )  # fmt: skip


def test_what_no_data_determine_does_not_move_the_tool_point() -> None:
    """Half a range is known of a change, so what is seen with a noise of 5 half ranges stays; the rest is as it was."""
    sizes, likely = [], []
    for seed in range(40):
        c = common([weak(seed), weak(1000 + seed)], [dict.fromkeys("abcd", 0.0)] * 2, [set(), set()])
        sizes.append(changes(c, "abcd", (0.0, 1.0), omnibus(c)[0].freedom).values)
        likely.append(likely_changes(c, "abcd", (0.0, 1.0)).values)
    by_ranges, free = np.std(likely, axis=0), np.std(sizes, axis=0)
    assert (by_ranges[2:] < 0.25).all() and (free[2:] > 0.5).all()
    assert by_ranges[:2] == pytest.approx(free[:2], rel=0.05)


def test_a_limit_of_the_change_is_kept_where_no_change_is_seen() -> None:
    """The estimate alone is above it, by chance; in text and JSON a change that is none is not one above the limit."""
    _, one, two = files(DAYS[:3], l3=(0.0, 0.0, 0.0))
    done = run("compare", one, two, "--json", "--fail-above", "change 0.001 um")
    (gate,) = done.json["gates"]
    assert done.json["tool_point"]["max"] > 0.001 and done.json["tool_point"]["alone"] is None
    assert done.code == 0 and gate["kept"] and gate["value"] == 0 and "no change is seen" in gate["what"]
    _, one, two = files(DAYS[:3], l3=(0.0, 0.0, 0.1 * MM))
    done = run("compare", one, two, "--json", "--fail-above", "change 0.001 um")
    (gate,) = done.json["gates"]
    assert done.code == 1 and not gate["kept"] and gate["value"] == done.json["tool_point"]["max"]
    assert "above the limit" in done.err
