"""Show results: pages of HTML, charts and figures, tables, colours, and numbers in words."""
