"""What all shaders of a frame know: the mapping from camera and settings to the GPU."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.light_table import look_along, perspective
from ssil_viewer.gpu.targets import rendered_size
from ssil_viewer.gpu.uniforms import Float, Int, Mat4, Vec2, Vec3
from ssil_viewer.scene.model import Camera, box_corners
from ssil_viewer.settings import Settings

# Steps of the two-dimensional low-discrepancy sequence of the plastic number (Roberts 2018)
_PLASTIC = (0.7548776662466927, 0.5698402909980532)
# Height for which the radius is given, so that a picture does not change with its resolution
REFERENCE_HEIGHT = 720
# Longest temporal mean while a light or an object moves: eight frames later a ninth of the old light is left
MOVING_FRAMES = 2
# The same for pixels whose light is far from the mean while the camera moves alone: most of it is noise of the dark
CHANGED_FRAMES = 8


@dataclass(frozen=True)
class FrameBlock:
    """The uniform block `frame`. World space is relative to the scene's origin (gpu/scene_buffers.py)."""

    view_from_world: Mat4
    world_from_view: Mat4
    clip_from_view: Mat4
    previous_view_from_world: Mat4
    previous_clip_from_view: Mat4
    previous_view_from_view: Mat4
    ray_scale: Vec2             # size of a level-0 pixel on the plane z = 1
    ray_origin: Vec2            # lower left corner of what is rendered on that plane
    previous_ray_scale: Vec2
    previous_ray_origin: Vec2
    extent: Vec2                # size of what is rendered over that of the image: 1 without a guard band
    jitter: Vec2                # shift of the sample pattern: turn and radius, in [0, 1)
    background: Vec3            # radiance of the backdrop
    exposure: Float             # factor on radiance before tone mapping
    environment_turn: Vec2      # cosine and sine of its rotation about +Y
    environment_strength: Float
    radius: Float               # of disc and rings, in texels of each level
    near: Float
    far: Float
    thickness: Float            # of visible surfaces, relative to their view depth
    samples: Int
    light_count: Int
    history_frames: Int         # longest temporal mean; 0: there is no history
    changed_frames: Float       # the same where the light is far from the mean
    unmoved: Int                # frames in a row in which nothing has moved, neither the camera nor anything else
    still: Int                  # 1: nothing has moved for some frames, neither the camera nor anything else
    voxel_view_slice: Int       # slice that the view of one slice shows


@dataclass(frozen=True)
class View:
    """A camera as matrices, float64, relative to the scene's origin."""

    view_from_world: np.ndarray
    clip_from_view: np.ndarray
    near: float
    far: float


def same_view(a: View, b: View) -> bool:
    """Whether two views show the same of a scene in which nothing moves."""
    return np.array_equal(a.view_from_world, b.view_from_world) and np.array_equal(a.clip_from_view, b.clip_from_view)


def make_view(camera: Camera, size: tuple[int, int], origin: np.ndarray, bounds: np.ndarray,
              band: tuple[int, int] = (0, 0)) -> View:
    """Matrices of a camera.

    Args:
        size: Image width and height in pixels; the camera's field of view is that of the image.
        origin: (3,) world position of the GPU's zero.
        bounds: (2, 3) box of the geometry relative to `origin`; the clip planes enclose it.
        band: Pixels of the guard band, by which the matrices see more at each side.

    Raises:
        UserError: Eye and target coincide, a vector has not three numbers, a number is not finite, or the field of
            view is not below 180 degrees.
    """
    eye, target, up = (np.asarray(v, np.float64) for v in (camera.eye, camera.target, camera.up))
    if not eye.shape == target.shape == up.shape == (3,):
        raise UserError("the camera's eye, target and up are not three numbers each", "", "give x, y and z")
    if not (np.isfinite(eye).all() and np.isfinite(target).all() and np.isfinite(up).all()):
        raise UserError("the camera is not finite", "--eye, --target, --up", "give plain numbers")
    forward = target - eye
    if np.linalg.norm(forward) < 1e-12 * max(1.0, float(np.abs(eye).max())):
        raise UserError("the camera looks at its own position", "--eye and --target", "move one of them")
    if not np.linalg.norm(up) > 0:
        raise UserError("the camera's up vector is zero", "--up", "give a direction, such as 0,1,0")
    if not 0 < camera.vertical_fov < math.pi:
        raise UserError(f"a field of view of {math.degrees(camera.vertical_fov):g} degrees cannot be shown", "--fov",
                        "give an angle between 0 and 180")
    view = look_along(eye - origin, forward, up)
    depths = -(box_corners(bounds) @ view[:3, :3].T + view[:3, 3])[:, 2]
    diagonal = float(np.linalg.norm(bounds[1] - bounds[0])) or 1.0
    far = max(float(depths.max()) * 1.01, diagonal * 1e-2)
    # From inside a scene the near plane is a two-thousandth of its size: near enough not to be noticed, far
    # enough for the depth buffer.
    near = camera.near or max(float(depths.min()) * 0.99, diagonal * 5e-4)
    # 24 bits of depth tell nothing apart behind a near plane that is closer still
    near = min(max(near, far * 1e-4), far * 0.5)
    tan_y = math.tan(camera.vertical_fov / 2)
    # Pixels are square: so much of the plane z = 1 for each
    tan_half = (tan_y * (size[0] + 2 * band[0]) / size[1], tan_y * (size[1] + 2 * band[1]) / size[1])
    return View(view, perspective(tan_half, near, far), near, far)


def view_from_matrices(clip_from_view: np.ndarray, view_from_world: np.ndarray) -> View:
    """The view of another program's camera.

    Args:
        clip_from_view: (4, 4), perspective, with OpenGL's conventions: the camera looks along -Z, y points up, depth
            goes from -1 to 1 or back. May be off-centre, reversed or infinite. Row-major: translations stand in the
            last column.
        view_from_world: (4, 4), rotation and translation.

    Raises:
        ValueError: A matrix is something else.
    """
    clip, view = np.asarray(clip_from_view, np.float64), np.asarray(view_from_world, np.float64)
    for name, matrix in (("projection", clip), ("view_from_world", view)):
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise ValueError(f"{name} must be 4x4 finite numbers")
    if not np.allclose(clip[3], (0, 0, -1, 0)) or clip[0, 0] <= 0 or clip[1, 1] <= 0 or clip[0, 1] or clip[1, 0]:
        hint = "; it looks transposed" if np.allclose(clip[:, 3], (0, 0, -1, 0)) else ""
        raise ValueError(f"projection must be a perspective matrix that looks along -Z{hint}")
    if not np.allclose(view[:3, :3] @ view[:3, :3].T, np.eye(3), atol=1e-3) or not np.allclose(view[3], (0, 0, 0, 1)):
        hint = "; it looks transposed" if np.allclose(view[:, 3], (0, 0, 0, 1)) else ""
        raise ValueError(f"view_from_world must be a rotation and a translation{hint}")
    # Where depth is -1 and where it is 1; the far plane may lie at infinity
    ends = [clip[2, 3] / (clip[2, 2] + depth) if clip[2, 2] + depth else np.inf for depth in (-1, 1)]
    return View(view, clip, min(ends), min(max(ends), 1e30))


def make_frame(view: View, previous: View, size: tuple[int, int], settings: Settings, frame_index: int,
               light_count: int, background: tuple[float, float, float], history: bool, moving: bool = False,
               still: bool = False, camera_alone: bool = False,
               unmoved: int = 0) -> FrameBlock:
    """The uniform block of one frame.

    Args:
        size: Of the image; `view` and `previous` see its guard band, too.
        frame_index: Frames since the history began; moves the sample pattern while temporal reprojection runs.
        history: Whether the last frame's textures hold this scene.
        moving: A light or an object moved since the last frame: the light of many frames ago is another one.
        still: Nothing has moved for some frames, the camera neither: what differs from the last frame is noise.
        camera_alone: Nothing but the camera has moved for some frames.
        unmoved: So many frames in a row in which nothing has moved since the one before.
    """
    world_from_view = np.linalg.inv(view.view_from_world)
    step = frame_index if settings.temporal else 0
    longest = min(settings.temporal_frames, MOVING_FRAMES) if moving else settings.temporal_frames
    start = np.random.default_rng(settings.seed).random(2)
    rendered = rendered_size(size, settings)
    jitter = [(start[i] + step * _PLASTIC[i]) % 1.0 for i in range(2)]

    # A point (x, y) of the plane z = 1 before the camera lands at ndc = clip[0, 0] x - clip[0, 2], in y likewise
    def ray_scale(v: View) -> tuple[float, float]:
        return 2 / (v.clip_from_view[0, 0] * rendered[0]), 2 / (v.clip_from_view[1, 1] * rendered[1])

    def ray_origin(v: View) -> tuple[float, float]:
        clip = v.clip_from_view
        return (clip[0, 2] - 1) / clip[0, 0], (clip[1, 2] - 1) / clip[1, 1]

    return FrameBlock(
        view_from_world=view.view_from_world, world_from_view=world_from_view, clip_from_view=view.clip_from_view,
        previous_view_from_world=previous.view_from_world, previous_clip_from_view=previous.clip_from_view,
        previous_view_from_view=previous.view_from_world @ world_from_view,
        ray_scale=ray_scale(view), ray_origin=ray_origin(view),
        previous_ray_scale=ray_scale(previous), previous_ray_origin=ray_origin(previous),
        extent=(rendered[0] / size[0], rendered[1] / size[1]), jitter=jitter, background=background,
        exposure=2.0**settings.exposure, radius=radius_texels(settings, size),
        environment_turn=(math.cos(math.radians(settings.environment_rotation)),
                          math.sin(math.radians(settings.environment_rotation))),
        environment_strength=2.0**settings.environment_strength,
        near=view.near, far=view.far, thickness=settings.thickness, samples=settings.samples, light_count=light_count,
        history_frames=longest if history else 0,
        changed_frames=min(CHANGED_FRAMES if camera_alone else MOVING_FRAMES, longest), unmoved=unmoved,
        still=int(still), voxel_view_slice=settings.voxel_view_slice)


def radius_texels(settings: Settings, size: tuple[int, int]) -> float:
    """Radius of disc and rings in texels of each level, for an image of this size."""
    return settings.radius * size[1] / REFERENCE_HEIGHT
