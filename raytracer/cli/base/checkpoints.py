"""The options `--checkpoint` and `--resume`: where samples are kept, and the command that goes on from them."""

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from raytracer.cli.base.options import parse_value
from raytracer.schema.units import parse_duration
from raytracer.util.errors import InputError

if TYPE_CHECKING:
    from raytracer.rendering.checkpoint import CheckpointInfo, CheckpointWriter


def parse_checkpoint_interval(text: str | None) -> float | None:
    """Parse the seconds between checkpoints from `--checkpoint TIME|off`; None for no checkpoints.

    Raises
    ------
    InputError : it is no time.
    """
    from raytracer.rendering.checkpoint import DEFAULT_INTERVAL

    if text is None:
        return DEFAULT_INTERVAL
    return None if text == "off" else parse_value("--checkpoint", text, parse_duration)


def find_checkpoint_path(outputs: Sequence[Path], *, is_required: bool, warn: Callable[[str], object]) -> Path | None:
    """Return the path of the checkpoint, beside the first output that is a regular file.

    Parameters
    ----------
    is_required : fail if there can be no checkpoint; otherwise warn if it cannot be written.

    Returns
    -------
    None : all outputs are devices or pipes, or the checkpoint cannot be written.

    Raises
    ------
    InputError : there can be no checkpoint, and it is required.
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
