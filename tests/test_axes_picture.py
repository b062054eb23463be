"""The picture of axes in the documentation: drawn from the program, and what it says of it is true."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from docs.axes import ARM, FILE, PANELS, Page, Panel, drawn

WAYS = {"x": (1.0, 0.0, 0.0), "[2, 1]": (2.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def test_the_picture_is_the_one_that_its_command_draws() -> None:
    assert FILE.read_text(encoding="utf-8") == drawn()
    assert "A carriage has the axes of its guide's frame" in "".join(ET.fromstring(drawn()).itertext())


@pytest.mark.parametrize("panel", PANELS, ids=lambda panel: panel.title)
def test_a_carriage_is_where_the_picture_shows_it(panel: Panel) -> None:
    """By hand: x = origin + R (at + travel along / |along| + point), its axes the columns of R."""
    angle = np.radians(panel.frame[1][-1])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    origin, at, point = (np.array([*part, 0.0][:3]) for part in (panel.frame[0], panel.at, panel.point))
    along, count = np.array(WAYS[panel.along]), len(panel.at)
    for travel in (0.0, panel.travel):
        found = panel.places(travel)
        place = origin + turn @ (at + travel * along / np.linalg.norm(along))
        assert found[0] == pytest.approx(place, abs=1e-9)
        assert found[-1] == pytest.approx(place + turn @ point, abs=1e-9)
        assert found[1 : 1 + count] - found[0] == pytest.approx(ARM * turn.T[:count], abs=1e-9)


def test_up_is_up_on_the_page() -> None:
    page = Page()
    assert page.on_page(np.array([1.0, 0, 0])) == (1.0, 0.0) and page.on_page(np.array([0, 1.0, 0])) == (0.0, -1.0)
