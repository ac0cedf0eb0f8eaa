"""A scene as Mitsuba 3 can take it: plain dictionaries and arrays, and a list of what is approximated.

Nothing here imports Mitsuba. `mitsuba_worker.py` turns the description into Mitsuba's objects, in a process of its own.
A dictionary that describes a picture is {"type": "bitmap", "data": (H, W, C) float32, ...}; transforms are (4, 4) or,
of texture coordinates, (3, 3) float64.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ssil_viewer.frame_uniforms import make_view
from ssil_viewer.reference.mitsuba_lights import Notes, light_description
from ssil_viewer.scene.environment import Environment
from ssil_viewer.scene.model import Camera, Image, Instance, Material, Primitive, Scene, TextureRef
from ssil_viewer.scene.texels import linear_from_srgb
from ssil_viewer.settings import Settings

_DIFFUSE_ROUGHNESS = 1.0
"""A dielectric as rough as this is Lambertian, as in shaders/passes/gbuffer.frag.glsl."""

NORMALS_AWAY = ("without LLVM surfaces are black where smooth or mapped normals face away from who sees them, and "
                "where mapped normals alone face the light")
PRINCIPLED = ("without LLVM reflections of the image are Disney's principled material, whose diffuse part is not quite "
              "Lambertian")


@dataclass
class Description:
    """A scene for Mitsuba.

    Attributes:
        meshes: Positions (V, 3), normals (V, 3), texcoords (V, 2), float32, world space; colors (V, 3) or None;
            faces (T, 3) uint32; bsdf, an index into `bsdfs`; emission, a texture or None.
        bsdfs: Descriptions of materials.
        lights: Descriptions of emitters and of shapes that emit.
        environment: An emitter, or None.
        masked: Whether some surface has holes.
        mirrors: Whether some surface has more than a Lambertian part: a bsdf of the type "surface".
        approximations: One clause for each thing that Mitsuba shows otherwise.
        scalar_approximations: What it shows otherwise only where it traces rays one by one: see `mitsuba_bsdf`.
    """

    meshes: list[dict[str, Any]] = field(default_factory=list)
    bsdfs: list[dict[str, Any]] = field(default_factory=list)
    lights: list[dict[str, Any]] = field(default_factory=list)
    environment: dict[str, Any] | None = None
    masked: bool = False
    mirrors: bool = False
    approximations: list[str] = field(default_factory=list)
    scalar_approximations: list[str] = field(default_factory=list)

    @property
    def emissive(self) -> bool:
        """Whether some surface shines."""
        return any(mesh["emission"] is not None for mesh in self.meshes)


def describe(scene: Scene, settings: Settings = Settings()) -> Description:
    """The scene for Mitsuba: geometry in world space, materials, lights and environment.

    Args:
        settings: Strength and turn of the environment.
    """
    notes = Notes()
    found = Description()
    bsdfs = _Bsdfs(scene, found, notes)
    for instance in scene.instances:
        for primitive in scene.meshes[instance.mesh].primitives:
            for part, mirrored in _parts_by_hand(scene, instance, primitive):
                mesh = _mesh(scene, instance, part, notes)
                if mesh is not None:
                    mesh["bsdf"] = bsdfs.index(part, mirrored)
                    found.meshes.append(mesh)
    found.lights = [light_description(light, notes) for light in scene.lights]
    if scene.environment is not None:
        found.environment = _environment(scene.environment, settings)
    found.approximations = notes.sentences()
    found.scalar_approximations = [NORMALS_AWAY] if found.meshes else []
    if found.mirrors:
        found.scalar_approximations.append(PRINCIPLED)
    return found


def camera_description(camera: Camera, size: tuple[int, int], scene: Scene) -> dict[str, Any]:
    """The camera as Mitsuba's sensor, with the clip planes that the viewer has for the scene; the box filter makes a
    pixel the mean over its square."""
    view = make_view(camera, size, np.zeros(3), np.stack(scene.bounds()))
    return {"fov": math.degrees(camera.vertical_fov), "near_clip": view.near, "far_clip": view.far,
            "eye": list(camera.eye), "target": list(camera.target), "up": list(camera.up),
            "width": size[0], "height": size[1]}


# -- geometry ----------------------------------------------------------------------------------------------------------


def _parts_by_hand(scene: Scene, instance: Instance, primitive: Primitive) -> list[tuple[Primitive, bool]]:
    """A primitive, and whether pictures lie on it mirrored; in two where they do so on a part of its triangles alone.

    Models whose halves share one picture have as many triangles of either kind, and a normal map needs to know.
    """
    if primitive.tangents is None or scene.materials[primitive.material].normal_texture is None:
        return [(primitive, False)]
    hand = np.sign(primitive.tangents[:, 3][primitive.indices].sum(1))
    if np.linalg.det(instance.world_from_object[:3, :3]) < 0:
        hand = -hand
    mirrored = hand < 0
    return [(replace(primitive, indices=primitive.indices[chosen]), is_mirrored)
            for chosen, is_mirrored in ((~mirrored, False), (mirrored, True)) if chosen.any()]


def _mesh(scene: Scene, instance: Instance, primitive: Primitive, notes: Notes) -> dict[str, Any] | None:
    """One instance of a primitive in world space; None where nothing of it can be seen."""
    material = scene.materials[primitive.material]
    matrix = instance.world_from_object
    linear = matrix[:3, :3]
    if not len(primitive.indices) or abs(np.linalg.det(linear)) < 1e-30:
        return None
    faces = primitive.indices
    if material.alpha_mode != "opaque" and (primitive.colors is not None or material.base_color_texture is None):
        alpha = np.ones(len(primitive.positions)) if primitive.colors is None else primitive.colors[:, 3]
        # Mean over a triangle: with a texture, what it cannot open any further stays
        faces = faces[alpha[faces].mean(1) * material.base_color[3] >= material.alpha_cutoff]
        if not len(faces):
            return None
        if primitive.colors is not None and np.ptp(primitive.colors[:, 3]) > 0:
            notes.add("alpha of vertices opens whole triangles")
    if np.linalg.det(linear) < 0:
        faces = faces[:, ::-1]      # front faces stay front faces
    normals = primitive.normals @ np.linalg.inv(linear)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    colors = None if primitive.colors is None else np.ascontiguousarray(primitive.colors[:, :3], np.float32)
    emission = None
    if max(material.emission) > 0:
        emission = _emission(scene.images, material)
        if material.double_sided:
            notes.add("a surface that shines does so to its front alone")
    return {"positions": np.ascontiguousarray(primitive.positions @ linear.T + matrix[:3, 3], np.float32),
            "normals": np.ascontiguousarray(normals, np.float32),
            "texcoords": np.ascontiguousarray(primitive.texcoords[:, _uv_set(material)], np.float32),
            "colors": colors, "faces": np.ascontiguousarray(faces, np.uint32), "emission": emission}


def _uv_set(material: Material) -> int:
    """The set of texture coordinates that the mesh takes along: Mitsuba's meshes have one."""
    ref = (material.base_color_texture or material.emission_texture or material.normal_texture
           or material.metallic_roughness_texture)
    return 0 if ref is None else ref.texcoord


# -- materials ---------------------------------------------------------------------------------------------------------


class _Bsdfs:
    """Materials as they are met; one description for each kind of use."""

    def __init__(self, scene: Scene, found: Description, notes: Notes) -> None:
        self._scene, self._found, self._notes = scene, found, notes
        self._known: dict[tuple, int] = {}

    def index(self, primitive: Primitive, mirrored: bool) -> int:
        """Where in `Description.bsdfs` the material of a primitive is.

        Args:
            mirrored: Whether pictures lie on it mirrored.
        """
        material = self._scene.materials[primitive.material]
        tint = None
        if primitive.colors is not None and material.base_color_texture is not None:
            tint = tuple(float(c) for c in primitive.colors[:, :3].mean(0).round(6))
            if np.ptp(primitive.colors[:, :3], axis=0).max() > 0:
                self._notes.add("colours of vertices under a texture are replaced by their mean")
        key = (primitive.material, primitive.colors is not None, tint, mirrored)
        if key not in self._known:
            self._known[key] = len(self._found.bsdfs)
            self._found.bsdfs.append(self._bsdf(material, primitive.colors is not None, tint, mirrored))
        return self._known[key]

    def _bsdf(self, material: Material, has_colors: bool, tint: tuple[float, float, float] | None,
              mirrored: bool) -> dict[str, Any]:
        images, notes = self._scene.images, self._notes
        refs = (material.base_color_texture, material.metallic_roughness_texture, material.normal_texture,
                material.emission_texture)
        if any(ref is not None and ref.wrap_u != ref.wrap_v for ref in refs):
            notes.add("textures that wrap differently along u and v repeat along both")
        color = np.asarray(material.base_color[:3]) * (1.0 if tint is None else np.asarray(tint))
        if material.base_color_texture is not None:
            base = _picture(images, material.base_color_texture, color, srgb=True)
        elif has_colors:
            base = {"type": "mesh_attribute", "name": "vertex_color", "factor": color.tolist()}
            if np.ptp(color) > 0 or color[0] != 1:
                notes.add("colours of vertices are taken without the material's own colour")
        else:
            base = {"type": "rgb", "value": np.clip(color, 0, 1).tolist()}
        bsdf = self._reflecting(material, base)
        if material.normal_texture is not None and self._fits(material, material.normal_texture, "normal maps"):
            bsdf = {"type": "normalmap", "bsdf": bsdf, "normalmap": _normals(images, material, mirrored),
                    "use_shadowing_function": False, "flip_invalid_normals": False}
        if material.occlusion_texture is not None:
            notes.add("occlusion maps are left out")
        if material.double_sided:
            bsdf = {"type": "twosided", "bsdf": bsdf}
        else:
            notes.add("backs of one-sided surfaces are black, where the viewer looks through them")
        if material.alpha_mode != "opaque" and material.base_color_texture is not None:
            bsdf = {"type": "mask", "bsdf": bsdf, "opacity": _opacity(images, material)}
            self._found.masked = True
            if material.alpha_mode == "blend":
                notes.add("transparent surfaces are opaque but for holes, as in the viewer")
        return bsdf

    def _reflecting(self, material: Material, base: dict[str, Any]) -> dict[str, Any]:
        """Lambertian, or, where there is a reflection, the viewer's own material, {"type": "surface"}.

        Its `dielectric` is the reflectance of non-metals at normal incidence, `mean_dielectric` what is left of it at
        the mean roughness.
        """
        images, ref = self._scene.images, material.metallic_roughness_texture
        if ref is not None and not self._fits(material, ref, "metallic and roughness maps"):
            ref = None
        roughness, metallic = material.roughness, material.metallic
        dielectric = material.specular * ((material.ior - 1) / (material.ior + 1)) ** 2
        mean_roughness = roughness
        if material.metallic_roughness_texture is not None:
            pixels = images[material.metallic_roughness_texture.image].pixels
            mean_roughness = roughness * float(pixels[..., 1].mean()) / 255
            if ref is None:
                roughness, metallic = mean_roughness, metallic * float(pixels[..., 2].mean()) / 255
        # The viewer fades a dielectric's reflection between roughness 0.8 and 1
        fade = min(max((mean_roughness - 0.8) / 0.2, 0), 1)
        faded = dielectric * (1 - fade * fade * (3 - 2 * fade))
        if metallic == 0 and (faded < 1e-6 or (ref is None and mean_roughness >= _DIFFUSE_ROUGHNESS)):
            return {"type": "diffuse", "reflectance": base}
        self._found.mirrors = True
        described = {"type": "surface", "base_color": base, "roughness": roughness, "metallic": metallic,
                     "dielectric": dielectric, "mean_dielectric": faded}
        if ref is not None:
            described["roughness"] = _channel(images, ref, 1, roughness)
            described["metallic"] = _channel(images, ref, 2, metallic)
        return described

    def _fits(self, material: Material, ref: TextureRef, what: str) -> bool:
        if ref.texcoord == _uv_set(material):
            return True
        self._notes.add(f"{what} with texture coordinates of their own are replaced by their mean or left out")
        return False


def _bitmap(data: np.ndarray, ref: TextureRef, nearest: bool = False) -> dict[str, Any]:
    if ref.wrap_u == ref.wrap_v:
        wrap = ref.wrap_u       # Mitsuba has the same names
    else:
        wrap = "repeat"     # Mitsuba has one mode for both
    return {"type": "bitmap", "data": np.ascontiguousarray(data, np.float32), "wrap_mode": wrap,
            "filter_type": "nearest" if nearest or ref.nearest else "bilinear", "to_uv": _uv_transform(ref)}


def _uv_transform(ref: TextureRef) -> np.ndarray:
    """(3, 3) of KHR_texture_transform."""
    c, s = math.cos(ref.rotation), math.sin(ref.rotation)
    (x, y), (w, h) = ref.offset, ref.scale
    return np.array([[c * w, s * h, x], [-s * w, c * h, y], [0.0, 0.0, 1.0]])


def _picture(images: tuple[Image, ...], ref: TextureRef, factor: np.ndarray, srgb: bool, most: float = 1.0) -> dict:
    pixels = images[ref.image].pixels[..., :3]
    data = linear_from_srgb(pixels) if srgb else pixels.astype(np.float32) / 255
    return _bitmap(np.clip(data * np.asarray(factor, np.float32), 0, most), ref)


def _channel(images: tuple[Image, ...], ref: TextureRef, channel: int, factor: float) -> dict[str, Any]:
    data = images[ref.image].pixels[..., channel:channel + 1].astype(np.float32) * (factor / 255)
    return _bitmap(np.clip(data, 0.0, 1), ref)


def _opacity(images: tuple[Image, ...], material: Material) -> dict[str, Any]:
    ref = material.base_color_texture
    alpha = images[ref.image].pixels[..., 3:].astype(np.float32) / 255 * material.base_color[3]
    return _bitmap((alpha >= material.alpha_cutoff).astype(np.float32), ref, nearest=True)


def _normals(images: tuple[Image, ...], material: Material, mirrored: bool) -> dict[str, Any]:
    """A normal map with its scale applied.

    Mitsuba's third axis is across normal and dP/du, glTF's has the sign of the tangent's w: green turns where the
    picture is mirrored on the surface.
    """
    normals = images[material.normal_texture.image].pixels[..., :3].astype(np.float32) / 255 * 2 - 1
    normals[..., :2] *= material.normal_scale
    if mirrored:
        normals[..., 1] *= -1
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-6)
    return _bitmap(normals * 0.5 + 0.5, material.normal_texture)


def _emission(images: tuple[Image, ...], material: Material) -> dict[str, Any]:
    ref = material.emission_texture
    if ref is None or ref.texcoord != _uv_set(material):
        factor = np.asarray(material.emission, np.float64)
        if ref is not None:
            factor = factor * linear_from_srgb(images[ref.image].pixels[..., :3]).mean((0, 1))
        return {"type": "rgb", "value": factor.tolist()}
    return _picture(images, ref, np.asarray(material.emission), srgb=True, most=np.inf)


# -- environment -------------------------------------------------------------------------------------------------------


def _environment(environment: Environment, settings: Settings) -> dict[str, Any]:
    turn = math.radians(settings.environment_rotation)
    matrix = np.eye(4)
    matrix[0, 0] = matrix[2, 2] = math.cos(turn)
    matrix[0, 2], matrix[2, 0] = math.sin(turn), -math.sin(turn)
    return {"type": "envmap", "data": environment.radiance, "scale": 2.0**settings.environment_strength,
            "to_world": matrix}
