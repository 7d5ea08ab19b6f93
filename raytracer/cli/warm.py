"""`rt warm`: compiles the kernels of scenes, and renders nothing."""

import time
from typing import Annotated

from raytracer.cli.base import options

EXAMPLE = """\b
Example:
  rt warm scenes/*.yaml
  rt warm scenes/cover.yaml -D camera.defocus_angle=0
  rt warm scenes/cornell.yaml --aov depth,normal --denoise
"""


@options.render_options(
    "aovs",
    "denoise",
    aovs="AOVs that the renders will record; may repeat.  See docs/aovs.md.",
    denoise="The renders will be denoised.",
)
def warm(
    scenes: Annotated[list[str], options.scene_argument("Scene files.")],
    *,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    given: options.GivenOptions,
    quiet: options.Quiet = False,
) -> None:
    """Compile what renders of these scenes need, so that they begin at once: in CI, a container's image, or a cluster.

    Effects, `-D`, AOVs and denoising decide what is compiled; the size of the picture, spp, depth and seed do not.
    """
    from raytracer.core.compiler.cache import check_cache
    from raytracer.core.compiler.compile_progress import COMPILATION, watch_compilation
    from raytracer.rendering.progress import CompileBar
    from raytracer.rendering.render import prepare_scene

    check_cache()
    wanted = given.parse()
    for scene in scenes:
        spec = options.load_scene(scene, define, allow_files)
        compiled, began = COMPILATION.count, time.perf_counter()
        with CompileBar(quiet=quiet, announcement=None) as bar, watch_compilation(bar.show):
            prepare_scene(spec, wanted)
        took = f"compiled in {time.perf_counter() - began:.1f} s"
        if not quiet:
            print(f"{scene}: {took if COMPILATION.count > compiled else 'was in the cache'}", flush=True)
