"""`rt completion`: prints what makes a shell complete command lines of rt."""

from typing import Annotated, Literal

from typer import Argument

from raytracer.cli.base.completion import VARIABLE

EXAMPLE = """\b
Examples:
  eval "$(rt completion bash)"                                     in ~/.bashrc
  eval "$(rt completion zsh)"                                      in ~/.zshrc, after compinit
  rt completion fish > ~/.config/fish/completions/rt.fish          once
"""


def completion(
    shell: Annotated[Literal["bash", "zsh", "fish"], Argument(metavar="SHELL", help="bash, zsh or fish.")],
) -> None:
    """Print the script by which a shell completes commands, options, scene files and values with the Tab key.

    The script asks rt itself, so it stays the same with a new version of rt.
    """
    from typer.completion import get_completion_script  # type: ignore[attr-defined]

    print(get_completion_script(prog_name="rt", complete_var=VARIABLE, shell=shell))
