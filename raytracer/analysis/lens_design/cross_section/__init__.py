"""Cross-section of a lens with rays through it, drawn as SVG and by Matplotlib."""
