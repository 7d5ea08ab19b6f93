"""Show results: pages of HTML, charts, tables and SVG."""
