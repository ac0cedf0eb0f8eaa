"""docs/architecture.md against the declarations of the passes: who reads and writes what, and when."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ssil_viewer import embed
from ssil_viewer.passes import FRAME, ScreenPass
from ssil_viewer.settings import Settings

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "architecture.md").read_text(encoding="utf-8")
SECTION = PAGE.split("\n## The frame\n")[1].split("\n## ")[0]
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in SECTION.splitlines()
        if line.startswith("| `")]
FEATURES = frozenset({"rays", "environment"})


def names(text: str) -> list[str]:
    """What stands in backticks, in its order; command lines aside."""
    return [name for name in re.findall("`(.+?)`", text) if not name.startswith("--")]


def sentence(beginning: str) -> str:
    """The item of the list below the table that begins so."""
    item, = re.findall(rf"^- ({re.escape(beginning)}.*?)(?=^- |\n\n)", SECTION, re.MULTILINE | re.DOTALL)
    return item


def test_the_table_has_all_passes_in_their_order():
    assert [names(row[0])[0] for row in ROWS] == [p.name for p in FRAME]


@pytest.mark.parametrize(("row", "declared"), list(zip(ROWS, FRAME)), ids=[p.name for p in FRAME])
def test_a_row_names_what_its_pass_declares(row, declared):
    _, reads, writes = row
    assert set(names(reads)) == {target for read in declared().target_reads() for target in read.targets}
    assert set(names(writes)) == {*declared.writes, *declared.extends}


def test_the_passes_of_each_bounce():
    every = [p.name for p in FRAME]
    first, last = names(sentence("The passes from"))[:2]
    assert every[every.index(first):every.index(last) + 1] == [p.name for p in FRAME if p.per_bounce]


def test_what_runs_without_bounces():
    settings = Settings(bounces=0, visibility="voxel", unseen_samples=1, visibility_rays=1, shadow_rays=True)
    always, sky = (names(part) for part in sentence("With `--bounces 0`").split("with an environment"))
    for features, told in ((FEATURES - {"environment"}, always), (FEATURES, [*always, *sky])):
        assert {p.name for p in FRAME if p().runs(settings, features)} == set(told)


def test_the_sequence_of_embedding():
    assert names(sentence("`embed.py` runs"))[1:] == [p.name for p in embed.FRAME]


@pytest.mark.parametrize("declared", [p for p in FRAME if issubclass(p, ScreenPass)], ids=lambda p: p.name)
def test_a_screen_pass_has_its_shader_under_its_name(declared):
    assert declared.shader == f"passes/{declared.name}.glsl"
