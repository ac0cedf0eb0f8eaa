"""What a frame would have to make first is foreseen: exactly the programs that it then compiles, and what rays need."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.errors import UserError
from ssil_viewer.gpu import scene_rays
from ssil_viewer.gpu.scene_rays import RayTables
from ssil_viewer.headless import read_display
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.scene.load import load_scene
from ssil_viewer.settings import Settings, load_preset
from tests import scenes

SIZE = 64, 36
DEFAULT = Settings(samples=8)
CHANGES = {
    "nothing": DEFAULT,
    "a number": replace(DEFAULT, samples=16, radius=20.0, exposure=1.0, temporal_frames=4),
    "a shadow map": replace(DEFAULT, shadow_resolution=256),
    "a filter": replace(DEFAULT, mip_filter="average", upsampling="nearest"),
    "voxels": replace(DEFAULT, visibility="voxel", voxel_slices=256),
    "levels": replace(DEFAULT, start_level=0, levels=2),
    "bounces": replace(DEFAULT, bounces=2, temporal=False),
    "feedback": replace(DEFAULT, feedback=True, guard_band=10),
    "quality": load_preset("quality"),
    "rays in a row": replace(DEFAULT, samples=16, visibility_rays=16),
}


def _of_first_frames(renderer) -> frozenset:
    """What it has compiled, but for the programs of frames in which nothing moves: they come later."""
    return frozenset(variant for variant in renderer.runner.variants if ("STILL", "") not in variant.defines)


@pytest.mark.parametrize("environment", [False, True], ids=["", "environment"])
def test_the_programs_are_those_that_the_frame_compiles(make_renderer, stage, environment):
    scene = load_scene("builtin:glossy")
    if environment:
        scene = replace(scene, environment=Environment("sky", np.ones((8, 16, 3), np.float32)))
    renderer = make_renderer(scene, SIZE, stage, samples=8)
    renderer.render(default_camera(scene))
    compiling = set()
    for name, settings in CHANGES.items():
        tables = None
        if renderer.missing(settings).rays:
            tables = RayTables.of(scene, renderer.origin, surfels=True)
        before, foreseen = renderer.runner.variants, renderer.missing(settings, tables)
        assert not foreseen.rays and renderer.runner.variants == before
        renderer.set_settings(settings, tables)
        assert renderer.missing(settings) == foreseen
        for _ in range(2):
            renderer.render(default_camera(scene))
        assert _of_first_frames(renderer) - before == foreseen.programs, name
        assert not renderer.missing(settings)
        if foreseen:
            compiling.add(name)
    assert compiling == set(CHANGES) - {"nothing", "a number", "a shadow map"}


def test_so_are_those_for_a_gpu_where_threads_share_work(make_renderer):
    scene = scenes.cornell()
    renderer = make_renderer(scene, SIZE, samples=8)
    renderer.runner.software_form = False
    for name in ("nothing", "levels", "bounces"):
        renderer.set_settings(CHANGES[name])
        before, foreseen = renderer.runner.variants, renderer.missing(CHANGES[name]).programs
        for _ in range(2):
            renderer.render(default_camera(scene))
        assert foreseen and renderer.runner.variants - before == foreseen, name
    assert not renderer.runner.gpu_compute or any(v.parts * v.levels > 1 for v in renderer.runner.variants)


def test_rays_need_tables_and_take_those_made_beforehand(make_renderer, monkeypatch):
    scene = scenes.cornell()
    renderer, other = (make_renderer(scene, SIZE, samples=8) for _ in range(2))
    shadows, unseen = replace(DEFAULT, shadow_rays=True), replace(DEFAULT, unseen_samples=1)
    assert (renderer.missing(shadows).rays, renderer.missing(unseen).rays) == ("triangles", "surfels")
    other.set_settings(unseen)
    tables = {surfels: RayTables.of(scene, renderer.origin, surfels) for surfels in (False, True)}
    assert renderer.missing(unseen, tables[False]).rays == "surfels"
    assert not renderer.missing(shadows, tables[False]).rays and not renderer.missing(unseen, tables[True]).rays
    foreign = replace(tables[True], scene=scenes.cornell())
    assert renderer.missing(unseen, foreign).rays == "surfels"

    made = []
    monkeypatch.setattr(RayTables, "of", lambda *arguments: made.append(arguments) or tables[True])
    renderer.set_settings(shadows, tables[False])
    assert not made and renderer.missing(unseen).rays == "surfels", "these have triangles alone"
    renderer.set_settings(unseen, tables[True])
    assert not made and not renderer.missing(unseen).rays and not renderer.missing(shadows).rays
    for each in (renderer, other):
        each.render(default_camera(scene))
    assert np.array_equal(*map(read_display, (renderer, other)))

    late = make_renderer(scene, SIZE, samples=8)
    late.set_settings(unseen, foreign)
    assert len(made) == 1, "tables of another scene are left aside"


def test_a_scene_without_surfaces_needs_no_tables(make_renderer):
    renderer = make_renderer(scenes.scene([], []), SIZE)
    assert renderer.missing(replace(DEFAULT, shadow_rays=True, unseen_samples=1)).rays == ""


def test_tables_that_find_no_memory_say_so(monkeypatch):
    def refuse(*arguments):
        raise MemoryError

    monkeypatch.setattr(scene_rays, "spread_surfels", refuse)
    with pytest.raises(UserError, match="out of memory.*unseen-samples 0"):
        RayTables.of(scenes.cornell(), np.zeros(3), surfels=True)
