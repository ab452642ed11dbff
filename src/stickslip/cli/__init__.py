"""The command line: one file a verb. `VERBS` names them; nothing heavy is imported until a verb runs.

A verb's file has SUMMARY, ``arguments(parser)`` and ``run(args) -> int``. Exit codes: 0 done, 1 a simulation
ended early or a check failed, 2 bad input (one line on stderr), 130 interrupted.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import math
import os
import re
import sys
import warnings
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from stickslip.core import compile_notice, progress
from stickslip.core.code_approval import allow_code
from stickslip.core.errors import (
    BEYOND,
    InputError,
    Interrupted,
    ModelRemark,
    StickslipError,
    UnusedPlace,
    beyond,
    one_line,
    suggestion,
)
from stickslip.core.messages import Surface, shown_on
from stickslip.core.type_rules import LARGEST_WHOLE
from stickslip.verbs.kinds import require

VERBS = (
    "study", "sweep", "tune", "simulate", "learn", "identify", "doctor", "analyse", "compare", "recommend", "demo",
    "rig", "machine", "laws", "law", "figure", "cite", "rerun", "export", "web", "warm-up", "version"
)  # fmt: skip


CODE = (
    "study",
    "sweep",
    "tune",
    "simulate",
    "learn",
    "identify",
    "compare",
    "recommend",
    "cite",
    "rerun",
    "export",
    "machine",
)
"""Verbs that read TOML files with names of laws; `rig` and `analyse` have the option in their actions."""
WANTED: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "identify": {"model": ("model",)},
    "compare": {"first": ("model",), "second": ("model",)},
    "recommend": {"model": ("model",)},
    "sweep": {"sweep": ("sweep", "tuning")},
    "tune": {"tune": ("tuning", "sweep")},
    "simulate": {"file": ("simulation", "model")},
    "learn": {"file": ("simulation", "model")},
    "study": {"study": ("study",)},
    "export": {"file": ("model", "simulation", "map")},
    "rig": {"rig": ("rig", "machine", "model")},
    "machine": {"name": ("machine", "model")},
}
"""Kinds of files by verb and argument that the verb accepts or reports better itself; records are checked when they are
read."""


REMARKS = (ModelRemark, UnusedPlace)
"""Warnings that the command line prints in one line each."""
OPTION = re.compile(r"--([a-z][a-z-]*)")


class Parser(argparse.ArgumentParser):
    """An argument parser with one-line errors that accepts only representable numbers."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self.register("type", int, whole_number)
        self.register("type", float, real_number)

    def error(self, message: str) -> NoReturn:
        """Raise instead of printing the usage."""
        raise InputError(f"{message}; see `{self.prog} --help`")

    def parse_known_args(self, *args: Any, **named: Any) -> Any:
        """Parse; for an unknown option the error names the nearest one."""
        known, rest = super().parse_known_args(*args, **named)
        for word in rest:
            if word.startswith("--"):
                name, own = word.partition("=")[0].removeprefix("--"), OPTION.findall(self.format_usage())
                remedy = suggestion(name, own, f"see `{self.prog} --help`")
                near = re.sub("'(.*?)'", r"--\1", remedy)
                raise InputError(f"`{self.prog}` has no option --{name}; {near}")
        return known, rest


def whole_number(text: str) -> int:
    """Read an option of `type=int`.

    Raises
    ------
    ValueError
        If it is not a whole number.
    ArgumentTypeError
        If it is too large for a counter.
    """
    number = int(text)
    if abs(number) >= LARGEST_WHOLE:
        raise argparse.ArgumentTypeError(f"{text[:20]}... is too large; give a smaller number")
    return number


def real_number(text: str) -> float:
    """Read an option of `type=float`; ``inf`` is for options that allow it.

    Raises
    ------
    ValueError
        If it is not a number.
    ArgumentTypeError
        If it is NaN, or too large or too small to compute with.
    """
    number = float(text)
    digits = text.lower().partition("e")[0]
    if math.isnan(number):
        raise argparse.ArgumentTypeError(f"{text} is not a number; give one, or leave the option out")
    if math.isinf(number) and any(c.isdigit() for c in digits):
        raise argparse.ArgumentTypeError(f"{text[:40]} is too large; give a smaller number")
    if number == 0.0 and any(c in "123456789" for c in digits):
        raise argparse.ArgumentTypeError(
            f"{text[:40]} is too small to be distinguished from 0; give a larger number"
        )
    return number


@shown_on(Surface.COMMAND_LINE)
def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    _tolerate_any_terminal()
    _one_thread_for_algebra()
    notice = compile_notice.Notice(sys.stderr)
    if argv is None:
        _collect_seldom()
        if not sys.warnoptions:
            # NumPy's warnings are about numbers that are checked later; tests and python -W show them.
            warnings.filterwarnings("ignore", category=RuntimeWarning)
        compile_notice.listen(notice)
        progress.listen(_tell)
    given = list(sys.argv[1:] if argv is None else argv)
    try:
        return _dispatch(given)
    except InputError as error:
        return _complain(as_given(str(error), given), 2)
    except Interrupted as error:
        return _complain(error, 130)
    except StickslipError as error:
        return _complain(error, 1)
    except KeyboardInterrupt as stop:
        return _complain(f"interrupted; {stop}" if stop.args else "interrupted", 130)
    except BrokenPipeError:
        # The reader (`| head`) is gone; Python would report this again when it flushes at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except BEYOND as error:
        return _complain(as_given(str(beyond(error)), given), 2)
    finally:
        notice.close()


def _tell(line: str) -> None:
    """Print a line on stderr, above a progress bar if there is one."""
    line = one_line(line)
    if "tqdm" in sys.modules:
        sys.modules["tqdm"].tqdm.write(f"stickslip: {line}", file=sys.stderr)
    else:
        print(f"stickslip: {line}", file=sys.stderr, flush=True)


def _one_thread_for_algebra() -> None:
    """Use one thread for linear algebra: matrices are small, so threads would mostly wait for each other at full
    load."""
    if "numpy" not in sys.modules:
        for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            os.environ.setdefault(name, "1")


def _collect_seldom() -> None:
    """Collect garbage rarely: imports create many objects and little garbage, and checking after every 700 took 7 % of
    `identify`'s time."""
    gc.set_threshold(100_000, 20, 20)


def parser_of(names: Sequence[str] = VERBS) -> argparse.ArgumentParser:
    """Return the parser of some verbs; their modules are imported."""
    parser = Parser(
        prog="stickslip",
        description="Identify, simulate and compensate friction of servo axes, and export the result.",
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", title="verbs")
    for name in names:
        module = importlib.import_module(f"stickslip.cli.{name.replace('-', '_')}")
        sub = verbs.add_parser(name, help=module.SUMMARY, description=module.__doc__,
                               formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
        module.arguments(sub)
        if name in CODE:
            allow_code_argument(sub)
        sub.set_defaults(run=module.run)
    return parser


def allow_code_argument(parser: argparse.ArgumentParser) -> None:
    """Add the option that lets code named in a file run."""
    parser.add_argument(
        "--allow-code", action="store_true",
        help="run Python code named in the given files; its SHA-256 is remembered",
    )  # fmt: skip


def _dispatch(argv: list[str]) -> int:
    # Only the called verb is imported; all of them if help or an error lists them.
    if argv and not argv[0].startswith("-") and argv[0] not in VERBS:
        raise InputError(f"unknown verb {argv[0]!r}; {suggestion(argv[0], VERBS)}")
    if any("\0" in word for word in argv):
        raise InputError("an argument contains a NUL character, which no name or number has; remove it")
    if odd := next((word for word in argv if not is_unicode(word)), ""):
        raise InputError(f"the argument {odd!r} is not Unicode; rename the file or folder in UTF-8")
    if odd := next((word for word in argv if OPTION.match(word) and word.partition("=")[2] == "--"), ""):
        # argparse drops these two dashes and passes an empty list to the verb.
        raise InputError(f"{odd}: -- is not a value; give one, or leave the option out")
    parser = parser_of(argv[:1] if argv and argv[0] in VERBS else VERBS)
    try:
        args: Any = parser.parse_args(argv)
    except SystemExit as leaving:  # --help
        return int(leaving.code or 0)
    if args.version:
        from stickslip import __version__

        print(__version__)
        return 0
    if args.verb is None:
        raise InputError(f"no verb; choose from {', '.join(VERBS)}; see `stickslip --help`")
    _check_kinds(args)
    with allow_code(getattr(args, "allow_code", False), remember=True), _remarks():
        code: int = args.run(args)
    sys.stdout.flush()
    return code


def is_unicode(text: str) -> bool:
    """Return whether a text is valid Unicode for reports and models; file names may have arbitrary bytes."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _check_kinds(args: argparse.Namespace) -> None:
    """Refuse files of a kind that the verb of `args` does not accept.

    Raises
    ------
    InputError
    """
    for name, wanted in WANTED.get(args.verb, {}).items():
        if (path := getattr(args, name, None)) is not None:  # `rig list` has none
            require(path, *wanted)


@contextmanager
def _remarks() -> Generator[None]:
    """Print remarks on models and places on stderr, each once and in one line."""
    said: set[str] = set()
    with warnings.catch_warnings():
        for kind in REMARKS:
            warnings.simplefilter("always", kind)
        otherwise = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any) -> None:
            if not issubclass(category, REMARKS):
                otherwise(message, category, *rest)
            elif str(message) not in said:
                said.add(str(message))
                print(f"stickslip: note: {message}", file=sys.stderr)

        warnings.showwarning = show
        yield


def as_given(message: str, argv: Sequence[str]) -> str:
    """Return a message in which a value that was given by an option has the name of the option: ``--torque-constant
    -1``."""
    for option in {found[1] for word in argv if (found := OPTION.match(word))}:
        message = re.sub(rf"(?<![\w.-]){option.replace('-', '_')} = ", f"--{option} ", message)
    return message


def _complain(what: object, code: int) -> int:
    """Print a message as one line on stderr."""
    print(f"stickslip: {one_line(str(what))}", file=sys.stderr)
    return code


def _tolerate_any_terminal() -> None:
    """Print units like N·m even on a terminal without such characters."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
