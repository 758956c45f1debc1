"""Arguments → a command → an exit status; the one place where errors become messages."""

from __future__ import annotations

import argparse
import errno
import gc
import importlib.util
import os
import sys
import traceback
from collections.abc import Sequence

from mocca_robot.cli import (
    check,
    cite,
    compare,
    config_show,
    design,
    examples,
    export,
    info,
    manual,
    new,
    plan,
    register,
    rehearse,
    run,
    sequence,
    simulate,
    strength,
    study,
    view,
)
from mocca_robot.cli.console import Console
from mocca_robot.cli.exit_code import ExitCode
from mocca_robot.cli.spelling import Parser
from mocca_robot.cli.studio import command as studio
from mocca_robot.errors import MoccaError, NearlyTouching

BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Commands share their work out themselves; threads inside its small matrices would only wait for each other."""
YOUNG_OBJECTS = 20_000
"""New objects after which the garbage collector looks: imports make hundreds of thousands that stay, and with Python's
own 700 a small design spends a tenth of its time on looking."""
UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
"""A disk that fills up during the work, or a folder that is taken away: no error in the program."""
EPILOG = """exit status: 0 every verdict is positive; 1 a negative verdict, with its evidence; 2 unusable input;
70 an error in mocca-robot itself; 130 interrupted (Ctrl-C), what was finished is kept.
`mocca-robot COMMAND --help` says what a command does. With --json it prints one JSON object for scripts."""


def main(argv: Sequence[str] | None = None) -> int:
    """Return the exit status of one command; `argv` defaults to the arguments of the process.

    Argument errors leave by SystemExit with status 2, as argparse does.
    """
    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")  # read when numpy is first imported, which no command has done yet
    gc.set_threshold(YOUNG_OBJECTS, 20, 20)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="replace")  # '°' on a terminal that knows ASCII only
    args = build_parser().parse_args(argv)
    as_json = bool(getattr(args, "json", False))
    try:
        return int(args.run(args))
    except NearlyTouching as error:
        from mocca_robot.cli.mended_copy import advice

        return _failed(
            as_json, ExitCode.UNUSABLE, f"{error} {advice(error, args)}" if hasattr(args, "input") else str(error)
        )
    except MoccaError as error:
        return _failed(as_json, ExitCode.UNUSABLE, str(error))
    except KeyboardInterrupt:
        return _failed(as_json, ExitCode.INTERRUPTED, "Interrupted. Files that were finished are kept.")
    except OSError as error:
        if error.errno not in UNWRITABLE:
            return _internal(as_json, error)
        where = f"'{error.filename}'" if error.filename else "A file"
        return _failed(
            as_json,
            ExitCode.UNUSABLE,
            f"{where} cannot be written: {error.strerror}. Free space or name another folder.",
        )
    except Exception as error:
        return _internal(as_json, error)


def _internal(as_json: bool, error: Exception) -> int:
    traceback.print_exc()
    message = (
        f"This is an error in mocca-robot, not in your input ({type(error).__name__}: {error}). Please report it "
        "with the lines above, the command and its input, and the output of `mocca-robot info`."
    )
    return _failed(as_json, ExitCode.INTERNAL, message)


class _Version(argparse.Action):
    """Tells the version, and looks for it only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_given: object) -> None:
        """Print the version and leave."""
        sys.stdout.write(f"mocca-robot {info.own_version()}\n")
        parser.exit()


def build_parser() -> argparse.ArgumentParser:
    """Return the parser with every command that is installed."""
    parser = Parser(
        prog="mocca-robot",
        description="Cone joints for structures that stand without glue, screws or friction.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show program's version number and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for command in (
        new,
        examples,
        run,
        design,
        simulate,
        study,
        studio,
        view,
        check,
        strength,
        config_show,
        sequence,
        plan,
        register,
        rehearse,
        export,
        manual,
        info,
        cite,
    ):
        command.add(commands)
    if importlib.util.find_spec(compare.COMPARISON) is not None:
        compare.add(commands)
    if importlib.util.find_spec("mocca_robot.ur") is not None:
        from mocca_robot.cli.execute import register as register_robot

        register_robot(commands)
    return parser


def _failed(as_json: bool, status: ExitCode, message: str) -> int:
    sys.stderr.write(f"mocca-robot: {message}\n")
    return Console(as_json).finish(status, {"error": message})
