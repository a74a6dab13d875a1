"""The `workbench` command: finds the verb, runs it, and turns what goes wrong into one line and an exit code.

0: done. 1: a defect of the workbench (traceback). 2: bad input, one line on stderr. 130: interrupted.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

import workbench
from workbench.cli.progress import forget_warnings, show_warnings

VERBS = (
    "demo", "inspect", "simulate", "inverse-dynamics", "compare", "diagnose", "predict", "optimize", "export", "flash",
    "servos", "play", "record", "run", "bench",
)


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one line; the usage is one `--help` away."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {' '.join(message.split())} (see {self.prog} --help)\n")


def make_parser() -> argparse.ArgumentParser:
    """The parser with every verb's arguments; imports no room, so that help comes at once."""
    parser = OneLineParser(prog="workbench", description=workbench.__doc__, allow_abbrev=False)
    parser.add_argument("--version", action="version", version=f"workbench {workbench.__version__}")
    subparsers = parser.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=OneLineParser)
    for verb in VERBS:
        import_module(f"workbench.cli.{verb.replace('-', '_')}").add_parser(subparsers)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one verb; `argv` without the program's name. Returns the exit code."""
    args = make_parser().parse_args(argv)
    logging.getLogger("drake").addFilter(_only_errors)  # what Drake warns of in a model is told by the workbench
    previous = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # cleans up on its way
    forget_warnings()
    if argv is None and not sys.warnoptions:  # of the libraries, to those who develop with them
        warnings.simplefilter("ignore")
        os.environ["PYTHONWARNINGS"] = "ignore"  # of worker processes, too
    try:
        code: int = args.run(args)
        show_warnings()
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print(f"\nworkbench {args.verb}: interrupted, nothing was written", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader of our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MemoryError as e:
        print(f"workbench {args.verb}: error: out of memory ({' '.join(str(e).split()) or 'no more is free'})", file=sys.stderr)
        return 2
    except (OSError, ValueError) as e:
        problem = _readable(e)
        if problem is None:
            raise
        print(f"workbench {args.verb}: error: {problem}", file=sys.stderr)
        return 2
    finally:
        signal.signal(signal.SIGTERM, previous)


def _only_errors(record: logging.LogRecord) -> bool:
    return record.levelno >= logging.ERROR


def _readable(error: OSError | ValueError) -> str | None:
    """One line for what the user can mend; None for what is a defect of ours."""
    from workbench.robot.errors import InputError

    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename is not None else error.strerror
    return None


if __name__ == "__main__":
    sys.exit(main())
