"""The command line: finds the command, runs it, and turns every failure into one line and an exit status.

Exit status: 0 done, 1 a fault of the program, 2 bad input or an unfit machine, 130 interrupted.
"""

from __future__ import annotations

import difflib
import errno
import importlib
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from ssil_viewer.commands.parser import Parser
from ssil_viewer.errors import UserError

COMMANDS = {
    "view": "open a window on a scene",
    "render": "render a scene to a .png, .exr or .npz file, without a window",
    "bench": "measure what each pass costs, under many settings",
    "tune": "find the settings with the least error for a time budget",
    "reproduce": "measure every claim of the talk, in one report",
    "compare": "measure the error against references and a path tracer",
    "info": "say what a scene file holds",
    "scenes": "list the built-in scenes",
}
_PROGRAM = "ssil-viewer"


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the program.

    Args:
        arguments: Words after the program's name; None takes them from the process.

    Returns:
        The exit status.
    """
    if arguments is None:
        _prepare_process()
        arguments = sys.argv[1:]
    debug = "--debug" in arguments
    try:
        try:
            status = _dispatch(list(arguments))
        except SystemExit as end:  # after --help, or told to end
            status = end.code
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    except BrokenPipeError:
        _give_up_stdout()   # the reader has gone, as `| head` does
        return 141  # 128 + SIGPIPE, which Windows does not name
    except UserError as error:
        return _complain(str(error), 2, debug)
    except OSError as error:
        if sys.platform == "win32" and error.errno == errno.EINVAL and error.filename is None:
            _give_up_stdout()   # how Windows says that the reader has gone
            return 141
        if error.errno != errno.ENOSPC or error.filename is not None:
            return _complain_of_fault(error, debug)
        _give_up_stdout()
        return _complain("no space left for what is printed", 2, debug)
    except MemoryError:
        return _complain("not enough memory, give a smaller --size or scene", 2, debug)
    except Exception as error:
        return _complain_of_fault(error, debug)


def _dispatch(arguments: list[str]) -> int:
    if arguments and arguments[0] in ("-h", "--help"):
        _top_parser().print_help()
        return 0
    if arguments and arguments[0] == "--version":
        from ssil_viewer import __version__

        print(f"{_PROGRAM} {__version__}")
        return 0
    name, rest = _split_command(arguments)
    command: ModuleType = importlib.import_module(f"ssil_viewer.commands.{name}")
    parser = Parser(f"{_PROGRAM} {name}", command.USAGE, COMMANDS[name].capitalize() + ".", command.EPILOG)
    command.add_flags(parser)
    parsed = parser.parse(rest)
    scene = getattr(parsed, "scene", None)
    if scene in COMMANDS and not Path(scene).exists():
        raise UserError(f"{scene} is a command, not a scene", "", f"begin with {_PROGRAM} {scene}")
    from ssil_viewer.commands import shared  # with NumPy, which what is above does without

    shared.take_picture(parsed)
    command.run(parsed)
    return 0


def _split_command(arguments: list[str]) -> tuple[str, list[str]]:
    """The command and its arguments; `ssil-viewer SCENE` means view."""
    words = [word for word in arguments if word != "--debug"]
    first = words[0] if words else "--"
    if first in COMMANDS:
        rest = list(arguments)
        rest.remove(first)
        return first, rest
    looks_like_scene = set(first) & set("./\\:") or Path(first).exists()
    if not first.startswith("-") and not looks_like_scene:
        near = difflib.get_close_matches(first, COMMANDS, 1)
        advice = f"did you mean {near[0]}?" if near else f"see {_PROGRAM} --help"
        raise UserError(f"no command or scene file is called {first!r}", "", advice)
    return "view", arguments


def _top_parser() -> Parser:
    listed = "\n".join(f"  {name:<9} {text}" for name, text in COMMANDS.items())
    epilog = (
        f"commands:\n{listed}\n\n"
        f"{_PROGRAM} COMMAND --help lists the flags of a command.\n"
        f"{_PROGRAM} SCENE is short for {_PROGRAM} view SCENE; write ./view for a file of that name."
    )
    usage = f"[SCENE] [flags]\n       {_PROGRAM} COMMAND [flags]"
    parser = Parser(_PROGRAM, usage, "A viewer of hierarchical screen-space indirect lighting.", epilog)
    parser.add_argument("--version", action="store_true", help="show the version and exit")
    return parser


def _prepare_process() -> None:
    """Lets odd file names be printed, and lets a polite kill clean up half-written files."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
            if sys.platform == "win32" and not stream.isatty():
                stream.reconfigure(encoding="utf-8")    # what reads JSON and TOML from a pipe expects
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))


def _give_up_stdout() -> None:
    """What is left to print goes nowhere: Python would complain about it again while closing down."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain_of_fault(error: Exception, debug: bool) -> int:
    reason = " ".join(str(error).split()) or "no message"
    advice = "please report it with the output of --debug"
    return _complain(f"internal error, {type(error).__name__}: {reason}, {advice}", 1, debug)


def _complain(message: str, status: int, debug: bool) -> int:
    if debug:
        traceback.print_exc()
    if sys.stderr is not None:
        print(f"{_PROGRAM}: error: {message}", file=sys.stderr)
    return status
