"""`rt view`: a scene in the browser while it renders, and while its file is edited."""

from pathlib import Path
from typing import Annotated

from typer import Option

from raytracer.cli.base import options
from raytracer.cli.base.outputs import say
from raytracer.util.errors import InputError
from raytracer.util.signals import WATCH, defer_interrupt

EXAMPLE = """\b
Examples:
  rt view scenes/cover.yaml
  rt view scenes/cover.yaml --aov depth,normal
  rt view scenes/cornell.yaml --noise 2% -o cornell.exr
  rt view scenes/cover.yaml --no-open --port 8123

\b
The page is for this machine alone, and for who has its address.  The picture is that of rt render; see docs/live.md.
"""

_POLL_SECONDS = 0.1


@options.render_options("spp", "seed", "threads", "noise", "aovs", "max_memory")
def view(
    scene: options.Scene,
    *,
    output: Annotated[
        list[Path] | None,
        options.output("FILE", "What `Save` writes; may repeat.  Default: outputs/<scene>.png."),
    ] = None,
    define: options.Define = None,
    allow_files: options.AllowFiles = None,
    given: options.GivenOptions,
    port: Annotated[int, Option(help="Port of the page.  Default: one that is free.", min=0, max=65535)] = 0,
    no_open: Annotated[bool, Option("--no-open", help="Only print the address, and open no browser.")] = False,
) -> None:
    """Show a scene in the browser while it renders, and anew at each edit of its file.

    It ends with Ctrl-C.
    """
    outputs = output or [Path("outputs") / f"{Path(scene).stem}.png"]
    wanted = given.parse()

    from raytracer.film.image_file import check_writable
    from raytracer.live.scene_file import SceneFile
    from raytracer.live.view import LiveView
    from raytracer.scene.overrides import parse_overrides

    if not Path(scene).is_file():
        options.load_scene(scene, define, allow_files)
    for path in outputs:
        check_writable(path)
    file = SceneFile(scene, parse_overrides(define or []), allow_files or [])
    with WATCH.on_first_signal(defer_interrupt), LiveView(file, wanted, outputs) as live:
        # The first picture is on its way meanwhile.
        try:
            from raytracer.live.server import LiveServer
        except ImportError:
            raise InputError("rt view needs aiohttp: pip install 'raytracer[view]'") from None
        with LiveServer(live, port) as server:
            print(server.address, flush=True)
            for sentence in live.state()["errors"]:
                say(sentence)
            if not no_open:
                _open(server.address)
            _wait()


def _open(address: str) -> None:
    """Open the page in the user's browser, if there is one."""
    import webbrowser

    if not webbrowser.open(address):
        say("there is no browser to open; the address is printed above")


def _wait() -> None:
    """Wait for Ctrl-C."""
    import time

    while WATCH.signal_number is None:
        time.sleep(_POLL_SECONDS)
