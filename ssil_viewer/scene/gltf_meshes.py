"""glTF meshes: primitives of every mode, with their attributes decoded and deformed to the rest pose."""

from __future__ import annotations

import numpy as np

from ssil_viewer.errors import UserError, pip_install
from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.geometry import VertexArrays, build_primitive
from ssil_viewer.scene.gltf_accessors import normalized, read_accessor
from ssil_viewer.scene.gltf_deform import (
    MAX_INFLUENCE_SETS,
    apply_morph_targets,
    apply_skin,
    joint_matrices,
    transformed,
)
from ssil_viewer.scene.gltf_document import Document, extension, index_at, list_at, number_at, object_at, text_at
from ssil_viewer.scene.gltf_draco import decode_draco
from ssil_viewer.scene.gltf_materials import MaterialReader, texture_references
from ssil_viewer.scene.gltf_nodes import PlacedNode
from ssil_viewer.scene.model import Mesh, Primitive

_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN = 4, 5, 6

_ATTRIBUTE_TYPES = {
    "POSITION": ("VEC3",),
    "NORMAL": ("VEC3",),
    "TANGENT": ("VEC4",),
    "TEXCOORD_0": ("VEC2",),
    "TEXCOORD_1": ("VEC2",),
    "COLOR_0": ("VEC3", "VEC4"),
}
for _set in range(MAX_INFLUENCE_SETS):
    _ATTRIBUTE_TYPES[f"JOINTS_{_set}"] = ("VEC4",)
    _ATTRIBUTE_TYPES[f"WEIGHTS_{_set}"] = ("VEC4",)


def triangle_indices(order: np.ndarray, mode: int) -> np.ndarray:
    """The triangles of a vertex sequence, (T, 3), all counter-clockwise as the format defines.

    Args:
        order: (N,) vertex indices.
        mode: The primitive's mode: triangles, strip or fan.
    """
    if mode == _TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    first = np.arange(max(0, len(order) - 2))
    if mode == _TRIANGLE_STRIP:
        odd = first % 2
        return np.stack([order[first], order[first + 1 + odd], order[first + 2 - odd]], axis=1)
    return np.stack([order[first + 1], order[first + 2], np.broadcast_to(order[:1], first.shape)], axis=1)


class MeshReader:
    """Reads the meshes that nodes place, each once for each way in which it is deformed.

    Attributes:
        meshes: The finished meshes.
    """

    def __init__(self, document: Document, materials: MaterialReader, worlds: dict[int, np.ndarray]) -> None:
        self._document = document
        self._warnings = document.warnings
        self._materials = materials
        self._worlds = worlds
        self._places: dict[tuple, int | None] = {}
        self._joints: dict[int, np.ndarray] = {}
        self.meshes: list[Mesh] = []

    def place(self, node: PlacedNode) -> tuple[int | None, bool]:
        """Reads the mesh of a node.

        Returns:
            The place in `meshes`, None when it has no triangles, and whether its vertices are in world space
            already, as those of a skinned mesh are.

        Raises:
            Malformed: The mesh cannot be read.
        """
        index = index_at(node.json, "mesh")
        entry = self._document.entry("meshes", index)
        skin = self._skin(node, entry)
        weights = self._weights(node, entry)
        key = (index, weights, skin, None if skin is None else node.index)
        if key not in self._places:
            name = text_at(entry, "name") or f"mesh {index}"
            primitives = self._primitives(entry, name, weights, skin, node.world_from_node)
            self._places[key] = len(self.meshes) if primitives else None
            if primitives:
                self.meshes.append(Mesh(name, tuple(primitives)))
        return self._places[key], skin is not None

    def _weights(self, node: PlacedNode, mesh: dict) -> tuple[float, ...]:
        owner = node.json if "weights" in node.json else mesh
        return tuple(number_at({"weight": weight}, "weight", 0.0) for weight in list_at(owner, "weights"))

    def _skin(self, node: PlacedNode, mesh: dict) -> int | None:
        """The skin of a node, None when it has none or one that cannot be read."""
        index = index_at(node.json, "skin")
        if index is None:
            return None
        try:
            if index not in self._joints:
                self._joints[index] = joint_matrices(self._document, index, self._worlds)
        except Malformed as problem:
            self._warnings.add("a skin was ignored", f"{node.name}: {problem}")
            return None
        rigged = any(
            isinstance(primitive, dict) and "JOINTS_0" in object_at(primitive, "attributes")
            for primitive in list_at(mesh, "primitives")
        )
        return index if rigged else None

    def _primitives(
        self, mesh: dict, name: str, weights: tuple[float, ...], skin: int | None, world: np.ndarray
    ) -> list[Primitive]:
        primitives = []
        for entry in list_at(mesh, "primitives"):
            try:
                if not isinstance(entry, dict):
                    raise Malformed("it is not a JSON object")
                primitive = self._primitive(entry, name, weights, skin, world)
            except Malformed as problem:
                self._warnings.add("part of a mesh was skipped", f"{name}: {problem}")
                continue
            if primitive is not None:
                primitives.append(primitive)
        return primitives

    def _primitive(
        self, entry: dict, name: str, weights: tuple[float, ...], skin: int | None, world: np.ndarray
    ) -> Primitive | None:
        mode = index_at(entry, "mode")
        mode = _TRIANGLES if mode is None else mode
        if mode not in (_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN):
            self._warnings.add("points and lines are not drawn", name)
            return None
        attributes, order = self._attributes(entry, name)
        count = len(attributes["POSITION"])
        if order is None:
            order = np.arange(count)
        arrays = VertexArrays(
            positions=attributes["POSITION"],
            indices=triangle_indices(order, mode).astype(np.int64),
            normals=attributes.get("NORMAL"),
            tangents=attributes.get("TANGENT"),
            texcoords=_texcoords(attributes),
            colors=_colors(attributes.get("COLOR_0")),
        )
        targets = list_at(entry, "targets")
        if targets:
            self._warnings.add("morph targets are shown with their default weights", name)
            arrays = apply_morph_targets(self._document, targets, weights, arrays, name)
        if skin is not None:
            if "JOINTS_0" in attributes and "WEIGHTS_0" in attributes:
                self._warnings.add("skins are shown in their rest pose", name)
                arrays = apply_skin(self._document, attributes, self._joints[skin], arrays, name)
            else:
                arrays = transformed(arrays, world)
        place = self._materials.place(index_at(entry, "material"))
        material = self._materials.material(place)
        if place in self._materials.unlit and arrays.colors is not None:
            self._warnings.add("vertex colours of unlit materials are ignored", name)
        for ref in texture_references(material).values():
            if attributes.get(f"TEXCOORD_{ref.texcoord}") is None:
                self._warnings.add("a textured mesh lacks the texture coordinates its material uses", name)
        return build_primitive(arrays, place, material, name, self._warnings)

    def _attributes(self, entry: dict, name: str) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
        """The decoded attributes, all equally long, "POSITION" among them, and the (N,) indices if there are any.

        Raises:
            Malformed: There are no positions, or the indices cannot be read.
        """
        declared = object_at(entry, "attributes")
        if "POSITION" not in declared:
            raise Malformed("it has no positions")
        for key in sorted(declared.keys() - _ATTRIBUTE_TYPES.keys()):
            if not key.startswith("_"):  # an application's own data
                self._warnings.add(f"the vertex attribute {key} is not used", name)
        compressed = self._decompressed(entry, name)
        if compressed is not None:
            attributes, order = compressed
        else:
            attributes, order = {}, None
            if "indices" in entry:
                order = read_accessor(self._document, index_at(entry, "indices"), ("SCALAR",))[:, 0]
                if order.dtype.kind not in "ui":
                    raise Malformed("its indices are not integers")
        for key, types in _ATTRIBUTE_TYPES.items():
            if key not in declared or key in attributes:
                continue
            try:
                values = read_accessor(self._document, index_at(declared, key), types)
                if key != "POSITION" and len(values) != len(attributes["POSITION"]):
                    raise Malformed(f"{key} differs in length from the positions")
                attributes[key] = values
            except Malformed as problem:
                if key == "POSITION":
                    raise
                self._warnings.add("a vertex attribute was ignored", f"{name}: {problem}")
        return attributes, order

    def _decompressed(self, entry: dict, name: str) -> tuple[dict[str, np.ndarray], np.ndarray] | None:
        """What KHR_draco_mesh_compression holds, or None when there is none or the plain data must do.

        Raises:
            Malformed: The compressed data are broken and the file has no plain ones.
            UserError: The decoder is not installed and the file cannot be read without it.
        """
        draco = extension(entry, "KHR_draco_mesh_compression")
        if draco is None:
            return None
        plain = "bufferView" in self._document.entry("accessors", index_at(object_at(entry, "attributes"), "POSITION"))
        try:
            attributes, order = decode_draco(self._document, draco)
            for key, values in attributes.items():
                accessor = self._document.entry("accessors", index_at(object_at(entry, "attributes"), key))
                if accessor.get("normalized") is True:
                    attributes[key] = normalized(values)
            return attributes, order
        except ImportError as error:
            if not plain:
                raise UserError(
                    "the geometry is compressed with Draco, whose decoder is not installed",
                    str(self._document.path),
                    "install it: " + pip_install("draco"),
                ) from error
            self._warnings.add("Draco is not installed (package DracoPy): uncompressed data are used", name)
        except Malformed as problem:
            if not plain:
                raise
            self._warnings.add("broken Draco data: the uncompressed data are used", f"{name}: {problem}")
        return None


def _texcoords(attributes: dict[str, np.ndarray]) -> np.ndarray | None:
    """Both UV sets, (V, 2, 2) float32, or None when there is neither."""
    sets = [attributes.get("TEXCOORD_0"), attributes.get("TEXCOORD_1")]
    if sets[0] is None and sets[1] is None:
        return None
    both = np.zeros((len(attributes["POSITION"]), 2, 2), dtype=np.float32)
    for number, values in enumerate(sets):
        if values is not None:
            both[:, number] = values
    return both


def _colors(values: np.ndarray | None) -> np.ndarray | None:
    """Linear RGBA, (V, 4) float32, from three or four components."""
    if values is None:
        return None
    colors = np.ones((len(values), 4), dtype=np.float32)
    colors[:, : values.shape[1]] = values
    if values.dtype.kind == "u":  # integers that are not marked as normalised, which glTF forbids but exporters write
        colors[:, : values.shape[1]] /= np.iinfo(values.dtype).max
    return colors
