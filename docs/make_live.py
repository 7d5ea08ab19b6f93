"""Write docs/gallery/live.jpg, the page of `rt view` as docs/live.md shows it.

    python docs/make_live.py

It needs Chromium and the extras `view` and `test`.
"""

import io
import shutil
import sys
from pathlib import Path

import PIL.Image
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from raytracer.live.scene_file import SceneFile  # noqa: E402
from raytracer.live.server import LiveServer  # noqa: E402
from raytracer.live.view import LiveView  # noqa: E402
from raytracer.rendering.options import RenderOptions  # noqa: E402

OUTPUT = ROOT / "docs" / "gallery" / "live.jpg"
SIZE = {"film.width": 640, "film.height": 360, "camera.defocus_angle": 1.5}
FOREGROUND = (0.2, 0.88)
SECONDS = 120_000


def main() -> None:
    """Click on the foreground, compare with before, and take a picture of the page."""
    file = SceneFile("scenes/cover.yaml", SIZE)
    with (
        LiveView(file, RenderOptions(spp=48), [Path("outputs/cover.png")]) as view,
        LiveServer(view) as server,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1120, "height": 900})
        page.goto(server.address)
        page.locator("body[data-done=true]").wait_for(timeout=SECONDS)
        page.locator("[data-mode=focus]").click()
        box = page.locator(".wipe-stage").bounding_box()
        if box is not None:
            page.mouse.click(box["x"] + FOREGROUND[0] * box["width"], box["y"] + FOREGROUND[1] * box["height"])
        page.locator("body[data-done=true][data-job='2']").wait_for(timeout=SECONDS)
        page.locator("#compare").click()
        shot = PIL.Image.open(io.BytesIO(page.screenshot()))
        browser.close()
    shot.convert("RGB").save(OUTPUT, quality=82, optimize=True)


if __name__ == "__main__":
    main()
