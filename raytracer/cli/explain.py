"""`rt explain`: tells what will be simulated, and why."""

from typing import Annotated

import typer

from raytracer.cli.base import options

EXAMPLE = """\b
Example:
  rt explain scenes/cover.yaml
  rt explain scenes/cover.yaml -D camera.defocus_angle=0 --json
  rt explain portrait.yaml --circle 0.03mm
  rt explain scenes/cornell.yaml --all
"""


def explain(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="Scene file.")],
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    circle: Annotated[
        str | None,
        typer.Option(
            metavar="SIZE",
            help="Blur at which the depth of field ends: 0.03mm, 2px; default: 1/1500 of the sensor's diagonal.",
        ),
    ] = None,
    every: Annotated[
        bool,
        typer.Option("--all", help="List every key of the scene too, at any depth: its value, and what it means."),
    ] = False,
    as_json: options.AsJson = False,
) -> None:
    """Say which effects a scene calls for and which not, and what its camera does, in numbers."""
    from raytracer.analysis.explain import explain as explained
    from raytracer.analysis.explain import parse_circle
    from raytracer.scene.load import load
    from raytracer.scene.overrides import parse_overrides

    limit = None if circle is None else parse_circle(circle)
    spec = load(scene, parse_overrides(define or []), allow_files=allow_files or [])
    explanation = explained(spec, circle=limit, every_key=every)
    if as_json:
        import json

        print(json.dumps(explanation.json(), indent=2, allow_nan=False))
    else:
        print(explanation.text(), end="")


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog=EXAMPLE)(explain)
