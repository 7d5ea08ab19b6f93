"""Options of commands that are made of the fields of `RenderOptions`."""

import inspect

import typer
from typer.testing import CliRunner

from raytracer.cli.base import options
from raytracer.rendering.options import OPTIONS, RenderOptions


def _ask(*names: str, words: list[str], **texts: str) -> tuple[RenderOptions, str]:
    """Return what a command with these options is given, and its help."""
    given_options = []

    @options.render_options(*names, **texts)
    def command(scene: str, *, given: options.GivenOptions, last: bool = False) -> None:
        """Do nothing."""
        given_options.append(given)

    app = typer.Typer(rich_markup_mode=None, add_completion=False)
    app.command()(command)
    result = CliRunner().invoke(app, ["scene.yaml", *words])
    assert result.exit_code == 0, result.output
    return given_options[0].parse(), CliRunner().invoke(app, ["--help"], terminal_width=200).output


def test_every_field_is_an_option() -> None:
    words = "--spp 5 --seed 7 --threads 2 --crop 0,0,4,4 --noise 2% --time-limit 1min --aov depth,normal --aov albedo"
    found, text = _ask(*OPTIONS, words=[*words.split(), "--denoise", "--strict", "--max-memory", "2GB"])
    assert found == RenderOptions(
        spp=5,
        seed=7,
        threads=2,
        crop=(0, 0, 4, 4),
        noise=0.02,
        time_limit=60.0,
        aovs=("depth", "normal", "albedo"),
        denoise=True,
        strict=True,
        max_memory=2 * 10**9,
    )
    for option in OPTIONS.values():
        assert " ".join(option.help.split()[:4]) in " ".join(text.split())


def test_options_that_are_not_given_are_the_defaults() -> None:
    assert _ask(*OPTIONS, words=[])[0] == RenderOptions()


def test_a_command_has_the_options_that_it_names_where_they_stand() -> None:
    @options.render_options("seed", "strict", strict="Only here.")
    def command(scene: str, *, given: options.GivenOptions, last: bool = False) -> None: ...

    assert list(inspect.signature(command).parameters) == ["scene", "seed", "strict", "last"]
    text = _ask("seed", "strict", words=[], strict="Only here.")[1]
    assert "Only here." in text
    assert OPTIONS["strict"].help[:20] not in text
    assert "--spp" not in text
