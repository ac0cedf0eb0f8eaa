"""Where a report was made, without names of machines and without dates."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import Any

import numpy as np

from ssil_viewer.measure.bench import describe
from ssil_viewer.pipeline import Renderer


def machine(renderer: Renderer) -> dict[str, Any]:
    """Program, OpenGL, clock, processor and system: what a reader needs to judge times."""
    found = describe(renderer)
    return {**{name: found[name] for name in ("program", "renderer", "vendor", "version", "stage", "timer", "clock")},
            "processor": _processor(), "cores": os.cpu_count(), "system": f"{platform.system()} {platform.release()}",
            "python": platform.python_version(), "numpy": np.__version__}


def _processor() -> str:
    """The processor's name; Linux tells it in a file alone."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
