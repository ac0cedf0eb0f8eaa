"""Scenes: files of many formats, read into plain numpy data without any OpenGL."""

from ssil_viewer.scene.describe import describe, format_description
from ssil_viewer.scene.framing import default_camera
from ssil_viewer.scene.load import BUILTIN_SCENES, load_scene
from ssil_viewer.scene.model import Camera, Image, Instance, Light, Material, Mesh, Primitive, Scene, TextureRef

__all__ = [
    "BUILTIN_SCENES",
    "Camera",
    "Image",
    "Instance",
    "Light",
    "Material",
    "Mesh",
    "Primitive",
    "Scene",
    "TextureRef",
    "default_camera",
    "describe",
    "format_description",
    "load_scene",
]
