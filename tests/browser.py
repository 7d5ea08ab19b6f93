"""Pages of HTML in a browser: headless Chromium, which has to be installed apart.

A page that a test opens may ask nothing of a network, and say nothing on the console: each test that uses `open_page`
fails at its end if one has.
"""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

REQUIRED = "RT_REQUIRE_BROWSER"

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
_WIDE = (1280, 800)

# Where all is drawn by a simulated graphics card; without any, Chromium complains of reading WebGL's pictures back.
WEBGL = (
    *(argument for argument in _ARGUMENTS if argument != "--disable-gpu"),
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)


class Windows:
    """A browser's windows, which are used again by tests that want the same: a new one takes half a second."""

    def __init__(self, browser: "Browser") -> None:
        self._browser = browser
        self._free: dict[str, list[Page]] = {}

    def take(self, settings: dict[str, Any]) -> "Page":
        free = self._free.setdefault(repr(settings), [])
        return free.pop() if free else self._browser.new_context(**settings).new_page()

    def give(self, settings: dict[str, Any], page: "Page") -> None:
        page.goto("about:blank")
        self._free[repr(settings)].append(page)


# Not for the whole session: Playwright's event loop would be in the way of all others in the same thread.
@pytest.fixture(scope="module")
def chromium(request: pytest.FixtureRequest) -> Iterator[Windows]:
    """A browser for the tests of a module; without one they are skipped, or fail where RT_REQUIRE_BROWSER is set.

    A module that names CHROMIUM has a browser with those arguments.
    """
    executable = next(filter(None, map(shutil.which, _NAMES)), None)
    if executable is None:
        why = f"no browser: none of {', '.join(_NAMES)} is installed"
        if os.environ.get(REQUIRED):
            pytest.fail(why)
        pytest.skip(why)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=executable, args=list(getattr(request.module, "CHROMIUM", _ARGUMENTS))
        )
        yield Windows(browser)
        browser.close()


@pytest.fixture
def open_page(chromium: Windows) -> "Iterator[Callable[..., Page]]":
    """Open a file, with a #fragment or none, in a window of some size, light or dark (`color_scheme="dark"`)."""
    taken: list[tuple[dict[str, Any], Page]] = []
    complaints: list[str] = []
    heard = {
        "console": lambda message: complaints.append(f"console: {message.type}: {message.text}"),
        "pageerror": lambda error: complaints.append(f"error: {error}"),
        "request": lambda request: _local(request.url) or complaints.append(f"request: {request.url}"),
    }

    def opened(path: Path, fragment: str = "", size: tuple[int, int] = _WIDE, **settings: Any) -> "Page":
        settings["viewport"] = {"width": size[0], "height": size[1]}
        page = chromium.take(settings)
        taken.append((settings, page))
        page.set_default_timeout(20_000)
        for event, listener in heard.items():
            page.on(event, listener)
        page.goto(path.resolve().as_uri() + fragment)
        return page

    yield opened
    for settings, page in taken:
        for event, listener in heard.items():
            page.remove_listener(event, listener)
        chromium.give(settings, page)
    assert not complaints


def _local(url: str) -> bool:
    return url.startswith(("file:", "data:", "blob:"))
