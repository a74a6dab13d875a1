"""The `workbench` command: finds the verb, runs it, and turns errors into one line and an exit code.

0: success. 1: internal error (traceback). 2: invalid input, one line on stderr. 130: interrupted.

Shell completion (argcomplete): eval "$(register-python-argcomplete workbench)" in ~/.bashrc or ~/.zshrc.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import signal
import sys
import warnings
from collections.abc import Sequence
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import NoReturn

import workbench
from workbench.cli.defaults import apply_defaults
from workbench.cli.log import LOGGER, RunLog, speak_up
from workbench.cli.progress import forget_warnings, progress_mode, show_warnings

VERBS = (
    "demo", "new-robot", "inspect", "view", "simulate", "inverse-dynamics", "compare", "diagnose", "predict", "optimize", "trim",
    "drive", "export", "flash", "servos", "play", "record", "run", "bench", "doctor",
)


class OneLineParser(argparse.ArgumentParser):
    """Reports the error in one line; the usage is one `--help` away."""

    def error(self, message: str) -> NoReturn:
        """Ends with exit code 2 and one line on stderr."""
        text = " ".join(message.split())
        self.exit(2, f"{self.prog}: error: {text}{self._guess(text)} (see {self.prog} --help)\n")

    def _guess(self, message: str) -> str:
        """A guess at the verb or option that was meant by an unknown one."""
        options = [o for a in self._actions for o in a.option_strings if o.startswith("--")]
        for pattern, known in ((r"invalid choice: '([^']+)'", list(VERBS)), (r"unrecognized arguments: (--[\w-]+)", options)):
            found = re.search(pattern, message)
            near = get_close_matches(found.group(1), known, 1) if found else []
            if near:
                return f"; did you mean {near[0]}?"
        return ""


def make_parser() -> argparse.ArgumentParser:
    """The parser with every verb's arguments; imports no other package, so that --help is fast."""
    parser = OneLineParser(
        prog="workbench", description=(workbench.__doc__ or "").partition("\n")[0], allow_abbrev=False,
        epilog="`workbench VERB --help` explains each. Exit codes: 0 success, 1 internal error, 2 invalid input (one line: "
        "file, place, expected value), 130 interrupted. From Python: `import workbench`.")
    parser.add_argument("--version", action="version", version=f"workbench {workbench.__version__}")
    subparsers = parser.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=OneLineParser)
    for verb in VERBS:
        import_module(f"workbench.cli.{verb.replace('-', '_')}").add_parser(subparsers)
    for of in subparsers.choices.values():
        loudness = of.add_mutually_exclusive_group()
        loudness.add_argument("--quiet", action="store_true", help="no progress on stderr, only warnings and errors")
        loudness.add_argument("--verbose", action="store_true", help="each step on stderr, with its time")
    if "_ARGCOMPLETE" in os.environ:
        from argcomplete import autocomplete

        autocomplete(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one verb; `argv` without the program's name. Returns the exit code."""
    parser = make_parser()
    try:
        apply_defaults(_verbs(parser))
    except ValueError as e:
        return _report("workbench", e)
    args = _parse(parser, sys.argv[1:] if argv is None else list(argv))
    log, heard = RunLog(sys.argv[1:] if argv is None else argv), speak_up(args.verbose, args.quiet)
    LOGGER.addHandler(log)
    progress_mode(args.quiet, args.verbose)
    try:
        code = _run(args, alone=argv is None)
        log.write(args.out if isinstance(getattr(args, "out", None), Path) else None, code)
        return code
    finally:
        for handler in (log, heard):
            if handler is not None:
                LOGGER.removeHandler(handler)


def _run(args: argparse.Namespace, alone: bool) -> int:
    """Runs the verb. alone: whether this process does nothing else, so that libraries' warnings may be silenced."""
    logging.getLogger("drake").addFilter(_serious)  # the workbench reports what Drake warns about in a model
    previous = signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # so that clean-up code runs
    forget_warnings()
    if alone:  # matrices are small and rollouts run side by side: further threads would only wait for each other
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if alone and not sys.warnoptions:  # from libraries, meant for their developers
        warnings.simplefilter("ignore")
        os.environ["PYTHONWARNINGS"] = "ignore"  # in worker processes, too
    try:
        code: int = args.run(args)
        show_warnings()
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        again = "; call it again to continue from there" if args.verb == "diagnose" else ""
        print(f"\nworkbench {args.verb}: interrupted, nothing was written{again}", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever reads our output has closed the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MemoryError as e:
        print(f"workbench {args.verb}: error: out of memory ({' '.join(str(e).split()) or 'no more is free'})", file=sys.stderr)
        return 2
    except (OSError, ValueError) as e:
        return _report(f"workbench {args.verb}", e)
    finally:
        signal.signal(signal.SIGTERM, previous)


def _parse(parser: argparse.ArgumentParser, argv: list[str]) -> argparse.Namespace:
    """Arguments of a verb; `help` and `help VERB` are the same as --help. Each verb reports arguments that it does not know,
    with its options."""
    if argv[:1] == ["help"]:
        argv = [*argv[1:2], "--help"]
    args, unknown = parser.parse_known_args(argv)
    if unknown:
        _verbs(parser)[args.verb].error(f"unrecognized arguments: {' '.join(unknown)}")
    return args


def _verbs(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    of = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return dict(of.choices)


def _report(name: str, error: OSError | ValueError) -> int:
    """Reports in one line an error that the user can correct; raises internal errors again."""
    problem = _readable(error)
    if problem is None:
        raise error
    print(f"{name}: error: {problem}", file=sys.stderr)
    return 2


def _serious(record: logging.LogRecord) -> bool:
    return record.levelno > logging.ERROR  # Drake's parser logs its errors and raises them, too


def _readable(error: OSError | ValueError) -> str | None:
    """One line for an error that the user can correct; None for an internal error."""
    from workbench.files import InputError

    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename is not None else error.strerror
    return None


if __name__ == "__main__":
    sys.exit(main())
