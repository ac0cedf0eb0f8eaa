"""Wavefront MTL materials, converted to metallic-roughness ones."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PureWindowsPath

import numpy as np
from PIL import Image as PillowImage

from ssil_viewer.scene.files import Malformed, find_sibling, read_sibling
from ssil_viewer.scene.images import Picture, checker, decode_all
from ssil_viewer.scene.model import Image, Material, TextureRef
from ssil_viewer.scene.obj_text import logical_lines
from ssil_viewer.scene.warning_list import WarningList

DEFAULT_MATERIAL = Material(name="default", base_color=(0.8, 0.8, 0.8, 1.0), specular=0.0, double_sided=True)
"""For faces without material: a light grey Lambertian surface."""

FULL_SPECULAR = 0.5
"""Ks that becomes the reflection of a dielectric with index 1.5: what exporters of physically based materials write
for it. The exponent's lobe is not normalised, so there is no exact conversion."""

BUMP_DEPTH = 8.0
"""Texels that a height of 1 stands for in a bump map: the format gives heights no unit."""

# Options of texture statements and how many arguments they have at most; numbers end the optional ones.
_OPTIONS = {
    "-s": 3,
    "-o": 3,
    "-t": 3,
    "-mm": 2,
    "-bm": 1,
    "-boost": 1,
    "-texres": 1,
    "-blendu": 1,
    "-blendv": 1,
    "-clamp": 1,
    "-cc": 1,
    "-imfchan": 1,
    "-type": 1,
}
_WORD_OPTIONS = {"-blendu", "-blendv", "-clamp", "-cc", "-imfchan", "-type"}

_IGNORED_MAPS = ("map_ks", "map_ns", "map_pr", "map_pm", "map_ps", "disp", "map_disp", "decal", "refl")


@dataclass(frozen=True)
class TextureUse:
    """The argument of a texture statement: the file as written and the options that count."""

    file: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    clamp: bool = False
    bump: float = 1.0

    def ref(self, image: int) -> TextureRef:
        """The reference with v turned downwards: v' = 1 - (scale (1 - v) + offset)."""
        return TextureRef(
            image,
            wrap_u="clamp" if self.clamp else "repeat",
            wrap_v="clamp" if self.clamp else "repeat",
            offset=(self.offset[0], 1.0 - self.scale[1] - self.offset[1]),
            scale=self.scale,
        )


@dataclass
class MtlMaterial:
    """The statements of one `newmtl`: numbers and texture uses by lower-case keyword."""

    name: str
    folder: Path
    numbers: dict[str, list[float]] = field(default_factory=dict)
    textures: dict[str, TextureUse] = field(default_factory=dict)

    def number(self, key: str, default: float) -> float:
        """The first number of a statement."""
        return self.numbers.get(key, [default])[0]

    def color(self, key: str) -> tuple[float, float, float] | None:
        """The RGB of a statement, grey when it has one number; None when absent."""
        values = self.numbers.get(key)
        if values is None:
            return None
        red, green, blue = values[:3] if len(values) >= 3 else values[:1] * 3
        return max(red, 0.0), max(green, 0.0), max(blue, 0.0)


def read_libraries(folder: Path, libraries: Sequence[str], warnings: WarningList) -> dict[str, MtlMaterial]:
    """Reads the files of all `mtllib` statements; the first material of a name counts."""
    materials: dict[str, MtlMaterial] = {}
    for argument in libraries:
        # One statement may name several files, but file names hold spaces more often than that.
        names = [argument]
        try:
            find_sibling(folder, _unquoted(argument), percent_encoded=False)
        except Malformed:
            if len(argument.split()) > 1:
                names = argument.split()
        for name in names:
            try:
                path = find_sibling(folder, _unquoted(name), percent_encoded=False)
                data = read_sibling(folder, _unquoted(name), percent_encoded=False)
            except Malformed as problem:
                warnings.add("a material file cannot be read", f"{name}: {problem}")
                continue
            for material in parse_mtl(data, path.parent):
                materials.setdefault(material.name, material)
    return materials


def _unquoted(text: str) -> str:
    return text[1:-1] if len(text) > 1 and text[0] == text[-1] == '"' else text


def parse_mtl(data: bytes, folder: Path) -> list[MtlMaterial]:
    """The materials of an MTL file whose textures lie in `folder`."""
    materials: list[MtlMaterial] = []
    for line in logical_lines(data):
        words = line.split(None, 1)
        if len(words) < 2 or words[0].startswith("#"):
            continue
        keyword, rest = words[0].lower(), words[1].strip()
        if keyword == "newmtl":
            materials.append(MtlMaterial(rest, folder))
        elif not materials:
            continue
        elif keyword.startswith("map_") or keyword in ("bump", "norm", "disp", "decal", "refl"):
            use = _parse_texture(rest)
            if use is not None:
                materials[-1].textures[keyword] = use
        else:
            values = _leading_numbers(rest.split())
            if values:
                materials[-1].numbers[keyword] = values
    return materials


def _leading_numbers(words: Sequence[str]) -> list[float]:
    """The finite numbers with which a statement begins."""
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            break
        if not np.isfinite(value):
            break
        values.append(value)
    return values


def _parse_texture(rest: str) -> TextureUse | None:
    """The file name, which may hold spaces, and the options before it; None without a file name."""
    options: dict[str, list[str]] = {}
    while (match := re.match(r"(-\w+)\s+", rest)) and match[1].lower() in _OPTIONS:
        option = match[1].lower()
        rest = rest[match.end() :]
        arguments = []
        while len(arguments) < _OPTIONS[option]:
            word, _, after = rest.partition(" ")
            # The file name may be a number too: the last word is never an argument.
            if not after.strip() or (option not in _WORD_OPTIONS and not _leading_numbers([word])):
                break
            arguments.append(word)
            rest = after.lstrip()
        options[option] = arguments
    file = _unquoted(rest.strip())
    if not file:
        return None
    scale = [*_leading_numbers(options.get("-s", [])), 1.0, 1.0]
    offset = [*_leading_numbers(options.get("-o", [])), 0.0, 0.0]
    bump = [*_leading_numbers(options.get("-bm", [])), 1.0]
    clamp = [word.lower() for word in options.get("-clamp", [])] == ["on"]
    return TextureUse(file, (scale[0], scale[1]), (offset[0], offset[1]), clamp, bump[0])


class MtlConverter:
    """Converts materials, decodes their pictures, and builds the ones that have no counterpart.

    Args:
        folder: The folder of the OBJ file, outside of which nothing is read.
        materials: In the order in which they shall stand in the scene; None for the default material.
        warnings: Receives what cannot be honoured.
    """

    def __init__(self, folder: Path, materials: Sequence[MtlMaterial | None], warnings: WarningList) -> None:
        self._folder = folder
        self._sources = materials
        self._warnings = warnings
        self._decoded: dict[tuple[Path, str], Image | None] = {}
        self._images: list[Image] = []
        self._places: dict[tuple, int] = {}

    def convert(self) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """The materials and their images."""
        wanted: dict[tuple[Path, str], None] = {}
        for source in self._sources:
            if source is not None:
                for keyword, use in source.textures.items():
                    if keyword not in _IGNORED_MAPS and keyword != "map_ka":
                        wanted[source.folder, use.file] = None
        pictures = [Picture(file, lambda f=folder, n=file: self._read(f, n)) for folder, file in wanted]
        self._decoded = dict(zip(wanted, decode_all(pictures, self._warnings), strict=True))
        materials = tuple(
            DEFAULT_MATERIAL if source is None else self._with_textures(self._plain(source), source)
            for source in self._sources
        )
        return materials, tuple(self._images)

    def _read(self, folder: Path, file: str) -> bytes:
        """The bytes of a texture: beside the MTL file, beside the OBJ file, or there under its bare name.

        The bare name helps with the absolute paths of somebody else's computer.
        """
        below = folder.relative_to(self._folder).as_posix()
        places = [file] if below == "." else [f"{below}/{file}", file]
        places.append(PureWindowsPath(file).name)
        problems = []
        for place in places:
            try:
                return read_sibling(self._folder, place, percent_encoded=False)
            except Malformed as problem:
                problems.append(problem)
        raise problems[0]

    def _plain(self, source: MtlMaterial) -> Material:
        """The material without textures."""
        diffuse = source.color("kd")
        if diffuse is None or ("map_kd" in source.textures and not any(diffuse)):
            # Exporters leave Kd out, or black, where a picture gives the colour.
            diffuse = (1.0, 1.0, 1.0) if "map_kd" in source.textures else DEFAULT_MATERIAL.base_color[:3]
        specular = source.color("ks") or (0.0, 0.0, 0.0)
        model = int(source.number("illum", 2.0))
        if model in (0, 1):
            specular = (0.0, 0.0, 0.0)
        if model in (4, 6, 7, 9):
            self._warnings.add("refraction and transparency by illum are not supported", source.name)
        exponent = max(source.number("ns", 0.0), 0.0)
        ior = source.number("ni", 1.5)
        material = Material(
            name=source.name,
            base_color=(*(min(value, 1.0) for value in diffuse), self._alpha(source)),
            metallic=min(max(source.number("pm", 0.0), 0.0), 1.0),
            roughness=min(max(source.number("pr", (2.0 / (exponent + 2.0)) ** 0.25), 0.0), 1.0),
            emission=source.color("ke") or (0.0, 0.0, 0.0),
            specular=min(max(specular) / FULL_SPECULAR, 1.0),
            ior=ior if 1.0 < ior <= 4.0 else 1.5,
            double_sided=True,
        )
        if model in (3, 5) and max(specular) > 0.0 and not any(source.color("kd") or ()):
            # A mirror: what little there is in this format to say "metal".
            material = replace(
                material, metallic=1.0, base_color=(*(min(value, 1.0) for value in specular), material.base_color[3])
            )
        if material.base_color[3] < 1.0:
            self._warnings.add("alpha blending is drawn as a cut-out at half opacity", source.name)
            material = replace(material, alpha_mode="blend")
        for keyword in source.textures:
            if keyword in _IGNORED_MAPS:
                self._warnings.add(f"{keyword} is not supported and was ignored", source.name)
        return material

    @staticmethod
    def _alpha(source: MtlMaterial) -> float:
        alpha = source.number("d", 1.0) if "d" in source.numbers else 1.0 - source.number("tr", 0.0)
        return min(max(alpha, 0.0), 1.0)

    def _with_textures(self, material: Material, source: MtlMaterial) -> Material:
        """Adds the textures of a material."""
        color, cutout = source.textures.get("map_kd"), source.textures.get("map_d")
        if cutout is not None:
            mask = self._decoded[source.folder, cutout.file]
            if mask is not None:
                use = color or cutout
                image = self._masked(source, color, cutout, mask)
                material = replace(material, base_color_texture=use.ref(image), alpha_mode="mask")
        if color is not None and material.base_color_texture is None:
            material = replace(material, base_color_texture=color.ref(self._picture(source, color)))
        glow = source.textures.get("map_ke")
        if glow is not None:
            emission = material.emission if any(material.emission) else (1.0, 1.0, 1.0)
            image = self._picture(source, glow)
            material = replace(material, emission=emission, emission_texture=glow.ref(image))
        return self._with_relief(material, source)

    def _with_relief(self, material: Material, source: MtlMaterial) -> Material:
        """Adds the normal map, made from heights where the material has a bump map."""
        for keyword in ("norm", "map_norm", "map_kn", "map_bump", "bump"):
            use = source.textures.get(keyword)
            image = None if use is None else self._decoded[source.folder, use.file]
            if use is None or image is None:
                continue
            if "bump" in keyword and _is_grey(image.pixels):
                key = ("bump", source.folder, use.file, use.bump)
                normals = Image(image.name, normals_from_heights(image.pixels[..., 0], use.bump))
                return replace(material, normal_texture=use.ref(self._place(key, normals)))
            place = self._place(("file", source.folder, use.file), image)
            return replace(material, normal_texture=use.ref(place), normal_scale=use.bump)
        return material

    def _picture(self, source: MtlMaterial, use: TextureUse) -> int:
        """Place of a picture as it is, or of the chequerboard that stands in for it."""
        image = self._decoded[source.folder, use.file]
        return self._place(("file", source.folder, use.file), image or checker(use.file))

    def _masked(self, source: MtlMaterial, color: TextureUse | None, cutout: TextureUse, mask: Image) -> int:
        """Place of the colour picture with the cut-out picture as its alpha."""
        base = None if color is None else self._decoded[source.folder, color.file]
        alpha = mask.pixels[..., 3] if np.any(mask.pixels[..., 3] < 255) else mask.pixels[..., :3].max(axis=-1)
        if color is not None and (color.scale, color.offset) != (cutout.scale, cutout.offset):
            self._warnings.add("map_d is laid out like map_Kd, although the material says otherwise", source.name)
        if base is None:
            pixels = np.full((*alpha.shape, 4), 255, dtype=np.uint8)
            if color is not None:
                cells = checker("").pixels
                pixels[..., :3] = np.resize(cells, (*alpha.shape, 4))[..., :3]
        else:
            pixels = base.pixels.copy()
            if alpha.shape != pixels.shape[:2]:
                size = (pixels.shape[1], pixels.shape[0])
                alpha = np.asarray(PillowImage.fromarray(alpha).resize(size, PillowImage.Resampling.BILINEAR))
        pixels[..., 3] = alpha
        key = ("masked", source.folder, color.file if color else "", cutout.file)
        return self._place(key, Image(color.file if color else cutout.file, pixels))

    def _place(self, key: tuple, image: Image) -> int:
        """Place of an image in the scene, which holds each only once."""
        if key not in self._places:
            self._places[key] = len(self._images)
            self._images.append(image)
        return self._places[key]


def _is_grey(pixels: np.ndarray) -> bool:
    """Whether a picture has no colour, up to what JPEG does to grey."""
    sample = pixels[::4, ::4, :3].astype(np.int16)
    return float(np.mean(np.ptp(sample, axis=-1))) < 6.0


def normals_from_heights(heights: np.ndarray, strength: float) -> np.ndarray:
    """A normal map of a height field that repeats, (H, W, 4) uint8, +Y (green) up.

    Args:
        heights: (H, W) uint8.
        strength: Multiplies the heights (the -bm option).
    """
    field_ = heights.astype(np.float32) * (BUMP_DEPTH * strength / 255.0)
    slope_right = (np.roll(field_, -1, axis=1) - np.roll(field_, 1, axis=1)) / 2.0
    slope_down = (np.roll(field_, -1, axis=0) - np.roll(field_, 1, axis=0)) / 2.0
    normals = np.stack([-slope_right, slope_down, np.ones_like(field_)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    pixels = np.full((*heights.shape, 4), 255, dtype=np.uint8)
    pixels[..., :3] = np.round(normals * 127.5 + 127.5)
    return pixels
