"""`rt`: finds the commands, and turns every way to fail into one sentence and an exit status.

A command is a module of this package with `register(app)`, which adds it to the Typer app.  It imports what it needs
when it runs, so that `rt --help` answers at once.
"""

import gc
import importlib
import os
import pkgutil
import sys
import time
import traceback
from collections.abc import Sequence
from typing import Annotated

import typer
from typer.exceptions import TyperException

import raytracer.cli
from raytracer.errors import InputError, Interrupted, OutputError, StrictError, one_line

FAILED = 1
WRONG_INPUT = 2
INTERRUPTED = 130

app = typer.Typer(
    name="rt",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"rt {raytracer.__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Path tracer for scenes in YAML."""


for _module in pkgutil.iter_modules(raytracer.cli.__path__):
    if _module.name not in {"main", "options"}:
        importlib.import_module(f"raytracer.cli.{_module.name}").register(app)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `rt` with `arguments` (default: those of the process).

    Returns
    -------
    Exit status: 0 done, 1 the thing checked for or the machine failed, 2 wrong usage or input, 130 interrupted.
    """
    is_process = arguments is None
    # When the command began: as a process, before what that has worked so far.
    began = time.perf_counter() - (time.process_time() if is_process else 0.0)
    try:
        status = app(arguments, prog_name="rt", standalone_mode=False, obj=began)
        if status == INTERRUPTED:
            # Typer's own answer to an interrupt.
            raise KeyboardInterrupt
        sys.stdout.flush()
    except TyperException as error:
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "rt"
        return _fail(error.exit_code, f"{_plain(error.format_message())} (see '{command} --help')")
    except StrictError as error:
        return max(_fail(WRONG_INPUT, sentence) for sentence in error.sentences)
    except InputError as error:
        return _fail(WRONG_INPUT, str(error))
    except OutputError as error:
        return _fail(FAILED, str(error))
    except Interrupted:
        return INTERRUPTED
    except KeyboardInterrupt:
        return _fail(INTERRUPTED, "interrupted")
    except MemoryError:
        return _fail(FAILED, "out of memory", unexpected=True)
    except OSError as error:
        return _fail(FAILED, _system_error(error), unexpected=True)
    except Exception as error:  # noqa: BLE001
        return _fail(
            FAILED, f"internal error, {type(error).__name__}: {error} (RT_TRACEBACK=1 shows where)", unexpected=True
        )
    finally:
        if is_process:
            # Lest the interpreter look through all that the compiler has left, before it ends: 0.4 s.
            gc.freeze()
    return int(status or 0)


def _plain(message: str) -> str:
    """A message of Typer's, which checks numbers by pydantic and speaks as that does."""
    message = message.rstrip(".").partition(", unable to parse")[0].replace("Input should be", "must be")
    message = message.replace(": Value error, ", ": ")
    return message.replace("a valid integer", "a whole number").replace("a valid number", "a number")


def _system_error(error: OSError) -> str:
    reason = error.strerror or str(error)
    return f"{error.filename}: {reason}" if error.filename else reason


def _fail(status: int, sentence: str, *, unexpected: bool = False) -> int:
    """Say what went wrong, on one line."""
    if unexpected and os.environ.get("RT_TRACEBACK"):
        traceback.print_exc()
    print(f"rt: {one_line(sentence)}", file=sys.stderr)
    return status
