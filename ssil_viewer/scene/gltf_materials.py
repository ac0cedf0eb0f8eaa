"""glTF materials, textures, samplers and images."""

from __future__ import annotations

from dataclasses import replace

from ssil_viewer.scene.files import Malformed
from ssil_viewer.scene.gltf_document import (
    Document,
    extension,
    index_at,
    number_at,
    object_at,
    text_at,
    vector_at,
)
from ssil_viewer.scene.images import Picture, checker, decode_all
from ssil_viewer.scene.model import Image, Material, TextureRef

DEFAULT_MATERIAL = Material(name="default", metallic=1.0, roughness=1.0)
"""What glTF prescribes for a primitive without material."""

_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_NEAREST = 9728

# Texture sources in order of preference: the extension that names the image, "" for the core property.
_SOURCES = ("", "EXT_texture_webp", "MSFT_texture_dds", "KHR_texture_basisu", "EXT_texture_avif")

_HONOURED = {
    "KHR_materials_emissive_strength",
    "KHR_materials_specular",
    "KHR_materials_ior",
    "KHR_materials_unlit",
    "KHR_materials_pbrSpecularGlossiness",
}


class MaterialReader:
    """Reads the materials that are used, and then all their images at once.

    Texture references hold glTF image indices until `finish` has decoded the images.

    Attributes:
        unlit: Indices into the finished materials of those that are unlit.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        self._warnings = document.warnings
        self._materials: list[Material] = []
        self._places: dict[int | None, int] = {}
        self.unlit: set[int] = set()

    def place(self, index: int | None) -> int:
        """The place of a glTF material in the scene; None, and an index out of range, is the default material."""
        if index not in self._places:
            material = DEFAULT_MATERIAL
            if index is not None:
                try:
                    entry = self._document.entry("materials", index)
                    material = self._read(entry, text_at(entry, "name") or f"material {index}")
                except Malformed as problem:
                    self._warnings.add("a material cannot be read and is replaced by the default", str(problem))
            self._places[index] = len(self._materials)
            self._materials.append(material)
        return self._places[index]

    def material(self, place: int) -> Material:
        """A material read so far."""
        return self._materials[place]

    def finish(self) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
        """Decodes the images that the materials use.

        Returns:
            The materials with references into the returned images. An image that cannot be read becomes a
            chequerboard as base colour or emission; as anything else it is left out.
        """
        wanted = sorted({ref.image for m in self._materials for ref in texture_references(m).values()})
        decoded = decode_all([self._picture(index) for index in wanted], self._warnings)
        images: list[Image] = []
        places: dict[int, int] = {}
        broken: set[int] = set()
        for index, image in zip(wanted, decoded, strict=True):
            places[index] = len(images)
            if image is None:
                broken.add(index)
                image = checker(self._picture(index).name)
            images.append(image)
        materials = tuple(_with_images(material, places, broken) for material in self._materials)
        return materials, tuple(images)

    def _picture(self, index: int) -> Picture:
        """The encoded image `index`; problems come up when it is read."""
        try:
            entry = self._document.entry("images", index)
        except Malformed as problem:
            reason = str(problem)

            def fail() -> bytes:
                raise Malformed(reason)

            return Picture(f"image {index}", fail)
        uri = entry.get("uri")
        external = isinstance(uri, str) and uri[:5].lower() != "data:"
        name = text_at(entry, "name") or (uri if external else f"image {index}")

        def read() -> bytes:
            if isinstance(uri, str):
                return self._document.read_uri(uri)
            return bytes(self._document.view(index_at(entry, "bufferView"))[0])

        return Picture(name, read)

    def _read(self, entry: dict, name: str) -> Material:
        extensions = object_at(entry, "extensions")
        for unknown in sorted(extensions.keys() - _HONOURED):
            self._warnings.add(self._document.unsupported(unknown), name)
        pbr = object_at(entry, "pbrMetallicRoughness")
        normal = object_at(entry, "normalTexture")
        occlusion = object_at(entry, "occlusionTexture")
        strength = number_at(extension(entry, "KHR_materials_emissive_strength") or {}, "emissiveStrength", 1.0)
        emission = vector_at(entry, "emissiveFactor", (0.0, 0.0, 0.0))
        if min(emission) * strength < 0.0 or max(emission) * strength < 0.0:
            self._warnings.add("negative emission was set to zero", name)
        material = Material(
            name=name,
            base_color=self._color(pbr, "baseColorFactor", name),
            base_color_texture=self._texture(pbr, "baseColorTexture", name),
            metallic=self._unit(pbr, "metallicFactor", name),
            roughness=self._unit(pbr, "roughnessFactor", name),
            metallic_roughness_texture=self._texture(pbr, "metallicRoughnessTexture", name),
            normal_texture=self._texture(entry, "normalTexture", name),
            normal_scale=number_at(normal, "scale", 1.0),
            occlusion_texture=self._texture(entry, "occlusionTexture", name),
            occlusion_strength=self._unit(occlusion, "strength", name),
            emission=tuple(max(0.0, value * strength) for value in emission),
            emission_texture=self._texture(entry, "emissiveTexture", name),
            alpha_mode=self._alpha_mode(entry, name),
            alpha_cutoff=number_at(entry, "alphaCutoff", 0.5),
            double_sided=entry.get("doubleSided") is True,
        )
        return self._with_extensions(material, entry)

    def _color(self, owner: dict, key: str, material: str) -> tuple[float, float, float, float]:
        """An RGBA factor, white when absent; more than 1 would reflect more light than there is."""
        red, green, blue, alpha = vector_at(owner, key, (1.0, 1.0, 1.0, 1.0))
        return tuple(self._clamped(value, key, material) for value in (red, green, blue, alpha))

    def _unit(self, owner: dict, key: str, material: str) -> float:
        """A factor from 0 to 1, 1 when absent."""
        return self._clamped(number_at(owner, key, 1.0), key, material)

    def _clamped(self, value: float, key: str, material: str) -> float:
        if not 0.0 <= value <= 1.0:
            self._warnings.add("material factors outside of 0 to 1 were clamped", f"{material} ({key})")
        return min(max(value, 0.0), 1.0)

    def _alpha_mode(self, entry: dict, name: str) -> str:
        mode = text_at(entry, "alphaMode", "OPAQUE").lower()
        if mode == "blend":
            self._warnings.add("alpha blending (BLEND) is drawn as a cut-out at half opacity", name)
        elif mode not in ("opaque", "mask"):
            self._warnings.add("an unknown alpha mode is treated as OPAQUE", name)
            mode = "opaque"
        return mode

    def _with_extensions(self, material: Material, entry: dict) -> Material:
        """The material changed by the extensions that are honoured."""
        specular = extension(entry, "KHR_materials_specular")
        if specular is not None:
            material = replace(material, specular=self._unit(specular, "specularFactor", material.name))
            for key in ("specularTexture", "specularColorTexture"):
                if key in specular:
                    self._warnings.add(f"{key} of KHR_materials_specular is not supported", material.name)
            if vector_at(specular, "specularColorFactor", (1.0, 1.0, 1.0)) != (1.0, 1.0, 1.0):
                self._warnings.add("specularColorFactor of KHR_materials_specular is not supported", material.name)
        ior = number_at(extension(entry, "KHR_materials_ior") or {}, "ior", 1.5)
        if ior < 1.0:
            self._warnings.add("an index of refraction below 1 is replaced by 1.5", material.name)
            ior = 1.5
        material = replace(material, ior=ior)
        glossiness = extension(entry, "KHR_materials_pbrSpecularGlossiness")
        if glossiness is not None:
            self._warnings.add("KHR_materials_pbrSpecularGlossiness is approximated", material.name)
            if "specularGlossinessTexture" in glossiness:
                self._warnings.add("specularGlossinessTexture is not supported", material.name)
            material = replace(
                material,
                base_color=self._color(glossiness, "diffuseFactor", material.name),
                base_color_texture=self._texture(glossiness, "diffuseTexture", material.name),
                metallic=0.0,
                roughness=1.0 - self._unit(glossiness, "glossinessFactor", material.name),
                metallic_roughness_texture=None,
            )
        if extension(entry, "KHR_materials_unlit") is not None:
            self._warnings.add("KHR_materials_unlit is approximated: the base colour is emitted", material.name)
            self.unlit.add(len(self._materials))
            material = replace(
                material,
                base_color=(0.0, 0.0, 0.0, material.base_color[3]),
                metallic=0.0,
                roughness=1.0,
                specular=0.0,
                metallic_roughness_texture=None,
                normal_texture=None,
                occlusion_texture=None,
                emission=material.base_color[:3],
                emission_texture=material.base_color_texture,
            )
        return material

    def _texture(self, owner: dict, key: str, material: str) -> TextureRef | None:
        """The reference under `key`, with the image's glTF index; None when absent or broken (with a warning)."""
        if key not in owner:
            return None
        try:
            info = object_at(owner, key)
            texture = self._document.entry("textures", index_at(info, "index"))
            sampler = {}
            if "sampler" in texture:
                sampler = self._document.entry("samplers", index_at(texture, "sampler"))
            transform = extension(info, "KHR_texture_transform") or {}
            texcoord = index_at(transform, "texCoord")
            if texcoord is None:
                texcoord = index_at(info, "texCoord") or 0
            if texcoord > 1:
                self._warnings.add("UV sets above 1 are not supported, set 0 is used", material)
                texcoord = 0
            return TextureRef(
                image=self._source(texture),
                texcoord=texcoord,
                wrap_u=self._wrap(sampler, "wrapS"),
                wrap_v=self._wrap(sampler, "wrapT"),
                nearest=index_at(sampler, "magFilter") == _NEAREST,
                offset=vector_at(transform, "offset", (0.0, 0.0)),
                scale=vector_at(transform, "scale", (1.0, 1.0)),
                rotation=number_at(transform, "rotation", 0.0),
            )
        except Malformed as problem:
            self._warnings.add("a texture reference is broken and was ignored", f"{material}, {key}: {problem}")
            return None

    def _wrap(self, sampler: dict, key: str) -> str:
        mode = index_at(sampler, key)
        if mode is not None and mode not in _WRAPS:
            self._warnings.add("an unknown texture wrap mode is treated as repeat", str(mode))
        return _WRAPS.get(10497 if mode is None else mode, "repeat")

    def _source(self, texture: dict) -> int:
        """The glTF index of the image of a texture.

        Raises:
            Malformed: The texture has no image.
        """
        for name in _SOURCES:
            owner = extension(texture, name) if name else texture
            source = index_at(owner or {}, "source")
            if source is not None:
                return source
        raise Malformed("the texture has no image")


_SLOTS = (
    "base_color_texture",
    "metallic_roughness_texture",
    "normal_texture",
    "occlusion_texture",
    "emission_texture",
)


def texture_references(material: Material) -> dict[str, TextureRef]:
    """The textures of a material by the name of the field."""
    return {slot: ref for slot in _SLOTS if (ref := getattr(material, slot)) is not None}


def _with_images(material: Material, places: dict[int, int], broken: set[int]) -> Material:
    """The material with references into the scene's images instead of the file's."""
    changes: dict = {}
    for slot, ref in texture_references(material).items():
        if ref.image in broken and slot not in ("base_color_texture", "emission_texture"):
            changes[slot] = None
            if slot == "metallic_roughness_texture":
                # The factors alone would turn what the picture makes a dielectric into a mirror.
                changes["metallic"] = 0.0
        else:
            changes[slot] = replace(ref, image=places[ref.image])
    return replace(material, **changes)
