"""Lights on the GPU: a table of their values, and a tile of the shadow atlas for each view from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Sequence

import moderngl
import numpy as np

from ssil_viewer.gpu.area_points import (
    TILES_PER_POINT,
    area_frame,
    area_points,
    hemisphere_axes,
    point_count,
    point_spacing,
)
from ssil_viewer.gpu.memory import allocating, release_framebuffers
from ssil_viewer.gpu.scene_buffers import float_table
from ssil_viewer.gpu.screen_program import FLOAT_TABLE
from ssil_viewer.scene.model import Light, box_corners

LIGHT_TABLES = {"lights": FLOAT_TABLE, "shadow_tiles": FLOAT_TABLE, "shadow_atlas": "sampler2DShadow"}
"""What passes that light something declare: names in shaders -> kind."""

LIGHT_TEXELS = 5
TILE_TEXELS = 7
_KINDS = {"directional": 0, "point": 1, "spot": 2, "rectangle": 3, "disc": 4, "sphere": 5}
SMALLEST_TILE = 64
# Faces of a point light in the order that shaders/lib/lights.glsl selects them: forward, up
_FACES = (((1, 0, 0), (0, 1, 0)), ((-1, 0, 0), (0, 1, 0)), ((0, 1, 0), (0, 0, 1)),
          ((0, -1, 0), (0, 0, 1)), ((0, 0, 1), (0, 1, 0)), ((0, 0, -1), (0, 1, 0)))


@dataclass(frozen=True)
class Tile:
    """A square of the shadow atlas and the view it holds.

    Attributes:
        corner, side: Lower left texel and side length.
        clip_from_world: (4, 4) float64.
    """

    corner: tuple[int, int]
    side: int
    clip_from_world: np.ndarray


def look_along(position: np.ndarray, forward: np.ndarray, up: np.ndarray) -> np.ndarray:
    """view_from_world of a camera at `position` that looks along `forward`; (4, 4) float64."""
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, up / np.linalg.norm(up))
    if np.linalg.norm(right) < 1e-6:
        right = np.cross(forward, (1.0, 0.0, 0.0) if abs(forward[0]) < 0.9 else (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right)
    rotation = np.stack([right, np.cross(right, forward), -forward])
    view = np.eye(4)
    view[:3, :3] = rotation
    view[:3, 3] = -rotation @ position
    return view


def perspective(tan_half: tuple[float, float], near: float, far: float) -> np.ndarray:
    """clip_from_view with OpenGL's depth range; (4, 4) float64. tan_half: of the half angles in x and y."""
    clip = np.zeros((4, 4))
    clip[0, 0], clip[1, 1] = 1 / tan_half[0], 1 / tan_half[1]
    clip[2, 2], clip[2, 3] = (far + near) / (near - far), 2 * far * near / (near - far)
    clip[3, 2] = -1
    return clip


def off_centre_perspective(low: float, high: float, near: float, far: float) -> np.ndarray:
    """As `perspective`, for tangents from `low` to `high` in both x and y; (4, 4) float64."""
    clip = perspective(((high - low) / 2,) * 2, near, far)
    clip[0, 2] = clip[1, 2] = (high + low) / (high - low)
    return clip


class LightTable:
    """Values and shadow maps of the lights.

    Attributes:
        table, tiles_table: RGBA32F textures; layout in shaders/lib/lights.glsl.
        atlas: Depth texture with all shadow maps.
        tiles: Views to render into the atlas.
        count: Number of lights.
        punctual_count: How many of them have no area; they come first.
        area_kinds: The kinds of the others.
        unshadowed: Names of lights that found no room in the atlas.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self.table = float_table(context, LIGHT_TEXELS, 1)
        self.tiles_table = float_table(context, TILE_TEXELS, 1)
        self.atlas = self._create_atlas((1, 1))
        self.framebuffer = context.framebuffer(depth_attachment=self.atlas)
        self.tiles: list[Tile] = []
        self.count = self.punctual_count = 0
        self.area_kinds: tuple[str, ...] = ()
        self.unshadowed: list[str] = []

    @property
    def textures(self) -> dict[str, moderngl.Texture]:
        """The three of `LIGHT_TABLES`."""
        return {"lights": self.table, "shadow_tiles": self.tiles_table, "shadow_atlas": self.atlas}

    def _create_atlas(self, size: tuple[int, int]) -> moderngl.Texture:
        atlas = self._context.depth_texture(size)
        atlas.compare_func = "<="
        atlas.filter = (moderngl.LINEAR, moderngl.LINEAR)
        atlas.repeat_x = atlas.repeat_y = False
        return atlas

    def update(self, lights: Sequence[Light], origin: np.ndarray, bounds: np.ndarray, resolution: int,
               max_size: int, area_samples: int = 9) -> None:
        """Write the tables and lay out the atlas; its content is then the shadow pass's to render.

        Args:
            origin: World position that the GPU's zero stands for.
            bounds: (2, 3) box of the geometry relative to `origin`.
            resolution: Side of a directional light's tile; spots get a quarter, others an eighth.
            max_size: Largest side of a texture.
            area_samples: Points on each area light from which its shadow is drawn.

        Raises:
            UserError: The atlas or a table cannot be allocated; all stays as it was then.
        """
        lights = sorted(lights, key=lambda light: light.is_area)
        sides = self._tile_sides(lights, resolution, max_size, area_samples)
        corners, atlas_size = _pack_squares([s for light_sides in sides for s in light_sides])
        tiles: list[Tile] = []
        rows = np.zeros((max(len(lights), 1), LIGHT_TEXELS, 4), np.float32)
        tile_rows: list[np.ndarray] = []
        for row, light, light_sides in zip(rows, lights, sides):
            first = len(tiles) if light_sides else -1
            position = np.asarray(light.position, np.float64) - origin
            direction = np.asarray(light.direction, np.float64)
            scale = 1.0 / max(np.cos(light.inner_cone) - np.cos(light.outer_cone), 1e-3)
            row[0] = (*position, _KINDS[light.kind])
            row[1] = (*direction, light.range if np.isfinite(light.range) else 0.0)
            # Beyond this, sums over lights would leave single precision; no display shows a difference
            row[2] = (*np.clip(np.asarray(light.color, np.float64) * light.intensity, 0.0, 1e30), first)
            row[3, :2] = (scale, -np.cos(light.outer_cone) * scale)
            if light.is_area:
                u, _, row[1, :3] = area_frame(light)
                row[3, 2:] = (light.width / 2, light.height / 2) if light.kind == "rectangle" else light.radius
                row[4] = (*u, point_count(light, area_samples))
            for (matrix, at_unit_distance, constant, point), side in zip(_views(light, position, bounds, light_sides),
                                                                         light_sides):
                corner = corners[len(tiles)]
                tiles.append(Tile(corner, side, matrix))
                tile = np.zeros((TILE_TEXELS, 4), np.float32)
                tile[:4] = matrix
                tile[4, :3] = (*corner, side)
                tile[5] = (at_unit_distance, constant, 0.0, 0.0)
                tile[6] = point
                tile_rows.append(tile)
        self._fit(len(rows), max(len(tile_rows), 1), atlas_size)
        self.table.write(rows.tobytes())
        self.tiles_table.write(np.array(tile_rows or [np.zeros((TILE_TEXELS, 4))], np.float32).tobytes())
        self.tiles = tiles
        self.count = len(lights)
        self.punctual_count = sum(not light.is_area for light in lights)
        self.area_kinds = tuple(sorted({light.kind for light in lights if light.is_area}))
        self.unshadowed = [light.name or light.kind for light, s in zip(lights, sides)
                           if light.cast_shadow and not s]

    def _fit(self, lights: int, tiles: int, atlas_size: tuple[int, int]) -> None:
        """Replace the textures whose size is not the one needed, all of them or none."""
        made: list[moderngl.Texture | moderngl.Framebuffer] = []
        table, tiles_table, atlas, framebuffer = self.table, self.tiles_table, self.atlas, self.framebuffer
        try:
            with allocating(self._context, f"the shadow maps of {lights} lights", "--shadow-resolution",
                            "give a smaller one"):
                if table.height != lights:
                    table = float_table(self._context, LIGHT_TEXELS, lights)
                    made.append(table)
                if tiles_table.height != tiles:
                    tiles_table = float_table(self._context, TILE_TEXELS, tiles)
                    made.append(tiles_table)
                if atlas.size != atlas_size:
                    atlas = self._create_atlas(atlas_size)
                    made.append(atlas)
                    framebuffer = self._context.framebuffer(depth_attachment=atlas)
                    made.append(framebuffer)
        except BaseException:
            for fresh in made:
                fresh.release()
            raise
        if framebuffer is not self.framebuffer:
            release_framebuffers(self._context, [self.framebuffer])
        for old, new in ((self.atlas, atlas), (self.table, table), (self.tiles_table, tiles_table)):
            if old is not new:
                old.release()
        self.table, self.tiles_table, self.atlas, self.framebuffer = table, tiles_table, atlas, framebuffer

    @staticmethod
    def _tile_sides(lights: Sequence[Light], resolution: int, max_size: int, area_samples: int) -> list[list[int]]:
        """Sides of each light's tiles. All are halved until they fit two directional maps' area; lights
        that would get less than `SMALLEST_TILE` go without, the last ones first."""
        relative = {"directional": (1, 1), "spot": (4, 1), "point": (8, 6)}
        relative |= {light.kind: (8, TILES_PER_POINT * point_count(light, area_samples))
                     for light in lights if light.is_area}
        side_limit = min(max_size, 8192)
        budget, largest = min(2 * resolution**2, side_limit**2), _floor_power_of_two(min(resolution, side_limit))
        scale = 1
        while True:
            sides = [[max(largest // (relative[x.kind][0] * scale), SMALLEST_TILE)] * relative[x.kind][1]
                     if x.cast_shadow else [] for x in lights]
            over = sum(s * s for light_sides in sides for s in light_sides) - budget
            if over <= 0:
                return sides
            if scale * 2 * SMALLEST_TILE > resolution:
                break
            scale *= 2
        for light_sides in reversed(sides):
            if over <= 0:
                break
            over -= sum(s * s for s in light_sides)
            light_sides.clear()
        return sides

    def release(self) -> None:
        """Free all GPU memory."""
        release_framebuffers(self._context, [self.framebuffer])
        for owned in (self.atlas, self.table, self.tiles_table):
            owned.release()


def _floor_power_of_two(value: int) -> int:
    return 1 << (value.bit_length() - 1)


def _pack_squares(sides: list[int]) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Places for squares with power-of-two sides in an atlas, largest first: in blocks as wide as it, one above the
    other, and in each along a Z-order curve, on which they are aligned to their own size and leave no gaps.

    Returns:
        (corner of each square in the order given, width and height of the atlas: a power of two, and at most twice
        as much).
    """
    corners: list[tuple[int, int]] = [(0, 0)] * len(sides)
    width = max(sides, default=1)
    while 2 * width * width < sum(side * side for side in sides):
        width *= 2
    at = height = 0
    for index in sorted(range(len(sides)), key=lambda i: -sides[i]):
        block, within = divmod(at, width * width)
        x = y = 0
        for bit in range(width.bit_length()):
            x |= ((within >> (2 * bit)) & 1) << bit
            y |= ((within >> (2 * bit + 1)) & 1) << bit
        y += block * width
        corners[index] = (x, y)
        at += sides[index] ** 2
        height = max(height, y + sides[index])
    return corners, (width, max(height, 1))


def _views(light: Light, position: np.ndarray, bounds: np.ndarray, sides: list[int]):
    """(clip_from_world, texel size at unit distance, constant texel size, point) of each tile of a light.

    point: (4,), of an area the place of the view and the width on the light that it stands for.
    """
    if not sides:
        return
    corners = box_corners(bounds)
    diagonal = float(np.linalg.norm(bounds[1] - bounds[0])) or 1.0
    nowhere = np.zeros(4)
    if light.kind == "directional":
        view = _smallest_view(np.asarray(light.direction, np.float64), corners)
        seen = corners @ view[:3, :3].T
        low, high = seen.min(axis=0) - 1e-3 * diagonal, seen.max(axis=0) + 1e-3 * diagonal
        clip = np.eye(4)
        extent = high - low
        clip[0, 0], clip[1, 1], clip[2, 2] = 2 / extent[0], 2 / extent[1], -2 / extent[2]
        clip[:3, 3] = -(high + low) / extent * (1, 1, -1)
        yield clip @ view, 0.0, float(max(extent[0], extent[1])) / sides[0], nowhere
        return
    far = max(float(np.linalg.norm(corners - position, axis=1).max()), 1e-6 * diagonal) * 1.01
    near = min(far * 1e-3, diagonal * 1e-3)
    if light.is_area:
        yield from _area_views(light, position, near, far, sides)
        return
    if light.kind == "spot":
        # A margin of two texels, so that filtering at the cone's edge stays inside
        tangent = np.tan(min(light.outer_cone, 1.5)) * (1 + 4 / sides[0])
        view = look_along(position, np.asarray(light.direction, np.float64), np.array((0.0, 1.0, 0.0)))
        yield perspective((tangent, tangent), near, far) @ view, 2 * tangent / sides[0], 0.0, nowhere
        return
    for (forward, up), side in zip(_FACES, sides):
        tangent = 1 + 6 / side
        view = look_along(position, np.asarray(forward, np.float64), np.asarray(up, np.float64))
        yield perspective((tangent, tangent), near, far) @ view, 2 * tangent / side, 0.0, nowhere


def _smallest_view(direction: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """view_from_world along a direction, turned so that the rectangle around a box is as small as it can be.

    Such a rectangle has a side along one of the outline's (Freeman and Shapira 1975), and those of a box are its axes'.
    """
    views = [look_along(np.zeros(3), direction, up) for up in np.eye(3)[[1, 0, 2]]]
    return min(views, key=lambda view: np.prod(np.ptp(corners @ view[:2, :3].T, axis=0)))


def _area_views(light: Light, position: np.ndarray, near: float, far: float, sides: list[int]):
    """Three views from each of an area's points, which together see the whole side to which it emits."""
    count = len(sides) // TILES_PER_POINT
    far += np.sqrt(2.0) * max(light.width, light.height, light.radius)
    spacing = point_spacing(light, count)
    margin = 24 / sides[0]      # eight texels, for the filter and for receivers moved along their normal
    for place, normal in zip(*area_points(light, count)):
        axes = hemisphere_axes(normal)
        for at, forward in enumerate(axes):
            right, up = axes[(at + 2) % 3], axes[(at + 1) % 3]      # the other two span the image
            view = np.eye(4)
            view[:3, :3] = np.stack([right, up, -forward])
            view[:3, 3] = -view[:3, :3] @ (position + place)
            clip = off_centre_perspective(-2.0 - margin, 1.0 + margin, near, far) @ view
            yield clip, (3.0 + 2.0 * margin) / sides[0], 0.0, np.array((*(position + place), spacing))
