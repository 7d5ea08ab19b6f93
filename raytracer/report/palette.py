"""Colours of pages, charts and drawings, each in one place.

Series have those of Okabe and Ito, which colour-blind readers can tell apart, each at least 3 to 1 against white and
against near black; nothing is told by colour alone.

References: Okabe and Ito 2008, "Color Universal Design".
"""

LIGHT = {
    "ink": "#1b1d21",
    "paper": "#ffffff",
    "faint": "#5c626b",
    "rule": "#d5d9df",
    "panel": "#f4f5f7",
    "raised": "#ffffff",
    "accent": "#0063a0",
    "accent-ink": "#ffffff",
    "second": "#a34700",
    "well": "#e6e8ec",
    "warn": "#fff4d6",
    "warn-rule": "#b57900",
    "good": "#1a7a3c",
    "bad": "#b3261e",
}
DARK = {
    "ink": "#e4e6ea",
    "paper": "#15171b",
    "faint": "#a2a9b4",
    "rule": "#383d46",
    "panel": "#1d2026",
    "raised": "#272b33",
    "accent": "#6db7ec",
    "accent-ink": "#10212e",
    "second": "#f0a065",
    "well": "#0c0d10",
    "warn": "#33290f",
    "warn-rule": "#d9a23a",
    "good": "#6fcf8e",
    "bad": "#ff8a80",
}
"""Colours of pages in light and in dark mode, by their names in style sheets; files have the light ones."""

INK, PAPER, FAINT, WELL, BAD = (LIGHT[name] for name in ("ink", "paper", "faint", "well", "bad"))

BLUE, VERMILLION, GREEN, PURPLE, OCHRE, SKY = "#0072b2", "#d55e00", "#009e73", "#b3649a", "#b07d00", "#2f94c9"
SERIES = (BLUE, VERMILLION, GREEN, PURPLE, OCHRE, SKY)
"""Colours of series, in their order."""

CROWN, FLINT, PLAIN_GLASS = "#56a0d3", "#c08a3e", "#7f8c8d"
"""Glass with an Abbe number above 50, with one below, and glass that does not disperse."""
