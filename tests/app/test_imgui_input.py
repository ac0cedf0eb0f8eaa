"""Events that come faster than frames, as they do on software OpenGL."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

pytest.importorskip("imgui_bundle")

from imgui_bundle import imgui  # noqa: E402

from ssil_viewer.app.imgui_input import ImguiInput  # noqa: E402

LEFT = 1    # moderngl-window's number


class Slider:
    """One slider in a window of the interface, without OpenGL."""

    def __init__(self) -> None:
        self.value = 0
        size = (800, 600)
        self.input = ImguiInput(SimpleNamespace(keys=SimpleNamespace(), size=size, buffer_size=size), None)
        self.frame(3)

    def frame(self, count: int = 1) -> None:
        for _ in range(count):
            self.input.begin_frame(0.5)
            imgui.new_frame()
            imgui.set_next_window_pos((100, 100))
            imgui.set_next_window_size((400, 200))
            imgui.begin("panel")
            _, self.value = imgui.slider_int("slider", self.value, 0, 100)
            self.low, self.high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
            imgui.end()
            imgui.render()

    def place(self, along: int) -> tuple[float, float]:
        return self.low.x + along, (self.low.y + self.high.y) / 2


@pytest.fixture
def slider():
    context = imgui.create_context()
    imgui.get_io().backend_flags |= imgui.BackendFlags_.renderer_has_textures
    imgui.get_io().set_ini_filename("")
    yield Slider()
    imgui.destroy_context(context)


def drag(slider, start: int, end: int, frames: int) -> int:
    """The value after a drag with so many frames between its events."""
    for step in (lambda: slider.input.move(*slider.place(start)), lambda: slider.input.button(LEFT, True),
                 lambda: slider.input.move(*slider.place(end)), lambda: slider.input.button(LEFT, False)):
        step()
        slider.frame(frames)
    slider.frame(4)
    return slider.value


def test_a_drag_within_one_frame_ends_where_it_ends(slider):
    slow = drag(slider, 40, 160, frames=2)
    assert drag(slider, 20, 60, frames=2) < slow
    assert drag(slider, 40, 160, frames=0) == slow
    slider.input.move(*slider.place(30))
    slider.frame(3)
    assert slider.value == slow     # it was let go


def test_two_clicks_within_one_frame_are_two(slider):
    for along in (30, 150):
        slider.input.move(*slider.place(along))
        slider.input.button(LEFT, True)
        slider.input.button(LEFT, False)
    slider.frame(8)
    assert slider.value == drag(slider, 150, 150, frames=2)
    assert not imgui.get_io().mouse_down[0]


def test_what_takes_the_mouse_is_told_by_the_place(slider):
    slider.input.move(400, 500)
    slider.frame(2)
    assert slider.input.is_over(*slider.place(5)) and not slider.input.is_over(400, 500)
