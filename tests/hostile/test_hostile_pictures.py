"""Textures that cannot be decoded, or are too large."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from ssil_viewer.scene import Scene
from tests.gltf_builder import GltfBuilder, png
from tests.scene_checks import outcome


def png_header(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds next to nothing."""
    import zlib

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"\0" * 100)) + chunk(b"IEND", b"")


BROKEN_PICTURES = {
    "empty": b"",
    "garbage": b"garbage",
    "bomb of 900 Mpx": png_header(30000, 30000),
    "just above the limit": png_header(8193, 8192),
    "as large as can be": png_header(2**31 - 1, 2**31 - 1),
    "no width": png_header(0, 5),
    "truncated": png(np.random.default_rng(0).integers(0, 255, (32, 32, 3), np.uint8))[:1000],
    "KTX2": b"\xabKTX 20\xbb\r\n\x1a\n" + b"\0" * 100,
    "SVG": b"<svg xmlns='http://www.w3.org/2000/svg'/>",
    "PostScript": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 1 1\n",
}


@pytest.mark.parametrize("data", BROKEN_PICTURES.values(), ids=BROKEN_PICTURES.keys())
def test_pictures_that_cannot_be_decoded(tmp_path, data):
    builder = GltfBuilder()
    texture = builder.texture(data)
    material = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    builder.node(mesh=builder.mesh(builder.primitive(material=material)))
    scene = outcome(builder.write(tmp_path))
    assert scene.images[0].pixels.shape == (64, 64, 4)
    assert "cannot be read" in scene.warnings[0]


def test_very_long_pictures_are_scaled_down(tmp_path):
    builder = GltfBuilder()
    texture = builder.texture(np.full((2, 10000, 3), 80, np.uint8))
    material = builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": texture}})
    builder.node(mesh=builder.mesh(builder.primitive(material=material)))
    scene = outcome(builder.write(tmp_path))
    assert scene.images[0].pixels.shape == (2, 8192, 4) and np.all(scene.images[0].pixels[..., :3] == 80)
    assert "at most 8192" in scene.warnings[0]


def test_many_pictures_share_a_budget(tmp_path, monkeypatch):
    monkeypatch.setattr("ssil_viewer.scene.images.MAX_TOTAL_PIXELS", 4 * 64 * 64)
    builder = GltfBuilder()
    primitive = builder.primitive()
    shades = [builder.texture(np.full((256, 128, 3), shade, np.uint8)) for shade in (1, 2, 3, 4)]
    materials = [builder.material(pbrMetallicRoughness={"baseColorTexture": {"index": shade}}) for shade in shades]
    builder.node(mesh=builder.mesh(*({**primitive, "material": m} for m in materials)))
    scene = outcome(builder.write(tmp_path))
    assert [image.pixels.shape for image in scene.images] == [(64, 32, 4)] * 4
    assert "at most 64" in scene.warnings[0]


def test_broken_normal_map_leaves_no_tangents(tmp_path):
    builder = GltfBuilder()
    material = builder.material(normalTexture={"index": builder.texture(b"garbage")})
    builder.node(mesh=builder.mesh(builder.primitive(material=material)))
    assert isinstance(outcome(builder.write(tmp_path)), Scene)
