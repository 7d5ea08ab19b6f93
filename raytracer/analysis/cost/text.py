"""Report of a study as text, for terminals and pipes."""

import io
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from raytracer.analysis.cost import formatting
from raytracer.analysis.cost.results import Study, VariantResult
from raytracer.report import wording
from raytracer.util.errors import one_line

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

# Terminal columns from which on an interval stands beside its value, and not below it.
_WIDE = 128

# Terminal columns from which on there is room for one more column of the table.
_ROOMY = 110

# Columns that the name of an variant has at least, if it takes them.
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
    _line(console, f"{one_line(study.scene)}: {formatting.format_extent(study)}", "bold")
    _line(console, formatting.headline(study), "bold")
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
            _line(console, rounds)
    if study.variants:
        _variants(console, study)
    _machine(console, study)
    if study.warnings:
        _title(console, "Warnings")
        _pairs(console, [("-", one_line(warning)) for warning in study.warnings], "yellow")

    # Rows are filled up to the width, which no reader of a file wants.
    file = console.file
    assert isinstance(file, io.StringIO)
    return "".join(f"{line.rstrip()}\n" for line in file.getvalue().splitlines())


def _line(console: "Console", words: str, style: str = "") -> None:
    from rich.text import Text

    console.print(Text(words, style=style))


def _title(console: "Console", words: str) -> None:
    console.print()
    _line(console, words, "bold")


def _grid(gap: int = 2) -> "Table":
    from rich.table import Table

    return Table(box=None, show_header=False, pad_edge=False, padding=(0, gap, 0, 0))


def _indented(console: "Console", table: "Table", by: int = 2) -> None:
    from rich.padding import Padding

    console.print(Padding(table, (0, 0, 0, by)))


def _pairs(console: "Console", pairs: Iterable[tuple[str, str]], style: str = "") -> None:
    from rich.text import Text

    table = _grid()
    table.add_column(max_width=max(24, console.width // 3))
    table.add_column(ratio=1)
    for first, second in pairs:
        table.add_row(Text(first, overflow="fold"), Text(second, style=style, overflow="fold"))
    _indented(console, table)


def _prediction(console: "Console", study: Study) -> None:
    from rich.text import Text

    predicted = study.prediction
    _title(console, "Relative error (RMS, of noise) and time of a render of the whole picture")
    if predicted.points:
        table = _grid(gap=4)
        for _ in range(3):
            table.add_column(justify="right", no_wrap=True)
        table.add_row(*(Text(words, style="dim") for words in ("spp", "time", "error")))
        for point in predicted.points:
            table.add_row(
                f"{point.spp:,}", wording.format_duration(point.seconds), wording.format_percent_interval(point.error)
            )
        _indented(console, table)
    else:
        _line(console, "  nothing was measured")

    _title(console, "Prediction, with 95 % intervals; compiling apart")
    pairs = formatting.prediction_rows(predicted)
    if not math.isnan(study.top_share):
        pairs.append(("where the error is", formatting.format_concentration(study)))
    _pairs(console, pairs)


def _variants(console: "Console", study: Study) -> None:
    from rich.table import Table
    from rich.text import Text

    spp = formatting.common_spp(study.variants)
    notes = formatting.Footnotes()
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim", collapse_padding=True)
    fits = max((len(formatting.display_name(variant)) + 1 for variant in study.variants), default=0) <= _NAME
    table.add_column("variant", vertical="top", overflow="fold", no_wrap=fits, max_width=None if fits else _NAME)
    table.add_column("time\nper spp", no_wrap=True, justify="right")
    table.add_column("time\nper ray", no_wrap=True, justify="right")
    if console.width >= _ROOMY:
        table.add_column("rays per\nsample", no_wrap=True, justify="right")
    table.add_column("time against\nthe scene")
    table.add_column(f"noise at\n{spp:,} spp" if spp else "noise")
    table.add_column("bias against\nthe scene")
    table.add_column(f"time to\n{wording.format_given_percent(study.prediction.target)}", justify="right")
    for title, variants in formatting.group_variants(study.variants):
        if title:
            table.add_row(Text(title, style="italic", no_wrap=True))
        for variant in variants:
            cells = _cells(variant, notes, spp, indent=bool(title))
            if console.width < _ROOMY:
                cells = (*cells[:3], *cells[4:])
            if console.width < _WIDE:
                cells = (
                    cells[0],
                    *(
                        cell.replace(" (", "\n(").replace(" diff", "\ndiff").replace(" scene", "\nscene")
                        for cell in cells[1:]
                    ),
                )
            table.add_row(*(Text(cell, overflow="fold") for cell in cells))
    _indented(console, table, by=0)

    if notes.sentences:
        console.print()
        _pairs(console, [(f"[{i + 1}]", sentence) for i, sentence in enumerate(notes.sentences)])
    meanings = [
        (formatting.display_name(variant), one_line(variant.what))
        for variant in study.variants
        if variant.what and variant.group != "scene"
    ]
    if meanings:
        _title(console, "What was changed")
        _pairs(console, meanings)


def _cells(variant: VariantResult, notes: formatting.Footnotes, spp: int | None, indent: bool) -> tuple[str, ...]:
    name = " " * indent + formatting.display_name(variant)
    if variant.failed:
        return name, "", "", "", f"not measured {notes.mark(variant.failed)}"
    noise = formatting.format_noise(variant)
    if spp is None and noise not in {wording.UNKNOWN, formatting.SAME_NOISE}:
        noise = f"{noise} at {variant.spp:,} spp"
    return (
        name,
        wording.format_duration(variant.per_sample.value),
        formatting.format_per_ray(variant.per_ray.value),
        wording.format_number(variant.rays_per_sample),
        formatting.format_time_ratio(variant),
        noise,
        formatting.format_bias(variant),
        formatting.format_target_cell(variant, notes),
    )


def _machine(console: "Console", study: Study) -> None:
    _title(console, "Measured")
    pairs = formatting.machine_rows(study)
    if study.seconds:
        pairs.append(("time spent", formatting.format_phases(study)))
    _pairs(console, pairs)
