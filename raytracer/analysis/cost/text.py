"""Report of a study as text, for terminals and pipes."""

import io
import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Literal

from raytracer.analysis.cost import formatting
from raytracer.analysis.cost.results import Study, VariantResult
from raytracer.report import wording
from raytracer.util.errors import one_line

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

# Columns of the table of variants, in their order.
_COLUMNS = ("per_sample", "per_ray", "rays_per_sample", "time", "noise", "bias", "target_seconds")

# Terminal columns from which on an interval stands beside its value, and not below it.
_WIDE = 128

# Terminal columns from which on there is room for one more column of the table.
_ROOMY = 110

# Columns that the name of a variant has at least, if it takes them.
_NAME = 22


def study_text(study: Study, width: int = 100, colour: bool = False) -> str:
    """Write all of a study but its pictures, ending in a line break.

    width : columns of the terminal; cells are folded to fit where they can be.
    colour : True to write the escape sequences of terminals; without them the text is ASCII, but for names in it.
    """
    from rich.console import Console

    console = Console(
        file=io.StringIO(),
        width=width,
        force_terminal=colour,
        color_system="standard" if colour else None,
        legacy_windows=False,
        markup=False,
        highlight=False,
        emoji=False,
        no_color=not colour,
        _environ={},
    )
    console.print(f"{one_line(study.scene)}: {formatting.format_extent(study)}", style="bold")
    console.print(formatting.headline(study), style="bold")
    for title, items in formatting.plan_sections(study):
        _title(console, title)
        if title == formatting.LEFT_OUT:
            # The reasons are on the page, and `rt explain` tells them.
            _pairs(console, [("", formatting.format_left_out(study))])
        else:
            _pairs(console, items)
    _prediction(console, study)
    if study.variants or study.interrupted:
        _title(console, "What each effect and setting costs, against the scene as it is")
        if rounds := formatting.format_rounds(study):
            console.print(rounds)
    if study.variants:
        _variants(console, study)
    _title(console, "Measured")
    _pairs(console, formatting.machine_rows(study))
    if study.warnings:
        _title(console, "Warnings")
        _pairs(console, [("-", one_line(warning)) for warning in study.warnings], "yellow")

    # Rows are filled up to the width, which no reader of a file wants.
    file = console.file
    assert isinstance(file, io.StringIO)
    return "".join(f"{line.rstrip()}\n" for line in file.getvalue().splitlines())


def _title(console: "Console", words: str) -> None:
    console.print()
    console.print(words, style="bold")


def _grid(gap: int = 2) -> "Table":
    from rich.table import Table

    return Table(box=None, show_header=False, pad_edge=False, padding=(0, gap, 0, 0))


def _indented(console: "Console", table: "Table", by: int = 2) -> None:
    from rich.padding import Padding

    console.print(Padding(table, (0, 0, 0, by)))


def _pairs(console: "Console", pairs: Iterable[tuple[str, str]], style: str = "") -> None:
    table = _grid()
    table.add_column(max_width=max(24, console.width // 3), overflow="fold")
    table.add_column(ratio=1, overflow="fold", style=style)
    for pair in pairs:
        table.add_row(*pair)
    _indented(console, table)


def _prediction(console: "Console", study: Study) -> None:
    from rich.text import Text

    _title(console, "Relative error (RMS, of noise) and time of a render of the whole picture")
    if study.prediction.points:
        table = _grid(gap=4)
        for _ in range(3):
            table.add_column(justify="right", no_wrap=True)
        table.add_row(*(Text(words, style="dim") for words in ("spp", "time", "error")))
        for row in formatting.point_rows(study.prediction):
            table.add_row(*row)
        _indented(console, table)
    else:
        console.print("  nothing was measured")

    _title(console, "Prediction, with 95 % intervals; compiling apart")
    pairs = formatting.prediction_rows(study.prediction)
    if not math.isnan(study.top_share):
        pairs.append(("where the error is", formatting.format_concentration(study)))
    _pairs(console, pairs)


def _variants(console: "Console", study: Study) -> None:
    from rich.table import Table
    from rich.text import Text

    columns, notes = formatting.columns(study), list[str]()
    columns = {key: columns[key] for key in _COLUMNS if key != "rays_per_sample" or console.width >= _ROOMY}
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim", collapse_padding=True)
    fits = max((len(formatting.display_name(variant)) + 1 for variant in study.variants), default=0) <= _NAME
    table.add_column("variant", vertical="top", overflow="fold", no_wrap=fits, max_width=None if fits else _NAME)
    for key, column in columns.items():
        justify: Literal["right", "left"] = "right" if column.is_number else "left"
        table.add_column(column.title, no_wrap=column.is_number and key != "target_seconds", justify=justify)
    for title, variants in formatting.group_variants(study.variants):
        if title:
            table.add_row(Text(title, style="italic", no_wrap=True))
        for variant in variants:
            cells = _cells(variant, columns, notes)
            if console.width < _WIDE:
                for before in (" (", " diff", " scene"):
                    cells = [cell.replace(before, f"\n{before[1:]}") for cell in cells]
            name = " " * bool(title) + formatting.display_name(variant)
            table.add_row(*(Text(cell, overflow="fold") for cell in (name, *cells)))
    _indented(console, table, by=0)

    if notes:
        console.print()
        _pairs(console, [(f"[{i + 1}]", sentence) for i, sentence in enumerate(notes)])
    meanings = [
        (formatting.display_name(variant), one_line(variant.what))
        for variant in study.variants
        if variant.what and variant.group != "scene"
    ]
    if meanings:
        _title(console, "What was changed")
        _pairs(console, meanings)


def _cells(variant: VariantResult, columns: Mapping[str, formatting.Column], notes: list[str]) -> list[str]:
    if variant.failed:
        return [f"not measured {_mark(variant.failed, notes)}" if key == "time" else "" for key in columns]
    cells = {key: column.words(variant) for key, column in columns.items()}
    cells["per_sample"] = wording.format_duration(variant.per_sample.value)
    cells["target_seconds"] = " ".join(
        words for words in (cells["target_seconds"], variant.why_blank and _mark(variant.why_blank, notes)) if words
    )
    return list(cells.values())


def _mark(sentence: str, notes: list[str]) -> str:
    """Add a sentence to the footnotes if it is new, and return its number in brackets."""
    text = one_line(sentence)
    if text not in notes:
        notes.append(text)
    return f"[{notes.index(text) + 1}]"
