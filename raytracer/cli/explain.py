"""`rt explain`: tells what will be simulated, and why."""

from typing import Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.options import takes
from raytracer.cli.base.outputs import print_json

EXAMPLE = """\b
Example:
  rt explain scenes/cover.yaml
  rt explain scenes/cover.yaml -D camera.defocus_angle=0 --json
  rt explain portrait.yaml --circle 0.03mm
  rt explain scenes/cornell.yaml --all
"""


def explain(
    scene: options.Scene,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    circle: Annotated[
        str | None,
        takes("SIZE", "Blur at which the depth of field ends: 0.03mm, 2px; default: 1/1500 of the sensor's diagonal."),
    ] = None,
    every: Annotated[
        bool,
        Option(
            "--all",
            help="List also the effects that are left out, and every key of the scene, at any depth, with its meaning.",
        ),
    ] = False,
    as_json: options.AsJson = False,
) -> None:
    """Say what a scene's camera does, in numbers, and which effects the scene calls for, and why."""
    from raytracer.analysis.explain import explain as explained
    from raytracer.analysis.explain import parse_circle

    limit = None if circle is None else parse_circle(circle)
    explanation = explained(options.load_scene(scene, define, allow_files), circle=limit, every_key=every)
    if as_json:
        print_json(explanation.json())
    else:
        print(explanation.text(), end="")
