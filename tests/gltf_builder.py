"""Writes small glTF files by code, so that tests depend on no download."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

QUAD = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
QUAD_UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
QUAD_INDICES = np.array([0, 1, 2, 0, 2, 3], np.uint16)
QUAD_NORMALS = np.tile(np.array([0, 0, 1], np.float32), (4, 1))

_COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def png(pixels: np.ndarray, mode: str | None = None) -> bytes:
    """A PNG file of an array that Pillow understands."""
    stream = io.BytesIO()
    picture = Image.fromarray(pixels)
    (picture.convert(mode) if mode else picture).save(stream, "PNG")
    return stream.getvalue()


class GltfBuilder:
    """A glTF asset under construction; `json` may be changed at will before it is written."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
        self.binary = bytearray()

    def add(self, kind: str, entry: dict) -> int:
        """Appends an object to a top-level array."""
        entries = self.json.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def view(self, data: bytes, **extra: Any) -> int:
        """A buffer view of new bytes, aligned to 4."""
        self.binary += b"\0" * (-len(self.binary) % 4)
        entry = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": len(data), **extra}
        self.binary += data
        return self.add("bufferViews", entry)

    def accessor(self, array: np.ndarray, **extra: Any) -> int:
        """An accessor of a (N,) or (N, n) array, tightly packed."""
        array = np.ascontiguousarray(array)
        entry = {
            "bufferView": self.view(array.tobytes()),
            "componentType": _COMPONENTS[array.dtype.name],
            "count": len(array),
            "type": _TYPES[array.size // max(len(array), 1) if array.ndim > 1 else 1],
            **extra,
        }
        return self.add("accessors", entry)

    def primitive(
        self, attributes: dict[str, Any] | None = None, indices: Any = QUAD_INDICES, **extra: Any
    ) -> dict[str, Any]:
        """A primitive; attribute values are arrays or accessor indices. The default is a unit quad facing +Z."""
        if attributes is None:
            attributes = {"POSITION": QUAD, "NORMAL": QUAD_NORMALS, "TEXCOORD_0": QUAD_UV}

        def place(value: Any) -> int:
            return value if isinstance(value, int) else self.accessor(value)

        entry = {"attributes": {name: place(value) for name, value in attributes.items()}, **extra}
        if indices is not None:
            entry["indices"] = place(indices)
        return entry

    def mesh(self, *primitives: dict, **extra: Any) -> int:
        """A mesh; without primitives it is the quad."""
        return self.add("meshes", {"primitives": list(primitives) or [self.primitive()], **extra})

    def node(self, root: bool = True, **entry: Any) -> int:
        """A node, by default a root of the scene."""
        index = self.add("nodes", entry)
        if root:
            self.json["scenes"][0]["nodes"].append(index)
        return index

    def texture(self, pixels: np.ndarray | bytes, sampler: dict | None = None, mime: str = "image/png") -> int:
        """A texture with an embedded picture."""
        data = pixels if isinstance(pixels, bytes) else png(pixels)
        entry = {"source": self.add("images", {"bufferView": self.view(data), "mimeType": mime})}
        if sampler is not None:
            entry["sampler"] = self.add("samplers", sampler)
        return self.add("textures", entry)

    def material(self, **entry: Any) -> int:
        """A material."""
        return self.add("materials", entry)

    def glb(self) -> bytes:
        """The asset as a binary file."""
        document = dict(self.json)
        if self.binary:
            document["buffers"] = [{"byteLength": len(self.binary)}]
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.binary) + b"\0" * (-len(self.binary) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def gltf(self, uri: str | None = None) -> bytes:
        """The asset as a text file, its buffer under `uri` or in a data URI."""
        document = dict(self.json)
        uri = uri or "data:application/octet-stream;base64," + base64.b64encode(self.binary).decode()
        document["buffers"] = [{"byteLength": len(self.binary), "uri": uri}]
        return json.dumps(document).encode()

    def write(self, folder: Path, name: str = "scene.glb") -> Path:
        """Writes the file, binary or text by its extension."""
        path = folder / name
        path.write_bytes(self.glb() if name.endswith(".glb") else self.gltf())
        return path


def quad_scene(**node: Any) -> GltfBuilder:
    """One node with the unit quad."""
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(), **node)
    return builder
