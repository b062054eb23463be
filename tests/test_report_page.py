"""The page of a sheet by itself: words of files are no markup, and letters of drawings are large enough on paper."""

from __future__ import annotations

import re

import pytest

from pkmcal_cli.loading.load_machine import load_machine
from pkmcal_cli.loading.poses import reference_poses
from pkmcal_cli.pictures.machine_picture import machine_picture
from pkmcal_cli.pictures.machine_shape import MachineShape, machine_shape
from pkmcal_cli.pictures.titles import titles
from pkmcal_cli.sheet.content import Block, Figure, Section, Sheet, Table, Text, Verdict
from pkmcal_cli.sheet.page import html
from tests.command import MACHINES


def page_of(*blocks: Block) -> str:
    return html(Sheet("m.yaml", "", Verdict("DONE", ""), (), (Section("k", "title", blocks),), ""))


def test_words_of_files_are_letters_of_equal_width_and_still_no_markup() -> None:
    page = page_of(Text("needs `period` of <b>q1</b>", "note"), Table("", ("a",), (("`<i>`",),)))
    assert 'needs <span class="key">period</span> of &lt;b&gt;q1&lt;/b&gt;' in page
    assert '<span class="key">&lt;i&gt;</span>' in page and "<i>" not in page


@pytest.mark.parametrize("name", ["hexapod7", "delta4", "triglide"])
def test_letters_of_a_drawing_are_printed_large_enough_to_read(name: str) -> None:
    """On A4 with the margins of the style sheet no letter is smaller than 6.5 points (newspapers' tables: 6 to 7)."""
    done = load_machine(str(MACHINES / f"{name}.yaml"))
    shape = machine_shape(done, done.model.nominal, reference_poses(done.model).rows, 0)
    assert isinstance(shape, MachineShape)
    page = page_of(Figure(machine_picture(shape, titles(name, "", [])), ""))
    (margins,) = re.findall(r"@page { size: A4; margin: (\d+)mm (\d+)mm; }", page)
    (most,) = re.findall(r"figure svg { max-height: (\d+)mm; }", page)
    assert 2 * int(margins[0]) + int(most) < 297  # as high as a page, and no higher
    (svg,) = re.findall(r"<svg.*?</svg>", page, re.S)
    width, height = (float(x) for x in re.findall(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)[0])
    printed = min(1.0, (210 - 2 * int(margins[1])) / 25.4 * 72 / width, int(most) / 25.4 * 72 / height)
    sizes = [float(size) for size in re.findall(r"(?:font-size: |font: [^;\"]*?)([\d.]+)px", svg)]
    assert len(sizes) > 5 and printed * min(sizes) > 6.5
