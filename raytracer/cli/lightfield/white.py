"""`rt lightfield white`: what a camera takes of something evenly bright."""

from pathlib import Path
from typing import Annotated

from raytracer.cli.base import options
from raytracer.cli.base.outputs import report_written
from raytracer.cli.lightfield import base

EXAMPLE = """\b
Examples:
  rt lightfield white scenes/lightfield/glass_wide.yaml -o white.lf    for rt lightfield devignette
  rt lightfield white scenes/lightfield/glass_wide.yaml -o white.exr   for rt lightfield decode --white
  rt lightfield white scenes/lightfield/glass_wide.yaml -D camera.f_number=4 -o white4.lf --spp 64
"""


@options.render_options("spp", "seed", "threads")
def white(
    scene: Annotated[str, options.scene_argument("Scene file, of a camera with microlenses or many views.")],
    *,
    output: Annotated[list[Path], options.output("OUT", "Light field, .lf, or raw picture.  May repeat.")],
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    size: options.Size = None,
    scale: options.Scale = None,
    given: options.GivenOptions,
    quiet: options.Quiet = False,
) -> None:
    """Render the white picture of a scene's camera: the same lens, focus and microlenses, and white all around.

    With the seed and the spp of the scene's own picture both take the same rays, so that dividing adds no noise.
    """
    from raytracer.film.light_field.lf import SUFFIX

    wanted = given.parse()
    spec = options.load_scene(scene, define, allow_files, options.parse_sizing(size, scale))
    base.check_outputs(output, (*base.picture_suffixes(), SUFFIX), "a white picture")

    from raytracer.lightfield.devignetting import white_scene
    from raytracer.rendering.progress import SampleBar
    from raytracer.rendering.render import render

    with options.name_in_errors(scene):
        of_white = white_scene(spec)
    with SampleBar(quiet=quiet) as bar:
        image = render(of_white, progress=bar.show, **wanted.as_keywords()).image
    for path in output:
        image.save(path)
    report_written(*output, quiet=quiet)
