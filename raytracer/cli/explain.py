"""`rt explain`: what will be simulated, and why."""

from typing import Annotated

import typer

EXAMPLE = """\b
Example:
  rt explain scenes/cover.yaml
  rt explain scenes/cover.yaml -D camera.defocus_angle=0 --json
"""


def explain(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="Scene file.")],
    define: Annotated[
        list[str] | None, typer.Option("--define", "-D", metavar="KEY=VALUE", help="Override a key of the scene.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say which effects a scene calls for and which not, and the camera's derived numbers."""
    from raytracer.explanation import explain as explained
    from raytracer.scene.load import load, parse_overrides

    explanation = explained(load(scene, parse_overrides(define or [])))
    if as_json:
        import json

        print(json.dumps(explanation.json(), indent=2, allow_nan=False))
    else:
        print(explanation.text(), end="")


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog=EXAMPLE)(explain)
