"""`rt schema`: the JSON Schema of scene files."""

import typer

EXAMPLE = """\b
Example, for an editor with the YAML language server:
  rt schema > scene.schema.json
and as the first line of a scene:
  # yaml-language-server: $schema=scene.schema.json
"""


def schema() -> None:
    """Print the JSON Schema of scene files.

    It holds every key with its meaning, unit, range and default.
    """
    import json

    from raytracer.scene.schema import schema as scene_schema

    print(json.dumps(scene_schema(), indent=2, ensure_ascii=False, allow_nan=False))


def register(app: typer.Typer) -> None:
    """Add the command to `app`."""
    app.command(epilog=EXAMPLE)(schema)
