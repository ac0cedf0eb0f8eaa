"""Errors of the built-in scenes against R1 and R2, small and quick: measured here, kept in tests/render/errors.toml."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np

from ssil_viewer.headless import render_frames
from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference.all_pixels import random_blocks
from ssil_viewer.reference.metrics import agreement
from ssil_viewer.reference.visible_pixels import references
from ssil_viewer.scene import default_camera, load_scene
from ssil_viewer.settings import Settings

TABLE = Path(__file__).parent / "render" / "errors.toml"
SCENES = ("cornell", "arch", "atrium", "glossy")
MODES = ("off", "horizon", "voxel")
SIZE, FRAMES, BLOCKS = (320, 180), 4, 80
SEEDS = tuple(range(8))    # at this size a few squares at edges hold most of the error, and chance most of theirs
SETTINGS = Settings(samples=64)
ADVICE = "if that is meant: .venv/bin/python tools/make_errors.py, and say in the change why"

Errors = dict[str, dict[str, dict[str, float]]]


def measure(context: moderngl.Context, name: str, settings: Settings = SETTINGS,
            modes: tuple[str, ...] = MODES) -> Errors:
    """Mode -> reference -> bias and relative_rmse, over means of 8x8 pixels at the same random places each time.

    Each is the mean over SEEDS; `spread` is how far apart they lie, from the least to the most, the
    larger of the two.
    """
    scene = load_scene(f"builtin:{name}")
    camera = default_camera(scene)
    renderer = Renderer(context, SIZE, replace(settings, visibility=modes[0]))
    try:
        renderer.set_scene(scene)
        renderer.render(camera)
        rows, columns = random_blocks(renderer.read("view_depth") > 0, BLOCKS)
        light = dict(zip(("R1", "R2"), references(renderer, camera, scene, settings.start_level, rows, columns)))
        open_share = renderer.read("occlusion")[rows, columns][..., None]
        errors: Errors = {}
        for mode in modes:
            of_seeds: dict[str, list[dict[str, float]]] = {reference: [] for reference in light}
            for seed in SEEDS:
                renderer.set_settings(replace(settings, visibility=mode, seed=seed))
                renderer.reset_history()
                render_frames(renderer, camera, FRAMES)
                ours = renderer.read("indirect")[rows, columns].mean((1, 2), dtype=np.float64)
                for reference, image in light.items():
                    of_seeds[reference].append(agreement(ours, (image * open_share).mean((1, 2))))
            errors[mode] = {reference: _mean(found) for reference, found in of_seeds.items()}
        return errors
    finally:
        renderer.release()


def _mean(found: list[dict[str, float]]) -> dict[str, float]:
    values = {key: [each[key] for each in found] for key in ("bias", "relative_rmse")}
    spread = max(max(value) - min(value) for value in values.values())
    return {key: float(np.mean(value)) for key, value in values.items()} | {"spread": spread}


def tolerance(relative_rmse: float, spread: float) -> float:
    """By how much an error may grow: half a percent of the light, a twentieth of the error, and a quarter of what the
    choice of random numbers does to one image, which is more than it does to the mean of eight."""
    return 0.005 + 0.05 * relative_rmse + 0.25 * spread


def read_table() -> dict[str, Errors]:
    """Scene -> mode -> reference -> bias, relative_rmse, spread and tolerance."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def grown(kept: Errors, found: Errors) -> list[str]:
    """What is worse than it may be, a sentence for each: the relative RMSE or the size of the bias."""
    complaints = []
    for mode, of_mode in found.items():
        for reference, errors in of_mode.items():
            before = kept[mode][reference]
            for key in ("bias", "relative_rmse"):
                value = errors[key]
                limit = abs(before[key]) + before["tolerance"]
                if not abs(value) <= limit:
                    complaints.append(f"--visibility {mode}, {key} against {reference}: {value:.4f}, was "
                                      f"{before[key]:.4f}, may be {limit:.4f}")
    return complaints


def to_toml(table: dict[str, Errors]) -> str:
    """The file's text."""
    lines = [
        "# Errors of one bounce of indirect light in the built-in scenes, for each --visibility, against the sums R1",
        f"# and R2 (docs/compare.md): {SIZE[0]}x{SIZE[1]}, {SETTINGS.samples} samples, {FRAMES} frames, means of "
        f"{len(SEEDS)} seeds; {BLOCKS} places of 8x8 pixels.",
        "# spread: of the relative RMSE or of the bias from seed to seed, whichever is more.",
        "# tests/render/test_errors.py fails where a bias or a relative RMSE grows by more than its tolerance.",
        "# Made by tools/make_errors.py, with Mesa's software OpenGL."]
    for scene, modes in table.items():
        for mode, of_mode in modes.items():
            lines += ["", f"[{scene}.{mode}]"]
            for reference, errors in of_mode.items():
                bias, error, spread = errors["bias"], errors["relative_rmse"], errors["spread"]
                lines.append(f"{reference} = {{ bias = {bias:.4f}, relative_rmse = {error:.4f}, spread = {spread:.4f}, "
                             f"tolerance = {tolerance(error, spread):.4f} }}")
    return "\n".join(lines) + "\n"
