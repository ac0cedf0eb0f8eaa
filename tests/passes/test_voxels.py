"""The voxel grid of the view frustum against boxes and spheres that are known, bit by bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssil_viewer.embed import IndirectLighting
from ssil_viewer.errors import UserError
from ssil_viewer.scene.model import Camera, Image, Instance, Material, Mesh, Primitive, TextureRef
from ssil_viewer.settings import Settings
from tests import scenes

# Odd sizes: the last texel of a row hangs over the edge at every level
SIZE = 71, 45
CAMERA = Camera(eye=(0, 0, 4), vertical_fov=0.9)
WHITE = Material(specular=0.0, double_sided=True)
BACKDROP = scenes.rectangle((-30, -30, -6), (60, 0, 0), (0, 60, 0))
BOX_CENTER, BOX_SIZE = np.array((0.1, 0.05, 0.2)), np.array((1.6, 1.1, 1.3))
ROUNDING = 2e-3
"""Slices: how far slice numbers may be off. Depth has 24 bits, log2 on GPUs a few units in the last place of its
result, and slice numbers go up to 256."""


def ball(center, radius: float, rings: int = 24) -> tuple[Primitive, float]:
    """A closed sphere of triangles with its corners on the sphere, and how deep its faces lie below it (sagitta)."""
    theta = np.pi * np.arange(rings + 1) / rings
    phi = np.pi * np.arange(2 * rings) / rings
    sin = np.where((np.arange(rings + 1) % rings) == 0, 0.0, np.sin(theta))     # poles are one point
    unit = np.stack([sin[:, None] * np.cos(phi), np.cos(theta)[:, None] + 0 * phi, sin[:, None] * np.sin(phi)], -1)
    at = np.arange((rings + 1) * 2 * rings).reshape(rings + 1, -1)
    a, b, c, d = at[:-1], at[1:], np.roll(at, -1, 1)[1:], np.roll(at, -1, 1)[:-1]
    faces = np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in ((a, c, b), (a, d, c))])
    positions = (np.asarray(center) + radius * unit.reshape(-1, 3)).astype(np.float32)
    corners = positions[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    faces = faces[area > 1e-9].astype(np.uint32)
    middle = positions[faces].mean(axis=1)
    # The point of a face that lies deepest is the centre of its circumcircle; an edge's middle is not deeper
    p, q, r = (positions[faces[:, i]].astype(np.float64) - center for i in range(3))
    normal = np.cross(q - p, r - p)
    distance = np.abs((p * normal).sum(-1)) / np.linalg.norm(normal, axis=1)
    normals = ((middle - center) / np.linalg.norm(middle - center, axis=1)[:, None]).astype(np.float32)
    flat = positions[faces].reshape(-1, 3)
    primitive = Primitive(flat, np.repeat(normals, 3, axis=0), None, np.zeros((len(flat), 2, 2), np.float32), None,
                          np.arange(len(flat), dtype=np.uint32).reshape(-1, 3), 0)
    return primitive, radius - float(distance.min())


def in_meshes(*parts, materials=(WHITE,)):
    """A scene with a mesh of its own for each group of primitives."""
    meshes = tuple(Mesh(f"part {i}", tuple(part)) for i, part in enumerate(parts))
    instances = tuple(Instance(mesh.name, i, np.eye(4)) for i, mesh in enumerate(meshes))
    return replace(scenes.scene((), materials), meshes=meshes, instances=instances)


def voxelized(make_renderer, scene, camera=CAMERA, size=SIZE, stage="auto", **settings):
    options = {"start_level": 1, "levels": 3, "samples": 4, "visibility": "voxel", **settings}
    renderer = make_renderer(scene, size, stage, **options)
    renderer.render(camera)
    return renderer


def slices_of(*halves: np.ndarray) -> np.ndarray:
    """The bits of voxel texels.

    Args:
        halves: (H, W, 4) uint32 each, the targets `voxels` and `voxels_far`.

    Returns:
        (H, W, S) bool, the nearest slice first.
    """
    words = np.ascontiguousarray(np.concatenate(halves, axis=-1)).astype("<u4")
    return np.unpackbits(words.view(np.uint8), axis=-1, bitorder="little").astype(bool)


def bits(renderer, level=1) -> np.ndarray:
    """(H, W, S) bool."""
    halves = ("voxels", "voxels_far") if renderer.settings.voxel_slices > 128 else ("voxels",)
    return slices_of(*(renderer.read_stored(name, level) for name in halves))


def slice_edges(renderer, at) -> np.ndarray:
    """View depths of slice coordinates, float64; k + 1/2 is the centre of slice k."""
    near, far = renderer.read_stored("depth_range")[0, 0].astype(np.float64)
    return near * (far / near) ** (np.asarray(at) / renderer.settings.voxel_slices)


def texel_rays(renderer, camera, level=1) -> np.ndarray:
    """(H, W, 3) float64 directions with z = -1 through the texels' centres; row 0 is the top."""
    width, height = renderer.size
    rows, columns = renderer.read_stored("voxels", level).shape[:2]
    tan = np.tan(camera.vertical_fov / 2)
    x = ((np.arange(columns) + 0.5) * 2**level / width * 2 - 1) * tan * width / height
    y = ((rows - 1 - np.arange(rows) + 0.5) * 2**level / height * 2 - 1) * tan
    return np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1)


def spans_of_box(rays, eye, center, size):
    """View depths (enter, leave) of rays through a box; enter >= leave where they miss it."""
    with np.errstate(divide="ignore"):
        ends = (np.stack([center - size / 2, center + size / 2]) - eye)[:, None, None] / rays
    return ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)


def agrees(renderer, found, enter, leave) -> None:
    """Each slice is set exactly if its centre lies between the two depths; those closer to one than rounding aside."""
    numbers = np.arange(renderer.settings.voxel_slices) + 0.5
    low, middle, high = (slice_edges(renderer, numbers + d) for d in (-ROUNDING, 0.0, ROUNDING))
    expected = (middle > enter[..., None]) & (middle < leave[..., None])
    unsure = np.zeros_like(expected)
    for border in (enter[..., None], leave[..., None]):
        unsure |= (low < border) & (high > border)
    assert expected[~unsure].any(), "the body is in view"
    assert unsure.mean() < 0.05, "most bits are checked"
    assert (found == expected)[~unsure].all()


@pytest.mark.parametrize("slices", [128, 256])
@pytest.mark.parametrize("start_level", [0, 1, 2])
def test_every_bit_of_a_box(make_renderer, slices, start_level):
    scene = in_meshes(scenes.box(BOX_CENTER, BOX_SIZE), [BACKDROP])
    renderer = voxelized(make_renderer, scene, voxel_slices=slices, start_level=start_level)
    rays = texel_rays(renderer, CAMERA, start_level)
    enter, leave = spans_of_box(rays, np.array(CAMERA.eye), BOX_CENTER, BOX_SIZE)
    silhouette = _silhouette(rays, BOX_CENTER - CAMERA.eye, BOX_SIZE)
    found = bits(renderer, start_level)
    depth = 10.0    # of the backdrop, an open mesh: its own slice alone
    wall = np.abs(np.log(slice_edges(renderer, np.arange(slices) + 0.5) / depth)).argmin()
    assert found[..., wall].all()
    found[..., wall] = False
    agrees(renderer, found[~silhouette], enter[~silhouette], leave[~silhouette])


def _silhouette(rays, center, size) -> np.ndarray:
    """Rays that pass an edge or corner of a box by less than rasterization tells apart: 1/256 pixel, with room."""
    answers = []
    for scale in (1 - 2e-3, 1 + 2e-3):
        enter, leave = spans_of_box(rays, np.zeros(3), center, size * scale)
        answers.append(enter < leave)
    return answers[0] != answers[1]


def test_every_bit_of_a_ball(make_renderer):
    """Slices nearer to the sphere than the sagitta of its triangles are left out, and no others."""
    center, radius = np.array((0.2, -0.1, 0.0)), 1.1
    primitive, sagitta = ball(center, radius)
    renderer = voxelized(make_renderer, in_meshes([primitive], [BACKDROP]))
    rays = texel_rays(renderer, CAMERA)
    found = bits(renderer)
    found &= slice_edges(renderer, np.arange(128)) < 9.0        # without the backdrop
    middle = slice_edges(renderer, np.arange(128) + 0.5)
    points = rays[:, :, None] * middle[:, None] + np.array(CAMERA.eye)
    distance = np.linalg.norm(points - center, axis=-1)
    rounding = 2 * (slice_edges(renderer, np.arange(128) + 0.5 + ROUNDING) - middle)
    sure = (distance < radius - sagitta - rounding) | (distance > radius + rounding)
    assert 0 < sagitta < 0.01 * radius
    assert sure.mean() > 0.99
    assert (found == (distance < radius))[sure].all()
    assert found[sure].any()


@pytest.mark.parametrize("near", [None, 2.5])
def test_an_empty_room_seen_from_within_is_empty(make_renderer, near):
    """Walls behind the camera and nearer than the near plane count like any other."""
    room_center, room_size = np.array((0.2, 0.1, 0.5)), np.array((5.0, 4.0, 6.0))
    camera = Camera(eye=(0.3, 0.2, 1.0), target=(0.6, 0.3, -3), vertical_fov=0.9, near=near)
    scene = in_meshes(scenes.box(room_center, room_size), [BACKDROP])
    renderer = voxelized(make_renderer, scene, camera)
    depth = renderer.read("view_depth", 1)[..., None]
    edges = slice_edges(renderer, np.arange(129))
    assert (depth > 0).any()
    before = (edges[1:] < depth * 0.98) & (depth > 0)
    assert before.any() and not bits(renderer)[before].any()


def test_what_is_nearer_than_the_near_plane_is_still_there(make_renderer):
    """A box whose front the near plane cuts off is filled from the nearest slice on."""
    camera = replace(CAMERA, near=3.2)
    center, size = np.array((0, 0, 0.5)), np.array((1.0, 0.8, 1.6))     # from 2.7 m to 4.3 m before the eye
    # What is seen nearest is the box's inside, so that a floor must make the slices begin before
    floor = scenes.rectangle((-9, -1.4, 9), (18, 0, 0), (0, 0, -18))
    renderer = voxelized(make_renderer, in_meshes(scenes.box(center, size), [floor]), camera)
    edges = slice_edges(renderer, np.arange(129))
    middle = bits(renderer)[bits(renderer).shape[0] // 2, bits(renderer).shape[1] // 2]
    inside = (edges[:-1] > 2.72) & (edges[1:] < 4.28)
    assert inside.sum() > 20 and edges[0] < 3.3
    assert middle[inside].all() and not middle[edges[:-1] > 4.35].any()


def test_bodies_one_behind_the_other_stay_apart(make_renderer):
    first = scenes.box((0, 0, 1.5), (1, 1, 0.6))
    second = scenes.box((0, 0, -0.5), (1, 1, 1.0))
    renderer = voxelized(make_renderer, in_meshes([*first, *second], [BACKDROP]))
    rays = texel_rays(renderer, CAMERA)
    near = spans_of_box(rays, np.array(CAMERA.eye), np.array((0, 0, 1.5)), np.array((1, 1, 0.6)))
    far = spans_of_box(rays, np.array(CAMERA.eye), np.array((0, 0, -0.5)), np.array((1, 1, 1.0)))
    column = tuple(np.array(rays.shape[:2]) // 2)
    middle = slice_edges(renderer, np.arange(128) + 0.5)
    expected = ((middle > near[0][column]) & (middle < near[1][column])) \
        | ((middle > far[0][column]) & (middle < far[1][column]))
    found = bits(renderer)[column]
    assert (found == expected)[middle < 9].all()


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -1, -1), (2, 0.5, 1.5)])
def test_mirrored_and_stretched_instances_are_filled(make_renderer, scale):
    scene = in_meshes(scenes.box((0, 0, 0), BOX_SIZE), [BACKDROP])
    placed = replace(scene, instances=(replace(scene.instances[0], world_from_object=np.diag((*scale, 1.0))),
                                       scene.instances[1]))
    renderer = voxelized(make_renderer, placed)
    column = bits(renderer)[11, 18]
    middle = slice_edges(renderer, np.arange(128) + 0.5)
    half = BOX_SIZE[2] / 2 * abs(scale[2])
    assert (column == (np.abs(middle - 4) < half))[middle < 9].all()


@pytest.mark.parametrize("slices", [128, 256])
def test_surface_mode_sets_the_slice_of_each_surface(make_renderer, slices):
    renderer = voxelized(make_renderer, in_meshes(scenes.box((0, 0, 0), (2, 2, 2)), [BACKDROP]),
                         voxel_fill="surface", voxel_slices=slices)
    column = bits(renderer)[11, 18]
    edges = slice_edges(renderer, np.arange(slices + 1))
    expected = np.zeros(slices, bool)
    expected[[np.searchsorted(edges, depth) - 1 for depth in (3.0, 5.0, 10.0)]] = True      # front, back, backdrop
    assert (column == expected).all()


def test_open_meshes_and_rooms_count_by_their_surface(make_renderer):
    """A box without a lid cannot be filled; one whose faces look inwards is an empty room."""
    for part in (scenes.box((0, 0, 0), (2, 2, 2))[:5], scenes.box((0, 0, 0), (2, 2, 2), inward=True)):
        renderer = voxelized(make_renderer, in_meshes(part, [BACKDROP]))
        column = bits(renderer)[11, 18]
        middle = slice_edges(renderer, np.arange(128) + 0.5)
        assert not column[(middle > 3.2) & (middle < 4.8)].any()
        assert column.sum() in (2, 3)


def test_open_meshes_are_named(make_renderer):
    renderer = voxelized(make_renderer, in_meshes(scenes.box((0, 0, 0), (2, 2, 2)), [BACKDROP]))
    assert [warning for warning in renderer.warnings if "1 mesh is" in warning and "part 1" in warning]
    closed = voxelized(make_renderer, in_meshes(scenes.box((0, 0, 0), (2, 2, 2))))
    assert not closed.warnings
    assert not make_renderer(in_meshes([BACKDROP]), SIZE).warnings, "nothing is sorted before voxels are needed"


def test_alpha_masks_leave_holes(make_renderer):
    pixels = np.full((64, 64, 4), 255, np.uint8)
    pixels[:, 32:, 3] = 0
    masked = replace(WHITE, base_color_texture=TextureRef(0), alpha_mode="mask")
    square = scenes.rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0), 1)
    scene = replace(in_meshes([square], [BACKDROP], materials=(WHITE, masked)), images=(Image("p", pixels),))
    renderer = voxelized(make_renderer, scene)
    edges = slice_edges(renderer, np.arange(129))
    found = bits(renderer)[..., np.searchsorted(edges, 4.0) - 1]
    x = texel_rays(renderer, CAMERA)[11, :, 0] * 4
    assert found[11, (x > -0.9) & (x < -0.1)].all()
    assert not found[11, (x > 0.1)].any()


def test_a_body_with_masked_faces_is_not_filled(make_renderer):
    faces = [replace(face, material=1) if i == 0 else face for i, face in enumerate(scenes.box((0, 0, 0), (2, 2, 2)))]
    masked = replace(WHITE, alpha_mode="mask")
    renderer = voxelized(make_renderer, in_meshes(faces, [BACKDROP], materials=(WHITE, masked)))
    middle = slice_edges(renderer, np.arange(128) + 0.5)
    assert not bits(renderer)[11, 18][(middle > 3.2) & (middle < 4.8)].any()


@pytest.mark.parametrize("slices", [128, 256])
def test_coarser_levels_are_the_or_of_four(make_renderer, stage, slices):
    renderer = voxelized(make_renderer, scenes.cornell(), scenes.CORNELL_CAMERA, stage=stage, voxel_slices=slices)
    for level in (2, 3):
        finer = bits(renderer, level - 1)[::-1]     # row 0 at the bottom, where the texels are aligned
        padded = np.pad(finer, ((0, finer.shape[0] % 2), (0, finer.shape[1] % 2), (0, 0)))
        expected = padded[::2, ::2] | padded[1::2, ::2] | padded[::2, 1::2] | padded[1::2, 1::2]
        found = bits(renderer, level)[::-1]
        assert found.any() and found.shape == expected.shape
        assert (found == expected).all()


@pytest.mark.parametrize("size", [(1, 1), (7, 65), (71, 45), (520, 9)])
def test_the_range_of_depth_is_that_of_the_image(make_renderer, stage, size):
    renderer = voxelized(make_renderer, scenes.cornell(), scenes.CORNELL_CAMERA, size, stage)
    depth = renderer.read("view_depth")
    near, far = renderer.read_stored("depth_range")[0, 0]
    assert near == pytest.approx(0.99 * depth[depth > 0].min(), rel=1e-6)
    assert far == pytest.approx(1.01 * depth.max(), rel=1e-6)


def test_nothing_in_view(make_renderer, stage):
    renderer = voxelized(make_renderer, in_meshes([BACKDROP]), replace(CAMERA, target=(0, 0, 9)), stage=stage)
    assert not bits(renderer).any()
    assert np.array_equal(renderer.read_stored("depth_range")[0, 0], (1, 2))
    assert not renderer.read("indirect").any()


def test_both_stages_agree(make_renderer):
    results = [voxelized(make_renderer, scenes.cornell(), scenes.CORNELL_CAMERA, stage="fragment")]
    if results[0].capabilities.compute:
        results.append(voxelized(make_renderer, scenes.cornell(), scenes.CORNELL_CAMERA, stage="compute"))
    assert bits(results[0]).any()
    assert (bits(results[0]) == bits(results[-1])).all()
    assert np.allclose(results[0].read("indirect"), results[-1].read("indirect"), rtol=0.01, atol=1e-4)


@pytest.mark.parametrize("slices", [128, 256])
def test_views_show_share_and_slice(make_renderer, stage, slices):
    renderer = voxelized(make_renderer, scenes.cornell(), scenes.CORNELL_CAMERA, stage=stage, voxel_slices=slices)
    occupied = np.flatnonzero(bits(renderer).any(axis=(0, 1)))
    for shown in (occupied[0], occupied[-1]):
        renderer.set_settings(replace(renderer.settings, voxel_view_slice=int(shown)))
        renderer.render(scenes.CORNELL_CAMERA)
        for level in (1, 2, 3):
            found = bits(renderer, level)
            assert np.allclose(renderer.read("voxels", level), found.mean(axis=-1), atol=1e-6)
            assert (renderer.read("voxel_slice", level) == found[..., shown]).all()
    assert occupied[-1] >= slices * 3 // 4
    renderer.show_buffer("voxels", 1)
    renderer.render(scenes.CORNELL_CAMERA)


def test_voxels_exist_only_when_asked_for(make_renderer):
    renderer = make_renderer(scenes.cornell(), SIZE, samples=4)
    renderer.render(scenes.CORNELL_CAMERA)
    assert "voxels" not in renderer.buffers()
    assert not renderer.target_bytes()["voxels"] and not renderer.target_bytes()["depth_range"]
    with pytest.raises(UserError, match="not made under these settings"):
        renderer.read("voxels", 2)
    renderer.set_settings(replace(renderer.settings, visibility="voxel"))
    renderer.render(scenes.CORNELL_CAMERA)
    assert renderer.target_bytes()["voxels"] and not renderer.target_bytes()["voxels_far"]
    assert slices_of(renderer.read_stored("voxels", 2)).any()
    renderer.set_settings(replace(renderer.settings, voxel_slices=256))
    renderer.render(scenes.CORNELL_CAMERA)
    assert renderer.read_stored("voxels_far", 2).any()


def test_a_g_buffer_without_triangles_is_refused(context):
    with pytest.raises(UserError, match="voxels need the scene's triangles"):
        IndirectLighting(context, SIZE, Settings(visibility="voxel"))


def test_moved_bodies_are_where_they_went(make_renderer):
    renderer = voxelized(make_renderer, in_meshes(scenes.box((0, 0, 0), (1, 1, 1)), [BACKDROP]))
    moved = np.eye(4)
    moved[:3, 3] = 0, 0, -2
    renderer.move_instance(0, moved)
    renderer.render(CAMERA)
    middle = slice_edges(renderer, np.arange(128) + 0.5)
    assert (bits(renderer)[11, 18] == (np.abs(middle - 6) < 0.5))[middle < 9].all()


def test_materials_that_nothing_is_drawn_with(make_renderer):
    """A scene of masked or closed meshes alone leaves one of the two kinds of draws without triangles."""
    masked = replace(WHITE, alpha_mode="mask")
    only_masked = voxelized(make_renderer, in_meshes([replace(BACKDROP, material=0)], materials=(masked,)))
    assert bits(only_masked).any()
