"""The triangles of a scene as float textures, for rays in shaders (shaders/lib/triangle_tree.glsl); OpenGL 3.3 will do.

Masked triangles have the same holes as with Embree (`triangles.py`). What is approximated: positions are single
precision about the scene's centre, not about the camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.memory import allocating
from ssil_viewer.gpu.screen_program import FLOAT_TABLE
from ssil_viewer.scene.model import Scene
from ssil_viewer.scene.surfels import TriangleColors
from ssil_viewer.scene.triangle_tree import TriangleTree, build_tree
from ssil_viewer.scene.triangles import Mask, SceneTriangles

TABLE_WIDTH = 4096      # shaders/lib/triangle_tree.glsl
TABLE_KINDS = {**dict.fromkeys(("nodes", "triangles", "triangle_colors", "corners", "masks"), FLOAT_TABLE),
               "alphas": "sampler2D"}
"""Every table there may be, and what shaders declare it as."""
MOST_TRIANGLES = 2**24     # floats count no farther
_WRAPS = {"repeat": 0, "clamp": 1, "mirror": 2}


@dataclass(frozen=True)
class TriangleTables:
    """What the textures hold. Made without OpenGL, so that another thread can do it: a second for 100,000 triangles.

    Attributes:
        texels: Name in shaders, without "texture_" -> (N, C) float32 or uint8.
        node_count: Of the tree.
        masked: There are triangles with holes, and the tables that tell of them.
        name: Of the scene.
    """

    texels: dict[str, np.ndarray]
    node_count: int
    masked: bool
    name: str

    @staticmethod
    def of(scene: Scene, origin: np.ndarray, colors: TriangleColors | None = None) -> TriangleTables:
        """The tables of a scene.

        Args:
            origin: (3,) the world position that shaders take for zero.
            colors: Also a table `triangle_colors` of these.

        Raises:
            UserError: The triangles are too many.
        """
        check_triangle_count(scene)
        moved = np.eye(4)
        moved[:3, 3] = -origin
        triangles = SceneTriangles.of(scene, moved)
        every = np.concatenate([triangles.solid, triangles.masked])
        tree = build_tree(every)
        texels = {"nodes": _node_texels(tree), "triangles": _triangle_texels(every, tree, len(triangles.solid))}
        if len(triangles.masked):
            texels |= _mask_tables(triangles)
        if colors is not None:
            texels["triangle_colors"] = _color_texels(colors, tree)
        return TriangleTables(texels, len(tree.low), len(triangles.masked) > 0, scene.name)


def check_triangle_count(scene: Scene) -> None:
    """Raises UserError if the triangles are too many."""
    if scene.triangle_count > MOST_TRIANGLES:
        raise UserError(f"a scene of {scene.triangle_count} triangles is too large for rays in shaders", scene.name,
                        f"at most {MOST_TRIANGLES} will do")


class GpuTriangles:
    """Textures of a scene's triangles, of their tree, and of the masks.

    Attributes:
        textures: By their names in shaders, without "texture_".
        kinds: What shaders declare each as.
        node_count, masked: As of the tables.

    Raises:
        UserError: They do not fit into memory; nothing is allocated then.
    """

    def __init__(self, context: moderngl.Context, tables: TriangleTables) -> None:
        self.node_count, self.masked = tables.node_count, tables.masked
        self.textures: dict[str, moderngl.Texture] = {}
        try:
            for name, texels in tables.texels.items():
                with allocating(context, "the triangles that rays meet", tables.name, "use a smaller scene"):
                    self.textures[name] = _table(context, texels)
        except BaseException:
            self.release()
            raise

    @property
    def kinds(self) -> dict[str, str]:
        return {name: TABLE_KINDS[name] for name in self.textures}

    def release(self) -> None:
        """Free the textures."""
        for texture in self.textures.values():
            texture.release()
        self.textures.clear()


def _table(context: moderngl.Context, texels: np.ndarray) -> moderngl.Texture:
    """A texture whose rows hold (N, C) texels one after the other, float32 or uint8."""
    rows = max(-(-len(texels) // TABLE_WIDTH), 3)
    # Never a power of two: llvmpipe compiles a program anew for textures of such a side, and those compiled ahead have
    # seen a smaller scene
    rows += (rows & (rows - 1)) == 0
    filled = np.zeros((rows * TABLE_WIDTH, texels.shape[1]), texels.dtype)
    filled[:len(texels)] = texels
    texture = context.texture((TABLE_WIDTH, rows), texels.shape[1], filled.tobytes(), alignment=1,
                              dtype="f1" if texels.dtype == np.uint8 else "f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.repeat_x = texture.repeat_y = False
    return texture


def _node_texels(tree: TriangleTree) -> np.ndarray:
    """Two texels a node: low and skip, high and first."""
    texels = np.zeros((len(tree.low), 2, 4), np.float32)
    texels[:, 0, :3], texels[:, 0, 3] = tree.low, tree.skip
    texels[:, 1, :3], texels[:, 1, 3] = tree.high, tree.first
    return texels.reshape(-1, 4)


def _triangle_texels(triangles: np.ndarray, tree: TriangleTree, solid: int) -> np.ndarray:
    """Three texels a triangle, in the tree's order: a corner and the number among the masked ones or -1; an edge and
    whether a leaf ends here; the other edge."""
    corner, edges = triangles[tree.order, 0], triangles[tree.order, 1:] - triangles[tree.order, :1]
    texels = np.zeros((len(corner), 3, 4), np.float32)
    texels[:, 0, :3], texels[:, 0, 3] = corner, np.where(tree.order < solid, -1, tree.order - solid)
    texels[:, 1, :3], texels[:, 1, 3] = edges[:, 0], tree.last
    texels[:, 2, :3] = edges[:, 1]
    return texels.reshape(-1, 4)


def _color_texels(colors: TriangleColors, tree: TriangleTree) -> np.ndarray:
    """A texel a triangle, in the tree's order: emission; the square roots of its albedo in 3x8 bits as a whole number,
    plus 1, negative where only its front sends."""
    root = np.rint(np.sqrt(np.clip(colors.albedo, 0, 1)) * 255)
    code = root @ np.array([1, 256, 65536]) + 1
    texels = np.zeros((len(code), 4), np.float32)
    texels[:, :3], texels[:, 3] = colors.emission, np.where(colors.double_sided, code, -code)
    return texels[tree.order]


def _mask_tables(triangles: SceneTriangles) -> dict[str, np.ndarray]:
    """corners: three texels a masked triangle: u, v and alpha of a corner, the mask in the first. masks: two texels a
    mask: first row of alphas, width, height, cutoff; wraps of u and v. alphas: each texture from a new row on."""
    corners = np.zeros((len(triangles.masked), 3, 4), np.float32)
    masks = np.zeros((len(triangles.masks), 2, 4), np.float32)
    rows: list[np.ndarray] = []
    row_of: dict[int, int] = {}     # by identity of the texture's pixels
    for number, mask in enumerate(triangles.masks):
        part = corners[triangles.first[number]:triangles.first[number + 1]]
        part[:, :, 2], part[:, 0, 3] = mask.alpha, number
        masks[number, 0, 3] = mask.cutoff
        if mask.pixels is not None:
            key = mask.pixels.__array_interface__["data"][0]
            if key not in row_of:
                row_of[key] = sum(map(len, rows)) // TABLE_WIDTH
                rows.append(_whole_rows(mask.pixels))
            part[:, :, :2] = _near_zero(mask)
            masks[number, 0, :3] = row_of[key], mask.pixels.shape[1], mask.pixels.shape[0]
            masks[number, 1, :2] = [_WRAPS[wrap] for wrap in mask.wraps]
    alphas = np.concatenate([np.zeros(0, np.uint8), *rows])[:, None]
    return {"corners": corners.reshape(-1, 4), "masks": masks.reshape(-1, 4), "alphas": alphas}


def _whole_rows(pixels: np.ndarray) -> np.ndarray:
    filled = np.zeros(-(-pixels.size // TABLE_WIDTH) * TABLE_WIDTH, np.uint8)
    filled[:pixels.size] = pixels.ravel()
    return filled


def _near_zero(mask: Mask) -> np.ndarray:
    """Texture coordinates without whole repetitions of the texture, which would cost precision."""
    period = [{"repeat": 1.0, "mirror": 2.0}.get(wrap, np.inf) for wrap in mask.wraps]
    with np.errstate(invalid="ignore"):
        whole = np.floor(mask.uv.min(1, keepdims=True) / period)
    return mask.uv - np.where(np.isfinite(period), whole * np.where(np.isfinite(period), period, 0), 0)
