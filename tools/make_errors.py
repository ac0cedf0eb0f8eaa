"""Measures the built-in scenes anew and writes tests/render/errors.toml, the errors that tests hold the picture to.

    .venv/bin/python tools/make_errors.py            # all scenes, less than a minute on two cores
    .venv/bin/python tools/make_errors.py cornell    # this scene again, the others as they are

Run it when an error has changed on purpose, and look at the differences before they are kept.
Needs `pip install '.[test]'`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from ssil_viewer import output  # noqa: E402
from ssil_viewer.gpu.context import create_headless_context  # noqa: E402
from tests import error_table  # noqa: E402


def main() -> None:
    """Measures and writes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", choices=[*error_table.SCENES, []], help="default: all")
    names = parser.parse_args().scenes or error_table.SCENES
    table = error_table.read_table() if error_table.TABLE.exists() else {}
    context = create_headless_context()
    for name in names:
        print(f"{name} ...", file=sys.stderr, flush=True)
        table[name] = error_table.measure(context, name)
    output.write_text(error_table.TABLE, error_table.to_toml({name: table[name] for name in error_table.SCENES}))


if __name__ == "__main__":
    main()
