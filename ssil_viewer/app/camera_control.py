"""The camera under the user's hands: orbiting a point or flying. Plain numbers, no OpenGL, no window.

Mouse movements come in as fractions of the window's height and act at once; held keys come in with the
time that passed. So neither depends on the frame rate, and nothing glides on after the hand stops
(a gliding camera would keep the temporal filter from converging).
"""

from __future__ import annotations

import dataclasses
import math
from typing import Callable, Literal

import numpy as np

from ssil_viewer.scene.model import Camera

Mode = Literal["orbit", "fly"]

_TURN_PER_HEIGHT = math.pi      # dragging over the window's height turns by half a circle
_ZOOM_PER_STEP = 0.88           # distance left after one wheel step
_SPEED_PER_STEP = 1.25          # flying speed gained by one wheel step
_FAST = 4.0                     # factor of the shift key
_MOST_STEPS = 100.0             # a broken wheel must not overflow
_SPEED_SHARE = 0.2              # default speed per second as a share of the scene's radius
_LONGEST_STEP = 0.5             # s; a stall (loading, a dialog) must not throw the camera out of the scene
_MOSTLY_SEEN = 1.5              # a box fits from so many times the distance at the most
_LEAST_FREE = 0.4               # share of the width in which a scene is framed, however wide the panel
_MOST_TURN = math.tan(math.radians(30.0))   # of the heading, to bring something beside the panel
_ROLL_TOLERANCE = 1e-3          # cosine; a camera tilted sideways less than this turns about the world's Y


@dataclasses.dataclass
class CameraControl:
    """Position and direction, how the mouse moves them, and the saved viewpoints.

    The direction is kept as heading and pitch about a fixed axis, with the heading as the horizontal
    `right` vector, so that looking straight down is nothing special.

    Attributes:
        mode: "orbit" turns about `pivot`, "fly" about the eye.
        eye: (3,) float64, world space.
        right: (3,) unit vector to the right, perpendicular to `axis`.
        axis: (3,) unit vector about which the heading turns: world +Y, or the camera's own up vector
            where it is rolled.
        pitch: Radians above the plane perpendicular to `axis`, -pi/2 to pi/2.
        distance: Metres from the eye to the target.
        aside: How far right of the target the pivot is, over the distance: a panel covers the left of the picture.
        vertical_fov: Radians.
        near: As in Camera, until the user moves the camera: it was chosen for one view.
        speed: Metres per second when flying.
        scene_radius: Half the diagonal of the scene's box, metres; scales speeds and limits.
        viewpoints: Saved cameras by the digit of their key.
        asides: `aside` of those that were saved here.
        jumped: True after a cut to another view, until somebody clears it: histories are void then.
    """

    mode: Mode = "orbit"
    eye: np.ndarray = dataclasses.field(default_factory=lambda: np.array([0.0, 0.0, 5.0]))
    right: np.ndarray = dataclasses.field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    axis: np.ndarray = dataclasses.field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))
    pitch: float = 0.0
    distance: float = 5.0
    aside: float = 0.0
    vertical_fov: float = math.pi / 3
    near: float | None = None
    speed: float = 1.0
    scene_radius: float = 5.0
    viewpoints: dict[int, Camera] = dataclasses.field(default_factory=dict)
    asides: dict[int, float] = dataclasses.field(default_factory=dict)
    jumped: bool = True

    @property
    def forward(self) -> np.ndarray:
        """(3,) unit view direction."""
        return math.cos(self.pitch) * np.cross(self.axis, self.right) + math.sin(self.pitch) * self.axis

    @property
    def screen_up(self) -> np.ndarray:
        """(3,) unit vector that points up on the screen."""
        return math.cos(self.pitch) * self.axis - math.sin(self.pitch) * np.cross(self.axis, self.right)

    @property
    def target(self) -> np.ndarray:
        """(3,) the point looked at, in the middle of the picture."""
        return self.eye + self.distance * self.forward

    @property
    def pivot(self) -> np.ndarray:
        """(3,) the point that orbiting keeps in place: the target, but beside a panel."""
        return self.target + self.distance * self.aside * self.right

    def camera(self) -> Camera:
        """The camera of this frame."""
        return Camera("", _triple(self.eye), _triple(self.target), _triple(self.screen_up),
                      self.vertical_fov, self.near)

    def set_camera(self, camera: Camera, aside: float = 0.0) -> None:
        """Jump to a camera of the scene, of the command line, or a saved one, with the `aside` that it had here."""
        self.eye = np.array(camera.eye, dtype=np.float64)
        self.vertical_fov, self.near = camera.vertical_fov, camera.near
        self._aim(np.array(camera.target, dtype=np.float64), np.array(camera.up, dtype=np.float64))
        self.aside, self.jumped = aside, True

    def step_aside(self, low: np.ndarray, high: np.ndarray, aspect: float, covered: float) -> None:
        """Turn until the target stands in the middle of what a panel leaves free; it is the pivot from then on.

        From outside of the scene, also step back where its box would be cut off more than before; not where most of it
        is cut off already, as for somebody who walks over a terrain.

        Args:
            low, high: Corners of the scene's box, world space.
            aspect: Width over height of the image.
            covered: Share of its width that lies behind the panel, from the left.
        """
        if not covered > 0.0:
            return
        reach = _reach_of_box(low, high, self.target)
        before = self._distance_for(reach, aspect, 0.0) / self.distance
        self._turn_aside(self.target, aspect, covered)
        if before < _MOSTLY_SEEN and np.any((self.eye < low) | (self.eye > high)):
            back = self._distance_for(reach, aspect, covered) / self.distance / max(before, 1.0)
            if back > 1.0:
                self._stand_at(self.pivot, self.distance * back)
                self.near = None
        self.jumped = True

    def set_scene_size(self, low: np.ndarray, high: np.ndarray) -> None:
        """Scale speeds and limits to the box of a new scene."""
        self.scene_radius = max(0.5 * float(np.linalg.norm(high - low)), 1e-6)
        self.speed = _SPEED_SHARE * self.scene_radius

    def rotate(self, dx: float, dy: float) -> None:
        """Turn about the pivot (orbit) or about the eye (fly).

        Args:
            dx, dy: Movement of the mouse to the right and down, in window heights.
        """
        pivot = self.pivot
        self.look(dx, dy)
        if self.mode == "orbit":
            self._stand_at(pivot, self.distance)

    def look(self, dx: float, dy: float) -> None:
        """Turn about the eye in either mode; arguments as in `rotate`."""
        angle = -dx * _TURN_PER_HEIGHT
        ahead = np.cross(self.axis, self.right)
        self.right = _unit(math.cos(angle) * self.right + math.sin(angle) * ahead)
        self.near = None
        self.pitch = min(max(self.pitch - dy * _TURN_PER_HEIGHT, -math.pi / 2), math.pi / 2)

    def pan(self, dx: float, dy: float) -> None:
        """Shift the view so that the target follows the mouse; arguments as in `rotate`."""
        metres = 2.0 * self.distance * math.tan(self.vertical_fov / 2)
        self.eye = self.eye + metres * (dy * self.screen_up - dx * self.right)
        self.near = None

    def wheel(self, steps: float) -> None:
        """Zoom (orbit) or change the speed (fly); positive steps are away from the user."""
        steps = min(max(steps, -_MOST_STEPS), _MOST_STEPS)
        if self.mode == "fly":
            limits = 1e-4 * self.scene_radius, 10.0 * self.scene_radius
            self.speed = min(max(self.speed * _SPEED_PER_STEP ** steps, limits[0]), limits[1])
            return
        limits = 1e-4 * self.scene_radius, 100.0 * self.scene_radius
        self._stand_at(self.pivot, min(max(self.distance * _ZOOM_PER_STEP ** steps, limits[0]), limits[1]))
        self.near = None

    def fly(self, right: float, up: float, forward: float, seconds: float, fast: bool = False) -> None:
        """Move by held keys.

        Args:
            right, up, forward: -1, 0 or 1 each; up is along the axis, not the screen.
            seconds: Time since the last call.
        """
        direction = right * self.right + up * self.axis + forward * self.forward
        length = float(np.linalg.norm(direction))
        if length > 0.0:
            step = self.speed * (_FAST if fast else 1.0) * min(seconds, _LONGEST_STEP)
            self.eye = self.eye + step / length * direction
            self.near = None

    def focus(self, point: np.ndarray) -> None:
        """Look at a point from where the eye is, and orbit about it from now on."""
        if np.linalg.norm(np.asarray(point) - self.eye) > 1e-9:
            self._aim(np.asarray(point, dtype=np.float64), self.axis)
            self.near = None
            self.jumped = True

    def point_at(self, u: float, v: float, aspect: float, view_depth: float) -> np.ndarray:
        """(3,) world position at a place of the image.

        Args:
            u, v: From 0 to 1, rightward and downward.
            aspect: Width over height.
            view_depth: Distance along the view direction.
        """
        tangent = np.tan(self.vertical_fov / 2)
        ray = self.forward + (2 * u - 1) * aspect * tangent * self.right + (1 - 2 * v) * tangent * self.screen_up
        return self.eye + view_depth * ray

    def frame(self, low: np.ndarray, high: np.ndarray, aspect: float, covered: float = 0.0) -> None:
        """Step back from the middle of a box until it fits into the image, as far as a panel leaves that free.

        Args:
            low, high, aspect, covered: As of `step_aside`.
        """
        middle, radius = 0.5 * (low + high), max(0.5 * float(np.linalg.norm(high - low)), 1e-6)
        self.eye = middle - (self.pivot - self.eye)     # seen from the direction of now
        self._turn_aside(middle, aspect, covered)
        # A ball, so that orbiting does not cut it off
        distance = self._distance_for(lambda normal: radius * float(np.linalg.norm(normal)), aspect, covered)
        self._stand_at(middle, distance)
        self.near = None
        self.jumped = True

    def save_viewpoint(self, digit: int) -> None:
        """Remember the present view under a digit."""
        self.viewpoints[digit], self.asides[digit] = self.camera(), self.aside

    def recall_viewpoint(self, digit: int) -> bool:
        """Go to a saved view; False when there is none under that digit."""
        if digit not in self.viewpoints:
            return False
        self.set_camera(self.viewpoints[digit], self.asides.get(digit, 0.0))
        return True

    def _stand_at(self, pivot: np.ndarray, distance: float) -> None:
        """Bring the eye to where the pivot is there, at a distance along the view direction."""
        self.distance = distance
        self.eye = pivot - distance * (self.forward + self.aside * self.right)

    def _turn_aside(self, pivot: np.ndarray, aspect: float, covered: float) -> None:
        """Turn about the eye until a point stands in the middle of what a panel leaves free; less far where it is
        steeply above or below, as the picture would turn about itself."""
        towards = _unit(pivot - self.eye)
        rise = float(towards @ self.axis)
        level = math.sqrt(max(1.0 - rise * rise, 0.0))
        slope = aspect * math.tan(self.vertical_fov / 2)
        self.aside = min(covered * slope, _MOST_TURN * level / math.hypot(1.0, _MOST_TURN * rise))
        self.pitch = math.asin(min(max(rise * math.hypot(1.0, self.aside), -1.0), 1.0))
        if level > 1e-9:
            ahead = _unit(towards - rise * self.axis)
            angle = math.atan2(self.aside, math.cos(self.pitch))
            self.right = math.cos(angle) * np.cross(ahead, self.axis) + math.sin(angle) * ahead
        self.distance = float((pivot - self.eye) @ self.forward)

    def _distance_for(self, reach: Callable[[np.ndarray], float], aspect: float, covered: float) -> float:
        """The least distance along the view direction at which something about the pivot fits into the free part.

        Args:
            reach: How far it goes from the pivot, times the length of a normal in world space, along that.
        """
        slope, upright = aspect * math.tan(self.vertical_fov / 2), math.tan(self.vertical_fov / 2)
        left = max((1.0 - 2.0 * covered) * slope, _LEAST_FREE * slope - self.aside)
        found = 0.0
        for x, y, z in ((1.0, 0.0, -slope), (-1.0, 0.0, -left), (0.0, 1.0, -upright), (0.0, -1.0, -upright)):
            normal = x * self.right + y * self.screen_up + z * self.forward
            found = max(found, reach(normal) / -(x * self.aside + z))
        return found

    def _aim(self, target: np.ndarray, up: np.ndarray) -> None:
        self.aside = 0.0
        offset = target - self.eye
        length = float(np.linalg.norm(offset))
        forward = offset / length if length > 0.0 else self.forward
        self.distance = length if length > 0.0 else self.distance
        # Looking along the up vector: the old heading, or any, is as good as another.
        candidates = (up, self.screen_up, np.eye(3)[np.argmin(np.abs(forward))])
        up = next(v for v in candidates if np.linalg.norm(np.cross(forward, v)) > 1e-9)
        right = _unit(np.cross(forward, up))
        world_up = np.array([0.0, 1.0, 0.0])
        level = abs(right @ world_up) < _ROLL_TOLERANCE and np.cross(right, forward) @ world_up > -_ROLL_TOLERANCE
        self.axis = world_up if level else _unit(up)
        self.right = _unit(right - (right @ self.axis) * self.axis)
        self.pitch = math.asin(min(max(float(forward @ self.axis), -1.0), 1.0))


def _reach_of_box(low: np.ndarray, high: np.ndarray, point: np.ndarray) -> Callable[[np.ndarray], float]:
    """How far a box reaches from a point along a normal, times its length."""
    return lambda normal: float(np.maximum(normal * (low - point), normal * (high - point)).sum())


def camera_flags(camera: Camera) -> str:
    """The command-line flags that give this camera, `--up` only where it is not the usual one.

    Joined with "=", since a value may begin with a minus.
    """
    flags = [f"--eye={_numbers(camera.eye)}", f"--target={_numbers(camera.target)}"]
    eye, target = np.array(camera.eye), np.array(camera.target)
    forward = _unit(target - eye)
    usual = np.cross(forward, (0.0, 1.0, 0.0))
    right = np.cross(forward, camera.up)
    same = np.linalg.norm(usual) > 1e-3 and _unit(usual) @ _unit(right) > 1.0 - 1e-6
    if not same:
        flags.append(f"--up={_numbers(camera.up)}")
    flags.append(f"--fov={math.degrees(camera.vertical_fov):.6g}")
    return " ".join(flags)


def _numbers(values: tuple[float, ...]) -> str:
    # "+ 0.0" turns a rounded -0 into 0
    return ",".join(f"{round(value, 6) + 0.0:.7g}" for value in values)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def _triple(vector: np.ndarray) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])
