"""The scene on the GPU: one vertex buffer, one index buffer, tables of objects and materials, texture arrays.

Everything that shares shader variant, textures and culling is one draw call, however many meshes and materials
it comes from: a vertex names its object (row of the transform table) and its material. So Sponza takes a handful
of draws, and an object moves by rewriting six texels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import moderngl
import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.gpu.gl import GLFunctions
from ssil_viewer.gpu.memory import allocating, require_memory
from ssil_viewer.gpu.solid_order import SolidOrder, solid_order
from ssil_viewer.scene.model import Material, Scene, TextureRef, require_scene

OBJECTS_PER_ROW = 128   # shaders/lib/scene.glsl
OBJECT_TEXELS = 6
MATERIAL_TEXELS = 16

_VERTEX = np.dtype([("position", "f4", 3), ("normal", "f4", 3), ("tangent", "f4", 4), ("texcoords", "f4", 4),
                    ("color", "f2", 4), ("object_material", "i4", 2)])
# An index has 32 bits; moderngl counts what it draws in 31.
MAX_VERTICES = 2**32
MAX_INDICES = 2**31 - 1
# moderngl buffer formats; shadows skip what they do not need
FULL_FORMAT = ("3f4 3f4 4f4 4f4 4f2 2i4", ("position", "normal", "tangent", "texcoords", "color", "object_material"))
MASKED_DEPTH_FORMAT = ("3f4 28x 4f4 4f2 2i4", ("position", "texcoords", "color", "object_material"))
DEPTH_FORMAT = ("3f4 52x 2i4", ("position", "object_material"))

# Texture slots of a material in the order of their shader define and sampler
SLOTS = ("base_color", "metallic_roughness", "normal", "occlusion", "emission")
_SRGB_SLOTS = {"base_color", "emission"}
# Most materials have these: where a scene uses one, a material without it reads a white texture instead, since a
# shader variant costs more (a tenth of a second of compilation on software OpenGL) than the lookup.
_SHARED_SLOTS = ("base_color", "normal")
# A white layer in an array that the scene has anyway saves a draw, and a program where drivers compile one for other
# texture sizes; larger layers would cost too much memory (this side: 5.6 MB with mipmaps).
_LARGEST_WHITE = 1024
_WHITE = -1     # in place of the index of an image
_WRAPS = {"repeat": 0, "clamp": 1, "mirror": 2}

_Owned = TypeVar("_Owned", moderngl.Texture, moderngl.Buffer)


@dataclass(frozen=True)
class DrawGroup:
    """Triangles that are drawn by one call.

    Attributes:
        first, count: Range of the index buffer.
        defines: Shader variant: the texture slots in use, ALPHA_MASK, SAMPLER_EXTRAS.
        textures: Slot -> index into `GpuScene.arrays`.
        cull: Back faces are not drawn.
        masked: Fragments may be discarded.
    """

    first: int
    count: int
    defines: tuple[str, ...]
    textures: tuple[tuple[str, int], ...]
    cull: bool
    masked: bool


class GpuScene:
    """GPU copy of a scene.

    World space is moved by `origin`, the centre of the scene's bounds: single precision is spent around the
    geometry, not on its distance from zero.

    Attributes:
        origin: (3,) float64, metres; subtract it from any world position before it goes to the GPU.
        groups: Draw calls, opaque ones first.
        opaque_count: Number of indices, from the first, that belong to opaque groups.
        has_occlusion_maps: Some material darkens indirect light.
        solids: Opaque triangles sorted by `sort_solids`, None before; `solid_buffer` has their indices.

    Raises:
        UserError: It is no scene, or too large for OpenGL or for memory; nothing is allocated then.
    """

    def __init__(self, context: moderngl.Context, scene: Scene, software: bool = False) -> None:
        require_scene(scene)
        _check_size(context, scene)
        self._context = context
        self._scene = scene
        self.solids: SolidOrder | None = None
        self.solid_buffer: moderngl.Buffer | None = None
        low, high = scene.bounds()
        self.origin = (low + high) / 2
        self._first_bounds = np.stack([low - self.origin, high - self.origin])
        self._bounds: np.ndarray | None = self._first_bounds    # None: to be found anew
        self._mesh_corners: dict[int, np.ndarray] = {}
        self._moved_corners: dict[int, np.ndarray] = {}     # instance -> its box's, relative to the origin
        self.has_occlusion_maps = any(m.occlusion_texture for m in scene.materials)
        self.arrays: list[moderngl.TextureArray] = []
        self._tables: list[moderngl.Texture | moderngl.Buffer] = []
        # (image, srgb) -> (array, layer)
        self._places: dict[tuple[int, bool], tuple[int, int]] = {}
        try:
            with allocating(context, f"a scene of {scene.triangle_count} triangles and {len(scene.images)} textures",
                            scene.name, "use a smaller one"):
                self._upload(scene, software)
        except BaseException:
            self.release()
            raise

    def _upload(self, scene: Scene, software: bool) -> None:
        self._shared = {slot for slot in _SHARED_SLOTS if any(getattr(m, f"{slot}_texture") for m in scene.materials)}
        self._upload_images(scene, software)
        self.materials = self._own(self._material_table(scene.materials))
        self._transforms = np.zeros((max(len(scene.instances), 1), OBJECT_TEXELS, 4), np.float32)
        for index, instance in enumerate(scene.instances):
            self._set_rows(index, instance.world_from_object)
        self._transforms[:, 3:] = self._transforms[:, :3]
        rows = -(-len(self._transforms) // OBJECTS_PER_ROW)
        self.objects = self._own(float_table(self._context, OBJECTS_PER_ROW * OBJECT_TEXELS, rows))
        self._moved = True
        self._settle = False
        self.upload_transforms()
        vertices, indices = self._merge(scene)
        self.vertex_buffer = self._own(self._context.buffer(vertices))
        self.index_buffer = self._own(self._context.buffer(indices))

    def _own(self, table: _Owned) -> _Owned:
        self._tables.append(table)
        return table

    # -- textures and materials --------------------------------------------------------------------------------

    def _upload_images(self, scene: Scene, software: bool) -> None:
        uses = {(ref.image, slot in _SRGB_SLOTS) for m in scene.materials for slot in SLOTS
                if (ref := getattr(m, f"{slot}_texture")) is not None}
        by_shape: dict[tuple[tuple[int, int], bool], list[int]] = {}
        for image, srgb in sorted(uses):
            shape = scene.images[image].pixels.shape[:2]
            by_shape.setdefault((shape, srgb), []).append(image)
        for srgb in sorted({slot in _SRGB_SLOTS for slot in self._shared}):
            shapes = [shape for shape, is_srgb in by_shape if is_srgb == srgb and max(shape) <= _LARGEST_WHITE]
            by_shape.setdefault((min(shapes, default=(1, 1)), srgb), []).append(_WHITE)
        gl = GLFunctions(self._context)
        limit = int(self._context.info.get("GL_MAX_ARRAY_TEXTURE_LAYERS", 256))
        for (shape, srgb), images in by_shape.items():
            for start in range(0, len(images), limit):
                chunk = images[start:start + limit]
                for layer, image in enumerate(chunk):
                    self._places[image, srgb] = (len(self.arrays), layer)
                layers = [np.full((*shape, 4), 255, np.uint8) if i == _WHITE else scene.images[i].pixels for i in chunk]
                array = gl.texture_array(layers, srgb, software)
                array.anisotropy = 1.0 if software else min(8.0, self._context.max_anisotropy)
                self.arrays.append(array)

    def _place(self, material: Material, slot: str) -> tuple[int, int] | None:
        """Array and layer of a material's texture, or of the white one where there is such a stand-in."""
        ref = getattr(material, f"{slot}_texture")
        if ref is None and slot not in self._shared:
            return None
        return self._places[_WHITE if ref is None else ref.image, slot in _SRGB_SLOTS]

    def _material_table(self, materials: tuple[Material, ...]) -> moderngl.Texture:
        rows = np.zeros((max(len(materials), 1), MATERIAL_TEXELS, 4), np.float32)
        for row, m in zip(rows, materials):
            layer = {slot: float(place[1]) if (place := self._place(m, slot)) else 0.0 for slot in SLOTS}
            dielectric = min(m.specular * ((m.ior - 1.0) / (m.ior + 1.0)) ** 2, 1.0)
            row[0] = m.base_color
            # A scale of zero makes white, read in place of a missing map, the unchanged normal
            row[1] = (*m.emission, m.normal_scale if m.normal_texture else 0.0)
            row[2] = (m.metallic, m.roughness, m.occlusion_strength, m.alpha_cutoff)
            row[3] = (dielectric, layer["base_color"], layer["metallic_roughness"], layer["normal"])
            row[4] = (layer["occlusion"], layer["emission"], 0.0, 0.0)
            for at, slot in enumerate(SLOTS):
                ref = getattr(m, f"{slot}_texture") or TextureRef(0)
                c, s = np.cos(ref.rotation), np.sin(ref.rotation)
                # columns of the 2x2 matrix: KHR_texture_transform rotates counter-clockwise with v down
                row[6 + 2 * at] = (c * ref.scale[0], -s * ref.scale[0], s * ref.scale[1], c * ref.scale[1])
                row[7 + 2 * at] = (*ref.offset, ref.texcoord + 2 * ref.nearest,
                                   _WRAPS[ref.wrap_u] + 3 * _WRAPS[ref.wrap_v])
        texture = float_table(self._context, MATERIAL_TEXELS, len(rows))
        texture.write(rows.tobytes())
        return texture

    # -- geometry ------------------------------------------------------------------------------------------------

    def _variant(self, m: Material) -> tuple:
        textures = tuple((slot, place[0]) for slot in SLOTS if (place := self._place(m, slot)))
        defines = [f"{slot.upper()}_MAP" for slot, _ in textures]
        masked = m.alpha_mode != "opaque"
        if masked:
            defines.append("ALPHA_MASK")
        refs = [ref for slot in SLOTS if (ref := getattr(m, f"{slot}_texture"))]
        if any(r.texcoord or r.nearest or r.wrap_u != "repeat" or r.wrap_v != "repeat" or r.rotation
               or r.offset != (0.0, 0.0) or r.scale != (1.0, 1.0) for r in refs):
            defines.append("SAMPLER_EXTRAS")
        return masked, not m.double_sided, tuple(defines), textures

    def _merge(self, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
        """All instances as one vertex and one index array; fills `groups`."""
        parts: dict[tuple, list[np.ndarray]] = {}
        chunks: list[np.ndarray] = []
        packed: dict[tuple[int, int], np.ndarray] = {}
        base = 0
        for index, instance in enumerate(scene.instances):
            mirrored = np.linalg.det(instance.world_from_object[:3, :3]) < 0
            for at, primitive in enumerate(scene.meshes[instance.mesh].primitives):
                key = (instance.mesh, at)
                if key not in packed:
                    packed[key] = _pack_vertices(primitive)
                vertices = packed[key].copy()
                vertices["object_material"] = (index, primitive.material)
                chunks.append(vertices)
                triangles = primitive.indices[:, ::-1] if mirrored else primitive.indices
                variant = self._variant(scene.materials[primitive.material])
                parts.setdefault(variant, []).append((triangles + np.uint32(base)).astype(np.uint32).ravel())
                base += len(vertices)
        self.groups: list[DrawGroup] = []
        self.opaque_count = 0
        ordered: list[np.ndarray] = []
        first = 0
        for variant in sorted(parts):
            masked, cull, defines, textures = variant
            indices = np.concatenate(parts[variant])
            ordered.append(indices)
            self.groups.append(DrawGroup(first, len(indices), defines, textures, cull, masked))
            first += len(indices)
            if not masked:
                self.opaque_count = first
        if not chunks:
            return np.zeros(1, _VERTEX), np.zeros(3, np.uint32)
        return np.concatenate(chunks), np.concatenate(ordered)

    def sort_solids(self) -> None:
        """Fill `solids` and `solid_buffer`, once: most scenes are drawn without ever needing them.

        Raises:
            UserError: There is no memory for them.
        """
        if self.solids is None:
            order = solid_order(self._scene)
            with allocating(self._context, f"the order of {len(order.indices) // 3} triangles", self._scene.name,
                            "choose --visibility off"):
                # OpenGL has no empty buffers
                self.solid_buffer = self._own(self._context.buffer(order.indices if len(order.indices) else bytes(12)))
            self.solids = order

    # -- transforms ------------------------------------------------------------------------------------------------

    def _set_rows(self, index: int, world_from_object: np.ndarray) -> None:
        moved = np.array(world_from_object, np.float64)
        moved[:3, 3] -= self.origin
        self._transforms[index, :3] = moved[:3]

    def move(self, instance: int, world_from_object: np.ndarray) -> None:
        """Place an instance anew; its old place is remembered for motion vectors until the next frame."""
        self._set_rows(instance, world_from_object)
        self._moved = True
        mesh = self._scene.instances[instance].mesh
        if mesh not in self._mesh_corners:
            self._mesh_corners[mesh] = self._scene.mesh_corners(mesh)
        place = np.asarray(world_from_object, np.float64)
        self._moved_corners[instance] = self._mesh_corners[mesh] @ place[:3, :3].T + place[:3, 3] - self.origin
        self._bounds = None

    @property
    def bounds(self) -> np.ndarray:
        """Corners of the box of all geometry as it came, and of what has moved where it is now: (2, 3) float64,
        relative to `origin`."""
        if self._bounds is None:
            # As it came, so that shadow maps do not get coarser and finer with each step of a thing within the scene
            corners = np.concatenate([self._first_bounds, *self._moved_corners.values()])
            self._bounds = np.stack([corners.min(axis=0), corners.max(axis=0)])
        return self._bounds

    def upload_transforms(self) -> bool:
        """Send changed transforms to the GPU, once a frame. Returns whether anything moves in this frame."""
        if not self._moved and not self._settle:
            return False
        moved = self._moved
        count = OBJECTS_PER_ROW * -(-len(self._transforms) // OBJECTS_PER_ROW)
        padded = np.zeros((count, OBJECT_TEXELS, 4), np.float32)
        padded[:len(self._transforms)] = self._transforms
        self.objects.write(padded.tobytes())
        # The frame after the last move still has to learn that nothing moves any more.
        self._transforms[:, 3:] = self._transforms[:, :3]
        self._settle, self._moved = moved, False
        return moved

    def release(self) -> None:
        """Free all GPU memory."""
        for owned in (*self.arrays, *self._tables):
            owned.release()


def _check_size(context: moderngl.Context, scene: Scene) -> None:
    """Refuses a scene that cannot be put into one vertex buffer, one index buffer and two tables.

    Raises:
        UserError: It has too much of something, or main memory cannot hold its vertices while they are merged.
    """
    side = int(context.info["GL_MAX_TEXTURE_SIZE"])
    vertices = sum(len(p.positions) for i in scene.instances for p in scene.meshes[i.mesh].primitives)
    indices = 3 * scene.triangle_count
    for count, limit, what in ((len(scene.instances), side * OBJECTS_PER_ROW, "instances"),
                               (len(scene.materials), side, "materials"),
                               (vertices, MAX_VERTICES, "vertices"), (indices, MAX_INDICES, "triangle corners")):
        if count > limit:
            raise UserError(f"the scene has {count} {what}, and {limit} can be drawn", scene.name, "use a smaller one")
    # Each array exists in pieces and joined; software OpenGL copies it once more.
    require_memory(3 * (vertices * _VERTEX.itemsize + 4 * indices), f"a scene of {scene.triangle_count} triangles",
                   scene.name, "use a smaller one")


def float_table(context: moderngl.Context, width: int, height: int) -> moderngl.Texture:
    texture = context.texture((width, max(height, 1)), 4, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    texture.repeat_x = texture.repeat_y = False
    return texture


def _pack_vertices(primitive) -> np.ndarray:
    vertices = np.zeros(len(primitive.positions), _VERTEX)
    vertices["position"] = primitive.positions
    vertices["normal"] = primitive.normals
    if primitive.tangents is not None:
        vertices["tangent"] = primitive.tangents
    vertices["texcoords"] = primitive.texcoords.reshape(-1, 4)
    vertices["color"] = 1.0 if primitive.colors is None else primitive.colors
    return vertices
