"""The files that a render writes: a dry run, the picture so far, the final files, and a fallback for failures."""

import contextlib
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from raytracer.cli.base.checkpoints import ResumeInfo
from raytracer.util.errors import OutputError
from raytracer.util.signals import WATCH, temporary_path

if TYPE_CHECKING:
    from raytracer.film.image import Image
    from raytracer.rendering.session import Rendered


def join_paths(paths: Sequence[Path]) -> str:
    """Join the names of files for a sentence."""
    return ", ".join(map(str, paths))


def dry_run_save(image: "Image", outputs: Sequence[Path]) -> None:
    """Write files of the same formats as the outputs to a temporary folder, and remove them.

    It loads and compiles what saving needs.  If there is no space for it, it is skipped.
    """
    with contextlib.suppress(OSError, OutputError), temporary_path(Path(tempfile.mkdtemp())) as folder:
        for number, path in enumerate(outputs):
            image.save(folder / f"{number}{path.suffix}")


def save_picture_so_far(image: "Image", outputs: Sequence[Path], say: Callable[[str], object]) -> None:
    """Write the picture of an unfinished render to all outputs that are regular files."""
    from raytracer.util.atomic_write import is_special

    files = [path for path in outputs if not is_special(path)]
    for path in files:
        image.save(path)
    if files:
        say(f"{join_paths(files)} has the picture so far, of {image.samples} samples per pixel; the render goes on")


def write_outputs(
    rendered: "Rendered",
    outputs: Sequence[Path],
    stats: Path | None,
    resume: ResumeInfo,
    warn: Callable[[str], object],
) -> None:
    """Write all files of a finished render.

    Raises
    ------
    OutputError : some files cannot be written; the others are.  It says where the samples or a copy of the picture are.
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
