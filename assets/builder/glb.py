"""A small writer of binary glTF 2.0 (GLB) files, enough for the built-in scenes.

The same calls give the same bytes: no times, no random names, sorted keys.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .geometry import Surface, rotation, tangents, unit

FLOAT, USHORT, UINT = 5126, 5123, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


@dataclass(frozen=True)
class MaterialHandle:
    """A material of a scene under construction.

    Attributes:
        index: Position in the file.
        tile: Metres that one repeat of its textures covers; None when texture coordinates are used as
            they are.
        textured: Whether meshes need texture coordinates.
        normal_mapped: Whether meshes need tangents.
    """

    index: int
    tile: float | None
    textured: bool
    normal_mapped: bool


class SceneBuilder:
    """Collects materials, meshes, nodes, lights and cameras, and writes them as one GLB file.

    Args:
        background: Radiance shown where no surface is, linear RGB; stored as `scenes[0].extras.background`.
    """

    def __init__(self, background: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        self._json: dict = {
            "asset": {"version": "2.0", "generator": "ssil-viewer assets/build_scenes.py", "copyright": "MIT"},
            "scene": 0,
            "scenes": [{"name": "scene", "nodes": [], "extras": {"background": _rounded(background)}}],
            "nodes": [],
        }
        self._binary = bytearray()
        self._extensions: set[str] = set()
        self._stored: dict[tuple, int] = {}

    def texture(self, name: str, encoded: bytes, mime: str) -> int:
        """Stores an encoded picture and returns the index of a repeating, filtered texture of it."""
        if "samplers" not in self._json:
            # Linear magnification, trilinear minification, repeat in both directions.
            self._json["samplers"] = [{"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}]
        image = self._append("images", {"name": name, "mimeType": mime, "bufferView": self._view(encoded)})
        return self._append("textures", {"name": name, "source": image, "sampler": 0})

    def material(
        self,
        name: str,
        color: Sequence[float] = (1.0, 1.0, 1.0),
        roughness: float = 1.0,
        metallic: float = 0.0,
        color_texture: int | None = None,
        normal_texture: int | None = None,
        normal_scale: float = 1.0,
        tile: float | None = 1.0,
        emission: Sequence[float] = (0.0, 0.0, 0.0),
        specular: float = 1.0,
        mask: float | None = None,
        double_sided: bool = False,
    ) -> MaterialHandle:
        """Adds a metallic-roughness material.

        Args:
            color: Linear RGB factor.
            tile: Metres per texture repeat; None when surfaces bring final texture coordinates.
            emission: Radiance, W m^-2 sr^-1, linear RGB; above 1 it is split into factor and strength.
            specular: KHR_materials_specular weight; 0 makes a non-metal exactly Lambertian.
            mask: Alpha cut-off, or None for an opaque material.
        """
        pbr: dict = {
            "baseColorFactor": _rounded((*color, 1.0)),
            "metallicFactor": metallic,
            "roughnessFactor": roughness,
        }
        material: dict = {"name": name, "pbrMetallicRoughness": pbr}
        extensions: dict = {}
        if color_texture is not None:
            pbr["baseColorTexture"] = {"index": color_texture}
        if normal_texture is not None:
            material["normalTexture"] = {"index": normal_texture, "scale": normal_scale}
        strongest = max(emission)
        if strongest > 0.0:
            material["emissiveFactor"] = _rounded([e / max(strongest, 1.0) for e in emission])
            if strongest > 1.0:
                extensions["KHR_materials_emissive_strength"] = {"emissiveStrength": _rounded([strongest])[0]}
        if specular != 1.0:
            extensions["KHR_materials_specular"] = {"specularFactor": specular}
        if extensions:
            material["extensions"] = extensions
            self._extensions.update(extensions)
        if mask is not None:
            material |= {"alphaMode": "MASK", "alphaCutoff": mask}
        if double_sided:
            material["doubleSided"] = True
        textured = color_texture is not None or normal_texture is not None
        return MaterialHandle(self._append("materials", material), tile, textured, normal_texture is not None)

    def mesh(self, name: str, *parts: tuple[MaterialHandle, Surface]) -> int:
        """Stores a mesh with one primitive per (material, surface) and returns its index."""
        primitives = []
        for material, surface in parts:
            if material.tile is not None:
                surface = surface.with_uvs(surface.uvs / material.tile)
            attributes = {
                "POSITION": self._accessor(surface.positions, bounds=True),
                "NORMAL": self._accessor(surface.normals),
            }
            if material.textured:
                attributes["TEXCOORD_0"] = self._accessor(surface.uvs)
            if material.normal_mapped:
                attributes["TANGENT"] = self._accessor(tangents(surface))
            primitives.append(
                {"attributes": attributes, "indices": self._indices(surface.triangles), "material": material.index}
            )
        return self._append("meshes", {"name": name, "primitives": primitives})

    def place(
        self,
        name: str,
        mesh: int,
        position: Sequence[float] = (0.0, 0.0, 0.0),
        turn: float = 0.0,
        scale: float | Sequence[float] = 1.0,
    ) -> None:
        """Adds a node that shows a mesh.

        Args:
            position: Metres.
            turn: Degrees about +Y, counter-clockwise seen from above.
            scale: One positive factor, or one per axis of the mesh.
        """
        node: dict = {"name": name, "mesh": mesh}
        if any(position):
            node["translation"] = _rounded(position)
        if turn % 360.0:
            half = np.radians(turn) / 2.0
            node["rotation"] = _rounded((0.0, np.sin(half), 0.0, np.cos(half)), digits=9)
        # Rounded before it is compared: sums that end at 1 differ in the last bit between numpy's versions
        factors = _rounded([scale] * 3 if isinstance(scale, int | float) else list(scale))
        if factors != [1.0, 1.0, 1.0]:
            node["scale"] = factors
        self._add_node(node)

    def camera(self, name: str, eye: Sequence[float], target: Sequence[float], fov: float, near: float = 0.05) -> None:
        """Adds a perspective camera; `fov` is the full vertical angle in degrees, the rest is in metres."""
        perspective = {"yfov": _rounded([np.radians(fov)])[0], "znear": near}
        camera = self._append("cameras", {"name": name, "type": "perspective", "perspective": perspective})
        forward = unit(np.asarray(target, dtype=np.float64) - np.asarray(eye, dtype=np.float64))
        self._add_node(
            {"name": name, "camera": camera, "translation": _rounded(eye), "rotation": _looking_along(forward)}
        )

    def light(
        self,
        name: str,
        kind: str,
        intensity: float,
        color: Sequence[float] = (1.0, 1.0, 1.0),
        position: Sequence[float] = (0.0, 0.0, 0.0),
        direction: Sequence[float] = (0.0, -1.0, 0.0),
        cone: tuple[float, float] | None = None,
    ) -> None:
        """Adds a punctual light (KHR_lights_punctual).

        Args:
            kind: "directional", "point" or "spot".
            intensity: W sr^-1, or W m^-2 for a directional light.
            direction: Where the light travels; not for points.
            cone: Inner and outer half angle of a spot, degrees.
        """
        light: dict = {"name": name, "type": kind, "intensity": intensity, "color": _rounded(color)}
        if cone is not None:
            inner, outer = _rounded(np.radians(cone))
            light["spot"] = {"innerConeAngle": inner, "outerConeAngle": outer}
        self._extensions.add("KHR_lights_punctual")
        root = self._json.setdefault("extensions", {}).setdefault("KHR_lights_punctual", {"lights": []})
        root["lights"].append(light)
        node: dict = {"name": name, "extensions": {"KHR_lights_punctual": {"light": len(root["lights"]) - 1}}}
        if kind != "directional":
            node["translation"] = _rounded(position)
        if kind != "point":
            node["rotation"] = _looking_along(unit(np.asarray(direction, dtype=np.float64)))
        self._add_node(node)

    def write(self, path: Path) -> None:
        """Writes the scene as a GLB file."""
        document = dict(self._json)
        if self._extensions:
            document["extensionsUsed"] = sorted(self._extensions)
        binary = bytes(self._binary) + b"\0" * (-len(self._binary) % 4)
        document["buffers"] = [{"byteLength": len(binary)}]
        text = json.dumps(document, sort_keys=True, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)

    def _append(self, key: str, value: dict) -> int:
        self._json.setdefault(key, []).append(value)
        return len(self._json[key]) - 1

    def _add_node(self, node: dict) -> None:
        self._json["scenes"][0]["nodes"].append(self._append("nodes", node))

    def _view(self, data: bytes, target: int | None = None) -> int:
        self._binary += b"\0" * (-len(self._binary) % 4)
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self._binary += data
        return self._append("bufferViews", view)

    def _accessor(self, values: np.ndarray, bounds: bool = False) -> int:
        values = np.ascontiguousarray(values, dtype="<f4")
        accessor = {"componentType": FLOAT, "count": len(values), "type": f"VEC{values.shape[1]}"}
        if bounds:
            accessor |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        return self._stored_once(accessor, values.tobytes(), ARRAY_BUFFER)

    def _indices(self, triangles: np.ndarray) -> int:
        # 65535 itself is reserved (primitive restart).
        small = int(triangles.max()) < 65535
        values = np.ascontiguousarray(triangles.reshape(-1), dtype="<u2" if small else "<u4")
        accessor = {"componentType": USHORT if small else UINT, "count": len(values), "type": "SCALAR"}
        return self._stored_once(accessor, values.tobytes(), ELEMENT_ARRAY_BUFFER)

    def _stored_once(self, accessor: dict, data: bytes, target: int) -> int:
        """Adds an accessor, or finds the same one: one cloth in four colours is stored once."""
        key = (data, accessor["type"], accessor["componentType"], "min" in accessor, target)
        if key not in self._stored:
            self._stored[key] = self._append("accessors", accessor | {"bufferView": self._view(data, target)})
        return self._stored[key]


def _rounded(values: Sequence[float] | np.ndarray, digits: int = 6) -> list[float]:
    # Adding 0.0 turns -0.0 into 0.0.
    return [round(float(v), digits) + 0.0 for v in values]


def _looking_along(forward: np.ndarray) -> list[float]:
    """The quaternion (x, y, z, w) that turns -Z to `forward` and keeps +Y as upright as it can be."""
    yaw = np.degrees(np.arctan2(-forward[0], -forward[2]))
    pitch = np.degrees(np.arcsin(np.clip(forward[1], -1.0, 1.0)))
    turned = rotation("y", yaw) @ rotation("x", pitch) @ np.array([0.0, 0.0, -1.0])
    assert np.allclose(turned, forward, atol=1e-9)
    (sy, cy), (sp, cp) = ((np.sin(np.radians(a) / 2), np.cos(np.radians(a) / 2)) for a in (yaw, pitch))
    return _rounded((cy * sp, sy * cp, -sy * sp, cy * cp), digits=9)
