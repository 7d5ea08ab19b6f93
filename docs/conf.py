"""Settings of the site: `make docs` builds it into outputs/site by Sphinx, from Markdown, without a network."""

project = "rt"
author = "the rt authors"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton", "sphinx_design"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_block", "attrs_inline"]
myst_heading_anchors = 4
html_theme = "furo"
html_title = "rt"
exclude_patterns = ["examples"]
templates_path = []
