"""Hierarchical screen-space indirect lighting: a library, a command line and a viewer.

The public names are loaded on first use, so that `import ssil_viewer` costs next to nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ssil_viewer.embed import IndirectLighting
    from ssil_viewer.errors import UserError
    from ssil_viewer.gpu.context import create_headless_context
    from ssil_viewer.headless import render
    from ssil_viewer.pipeline import Renderer
    from ssil_viewer.scene import default_camera, load_scene
    from ssil_viewer.scene.environment import Environment, load_environment
    from ssil_viewer.scene.model import Camera, Light, Scene
    from ssil_viewer.settings import Settings, load_preset, load_settings

__version__ = "0.1.0"

_HOME = {
    "Camera": "ssil_viewer.scene.model",
    "Environment": "ssil_viewer.scene.environment",
    "IndirectLighting": "ssil_viewer.embed",
    "Light": "ssil_viewer.scene.model",
    "Renderer": "ssil_viewer.pipeline",
    "Scene": "ssil_viewer.scene.model",
    "Settings": "ssil_viewer.settings",
    "UserError": "ssil_viewer.errors",
    "create_headless_context": "ssil_viewer.gpu.context",
    "default_camera": "ssil_viewer.scene",
    "load_environment": "ssil_viewer.scene.environment",
    "load_preset": "ssil_viewer.settings",
    "load_scene": "ssil_viewer.scene",
    "load_settings": "ssil_viewer.settings",
    "render": "ssil_viewer.headless",
}

__all__ = [
    "Camera", "Environment", "IndirectLighting", "Light", "Renderer", "Scene", "Settings", "UserError",
    "create_headless_context", "default_camera", "load_environment", "load_preset", "load_scene", "load_settings",
    "render",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'ssil_viewer' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
