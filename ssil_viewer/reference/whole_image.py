"""R1 and R2 of all pixels by the GPU, for `compare`, and the picture of the error with its scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Callable, Sequence

import numpy as np

from ssil_viewer.pipeline import Renderer
from ssil_viewer.reference import metrics
from ssil_viewer.reference.gpu_pictures import ReferencePictures, Scale
from ssil_viewer.reference.gpu_sums import ProgressiveReference

_TURN = 0.25    # s between two reports of the progress
_MARGIN, _BAR, _TEXT = 10, 14, 13   # pixels of the legend


@dataclass
class WholeImage:
    """What came out.

    Attributes:
        ours: (H, W, 3) irradiance of the last frame, W m^-2.
        references: "R1" and "R2", those that were asked for: (H, W, 3), W m^-2.
        agreement: Name -> bias, relative_rmse and correlation over means of all squares of pixels without background.
        heat_map: (h, W, 3) uint8, the error against the last reference, with its scale; None unless asked for.
    """

    ours: np.ndarray
    references: dict[str, np.ndarray]
    agreement: dict[str, dict[str, float]]
    heat_map: np.ndarray | None = None


def sum_whole_image(renderer: Renderer, wanted: Sequence[str], rays: int, block: int, scale: Scale | None = None,
                    progress: Callable[[float], None] = lambda share: None) -> WholeImage:
    """R1 and R2 of the renderer's last frame, of every pixel, from every pixel.

    Args:
        wanted: Some of "R1" and "R2", not none.
        rays: Of R2, for each pixel; rounded up to a power of four.
        block: Side of the squares.
        scale: Of the heat map, if there is to be one.

    Raises:
        UserError: There is not enough memory.
    """
    found = ProgressiveReference(renderer, "R2" if "R2" in wanted else "R1", rays if "R2" in wanted else None,
                                 pixels=True)
    try:
        while not found.done:
            found.advance_for(_TURN)
            progress(found.progress)
        # R2's sweep has the unoccluded sum in it
        references = {name: found.read(unoccluded=name == "R1") for name in wanted}
        ours, visible = renderer.read("indirect"), renderer.read("view_depth") > 0
        our_means = metrics.block_means(ours, visible, block)
        agreement = {name: metrics.agreement(our_means, metrics.block_means(image, visible, block))
                     for name, image in references.items()} if len(our_means) else {}
        done = WholeImage(ours, references, agreement)
        if scale is not None:
            mean = float(references[found.kind][visible].mean(dtype=np.float64)) if visible.any() else 0.0
            done.heat_map = _heat_map(renderer, found, mean, scale, agreement.get(found.kind))
        return done
    finally:
        found.release()


def _heat_map(renderer: Renderer, found: ProgressiveReference, mean: float, scale: Scale,
              agreement: dict[str, float] | None) -> np.ndarray:
    pictures = ReferencePictures(renderer)
    try:
        pictures.error(found, mean, scale)
        picture = pictures.read()
    finally:
        pictures.release()
    difference = f"ours - {found.kind}" if scale.signed else f"|ours - {found.kind}|"
    text = f"{difference}, relative to the mean of {found.kind}, {mean:.4g}\N{NO-BREAK SPACE}W\N{NO-BREAK SPACE}m^-2"
    if agreement is not None and agreement["bias"] is not None:
        text += f"; bias {agreement['bias']:+.1%}, relative RMSE {agreement['relative_rmse']:.3f}"
    return np.concatenate([picture, legend(picture.shape[1], scale, text)])


def legend(width: int, scale: Scale, text: str) -> np.ndarray:
    """(h, width, 3) uint8: the colours of a scale, their numbers, and text, broken at spaces where it does not fit."""
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(_TEXT)
    lines = [""]
    for word in text.split(" "):     # not at those that hold a number and its unit together
        word = word.replace("\N{NO-BREAK SPACE}", " ")      # the font has no picture of it
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width - 2 * _MARGIN:
            lines.append(word)
        else:
            lines[-1] = longer
    height = 3 * _MARGIN + _BAR + round(1.3 * _TEXT) * (1 + len(lines))
    made = Image.new("RGB", (width, height), (24, 25, 28))
    inset = min(3 * _MARGIN, width // 4)
    place = np.linspace(0, 4, max(width - 2 * inset, 2))
    bar = np.stack([np.interp(place, range(5), [stop[c] for stop in scale.stops]) for c in range(3)], -1)
    made.paste(Image.fromarray(np.tile(np.round(bar * 255).astype(np.uint8), (_BAR, 1, 1))), (inset, _MARGIN))
    draw = ImageDraw.Draw(made)
    for index, value in enumerate(scale.values):
        number = f"{value:+.0%}" if scale.signed and value else f"{value:.0%}"
        x = inset + index * (width - 2 * inset) / 4
        draw.text((x, _MARGIN + _BAR + 3), number, (230, 232, 235), font, anchor="ma")
    for index, line in enumerate(lines):
        draw.text((_MARGIN, 2 * _MARGIN + _BAR + round(1.3 * _TEXT) * (1 + index)), line, (230, 232, 235), font)
    return np.asarray(made)
