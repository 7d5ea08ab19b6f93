"""The application `rt`: finds the commands, and turns every failure into one sentence and an exit status.

A command is a module of this package with a function of its name, and `EXAMPLE` for its help; or a group of commands
of its name.  It imports what it needs when it runs, so that `rt --help` answers at once.
"""

import contextlib
import gc
import importlib
import os
import pkgutil
import re
import sys
import time
import traceback
import warnings
from collections.abc import Sequence
from types import ModuleType
from typing import Annotated, Any, TextIO

import typer
from typer import Option
from typer.exceptions import TyperException

import raytracer.cli
from raytracer.cli.base.completion import VARIABLE, command_to_complete
from raytracer.cli.base.defaults import default_map
from raytracer.cli.base.optional_values import add_left_out_values
from raytracer.cli.base.options import Invocation
from raytracer.util.errors import InputError, Interrupted, OutputError, StrictError, one_line
from raytracer.util.signals import WATCH, defer_interrupt
from raytracer.util.terminal import YELLOW, paint, print_error

FAILED = 1
WRONG_INPUT = 2

# Typer's own answer to an interrupt.
_TYPERS_INTERRUPTED = 130

# What Numba takes from the folder that a program runs in, by all versions so far: files to write (`chrome_trace`) and
# modules to import (`cache_locator_classes`) among others, which may have come with the scene.
_SETTINGS_OF_THE_FOLDER = ".numba_config.yaml"


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"rt {raytracer.__version__}")
        raise typer.Exit


def options(
    version: Annotated[
        bool, Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Path tracer for scenes in YAML."""
    if os.path.lexists(_SETTINGS_OF_THE_FOLDER):
        raise InputError(
            f"{_SETTINGS_OF_THE_FOLDER}: Numba would obey this file of the current folder, down to files that it has "
            "written; run rt from another folder, or remove it and set its keys as variables NUMBA_..."
        )


def application(command: str | None = None) -> typer.Typer:
    """Make the application with all commands, or with one alone, which is named as its module is."""
    app = typer.Typer(
        name="rt",
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    )
    app.callback()(options)
    add_commands(app, raytracer.cli, command)
    return app


def add_commands(app: typer.Typer, package: ModuleType, command: str | None = None) -> None:
    """Add all commands of a package to `app`, or one alone; each is the function, or the group, named as its module."""
    names = [found.name for found in pkgutil.iter_modules(package.__path__) if found.name not in {"base", "main"}]
    for name in [command] if command in names else names:
        module = importlib.import_module(f"{package.__name__}.{name}")
        added, word = getattr(module, name), name.rstrip("_").replace("_", "-")
        if isinstance(added, typer.Typer):
            app.add_typer(added, name=word, short_help=_summarize(added.info.help))
        else:
            app.command(word, epilog=module.EXAMPLE, short_help=_summarize(added.__doc__))(added)


def _summarize(text: str | None) -> str:
    """Return the first sentence of a command's help, which Typer would cut to the width of a line."""
    return f"{re.split(r'[.:](?: |$)', ' '.join((text or '').split()))[0]}."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `rt` with `arguments` (default: those of the process).

    Returns the exit status: 0 done, 1 the thing checked for or the machine failed, 2 wrong usage or input; 130
    interrupted by Ctrl-C, 143 by SIGTERM.
    """
    if arguments is not None:
        return _run(arguments, time.perf_counter())
    WATCH.start()
    warnings.showwarning = _show_warning
    # The command began before what the process has worked so far.
    began = time.perf_counter() - time.process_time()
    sys.stderr = lasting = _FailsafeStream(sys.stderr)
    status = _run(None, began)
    with WATCH.on_first_signal(defer_interrupt):
        lasting.settle()
        if status == WATCH.status:
            # Without waiting for threads that still compile.
            with contextlib.suppress(OSError):
                sys.stdout.flush()
            WATCH.exit_now(status)
        # Keeps the interpreter from collecting all that the compiler has left, before it exits: 0.4 s.
        gc.freeze()
        return status


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Print a library's warning as the commands do, without the line of its source."""
    print(f"rt: warning: {one_line(str(message))}", file=sys.stderr)


_WARNING = "rt: warning:"


class _FailsafeStream:
    """A stream that ignores failures to write: no render ends because its progress cannot be shown.

    The terminal may be closed, the reader of a pipe gone, the disk of a log full.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write, if that is possible; a warning is yellow where there are colours."""
        begin = _WARNING if text.startswith(_WARNING) else ""
        with contextlib.suppress(OSError):
            self._stream.write((paint(begin, YELLOW, self._stream) if begin else "") + text.removeprefix(begin))
        return len(text)

    def flush(self) -> None:
        """Flush, if that is possible."""
        with contextlib.suppress(OSError):
            self._stream.flush()

    def settle(self) -> None:
        """Discard output that could not be written."""
        try:
            self._stream.flush()
        except OSError:
            _discard(self._stream)


def _discard(stream: TextIO) -> None:
    """Discard output that could not be written, so that the interpreter does not fail when it exits."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _run(arguments: Sequence[str] | None, began: float) -> int:
    """Run a command that has begun at a time of `time.perf_counter`."""
    call = Invocation(began, tuple(add_left_out_values(sys.argv[1:] if arguments is None else arguments)))
    try:
        # The other commands are not imported: a tenth of a second.
        app = application(next(iter(call.words), None) or command_to_complete(os.environ))
        if VARIABLE in os.environ:
            from typer.completion import completion_init  # type: ignore[attr-defined]

            completion_init()
        defaults = default_map(call.words, os.environ)
        status = app(call.words, prog_name="rt", standalone_mode=False, obj=call, default_map=defaults)
        if status == _TYPERS_INTERRUPTED:
            raise KeyboardInterrupt
        try:
            sys.stdout.flush()
        except OSError:
            _discard(sys.stdout)
            raise
    except TyperException as error:
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "rt"
        hint = _hint(call.words)
        return _fail(error.exit_code, f"{_plain(error.format_message())}{hint} (see '{command} --help')")
    except StrictError as error:
        return max(_fail(WRONG_INPUT, sentence) for sentence in error.sentences)
    except InputError as error:
        hint = _hint_of_spaces(call.words)
        return max(_fail(WRONG_INPUT, f"{one}{hint}") for one in (error, *getattr(error, "others", ())))
    except OutputError as error:
        return _fail(FAILED, str(error))
    except Interrupted:
        return WATCH.status
    except KeyboardInterrupt:
        return _fail(WATCH.status, "interrupted")
    except MemoryError:
        return _fail(FAILED, "out of memory", unexpected=True)
    except BrokenPipeError:
        # Whoever reads has seen enough; Typer says nothing either where a command finds that out.
        return FAILED
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        return _fail(FAILED, f"{place}{error.strerror or error}", unexpected=True)
    except Exception as error:  # noqa: BLE001
        return _fail(
            FAILED, f"internal error, {type(error).__name__}: {error} (RT_TRACEBACK=1 shows where)", unexpected=True
        )
    # A signal that did not end the command must still end a script that it is part of.
    return int(status or 0) if WATCH.signal_number is None else WATCH.status


_OTHER_OPTIONS = {
    "--samples": "--spp",
    "--resolution": "--size 640x360",
    "--out": "--output",
    "--jobs": "--threads",
    "--cores": "--threads",
}
"""Options here by options elsewhere."""


def _hint(words: Sequence[str]) -> str:
    """Tell what was probably meant by a command line that is wrong; empty if nothing comes to mind."""
    if words and words[0].endswith((".yaml", ".yml")):
        return f"; did you mean 'rt render {words[0]}'?"
    if len(words) > 1 and words[0] == "new" and words[1].endswith((".yaml", ".yml")):
        return f"; did you mean 'rt new thin_lens {words[1]}'?"
    if spaces := _hint_of_spaces(words):
        return spaces
    for word in words:
        if here := _OTHER_OPTIONS.get(word.partition("=")[0]):
            return f"; did you mean {here}?"
    return ""


def _hint_of_spaces(words: Sequence[str]) -> str:
    """Tell that the shell has parted a value, if it has; empty otherwise."""
    is_parted = any(word.count("[") > word.count("]") for word in words)
    return "; a value with spaces is quoted: -D 'camera.look_from=[1, 2, 3]'" if is_parted else ""


def _plain(message: str) -> str:
    """Turn a message of Typer, in the words of pydantic, into plain English."""
    message = message.rstrip(".").partition(", unable to parse")[0].replace("Input should be", "must be")
    message = message.replace(": Value error, ", ": ")
    return message.replace("a valid integer", "an integer").replace("a valid number", "a number")


def _fail(status: int, sentence: str, *, unexpected: bool = False) -> int:
    """Print an error, on one line."""
    if unexpected and os.environ.get("RT_TRACEBACK"):
        traceback.print_exc()
    print_error(one_line(sentence))
    return status
