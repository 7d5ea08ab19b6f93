"""Pages of HTML in a browser: headless Chromium, which has to be installed apart.

A page that a test opens may ask nothing of a network, and say nothing on the console: each test that uses `open_page`
fails at its end if one has.
"""

import os
import shutil

import pytest

REQUIRED = "RT_REQUIRE_BROWSER"

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_SILENT = ("--disable-background-networking", "--disable-component-update", "--disable-sync")
_ALL = ("--no-sandbox", "--no-first-run", *_SILENT)
_PLAIN = (*_ALL, "--disable-gpu")
_WIDE = (1280, 800)

# Where all is drawn by a simulated graphics card; without any, Chromium complains of reading WebGL's pictures back.
WEBGL = (*_ALL, "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


class Windows:
    """A browser's windows, which tests use again, in another size and light or dark: a new one takes half a second."""

    def __init__(self, browser):
        self._browser, self._free = browser, {}

    def take(self, settings):
        free = self._free.setdefault(repr(settings), [])
        return free.pop() if free else self._browser.new_context(**settings).new_page()

    def give(self, settings, page):
        page.goto("about:blank")
        self._free[repr(settings)].append(page)


def launched(arguments=_PLAIN):
    """A browser; without one tests are skipped, or fail where RT_REQUIRE_BROWSER is set."""
    executable = next(filter(None, map(shutil.which, _NAMES)), None)
    if executable is None:
        why = f"no browser: none of {', '.join(_NAMES)} is installed"
        (pytest.fail if os.environ.get(REQUIRED) else pytest.skip)(why)
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=list(arguments))
        yield Windows(browser)
        browser.close()


# Not for the whole session: Playwright's event loop would be in the way of all others in the same thread.
@pytest.fixture(scope="module")
def chromium(request):
    """A browser for the tests of a module, with the arguments that it names CHROMIUM if it does."""
    yield from launched(getattr(request.module, "CHROMIUM", _PLAIN))


@pytest.fixture
def open_page(chromium):
    """Open a file, with a #fragment or none, in a window of some size, light or dark (`color_scheme="dark"`).

    In place of the file it takes the address of a local server's page, which may ask that server for what is below it.
    """
    taken, complaints, served = [], [], []

    def note_request(request):
        if not request.url.startswith(("file:", "data:", "blob:", *served)):
            complaints.append(f"request: {request.url}")

    heard = {
        "console": lambda message: complaints.append(f"console: {message.type}: {message.text}"),
        "pageerror": lambda error: complaints.append(f"error: {error}"),
        "request": note_request,
    }

    def opened(path, fragment="", size=_WIDE, color_scheme="light", **settings):
        page = chromium.take(settings)
        page.set_viewport_size({"width": size[0], "height": size[1]})
        # Nothing is found on its way from one state to another.
        page.emulate_media(color_scheme=color_scheme, reduced_motion="reduce")
        taken.append((settings, page))
        page.set_default_timeout(20_000)
        for event, listener in heard.items():
            page.on(event, listener)
        if isinstance(path, str):
            served.append(path)
        page.goto((path if isinstance(path, str) else path.resolve().as_uri()) + fragment)
        return page

    yield opened
    for settings, page in taken:
        for event, listener in heard.items():
            page.remove_listener(event, listener)
        chromium.give(settings, page)
    assert not complaints, complaints
