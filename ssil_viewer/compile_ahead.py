"""Compiles the frame's programs in a second thread while the scene loads.

Mesa's software OpenGL, llvmpipe, compiles a program when it is first drawn with, on one core: two seconds for a frame,
in which the other cores wait. What it compiled it keeps in a cache on disk, where every context looks first. So a
second context, in a thread of its own, draws with the same programs, and the one that renders finds them there. Nothing
depends on it: a program that is not there in time is compiled as always.
"""

from __future__ import annotations

import os
import threading
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from typing import Iterable, Iterator, Sequence

import moderngl

from ssil_viewer.gpu.context import Capabilities, create_headless_context
from ssil_viewer.gpu.light_table import LightTable
from ssil_viewer.pass_runner import Frame, PassRunner
from ssil_viewer.passes import FRAME
from ssil_viewer.passes.base import Pass
from ssil_viewer.settings import Settings

# Sides are halved until they are below this: what is drawn does not matter, and costs nothing then
_LARGE = 256


@contextmanager
def compiling_ahead(capabilities: Capabilities, size: tuple[int, int], settings: Settings, *,
                    keep: Iterable[str] = (), passes: Sequence[type[Pass]] = FRAME) -> Iterator[None]:
    """Compile meanwhile, where OpenGL is llvmpipe with compute shaders and there is a second core; else do nothing.

    Args:
        capabilities: Of the context that will draw.
        size, settings, keep, passes: As of `pipeline.Renderer`.
    """
    if "llvmpipe" not in capabilities.renderer or not capabilities.compute or (os.cpu_count() or 1) < 2:
        yield
        return
    stop = threading.Event()
    thread = threading.Thread(target=_compile, name="compile-ahead",
                              args=(stop, same_programs_size(size), settings, tuple(keep), passes))
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()   # LLVM must not be at work when the process ends


def same_programs_size(size: tuple[int, int]) -> tuple[int, int]:
    """A small image size for which llvmpipe compiles what it does for this one.

    Its programs differ between textures whose sides are powers of two and others; halving both keeps that.
    """
    width, height = size
    while max(width, height) >= _LARGE and min(width, height) > 1:
        width, height = -(-width // 2), -(-height // 2)
    return width, height


def _compile(stop: threading.Event, size: tuple[int, int], settings: Settings, keep: tuple[str, ...],
             passes: Sequence[type[Pass]]) -> None:
    # Whatever fails here fails again where the frame is rendered, and is told there
    with suppress(Exception):
        context = create_headless_context()
        try:
            # Last comes what not every scene needs: whether anything is glossy is known when the scene is there
            for chosen in dict.fromkeys((replace(settings, glossy_samples=0), settings)):
                compile_programs(context, size, chosen, keep, passes, stop)
        finally:
            context.release()


@dataclass(kw_only=True)
class _UnlitFrame(Frame):
    lights: LightTable


def compile_programs(context: moderngl.Context, size: tuple[int, int], settings: Settings, keep: Iterable[str],
                     passes: Sequence[type[Pass]], stop: threading.Event) -> None:
    """Compile in this thread, on this context, until `stop`; other arguments as of `compiling_ahead`."""
    runner = PassRunner(context, passes, size, settings, keep=keep, timed=False)
    lights = LightTable(context)
    try:
        runner.compile_ahead(stop, _UnlitFrame(runner, settings, runner.radius, lights.textures, lights=lights))
    finally:
        lights.release()
        runner.release()
