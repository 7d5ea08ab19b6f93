"""`rt schema`: the JSON Schema of scene files, and of lens files."""

from typing import Annotated

from typer import Option

EXAMPLE = """\b
Example, for an editor with the YAML language server:
  rt schema > scene.schema.json
and as the first line of a scene:
  # yaml-language-server: $schema=scene.schema.json
And for files of lenses:
  rt schema --lens > lens.schema.json
"""


def schema(lens: Annotated[bool, Option("--lens", help="That of lens files instead.")] = False) -> None:
    """Print the JSON Schema of scene files.

    It holds every key with its meaning, unit, range and default.
    """
    import json

    from raytracer.scene.json_schema import lens_schema, scene_schema

    print(json.dumps(lens_schema() if lens else scene_schema(), indent=2, ensure_ascii=False, allow_nan=False))
