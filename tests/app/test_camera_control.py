"""Camera control without a window: exact movements, frame-rate independence, round trips."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ssil_viewer.app.camera_control import CameraControl, camera_flags
from ssil_viewer.scene.model import Camera

CAMERAS = [
    Camera(eye=(0, 0, 5), target=(0, 0, 0)),
    Camera(eye=(-9, 4, -0.3), target=(5, 3.5, 0), vertical_fov=0.7, near=0.01),
    Camera(eye=(0, 10, 0), target=(0, 0, 0), up=(0, 0, -1)),          # straight down
    Camera(eye=(1, 2, 3), target=(0, 0, 0), up=(0.5, 1.0, 0.0)),      # rolled
    Camera(eye=(1, 2, 3), target=(0, 0, 0), up=(0, 0, 1)),            # Z up
    Camera(eye=(0, 0, 5), target=(0, 0, 0), up=(0, -1, 0)),           # upside down
]


def control(camera=CAMERAS[0], mode="orbit"):
    result = CameraControl(mode=mode)
    result.set_camera(camera)
    result.set_scene_size(np.full(3, -5.0), np.full(3, 5.0))
    result.jumped = False
    return result


def screen_axes(camera):
    forward = np.subtract(camera.target, camera.eye)
    right = np.cross(forward, camera.up)
    return forward / np.linalg.norm(forward), right / np.linalg.norm(right)


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_camera_comes_back_as_the_same_view(camera):
    back = control(camera).camera()
    assert back.eye == pytest.approx(camera.eye)
    assert back.target == pytest.approx(camera.target)
    assert (back.vertical_fov, back.near) == (camera.vertical_fov, camera.near)
    np.testing.assert_allclose(screen_axes(back), screen_axes(camera), atol=1e-9)


def test_a_camera_along_its_own_up_vector_is_usable():
    camera = control(Camera(eye=(0, 5, 0), target=(0, 0, 0), up=(0, 1, 0))).camera()
    forward, right = screen_axes(camera)
    assert np.all(np.isfinite(right)) and forward @ (0, -1, 0) == pytest.approx(1.0)


@pytest.mark.parametrize("camera", CAMERAS)
def test_orbiting_keeps_target_distance_and_roll(camera):
    it = control(camera)
    for dx, dy in [(0.1, 0.0), (0.0, 0.2), (-0.4, -0.3), (0.05, 0.9)]:
        it.rotate(dx, dy)
    assert it.target == pytest.approx(camera.target, abs=1e-9)
    assert np.linalg.norm(it.eye - it.target) == pytest.approx(math.dist(camera.eye, camera.target))
    assert it.right @ it.axis == pytest.approx(0.0, abs=1e-9)


def test_dragging_right_moves_the_eye_left_and_dragging_down_lifts_it():
    it = control()
    it.rotate(0.1, 0.0)
    assert it.eye[0] < 0
    it = control()
    it.rotate(0.0, 0.1)
    assert it.eye[1] > 0


def test_orbiting_stops_at_the_pole_and_comes_back():
    it = control()
    it.rotate(0.0, 5.0)
    assert it.pitch == pytest.approx(-math.pi / 2)
    assert np.all(np.isfinite(it.camera().up))
    it.rotate(0.0, -0.5)
    assert it.eye == pytest.approx((0.0, 0.0, 5.0), abs=1e-9)


def test_looking_about_in_fly_mode_keeps_the_eye():
    it = control(mode="fly")
    it.rotate(0.25, 0.0)
    assert it.eye == pytest.approx((0, 0, 5))
    assert it.forward[0] > 0.5


def test_panning_moves_the_target_plane_by_exactly_the_drag():
    it = control()
    it.pan(0.5, 0.25)
    height = 2 * 5 * math.tan(it.vertical_fov / 2)
    assert it.target == pytest.approx((-0.5 * height, 0.25 * height, 0.0))


def test_the_wheel_zooms_toward_the_target_and_never_through_it():
    it = control()
    it.wheel(1)
    assert 0 < it.distance < 5 and it.target == pytest.approx((0, 0, 0), abs=1e-12)
    it.wheel(10_000)
    assert it.distance > 0
    it.wheel(-10_000)
    assert math.isfinite(it.distance)


def test_flying_covers_the_same_way_at_any_frame_rate():
    slow, quick = control(mode="fly"), control(mode="fly")
    for _ in range(4):
        slow.fly(1, 0, 1, 0.25)
    for _ in range(100):
        quick.fly(1, 0, 1, 0.01)
    assert slow.eye == pytest.approx(quick.eye)
    assert math.dist(slow.eye, (0, 0, 5)) == pytest.approx(slow.speed)


def test_a_stall_moves_no_further_than_half_a_second():
    it = control(mode="fly")
    it.fly(0, 0, 1, 60.0)
    assert math.dist(it.eye, (0, 0, 5)) == pytest.approx(0.5 * it.speed)


def test_shift_and_wheel_change_the_speed():
    it = control(mode="fly")
    normal = it.speed
    it.wheel(2)
    assert it.speed > normal and it.eye == pytest.approx((0, 0, 5))
    a, b = control(mode="fly"), control(mode="fly")
    a.fly(0, 0, 1, 0.1)
    b.fly(0, 0, 1, 0.1, fast=True)
    assert math.dist(b.eye, (0, 0, 5)) == pytest.approx(4 * math.dist(a.eye, (0, 0, 5)))


def test_default_speed_follows_the_size_of_the_scene():
    it = control()
    small = it.speed
    it.set_scene_size(np.full(3, -50.0), np.full(3, 50.0))
    assert it.speed == pytest.approx(10 * small)


def places(it, points, aspect):
    """(N, 2): where points are in the picture, -1 to 1 rightward and upward; they have to be before the eye."""
    offsets = np.atleast_2d(points) - it.eye
    depth = offsets @ it.forward
    assert np.all(depth > 0)
    tangent = math.tan(it.vertical_fov / 2)
    return np.stack([offsets @ it.right / (aspect * tangent * depth), offsets @ it.screen_up / (tangent * depth)], 1)


def corners(low, high):
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


@pytest.mark.parametrize("covered", [0.0, 0.27, 0.48])
@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 0.4])
@pytest.mark.parametrize("camera", CAMERAS)
def test_framing_shows_the_whole_box(camera, aspect, covered):
    it = control(camera)
    low, high = np.array([-3.0, 0.0, -1.0]), np.array([4.0, 2.0, 9.0])
    for _ in range(2):      # from where it is then, again
        it.frame(low, high, aspect, covered)
        found = places(it, corners(low, high), aspect)
        middle = places(it, 0.5 * (low + high), aspect)[0]
        aside = middle[0] / covered if covered else 1.0
        assert middle[1] == pytest.approx(0, abs=1e-9) and -1e-9 <= aside <= 1 + 1e-9
        towards = 0.5 * (low + high) - it.eye
        if abs(towards @ it.axis) < 0.4 * np.linalg.norm(towards):
            assert aside == pytest.approx(1)
        # Steeply from above less is moved aside, so there is less room; then not all of a wide panel is kept free
        assert np.all(found[:, 0] >= (2 * covered - 1 if aside > 0.99 else min(2 * covered - 1, -0.4)) - 1e-9)
        assert np.all(found[:, 0] <= 1) and np.all(np.abs(found[:, 1]) <= 1)
        assert it.jumped
        it.rotate(0.2, 0.05)
        assert it.pivot == pytest.approx(0.5 * (low + high)), "turns about the scene"
        it.rotate(-0.2, -0.05)


@pytest.mark.parametrize("camera", CAMERAS)
def test_stepping_aside_brings_the_target_beside_the_panel(camera):
    it, aspect, covered = control(camera), 1.5, 0.3
    before = it.camera()
    low, high = np.array([-2.0, -0.5, -0.5]), np.array([2.0, 0.5, 0.5])
    it.step_aside(low, high, aspect, 0.0)
    assert it.camera() == before, "no panel"
    it.step_aside(low, high, aspect, covered)
    away = np.subtract(before.target, before.eye)
    steep = abs(away @ it.axis) > 0.99 * np.linalg.norm(away)
    assert it.pivot == pytest.approx(before.target)
    assert places(it, before.target, aspect)[0] == pytest.approx((0 if steep else covered, 0), abs=1e-9)
    assert it.right @ it.axis == pytest.approx(0.0, abs=1e-9), "it does not roll"
    seen_from = it.eye - np.asarray(before.target)
    assert seen_from / np.linalg.norm(seen_from) == pytest.approx(-away / np.linalg.norm(away))
    again = control(it.camera())    # copied, or kept as a viewpoint
    np.testing.assert_allclose(places(again, corners(low, high), aspect), places(it, corners(low, high), aspect))


def test_what_is_seen_whole_stays_so_beside_the_panel_and_a_room_is_not_left():
    low, high = np.array([-2.0, -1.0, -1.0]), np.array([2.0, 1.0, 1.0])
    whole = control(Camera(eye=(0, 0, 4), target=(0, 0, 0), vertical_fov=0.9))
    assert np.abs(places(whole, corners(low, high), 1.5)).max() < 1
    whole.step_aside(low, high, 1.5, 0.4)
    found = places(whole, corners(low, high), 1.5)[:, 0]
    assert found.min() >= -0.2 - 1e-9 and found.max() <= 1 + 1e-9
    assert max(-0.2 - found.min(), found.max() - 1) == pytest.approx(0, abs=1e-9), "and no farther than that takes"
    inside = control(Camera(eye=(0, 0, 0.9), target=(0, 0, 0), near=0.3))
    inside.step_aside(low, high, 1.5, 0.4)
    assert inside.eye == pytest.approx((0, 0, 0.9)) and inside.near == 0.3, "a section is still one"
    terrain = np.array([-50.0, 0.0, -50.0]), np.array([50.0, 1.6, 50.0])
    walking = control(Camera(eye=(0, 1.7, 0), target=(0, 1.5, -5)))
    walking.step_aside(*terrain, 1.5, 0.4)
    assert walking.eye == pytest.approx((0, 1.7, 0))


def test_wheel_and_drag_keep_the_pivot_where_it_is_in_the_picture():
    it = control()
    it.step_aside(np.full(3, -1.0), np.full(3, 1.0), 1.5, 0.3)
    place = places(it, it.pivot, 1.5)
    pivot = it.pivot
    for move in (lambda: it.wheel(3), lambda: it.rotate(0.2, 0.3), lambda: it.wheel(-2)):
        move()
        assert it.pivot == pytest.approx(pivot) and places(it, pivot, 1.5) == pytest.approx(place)
    it.save_viewpoint(3)
    it.pan(0.3, 0.1)
    it.recall_viewpoint(3)
    assert it.pivot == pytest.approx(pivot)
    it.focus(np.array([0.5, 0.0, 0.0]))
    assert it.pivot == pytest.approx((0.5, 0, 0)) and it.aside == 0, "what was double-clicked is in the middle"


def test_focusing_turns_to_the_point_and_orbits_it():
    it = control()
    it.focus(np.array([2.0, 1.0, 0.0]))
    assert it.eye == pytest.approx((0, 0, 5)) and it.target == pytest.approx((2, 1, 0))
    it.rotate(0.3, 0.1)
    assert it.target == pytest.approx((2, 1, 0))


def test_viewpoints_are_saved_and_recalled():
    it = control()
    it.save_viewpoint(3)
    saved = it.camera()
    it.rotate(0.3, 0.2)
    it.wheel(4)
    assert not it.recall_viewpoint(4)
    assert not it.jumped
    assert it.recall_viewpoint(3)
    assert it.jumped and it.camera().eye == pytest.approx(saved.eye)


def test_flags_repeat_the_camera():
    assert camera_flags(Camera(eye=(-9, 4, -0.3), target=(5, 3.5, 0), vertical_fov=math.radians(50))) == \
        "--eye=-9,4,-0.3 --target=5,3.5,0 --fov=50"
    assert "--up=0,0,-1" in camera_flags(CAMERAS[2])
    assert "--up" not in camera_flags(control(CAMERAS[1]).camera())


@pytest.mark.parametrize("move", [
    lambda c: c.rotate(0.1, 0.0), lambda c: c.pan(0.1, 0.0), lambda c: c.wheel(1.0), lambda c: c.look(0.0, 0.1),
    lambda c: c.fly(0, 0, 1, seconds=0.1), lambda c: c.focus(np.ones(3)),
    lambda c: c.frame(np.zeros(3), np.ones(3), 1.0),
    lambda c: c.step_aside(np.full(3, -2.0), np.full(3, 2.0), 1.0, 0.3)])
def test_the_near_plane_of_a_camera_belongs_to_its_own_view(move):
    camera = Camera(eye=(0, 0, 5), near=2.0)
    moved = control(camera)
    moved.fly(0, 0, 0, seconds=0.1)
    assert moved.camera().near == 2.0
    move(moved)
    assert moved.camera().near is None
    moved.set_camera(camera)
    assert moved.camera().near == 2.0
