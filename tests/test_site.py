"""The site: it builds without a warning or a network, its links lead somewhere, and it fits into small windows."""

import itertools
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
from axe_playwright_python import sync_playwright as axe

from tests.repository import ROOT, script

BENCHES = script("docs/make_pages.py").PAGES
LECTURE = sorted((ROOT / "docs" / "lecture").glob("*.md"))
REFERENCE = (
    *("scenes/index", "scenes/rules", "scenes/exposure", "scenes/cameras/index", "scenes/cameras/thin_lens"),
    *("scenes/materials/index", "commands/index", "commands/render", "python/index"),
)
PAGES = [
    *(
        "index",
        "tutorial",
        "costs",
        "hard-cases",
        "only-what-is-called-for",
        "scenes-gallery",
        "lecture",
        *(f"lecture/{path.stem}" for path in LECTURE),
    ),
    *(f"reference/{name}" for name in REFERENCE),
]
SEARCHED = ("reference/scenes/materials/rough_conductor", "reference/python/lightfield")


class Page(HTMLParser):
    """What a page links to, loads and shows."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.headings: list[int] = []
        self.undescribed: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attributes: Any) -> None:
        keys = dict(attributes)
        self.anchors |= {keys["id"]} if keys.get("id") else set()
        if tag == "a" and "href" in keys:
            self.links.append(keys["href"])
        if tag in ("link", "script", "img", "iframe"):
            self.loaded.append(keys.get("href") or keys.get("src") or "")
        if tag == "img" and not keys.get("alt"):
            self.undescribed.append(keys["src"])
        if tag in ("h1", "h2", "h3", "h4"):
            self.headings.append(int(tag[1]))


PARTIAL = "WARNING: search index couldn't be loaded, but not all documents will be built: the index will be incomplete."
"""What Sphinx says, rightly, where some pages are built."""


def build(folder: Path, *names: str) -> Path:
    """Build all pages, or those of some names; a warning is an error."""
    sources = [str(ROOT / "docs" / f"{name}.md") for name in names]
    options = ("--quiet", "--no-color", "--keep-going", "--builder=html")
    words = [sys.executable, "-m", "sphinx", *options, ROOT / "docs", folder, *sources]
    built = subprocess.run(words, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    assert [line for line in built.stderr.splitlines() if not (names and line == PARTIAL)] == []
    return folder


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the pages that are looked at; all are read, and it is writing them that takes time."""
    return build(tmp_path_factory.mktemp("site"), *PAGES, *SEARCHED)


@pytest.fixture(scope="module")
def whole_site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site's folder."""
    return build(tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: Page(path) for path in site.rglob("*.html")}


@pytest.mark.slow
def test_every_link_within_the_site_leads_to_a_place_that_is_there(whole_site: Path) -> None:
    lost, pages = [], {path: Page(path) for path in whole_site.rglob("*.html")}
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            is_there = target.exists() and (
                not parts.fragment or target not in pages or parts.fragment in pages[target].anchors
            )
            if not parts.scheme and not is_there and parts.fragment != "":
                lost.append(f"{path.relative_to(whole_site)}: {link}")
    assert not lost


def test_nothing_is_fetched_from_elsewhere(pages: dict[Path, Page]) -> None:
    assert [link for page in pages.values() for link in page.loaded if urlsplit(link).scheme not in ("", "data")] == []


def test_pages_have_one_title_headings_in_order_and_pictures_with_words(site: Path, pages: dict[Path, Page]) -> None:
    for name in PAGES:
        page = pages[site / f"{name}.html"]
        assert page.headings.count(1) == 1, name
        assert all(after - before <= 1 for before, after in zip(page.headings, page.headings[1:], strict=False)), name
        assert not page.undescribed, name


def test_columns_of_tables_have_names() -> None:
    nameless = []
    for path in sorted((ROOT / "docs").rglob("*.md")):
        lines = path.read_text(encoding="utf-8").splitlines()
        for number, (head, rule) in enumerate(itertools.pairwise(lines), 1):
            if re.fullmatch(r"\|(\s*:?-+:?\s*\|)+", rule) and "" in map(str.strip, head.strip("|").split("|")):
                nameless.append(f"{path.relative_to(ROOT)}:{number}: {head}")
    assert nameless == []


def test_the_site_has_four_parts_and_a_page_for_every_kind_and_command(site: Path, pages: dict[Path, Page]) -> None:
    text = (site / "index.html").read_text(encoding="utf-8")
    captions = re.findall(r'class="caption"[^>]*><span class="caption-text">([^<]+)<', text)
    assert captions == ["Tutorial", "How-to", "Reference", "Explanation"]
    made = [path.relative_to(ROOT / "docs").with_suffix(".html") for path in (ROOT / "docs/reference").rglob("*.md")]
    assert {str(path) for path in made} <= set(pages[site / "index.html"].links)


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        ("circle of confusion", "11-defocus"),
        ("hyperfocal", "11-defocus"),
        ("弥散圆", "glossary"),
        ("rough_conductor", "reference/scenes/materials/rough_conductor"),
        ("checkpoint", "reference/commands/render"),
        ("rt.lightfield.refocus", "reference/python/lightfield"),
    ],
)
def test_words_are_found(words: str, wanted: str, site: Path, open_page: Any) -> None:
    page = open_page(site / "search.html", f"?q={words}")
    page.wait_for_selector(f"ul.search li a[href*='{wanted}']")


def barriers(page: Any) -> list[str]:
    """What the rules of axe find on a page: contrast, names, roles, headings, what a keyboard cannot reach."""
    # Without preloading it reads no styles by requests, which pages in folders may not make.
    found = axe.Axe().run(page, options={"preload": False}).response["violations"]
    return [f"{rule['id']}: {rule['nodes'][0]['html']}" for rule in found]


SORTS = (
    *("index", "search", "costs", "lecture/11-defocus"),
    *("reference/scenes/cameras/thin_lens", "reference/commands/render"),
)
WINDOWS = pytest.mark.parametrize(
    ("width", "scheme"), [pytest.param(1280, "light", marks=pytest.mark.slow), (400, "dark")]
)


@pytest.mark.parametrize(("width", "scheme"), [(1280, "light"), (400, "dark")])
def test_pages_of_each_sort_are_without_barriers(width: int, scheme: str, site: Path, open_page: Any) -> None:
    for name in (*SORTS, f"lecture/pages/{next(iter(BENCHES))}"):
        page = open_page(site / f"{name}.html", size=(width, 800), color_scheme=scheme)
        assert barriers(page) == [], name


@WINDOWS
@pytest.mark.slow
def test_no_page_has_barriers(width: int, scheme: str, whole_site: Path, open_page: Any) -> None:
    found = {}
    for path in sorted(whole_site.rglob("*.html")):
        if here := barriers(open_page(path, size=(width, 800), color_scheme=scheme)):
            found[path.relative_to(whole_site).as_posix()] = here
    assert found == {}


@WINDOWS
def test_pages_fit_the_window(width: int, scheme: str, site: Path, open_page: Any) -> None:
    for name in PAGES:
        page = open_page(site / f"{name}.html", size=(width, 800), color_scheme=scheme)
        assert page.evaluate("document.documentElement.scrollWidth") <= width, name
        if name.startswith("reference"):
            tables = "tables => tables.filter(table => table.scrollWidth > table.clientWidth).length"
            assert page.eval_on_selector_all(".table-wrapper", tables) == 0, name
        missing = (
            "images => images.filter(image => image.loading != 'lazy' && !image.naturalWidth).map(image => image.src)"
        )
        assert page.eval_on_selector_all("img", missing) == [], name
