"""Reference R3: Mitsuba 3, run in a process of its own."""

from __future__ import annotations

import functools
import importlib.util
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Callable

import numpy as np

from ssil_viewer.errors import pip_install
from ssil_viewer.reference.mitsuba_export import Description
from ssil_viewer.reference.mitsuba_job import ImageTask, IrradianceTask, Job

VARIANTS = ("llvm_ad_rgb", "scalar_rgb")
"""In order of preference: the first is several times as fast, and needs a libLLVM that it likes."""

_WORKER = "ssil_viewer.reference.mitsuba_worker"
_TRIAL_SECONDS = 120


class ReferenceFailure(Exception):
    """A reference cannot be made; the message is one clause that says why and what helps."""


def has_mitsuba() -> bool:
    """Whether Mitsuba is installed; nothing of it is imported."""
    return importlib.util.find_spec("mitsuba") is not None


@functools.cache
def working_variant() -> str:
    """The first variant that renders on this machine.

    Raises:
        ReferenceFailure: None does, or Mitsuba is missing.
    """
    if not has_mitsuba():
        raise ReferenceFailure("Mitsuba is not installed: " + pip_install("reference"))
    reason = ""
    for variant in VARIANTS:
        try:
            done = subprocess.run(_command(variant), env=_environment(), capture_output=True, text=True,
                                  errors="replace", timeout=_TRIAL_SECONDS)
        except subprocess.TimeoutExpired:
            reason = f"no image after {_TRIAL_SECONDS} s"
            continue
        if done.returncode == 0:
            return variant
        reason = _cause(done.returncode, done.stderr)
    raise ReferenceFailure(f"Mitsuba does not work here ({reason}): reinstall the package mitsuba")


def path_trace(description: Description, tasks: list[ImageTask | IrradianceTask],
               progress: Callable[[str, float], None] = lambda name, share: None,
               variant: str | None = None) -> dict[str, dict[str, np.ndarray]]:
    """Does tasks in Mitsuba's process.

    Args:
        progress: Hears the name of a task and the share of it that is done.

    Returns:
        Task -> name -> array; see `mitsuba_worker.render_image` and `gather_irradiance`.

    Raises:
        ReferenceFailure: Mitsuba is missing, or died; what was done before is lost.
    """
    variant = variant or working_variant()
    with tempfile.TemporaryDirectory(prefix="ssil-viewer-") as name:
        folder = Path(name)
        with (folder / "job.pickle").open("wb") as file:
            pickle.dump(Job(description, tuple(tasks)), file, pickle.HIGHEST_PROTOCOL)
        with (folder / "errors.txt").open("w+b") as errors:
            process = subprocess.Popen([*_command(variant), name], env=_environment(), stdout=subprocess.PIPE,
                                       stderr=errors, text=True, errors="replace")
            try:
                for line in process.stdout:
                    words = line.split()
                    if len(words) == 3 and words[0] == "progress":
                        progress(words[1], float(words[2]))
                status = process.wait()
            finally:
                if process.poll() is None:
                    process.kill()
                    process.wait()
                process.stdout.close()
            errors.seek(0)
            said = errors.read().decode(errors="replace")
        missing = [task.name for task in tasks if not (folder / f"{task.name}.npz").exists()]
        # All results there, an exit status is a fault in closing down, which is none of ours
        if missing:
            raise ReferenceFailure(f"Mitsuba ended before it was done ({_cause(status, said)})")
        found = {}
        for task in tasks:
            with np.load(folder / f"{task.name}.npz") as arrays:
                found[task.name] = {key: arrays[key] for key in arrays.files}
        return found


def _command(variant: str) -> list[str]:
    return [sys.executable, "-m", _WORKER, variant]


def _environment() -> dict[str, str]:
    """This process's environment, in which the child finds the same package."""
    root = str(Path(__file__).resolve().parents[2])
    paths = [root, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths)}


def _cause(status: int, said: str) -> str:
    """One clause on why a process ended."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    if status < 0:
        try:
            name = signal.Signals(-status).name
        except ValueError:
            name = f"signal {-status}"
        first = next((line for line in lines if "error" in line.lower()), "")
        return f"{name}: {first[:120]}" if first else name
    return lines[-1][:160] if lines else f"exit status {status}"
