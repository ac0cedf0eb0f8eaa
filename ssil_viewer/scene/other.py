"""Loads the mesh formats that trimesh reads: PLY, STL, OFF, 3MF, COLLADA."""

from __future__ import annotations

import logging
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ssil_viewer.errors import UserError, pip_install
from ssil_viewer.scene.colors import srgb_to_linear
from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.geometry import VertexArrays, build_primitive
from ssil_viewer.scene.images import MAX_PIXELS, rgba_pixels
from ssil_viewer.scene.model import Image, Instance, Material, Mesh, Scene, TextureRef
from ssil_viewer.scene.transforms import made_invertible, origin_near
from ssil_viewer.scene.warning_list import WarningList

OTHER_FORMATS = (".ply", ".stl", ".off", ".3mf", ".dae")
"""Extensions of the files that `load_other` reads."""

_OF_EXTRA = {".3mf", ".dae"}
"""For these trimesh needs packages besides itself: those of the extra `formats`."""

MAX_UNPACKED_BYTES = 1 << 31
"""Archives that unpack to more are refused."""

_GREY = (0.8, 0.8, 0.8, 1.0)


def load_other(path: Path, name: str) -> Scene:
    """Loads a file through trimesh, each of its meshes by itself.

    Formats without units are taken as metres, others are converted to them.

    Args:
        path: The file.
        name: For `Scene.name`.

    Raises:
        UserError: It cannot be read, or holds no triangles.
    """
    extension = path.suffix.lower()
    source = _read(path, extension)
    converter = _Converter()
    for key, geometry in source.geometry.items():
        converter.add_mesh(str(key), geometry)
    scale = _metres(source, path, converter.warnings)
    for node in source.graph.nodes_geometry:
        matrix, key = source.graph[node]
        converter.add_instance(str(node), str(key), scale @ np.asarray(matrix, dtype=np.float64))
    if not converter.instances:
        reasons = converter.warnings.sentences()
        raise UserError("no geometry to show", str(path), reasons[0] if reasons else "it has no triangles")
    return Scene(
        name=name,
        meshes=tuple(converter.meshes),
        instances=tuple(converter.instances),
        materials=tuple(converter.materials),
        images=tuple(converter.images),
        warnings=converter.warnings.sentences(),
    )


def _read(path: Path, extension: str) -> Any:
    """The trimesh scene of a file."""
    import trimesh  # half a second, which glTF and OBJ need not pay

    # Its remarks would land on standard error by way of logging's last resort.
    logging.getLogger("trimesh").addHandler(logging.NullHandler())
    try:
        if extension == ".3mf":
            with zipfile.ZipFile(path) as archive:
                if sum(entry.file_size for entry in archive.infolist()) > MAX_UNPACKED_BYTES:
                    raise UserError("the archive unpacks to more than 2 GiB", str(path))
        return trimesh.load_scene(path, process=False)
    except (ImportError, NotImplementedError) as error:
        advice = "install it: " + pip_install("formats") if extension in _OF_EXTRA else str(error)
        raise UserError("a package that reads this format is not installed", str(path), advice) from error
    except (UserError, MemoryError):
        raise
    except Exception as error:  # the readers raise whatever a broken file provokes
        if extension in _OF_EXTRA and "not supported" in str(error):
            advice = "if it is intact, a package is missing: " + pip_install("formats")
        else:
            advice = f"the reader says: {str(error)[:120] or type(error).__name__}"
        raise UserError("the file is broken", str(path), advice) from error


def _metres(source: Any, path: Path, warnings: WarningList) -> np.ndarray:
    """The (4, 4) scaling from the file's unit, if it has one, to metres."""
    from trimesh.units import unit_conversion

    scale = np.eye(4)
    unit = source.units
    if unit is not None:
        try:
            scale[:3, :3] *= unit_conversion(unit, "meters")
        except (KeyError, ValueError):
            warnings.add("an unknown unit is taken as metres", str(unit))
    return scale


class _Converter:
    """Turns trimesh's geometry into the scene's."""

    def __init__(self) -> None:
        self.warnings = WarningList()
        self.meshes: list[Mesh] = []
        self.instances: list[Instance] = []
        self.materials: list[Material] = []
        self.images: list[Image] = []
        self._places: dict[str, tuple[int, np.ndarray]] = {}

    def add_mesh(self, key: str, geometry: Any) -> None:
        """Converts a mesh; points and curves give a warning."""
        if not hasattr(geometry, "faces"):
            self.warnings.add("points and lines are not drawn", key)
            return
        positions = np.asarray(geometry.vertices, dtype=np.float64).reshape(-1, 3)
        translation = origin_near(positions)
        # A look into the cache tells normals of the file from ones that trimesh would compute.
        normals = np.asarray(geometry.vertex_normals) if "vertex_normals" in geometry._cache else None
        arrays = VertexArrays(
            positions - translation, np.asarray(geometry.faces, dtype=np.int64).reshape(-1, 3), normals
        )
        arrays, material = self._with_look(key, geometry.visual, arrays)
        primitive = build_primitive(arrays, len(self.materials), material, key, self.warnings)
        if primitive is not None:
            self._places[key] = len(self.meshes), translation
            self.materials.append(material)
            self.meshes.append(Mesh(key, (primitive,)))

    def add_instance(self, name: str, key: str, world_from_file: np.ndarray) -> None:
        """Places a mesh that `add_mesh` has kept."""
        if key not in self._places:
            return
        mesh, translation = self._places[key]
        shift = np.eye(4)
        shift[:3, 3] = translation
        transforms, visible = made_invertible((world_from_file @ shift)[None])
        if visible[0]:
            self.instances.append(Instance(name, mesh, transforms[0]))
        else:
            self.warnings.add("an instance that is scaled to nothing or beyond all bounds is not drawn", name)

    def _with_look(self, key: str, visual: Any, arrays: VertexArrays) -> tuple[VertexArrays, Material]:
        """Adds colours or texture coordinates, and makes the material, a Lambertian one."""
        material = Material(name=key, base_color=_GREY, specular=0.0, double_sided=True)
        kind = getattr(visual, "kind", None)
        if kind in ("vertex", "face"):
            colors = np.asarray(visual.vertex_colors if kind == "vertex" else visual.face_colors)
            if kind == "face" and len(colors) == len(arrays.indices):
                corners = arrays.indices.reshape(-1)
                arrays = arrays.take(corners, np.arange(len(corners)).reshape(-1, 3))
                colors = np.repeat(colors, 3, axis=0)
            if len(colors) == len(arrays.positions):
                arrays = replace(arrays, colors=_linear_rgba(colors))
                material = replace(material, base_color=(1.0, 1.0, 1.0, 1.0))
        elif kind == "texture":
            uv = visual.uv
            if uv is not None and len(uv) == len(arrays.positions):
                texcoords = np.zeros((len(uv), 2, 2))
                texcoords[:, 0, 0] = uv[:, 0]
                texcoords[:, 0, 1] = 1.0 - uv[:, 1]  # trimesh counts v from the bottom
                arrays = replace(arrays, texcoords=texcoords)
            material = self._textured(material, visual.material)
        return arrays, material

    def _textured(self, material: Material, source: Any) -> Material:
        """The material with the main colour and picture of a trimesh one."""
        color = _linear_rgba(np.asarray(getattr(source, "main_color", [204, 204, 204, 255]))[None])[0]
        material = replace(material, base_color=tuple(color.tolist()))
        picture = getattr(source, "image", None) or getattr(source, "baseColorTexture", None)
        if picture is None:
            return material
        try:
            if picture.width * picture.height > MAX_PIXELS:
                raise Malformed(f"{picture.width} x {picture.height} pixels are too many")
            pixels = rgba_pixels(picture)
        except Malformed as problem:
            self.warnings.add("a texture cannot be read and is left out", f"{material.name}: {problem}")
            return material
        self.images.append(Image(material.name, pixels))
        ref = TextureRef(len(self.images) - 1)
        return replace(material, base_color=(1.0, 1.0, 1.0, 1.0), base_color_texture=ref)


def _linear_rgba(colors: np.ndarray) -> np.ndarray:
    """Linear RGBA in [0, 1], (N, 4), of sRGB-encoded 8-bit colours with three or four channels."""
    rgba = np.ones((len(colors), 4))
    rgba[:, : colors.shape[1]] = colors / 255.0
    rgba[:, :3] = srgb_to_linear(rgba[:, :3])
    return rgba
