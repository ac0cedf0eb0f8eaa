"""The scene as plain numpy data: what every loader produces and the renderer uploads.

Nothing here knows of files or of OpenGL. World space is right-handed, +Y up, metres. Matrices are
(4, 4) float64, act on column vectors and are named target_from_source. Colours are linear RGB with
Rec. 709 primaries; texture pixels are kept as stored (8 bits, colour textures sRGB-encoded), since the
GPU decodes them for free.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.light_values import NUMBERS, VECTORS, LightKind, check_cones, check_kind, check_value

Wrap = Literal["repeat", "clamp", "mirror"]
AlphaMode = Literal["opaque", "mask", "blend"]
AREA_KINDS: tuple[LightKind, ...] = ("rectangle", "disc", "sphere")


@dataclass(frozen=True, eq=False)
class Image:
    """A decoded picture.

    Attributes:
        name: File name or the name in the scene file; for messages.
        pixels: (H, W, 4) uint8, C-contiguous, row 0 = top, straight alpha. Whether RGB is sRGB-encoded
            depends on the use (base colour and emission are, all else is linear).
    """

    name: str
    pixels: np.ndarray


@dataclass(frozen=True)
class TextureRef:
    """The use of an image by a material.

    Attributes:
        image: Index into `Scene.images`.
        texcoord: UV set, 0 or 1.
        wrap_u, wrap_v: Behaviour outside [0, 1].
        nearest: True when the file asks for magnification without interpolation.
        offset, scale, rotation: KHR_texture_transform, uv' = offset + R(rotation) * (scale * uv), radians,
            counter-clockwise rotation in a UV space whose origin is the top left.
    """

    image: int
    texcoord: int = 0
    wrap_u: Wrap = "repeat"
    wrap_v: Wrap = "repeat"
    nearest: bool = False
    offset: tuple[float, float] = (0.0, 0.0)
    scale: tuple[float, float] = (1.0, 1.0)
    rotation: float = 0.0


@dataclass(frozen=True)
class Material:
    """A glTF 2.0 metallic-roughness material; other formats are converted to it.

    Attributes:
        base_color: Linear RGBA factor.
        emission: Emitted radiance factor, W m^-2 sr^-1, linear RGB; emissive strength is multiplied in.
        specular: Weight of the dielectric reflection (KHR_materials_specular specularFactor); 0 makes a
            non-metal exactly Lambertian (an OBJ material with Ks 0).
        ior: Index of refraction of the dielectric (KHR_materials_ior).
        alpha_cutoff: Fragments with less alpha vanish; only for `alpha_mode` "mask".
        *_texture: None or the texture that multiplies the factor. Channels as in glTF: metallic_roughness
            G = roughness, B = metallic; occlusion R; normal RGB, +Y (green) up.
    """

    name: str = ""
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    base_color_texture: TextureRef | None = None
    metallic: float = 0.0
    roughness: float = 1.0
    metallic_roughness_texture: TextureRef | None = None
    normal_texture: TextureRef | None = None
    normal_scale: float = 1.0
    occlusion_texture: TextureRef | None = None
    occlusion_strength: float = 1.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_texture: TextureRef | None = None
    specular: float = 1.0
    ior: float = 1.5
    alpha_mode: AlphaMode = "opaque"
    alpha_cutoff: float = 0.5
    double_sided: bool = False


@dataclass(frozen=True, eq=False)
class Primitive:
    """An indexed triangle list with one material, in object space.

    Attributes:
        positions: (V, 3) float32, finite.
        normals: (V, 3) float32, unit length.
        tangents: (V, 4) float32, unit xyz and the bitangent's sign w (bitangent = w * cross(n, t)), or None
            when the material has no normal map.
        texcoords: (V, 2, 2) float32: UV sets 0 and 1, origin at the top left of the image (glTF);
            zeros where the file has none.
        colors: (V, 4) float32 linear RGBA, or None for white.
        indices: (T, 3) uint32, counter-clockwise front faces.
        material: Index into `Scene.materials`.
    """

    positions: np.ndarray
    normals: np.ndarray
    tangents: np.ndarray | None
    texcoords: np.ndarray
    colors: np.ndarray | None
    indices: np.ndarray
    material: int


@dataclass(frozen=True, eq=False)
class Mesh:
    """A named group of primitives that move together."""

    name: str
    primitives: tuple[Primitive, ...]


@dataclass(frozen=True, eq=False)
class Instance:
    """A mesh placed in the world.

    Attributes:
        mesh: Index into `Scene.meshes`.
        world_from_object: (4, 4) float64. May mirror (negative determinant): the renderer flips the
            winding, so front faces stay front faces.
    """

    name: str
    mesh: int
    world_from_object: np.ndarray


@dataclass(frozen=True)
class Light:
    """A light: punctual with glTF's units and falloff (KHR_lights_punctual), or an area that emits evenly.

    Area lights cannot be seen by the camera: what should be seen needs geometry with a material that emits.

    Attributes:
        kind: "directional", "point", "spot"; with an area "rectangle", "disc", "sphere".
        color: Linear RGB, multiplies `intensity`.
        intensity: Point and spot: W sr^-1 (E = I cos / r^2); directional: W m^-2 (E = I cos); rectangle, disc and
            sphere: radiance, W m^-2 sr^-1, the same in all directions.
        position: World space, metres: of an area the middle; ignored for directional lights.
        direction: World space unit vector along which the light travels. Rectangles and discs emit to this side only;
            ignored for point lights and spheres.
        range: Metres beyond which the light is cut smoothly as glTF recommends; inf for no limit. Point and spot only.
        inner_cone, outer_cone: Half angles in radians, 0 <= inner <= outer <= pi/2; spots only.
        cast_shadow: False lets it shine through geometry.
        width, height: Sides of a rectangle in metres; `height` goes along `up`.
        radius: Of a disc or sphere, metres.
        up: World space; its part across `direction` is where a rectangle's height goes. Need not be a unit vector.

    Raises:
        UserError: A kind that there is not (the nearest is named), or a value of another type or out of range.
    """

    kind: LightKind
    name: str = ""
    color: tuple[float, float, float] = (1.0, 1.0, 1.0)
    intensity: float = 1.0
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (0.0, -1.0, 0.0)
    range: float = float("inf")
    inner_cone: float = 0.0
    outer_cone: float = 0.7853981633974483
    cast_shadow: bool = True
    width: float = 1.0
    height: float = 1.0
    radius: float = 0.5
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)

    def __post_init__(self) -> None:
        check_kind(self.kind)
        where = f"{self.kind} light {self.name}".rstrip()
        for key in ("name", "cast_shadow", *NUMBERS, *VECTORS):
            check_value(key, getattr(self, key), where)
        if self.kind == "spot":
            check_cones(self.inner_cone, self.outer_cone, where)
        for key in VECTORS:
            if not isinstance(value := getattr(self, key), tuple):      # lists and arrays do not compare as lights must
                object.__setattr__(self, key, tuple(float(part) for part in value))

    @property
    def is_area(self) -> bool:
        """Whether it has an extent and so casts penumbrae."""
        return self.kind in AREA_KINDS


@dataclass(frozen=True)
class Camera:
    """A perspective camera: a position, a point looked at, and a vertical field of view.

    Attributes:
        eye, target, up: World space; `up` need not be orthogonal to the view direction.
        vertical_fov: Full vertical angle in radians.
        near: Distance of the near plane in metres, or None to choose it from the scene's size.
    """

    name: str = ""
    eye: tuple[float, float, float] = (0.0, 0.0, 5.0)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    vertical_fov: float = 1.0471975511965976
    near: float | None = None


def require_scene(scene: object) -> None:
    """Raises UserError for what is no scene, such as a name."""
    if not isinstance(scene, Scene):
        raise UserError(f"{scene!r} is not a scene", "", "load_scene makes one of a file or of builtin:NAME")


def box_corners(box: np.ndarray) -> np.ndarray:
    """The corners of an axis-aligned box.

    Args:
        box: (2, 3), least and largest coordinates.

    Returns:
        (8, 3); bit a of a corner's number tells which of the two coordinate a has.
    """
    return np.array([[box[(i >> a) & 1][a] for a in range(3)] for i in range(8)])


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything a file holds that the renderer can show, and a warning for everything it cannot.

    Attributes:
        name: What the user typed, for titles and reports.
        materials: At least one when there is a mesh; index 0 need not be a default.
        background: Radiance shown where no surface is, linear RGB. It is a backdrop: it lights nothing.
        environment: Light from far away in every direction, which also replaces the backdrop; no file format sets it.
        animations: Names of the animations in the file.
        warnings: One sentence for each thing that was dropped, replaced or approximated.
    """

    name: str
    meshes: tuple[Mesh, ...] = ()
    instances: tuple[Instance, ...] = ()
    materials: tuple[Material, ...] = ()
    images: tuple[Image, ...] = ()
    lights: tuple[Light, ...] = ()
    cameras: tuple[Camera, ...] = ()
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    environment: Environment | None = None
    animations: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default_factory=tuple)

    @property
    def triangle_count(self) -> int:
        """Triangles drawn in a frame: instances count each time."""
        per_mesh = [sum(len(p.indices) for p in mesh.primitives) for mesh in self.meshes]
        return sum(per_mesh[instance.mesh] for instance in self.instances)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The world-space box of all instances.

        Returns:
            (minimum, maximum), each (3,) float64. A scene without vertices gives two zero vectors.
        """
        boxes = {mesh: self.mesh_corners(mesh) for mesh in {instance.mesh for instance in self.instances}}
        corners = [boxes[instance.mesh] @ instance.world_from_object[:3, :3].T + instance.world_from_object[:3, 3]
                   for instance in self.instances]
        stacked = np.concatenate(corners) if corners else np.zeros((0, 3))
        if not len(stacked):
            return np.zeros(3), np.zeros(3)
        return stacked.min(axis=0), stacked.max(axis=0)

    def mesh_corners(self, mesh: int) -> np.ndarray:
        """Corners of a mesh's box in its own space: (8, 3) float64, or (0, 3) where it has no vertices."""
        # One row for each axis: numpy reduces long rows several times as fast as short ones
        points = [np.ascontiguousarray(p.positions.T) for p in self.meshes[mesh].primitives if len(p.positions)]
        if not points:
            return np.zeros((0, 3))
        low = np.min([p.min(axis=1) for p in points], axis=0).astype(np.float64)
        high = np.max([p.max(axis=1) for p in points], axis=0).astype(np.float64)
        return box_corners(np.stack([low, high]))
