"""Settings of the site, which `make docs` builds from Markdown by Sphinx, without a network."""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

from make_pages import PAGES

project = "rt"
author = "the rt authors"
extensions = ["myst_parser", "sphinx_copybutton", "mathml"]
exclude_patterns = ["examples"]

myst_enable_extensions = ["colon_fence", "dollarmath"]
# Sections can be linked to by their headings, as on the pages of a repository.
myst_heading_anchors = 4

# Blocks without a language are commands and what they print.
highlight_language = "none"
# Quotes and dots, but no dashes: options begin with two hyphens.
smartquotes_action = "qe"

html_math_renderer = "mathml"

html_theme = "furo"
html_title = "rt"
html_static_path = ["_static"]
html_show_sourcelink = False
html_copy_source = False

# A browser may not read other pages of a folder by script, which summaries of what is found would take.
html_show_search_summary = False


def setup(app: Any) -> None:
    """Write the pages that can be played with beside the lecture's, and give the reference its style."""

    def write(app: Any, error: Exception | None) -> None:
        folder = Path(app.outdir) / "lecture" / "pages"
        folder.mkdir(parents=True, exist_ok=True)
        for name, make in PAGES.items():
            (folder / f"{name}.html").write_bytes(make())

    def add_style(app: Any, page: str, *_: Any) -> None:
        if page.startswith("reference/"):
            app.add_css_file("reference.css")

    app.connect("build-finished", write)
    app.connect("html-page-context", add_style)
