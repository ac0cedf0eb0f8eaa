"""The interface renderer, offscreen: textures on demand, long draw lists, scaling, and no growth."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from ssil_viewer.app.imgui_renderer import ImguiRenderer, rebased_indices
from ssil_viewer.gpu.context import create_headless_context

SIZE = 200, 100
NO_DECORATION = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_background


@pytest.fixture(scope="module")
def ctx():
    context = create_headless_context()
    yield context
    context.release()


@pytest.fixture
def gui(ctx):
    """An imgui context with its renderer."""
    context = imgui.create_context()
    imgui.get_io().set_ini_filename("")
    renderer = ImguiRenderer(ctx)
    yield renderer
    renderer.release()
    imgui.destroy_context(context)
    assert ctx.error == "GL_NO_ERROR"


def draw_into(target, renderer, content, scale=1.0):
    """One frame with `content` in a bare window that covers everything."""
    size = target.width / scale, target.height / scale
    io = imgui.get_io()
    io.display_size = size
    io.display_framebuffer_scale = (scale, scale)
    imgui.new_frame()
    imgui.set_next_window_pos((0, 0))
    imgui.set_next_window_size(size)
    imgui.begin("all", None, NO_DECORATION)
    content(imgui.get_window_draw_list())
    imgui.end()
    imgui.render()
    renderer.render(imgui.get_draw_data(), target)


def draw(ctx, renderer, content, scale=1.0):
    """One frame over black: (H, W, 4) uint8, row 0 = top."""
    pixels = round(SIZE[0] * scale), round(SIZE[1] * scale)
    target = ctx.framebuffer([ctx.texture(pixels, 4)])
    target.clear(0.0, 0.0, 0.0, 1.0)
    draw_into(target, renderer, content, scale)
    return np.frombuffer(target.read(components=4), np.uint8).reshape(pixels[1], pixels[0], 4)[::-1]


def test_draw_lists_of_more_than_65536_vertices_keep_their_last_rectangle(ctx, gui):
    def many(commands):
        for _ in range(20_000):
            commands.add_rect_filled((10, 10), (12, 12), 0xFF0000FF)
        commands.add_rect_filled((150, 50), (160, 60), 0xFF00FF00)

    image = draw(ctx, gui, many)
    assert imgui.get_draw_data().total_vtx_count > 65_536
    assert tuple(image[11, 11]) == (255, 0, 0, 255)
    assert tuple(image[55, 155]) == (0, 255, 0, 255)
    assert tuple(image[65, 155]) == (0, 0, 0, 255)


def test_the_buffers_shrink_back_to_correct_small_frames(ctx, gui):
    draw(ctx, gui, lambda d: [d.add_rect_filled((0, 0), (2, 2), 0xFF0000FF) for _ in range(20_000)])
    image = draw(ctx, gui, lambda d: d.add_rect_filled((20, 30), (40, 50), 0xFFFF0000))
    assert tuple(image[40, 30]) == (0, 0, 255, 255)
    assert tuple(image[0, 0]) == (0, 0, 0, 255)


def test_new_glyphs_are_uploaded_when_they_are_first_used(ctx, gui):
    first = draw(ctx, gui, lambda d: d.add_text((10, 10), 0xFFFFFFFF, "abc"))
    assert first[..., 0].max() > 200
    for size in (9.0, 17.0, 41.0):   # forces updates of the atlas, and in the end a bigger one
        def text(commands, size=size):
            imgui.push_font(None, size)
            commands.add_text((10, 10), 0xFFFFFFFF, "The quick brown fox: 0123456789 %s %d")
            imgui.pop_font()
        image = draw(ctx, gui, text)
        assert image[..., 0].max() > 200


def test_a_high_density_framebuffer_shows_the_same_layout_in_more_pixels(ctx, gui):
    image = draw(ctx, gui, lambda d: d.add_rect_filled((20, 30), (40, 50), 0xFF0000FF), scale=2.0)
    assert image.shape[:2] == (200, 400)
    red = np.argwhere(image[..., 0] > 127)
    assert red.min(axis=0).tolist() == [60, 40] and red.max(axis=0).tolist() == [99, 79]


def test_colours_are_written_as_they_are(ctx, gui):
    image = draw(ctx, gui, lambda d: d.add_rect_filled((0, 0), (50, 50), 0xFF80A040))
    assert tuple(image[25, 25, :3]) == (0x40, 0xA0, 0x80)


def test_clip_rectangles_cut(ctx, gui):
    def clipped(commands):
        commands.push_clip_rect((10, 10), (20, 20))
        commands.add_rect_filled((0, 0), (100, 100), 0xFFFFFFFF)
        commands.pop_clip_rect()

    white = np.argwhere(draw(ctx, gui, clipped)[..., 0] > 127)
    assert white.min(axis=0).tolist() == [10, 10] and white.max(axis=0).tolist() == [19, 19]


def test_the_state_of_other_passes_survives(ctx, gui):
    other = ctx.framebuffer([ctx.texture((8, 8), 4)])
    other.use()
    ctx.enable_only(moderngl.DEPTH_TEST | moderngl.CULL_FACE)
    draw(ctx, gui, lambda d: d.add_rect_filled((0, 0), (100, 100), 0xFFFFFFFF))
    assert ctx.fbo.glo == other.glo
    other.clear(0.0, 1.0, 0.0, 1.0)   # would be cut by a scissor rectangle left behind
    assert np.frombuffer(other.read(), np.uint8).reshape(-1, 3)[:, 1].min() == 255
    ctx.enable_only(moderngl.NOTHING)


def test_an_idle_interface_makes_no_new_objects(ctx, gui):
    def text(commands):
        commands.add_text((10, 10), 0xFFFFFFFF, "idle")

    def probe():
        texture, buffer = ctx.texture((1, 1), 4), ctx.buffer(reserve=4)
        names = texture.glo, buffer.glo
        texture.release()
        buffer.release()
        return names

    target = ctx.framebuffer([ctx.texture(SIZE, 4)])
    draw_into(target, gui, text)
    draw_into(target, gui, text)
    texture, buffer = probe()
    for _ in range(20):
        draw_into(target, gui, text)
    # Mesa hands out names in order or again, so twenty frames with one new object each would show.
    after = probe()
    assert after[0] <= texture + 1 and after[1] <= buffer + 1


@pytest.mark.parametrize("kind", [np.uint16, np.uint32])
def test_vertex_offsets_of_commands_are_added(kind):
    indices = np.array([0, 1, 2, 0, 1, 2], kind)
    result = rebased_indices(indices, [(0, 3, 0), (3, 3, 70_000)], vertex_base=1000)
    assert result.dtype == np.uint32
    assert result.tolist() == [1000, 1001, 1002, 71_000, 71_001, 71_002]
