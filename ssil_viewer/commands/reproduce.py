"""`ssil-viewer reproduce`: the talk's claims, measured, in one report."""

from __future__ import annotations

import argparse
import shlex
import sys
from dataclasses import replace
from typing import Any, Callable

from ssil_viewer import output
from ssil_viewer.commands import measuring, shared, values
from ssil_viewer.commands.parser import Parser
from ssil_viewer.settings import Settings, knobs

USAGE = "-o DIR [--quick] [--claims C1,C2,...] [flags]"
EPILOG = """\
Measures every claim of the talk on the built-in scenes and writes DIR/index.html, one page with all pictures, plots
and tables in it; DIR/data.json and the files beside it have the numbers. A former report in DIR is replaced, anything
else is not touched. --quick takes some minutes on software OpenGL.

  ssil-viewer reproduce -o report --quick
  ssil-viewer reproduce -o report --claims C3,C7

docs/reproduce.md has the rule behind each verdict. Plots take matplotlib, the path tracer of C11 Mitsuba."""
_SIZE, _QUICK_SIZE = (1280, 720), (640, 360)


def add_flags(parser: Parser) -> None:
    """What the command takes."""
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="the report's folder")
    parser.add_argument("--quick", action="store_true", help="a smaller image, fewer points, frames and seeds")
    parser.add_argument("--claims", metavar="C1,C2,...", help="measure these alone")
    parser.add_argument("--scene", metavar="FILE", help="also show this scene with C12, such as Sponza")
    parser.add_argument("--size", type=values.size, metavar="WxH",
                        help="pixels, default 1280x720, with --quick 640x360")
    parser.add_argument("--seed", type=values.whole("--seed", 0, 2**31 - 1), default=0, metavar="N",
                        help="fixes every random choice, default 0")


def run(args: argparse.Namespace) -> None:
    """Measures, and writes the report."""
    from ssil_viewer.reproduce import report
    from ssil_viewer.reproduce.claims import chosen
    from ssil_viewer.reproduce.machine import machine
    from ssil_viewer.reproduce.run import measure
    from ssil_viewer.reproduce.studio import RAW, Studio

    claims = chosen(args.claims)
    folder = output.check_folder(args.output, report.is_report)
    size = args.size or (_QUICK_SIZE if args.quick else _SIZE)
    studio = Studio(size, replace(RAW, seed=args.seed))
    try:
        # A bad scene ends the command now rather than after all other claims
        studio.aim(args.scene or "builtin:cornell")
        shared.warn(studio.renderer.scene.warnings)
        head = _head(args, size, machine(studio.renderer), studio.base)
        with measuring.progress_bar(in_pipes=True) as show:
            in_pipe = sys.stderr is None or not sys.stderr.isatty()
            results = measure(studio, claims, args.quick, args.scene, _claims_alone(show) if in_pipe else show)
    finally:
        studio.close()
    try:
        report.write(folder, head, results)
        measuring.say_written(folder / report.PAGE)
    finally:    # whatever becomes of the files
        for result in results:
            print(f"{result.claim.id:<4}{result.finding.verdict:<21}{result.finding.why}")


def _claims_alone(show: Callable[[str, float, float], None]) -> Callable[[str, float, float], None]:
    """Of what is done, the claim that it is for: a line each will do in a pipe."""
    begun: list[str] = []

    def tell(what: str, done: float, total: float) -> None:
        name = what.partition(":")[0]
        if name not in begun:
            begun.append(name)
        show(f"{name} ({begun.index(name) + 1} of {int(total)})", done, total)

    return tell


def _head(args: argparse.Namespace, size: tuple[int, int], machine: dict[str, Any], base: Settings) -> dict[str, Any]:
    effort = "quick: fewer points, frames and seeds" if args.quick else "full"
    flags = ["--quick"] if args.quick else []
    flags += [f"--size {size[0]}x{size[1]}"] if args.size else []
    flags += [f"--seed {args.seed}"] if args.seed else []
    flags += [f"--scene {shlex.quote(args.scene)}"] if args.scene else []
    every = {info.name: getattr(base, info.name) for info in knobs()}
    shown = ", ".join(f"{name} {({True: 'on', False: 'off'}[value] if isinstance(value, bool) else value)}"
                      for name, value in every.items())
    return {**machine, "size": f"{size[0]}x{size[1]}", "seed": args.seed, "effort": effort,
            **({"flags": " ".join(flags)} if flags else {}), "settings": f"but for what a claim says: {shown}"}
