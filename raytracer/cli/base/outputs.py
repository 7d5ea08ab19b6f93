"""Outputs of commands: sentences, JSON, and the files of a render, with its checkpoint and a fallback for failures."""

import contextlib
import json
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from raytracer.cli.base.options import parse_value
from raytracer.schema.units import parse_duration
from raytracer.util.errors import InputError, OutputError
from raytracer.util.signals import WATCH, temporary_path

if TYPE_CHECKING:
    from raytracer.film.image import Image
    from raytracer.rendering.checkpoint import CheckpointInfo, CheckpointWriter
    from raytracer.rendering.session import Rendered


def say(sentence: str) -> None:
    """Print a sentence about what the command does on stderr."""
    print(f"rt: {sentence}", file=sys.stderr)


def warn(sentence: str) -> None:
    """Print a warning on stderr."""
    say(f"warning: {sentence}")


def to_json(data: Any, *, ensure_ascii: bool = True) -> str:
    """Write data as lines of JSON."""
    return json.dumps(data, indent=2, allow_nan=False, ensure_ascii=ensure_ascii) + "\n"


def print_json(data: Any, *, ensure_ascii: bool = True) -> None:
    """Print the result that `--json` asks for."""
    print(to_json(data, ensure_ascii=ensure_ascii), end="")


def check_files(paths: Iterable[Path]) -> None:
    """Check that files can be written before the work, not after."""
    from raytracer.util.atomic_write import check_file

    for path in paths:
        check_file(path)


def report_written(*paths: Path, quiet: bool) -> None:
    """Say which files were written, a line each."""
    for path in () if quiet else paths:
        print(f"wrote {path}", file=sys.stderr)


def report_faults(faults: Iterable[str], *, strict: bool) -> None:
    """Say what is wrong with a picture; if `strict`, the first fault is an OutputError."""
    for fault in faults:
        if strict:
            raise OutputError(fault)
        say(fault)


# ---- Checkpoints


def parse_checkpoint_interval(text: str | None) -> float | None:
    """Parse the seconds between checkpoints from `--checkpoint TIME|off`; None for no checkpoints."""
    from raytracer.rendering.checkpoint import DEFAULT_INTERVAL

    if text is None:
        return DEFAULT_INTERVAL
    return None if text == "off" else parse_value("--checkpoint", text, parse_duration)


def find_checkpoint_path(outputs: Sequence[Path], *, is_required: bool, warn: Callable[[str], object]) -> Path | None:
    """Return the path of the checkpoint, beside the first output that is a regular file; None if there can be none.

    is_required : raise an InputError then; otherwise `warn` if it cannot be written.
    """
    from raytracer.rendering.checkpoint import checkpoint_path
    from raytracer.util.atomic_write import check_file, is_special

    files = [path for path in outputs if not is_special(path)]
    if not files:
        if is_required:
            raise InputError(f"a checkpoint lies beside the picture, and {outputs[0]} is no file: add -o NAME.png")
        return None
    path = checkpoint_path(files[0])
    try:
        check_file(path)
    except InputError as error:
        if is_required:
            raise
        warn(f"{error}; the render's samples are not kept")
        return None
    return path


def resume_command(words: Sequence[str]) -> str:
    """Return the command line that resumes the one with these words after `rt`."""
    return shlex.join(["rt", *(word for word in words if word != "--resume"), "--resume"])


class ResumeInfo(NamedTuple):
    """The checkpoint of a render, and the command that resumes from it.

    writer : of the checkpoint.
    words : of the command line that rendered, after `rt`.
    """

    writer: "CheckpointWriter"
    words: Sequence[str]

    @property
    def checkpoint(self) -> "CheckpointInfo | None":
        """Contents of the checkpoint; None if none was written, or its folder is gone."""
        info = self.writer.info
        return info if info is not None and info.path.is_file() else None

    def command(self) -> str:
        """Return the command line that resumes the render."""
        return resume_command(self.words)


# ---- The files of a render


def join_paths(paths: Sequence[Path]) -> str:
    """Join the names of files for a sentence."""
    return ", ".join(map(str, paths))


def dry_run_save(image: "Image", outputs: Sequence[Path]) -> None:
    """Write files of the same formats as the outputs to a temporary folder, and remove them.

    It loads and compiles what saving needs.  If there is no space for it, it is skipped.
    """
    with contextlib.suppress(OSError, OutputError), temporary_path(Path(tempfile.mkdtemp())) as folder:
        for number, path in enumerate(outputs):
            # A device, and standard output, get a .png file's bytes.
            image.save(folder / f"{number}{path.suffix or '.png'}")


def save_picture_so_far(image: "Image", outputs: Sequence[Path], say: Callable[[str], object]) -> None:
    """Write the picture of an unfinished render to all outputs that are regular files."""
    from raytracer.util.atomic_write import is_special

    files = [path for path in outputs if not is_special(path)]
    for path in files:
        image.save(path)
    if files:
        say(f"{join_paths(files)} has the picture so far, of {image.samples} samples per pixel; the render goes on")


def write_outputs(
    rendered: "Rendered", outputs: Sequence[Path], stats: Path | None, resume: ResumeInfo, warn: Callable[[str], object]
) -> None:
    """Write all files of a finished render.

    Raises OutputError: some files cannot be written; the others are.  It says where the samples or a copy are.
    """
    from concurrent.futures import ThreadPoolExecutor

    from raytracer.util.atomic_write import write_bytes, write_with_retries

    tasks: dict[Path, Callable[[], object]] = {path: partial(rendered.image.save, path) for path in outputs}
    if stats is not None:
        text = json.dumps(rendered.stats.json(), indent=2) + "\n"
        tasks[stats] = partial(write_bytes, stats, text.encode())
    # What encodes a picture mostly leaves the interpreter to others.
    with ThreadPoolExecutor(len(tasks), "writer") as pool:
        failures = write_with_retries(tasks, warn, lambda: WATCH.signal_number is not None, pool)
    if failures:
        raise OutputError(_describe_failures(rendered, outputs, failures, resume))


def _describe_failures(
    rendered: "Rendered", outputs: Sequence[Path], failures: Mapping[Path, Exception], resume: ResumeInfo
) -> str:
    """Say which files could not be written; save the picture elsewhere if the checkpoint does not hold it all."""
    from raytracer.core.embree import PACKET

    sentence = str(next(iter(failures.values())))
    if len(failures) > 1:
        sentence += f"; nor can {join_paths(list(failures)[1:])}"
    checkpoint = resume.checkpoint
    is_whole = checkpoint is not None and checkpoint.samples > rendered.fewest_samples - PACKET
    if checkpoint is not None:
        has = "the samples" if is_whole else f"{checkpoint.samples} samples per pixel"
        sentence += f"; {checkpoint.path} has {has}, and this writes the rest: {resume.command()}"
    if not is_whole and (copies := _save_to_temp(rendered.image, [path for path in outputs if path in failures])):
        sentence += f"; instead, there is {join_paths(copies)}"
    return sentence


def _save_to_temp(image: "Image", outputs: Sequence[Path]) -> list[Path]:
    """Save a picture to a new folder among the system's temporary files, and return the files that had space."""
    copies: list[Path] = []
    with contextlib.suppress(OSError, OutputError):
        folder = Path(tempfile.mkdtemp(prefix="rt-"))
        for path in outputs:
            # A device may have no suffix, and gets a .png file's bytes.
            file = folder / (path.name if path.suffix else f"{path.name}.png")
            image.save(file)
            copies.append(file)
    return copies
