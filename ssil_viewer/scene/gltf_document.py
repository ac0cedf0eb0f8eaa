"""The container of a glTF 2.0 asset: the JSON with checked access, and the bytes behind it."""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ssil_viewer.errors import UserError
from ssil_viewer.scene.files import Malformed, read_data_uri, read_sibling
from ssil_viewer.scene.warning_list import WarningList

GLB_MAGIC = b"glTF"
_CHUNK_JSON = 0x4E4F534A
_CHUNK_BIN = 0x004E4942


def object_at(owner: dict, key: str) -> dict:
    """The JSON object under `key`, empty when absent.

    Raises:
        Malformed: It is something else.
    """
    value = owner.get(key, {})
    if not isinstance(value, dict):
        raise Malformed(f'"{key}" is not a JSON object')
    return value


def list_at(owner: dict, key: str) -> list:
    """The JSON array under `key`, empty when absent.

    Raises:
        Malformed: It is something else.
    """
    value = owner.get(key, [])
    if not isinstance(value, list):
        raise Malformed(f'"{key}" is not a JSON array')
    return value


def text_at(owner: dict, key: str, default: str = "") -> str:
    """The string under `key`; names are optional and harmless, so anything else counts as absent."""
    value = owner.get(key, default)
    return value if isinstance(value, str) else default


def number_at(owner: dict, key: str, default: float) -> float:
    """The finite number under `key`.

    Raises:
        Malformed: It is something else.
    """
    value = owner.get(key, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise Malformed(f'"{key}" is not a number')
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number) and key in owner:
        raise Malformed(f'"{key}" is not finite')
    return number


def vector_at(owner: dict, key: str, default: tuple[float, ...]) -> tuple[float, ...]:
    """The array of as many finite numbers as `default` has.

    Raises:
        Malformed: It is something else.
    """
    if key not in owner:
        return default
    values = list_at(owner, key)
    if len(values) != len(default):
        raise Malformed(f'"{key}" does not have {len(default)} numbers')
    return tuple(number_at({key: value}, key, 0.0) for value in values)


def index_at(owner: dict, key: str) -> int | None:
    """The non-negative integer under `key`, None when absent.

    Raises:
        Malformed: It is something else.
    """
    value = owner.get(key)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or value < 0 or value != value // 1:
        raise Malformed(f'"{key}" is not an index')
    return int(value)


def extension(owner: dict, name: str) -> dict | None:
    """The object of an extension, None when absent.

    Raises:
        Malformed: "extensions" or the extension is not an object.
    """
    extensions = object_at(owner, "extensions")
    return object_at(extensions, name) if name in extensions else None


class Document:
    """A parsed asset.

    Attributes:
        path: The file, for messages and for what it refers to.
        json: The top-level JSON object.
        warnings: Where every reader of the document reports.
    """

    def __init__(self, path: Path, json_object: dict, binary: memoryview | None, warnings: WarningList) -> None:
        self.path = path
        self.json = json_object
        self.warnings = warnings
        self._binary = binary
        self._buffers: dict[int, memoryview | Malformed] = {}
        self.accessor_cache: dict[int, np.ndarray] = {}

    def entry(self, kind: str, index: int | None) -> dict:
        """The object `index` of a top-level array such as "accessors".

        Raises:
            Malformed: There is no such object.
        """
        entries = list_at(self.json, kind)
        if index is None or not 0 <= index < len(entries):
            raise Malformed(f"{kind}[{index}] does not exist")
        if not isinstance(entries[index], dict):
            raise Malformed(f"{kind}[{index}] is not a JSON object")
        return entries[index]

    def unsupported(self, name: str) -> str:
        """The warning for an extension that is not honoured, the same wherever it comes up."""
        required = self.json.get("extensionsRequired")
        if isinstance(required, list) and name in required:
            return f"the extension {name} is required by the file but not supported, so the picture is incomplete"
        return f"the extension {name} is not supported and was ignored"

    def buffer(self, index: int | None) -> memoryview:
        """The bytes of a buffer, at most `byteLength` of them; fewer, with a warning, when the file is short.

        Raises:
            Malformed: The buffer cannot be had.
        """
        entry = self.entry("buffers", index)
        if index not in self._buffers:
            try:
                self._buffers[index] = self._read_buffer(index, entry)
            except Malformed as problem:
                self._buffers[index] = problem
        found = self._buffers[index]
        if isinstance(found, Malformed):
            raise Malformed(str(found))
        return found

    def _read_buffer(self, index: int, entry: dict) -> memoryview:
        uri = entry.get("uri")
        label = f"buffers[{index}]"
        if uri is None:
            if index != 0 or self._binary is None:
                raise Malformed(f"{label} has no data")
            data = self._binary
        elif not isinstance(uri, str):
            raise Malformed(f"{label} has a URI that is not text")
        else:
            label = "data URI" if uri[:5].lower() == "data:" else uri
            try:
                data = memoryview(self.read_uri(uri))
            except Malformed as problem:
                raise Malformed(f"{label}: {problem}") from problem
        length = index_at(entry, "byteLength")
        if length is None:
            return data
        if len(data) < length:
            self.warnings.add("a buffer is shorter than the file says", f"{label}, {len(data)} of {length} bytes")
        return data[:length]

    def read_uri(self, uri: str) -> bytes:
        """The bytes behind a URI of the asset.

        Raises:
            Malformed: It is broken, missing or refused.
        """
        if uri[:5].lower() == "data:":
            return read_data_uri(uri)
        return read_sibling(self.path.parent, uri)

    def view(self, index: int | None) -> tuple[memoryview, int]:
        """The bytes of a buffer view and its stride, 0 when tightly packed.

        The bytes may be fewer than the view's length where the buffer is cut short.

        Raises:
            Malformed: The view or its buffer cannot be had, or it begins beyond the buffer's end.
        """
        entry = self.entry("bufferViews", index)
        if extension(entry, "EXT_meshopt_compression") is not None:
            buffer = self.entry("buffers", index_at(entry, "buffer"))
            if "uri" not in buffer and extension(buffer, "EXT_meshopt_compression") is not None:
                raise Malformed("it is compressed with EXT_meshopt_compression, which is not supported")
        data = self.buffer(index_at(entry, "buffer"))
        offset = index_at(entry, "byteOffset") or 0
        length = index_at(entry, "byteLength")
        if offset > len(data):
            raise Malformed(f"bufferViews[{index}] begins beyond the end of its buffer")
        end = len(data) if length is None else min(len(data), offset + length)
        return data[offset:end], index_at(entry, "byteStride") or 0


def read_document(path: Path, warnings: WarningList) -> Document:
    """Reads a .gltf or .glb file; which of the two is told by its first bytes.

    Raises:
        UserError: It cannot be read as glTF 2.0 at all.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise UserError(f"the scene cannot be read ({error.strerror})", str(path)) from error
    binary = None
    text = data
    if data[:4] == GLB_MAGIC:
        text, binary = _split_glb(data, path, warnings)
    elif path.suffix.lower() == ".glb":
        raise UserError("the file is not a binary glTF", str(path), _guess(data))
    document = Document(path, _parse(text, path, warnings), binary, warnings)
    _check_version(document)
    return document


def _guess(data: bytes) -> str:
    """What a file that is not glTF may be instead, as advice."""
    start = data[:64].lstrip().lower()
    if start.startswith((b"<!doctype", b"<html", b"<?xml", b"<")):
        return "it is a web page: download the file itself"
    if start.startswith(b"version https://git-lfs"):
        return "it is a Git LFS pointer: fetch the real file with git lfs pull"
    return "it is empty" if not data else "export it again as glTF 2.0"


def _split_glb(data: bytes, path: Path, warnings: WarningList) -> tuple[bytes, memoryview | None]:
    """The JSON and the binary chunk of a GLB file."""
    if len(data) < 20:
        raise UserError("the binary glTF is cut short", str(path), "download or export it again")
    _, version, length = struct.unpack_from("<4sII", data)
    if version != 2:
        raise UserError(f"the binary glTF has version {version}", str(path), "export it as glTF 2.0")
    if length > len(data):
        warnings.add("the file is cut short", f"{len(data)} of {length} bytes")
    text, binary = None, None
    offset = 12
    while offset + 8 <= len(data) and (text is None or binary is None):
        size, kind = struct.unpack_from("<II", data, offset)
        chunk = memoryview(data)[offset + 8 : offset + 8 + size]
        if kind == _CHUNK_JSON and text is None:
            if len(chunk) < size:
                raise UserError("the binary glTF is cut short", str(path), "download or export it again")
            text = bytes(chunk)
        elif kind == _CHUNK_BIN and binary is None:
            binary = chunk
        offset += 8 + size
    if text is None:
        raise UserError("the binary glTF has no JSON chunk", str(path), "export it again")
    return text, binary


def _parse(text: bytes, path: Path, warnings: WarningList) -> dict:
    """The top-level object of the JSON text."""
    try:
        decoded = text.decode("utf-8-sig")
    except UnicodeDecodeError:
        decoded = text.decode("latin-1")
        warnings.add("the JSON is not UTF-8 and was read as Latin-1")
    try:
        # Trailing NULs are not allowed, but some writers pad the chunk with them.
        parsed: Any = json.loads(decoded.rstrip("\0"))
    except (ValueError, RecursionError) as error:
        raise UserError("the file is not JSON, so not glTF", str(path), _guess(text)) from error
    if not isinstance(parsed, dict):
        raise UserError("the JSON is not a glTF asset", str(path), "its top level must be an object")
    if not {"asset", "scenes", "nodes", "meshes", "buffers"} & parsed.keys():
        raise UserError("the JSON is not a glTF asset", str(path), "it has neither nodes nor meshes")
    return parsed


def _check_version(document: Document) -> None:
    asset = document.json.get("asset")
    version = str(asset.get("version", "")) if isinstance(asset, dict) else ""
    if version.startswith("1."):
        raise UserError(f"the file is glTF {version}", str(document.path), "export it as glTF 2.0")
    if not version.startswith("2."):
        document.warnings.add("the file does not say that it is glTF 2.0")
