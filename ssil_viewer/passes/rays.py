"""Rays against the triangles of the scene (shaders/lib/scene_rays.glsl): who asks for them, and what passes need."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ssil_viewer.gpu.triangle_tables import TABLE_KINDS
from ssil_viewer.settings import Settings

if TYPE_CHECKING:
    from ssil_viewer.scene_frame import SceneFrame

RAYS = frozenset({"rays"})
RAY_TABLES = TABLE_KINDS
RAY_UNIFORMS = {"node_count": "int", "extent": "float"}


def gathers_unseen(settings: Settings) -> bool:
    """Whether light from unseen surfaces is asked for."""
    return settings.unseen_samples > 0 and settings.bounces > 0


def traces_shadows(settings: Settings) -> bool:
    """Whether shadows by rays are asked for."""
    return settings.shadow_rays


def corrects_visibility(settings: Settings) -> bool:
    """Whether rays correct what horizons say about visibility."""
    return settings.visibility_rays > 0 and settings.visibility == "horizon" and settings.bounces > 0


def traces_rays(settings: Settings) -> bool:
    """Whether some pass traces rays against the scene's triangles, whose tables take long to make."""
    return gathers_unseen(settings) or traces_shadows(settings) or corrects_visibility(settings)


def random_seed(frame: SceneFrame) -> int:
    """Differs from frame to frame while a temporal filter takes the mean."""
    settings = frame.settings
    return (settings.seed * 7919 + (frame.runner.frame_index if settings.temporal else 0)) % 2**31


def ray_uniforms(frame: SceneFrame) -> dict[str, object]:
    """Values of RAY_UNIFORMS."""
    return {"node_count": frame.rays.node_count, "extent": frame.rays.extent}


def ray_defines(frame: SceneFrame) -> tuple[tuple[str, str], ...]:
    """Definitions that shaders/lib/scene_rays.glsl needs."""
    return (("MASKED", ""),) if frame.rays.masked else ()
