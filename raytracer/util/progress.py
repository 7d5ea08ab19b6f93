"""Progress of work: callbacks for those who call, and bars on a terminal and in a notebook."""

import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, Self, TextIO, TypeVar

Update = Callable[[float, float], object]
"""Callback of progress: called with the work that is done, and with all of it."""

_Item = TypeVar("_Item")

_BATCH_LAYOUT = "{percentage:3.0f}%|{bar}| {postfix}[{elapsed}<{remaining}]"


def report_progress(items: Sequence[_Item], update: Update | None) -> Iterator[_Item]:
    """Yield items, and report each once it is done."""
    for number, item in enumerate(items, 1):
        yield item
        if update is not None:
            update(number, len(items))


class ProgressCounter:
    """Counter of the work of several stages, for one callback."""

    def __init__(self, update: Update | None) -> None:
        self._update = update
        self._done = self._total = 0

    def add_total(self, steps: int) -> None:
        """Add the steps of a further stage to the total."""
        self._total += steps

    def step(self) -> None:
        """Report one more step as done."""
        self._done += 1
        if self._update is not None:
            self._update(self._done, self._total)


def tqdm_class() -> Any:
    """Return tqdm's class for the environment: a widget in a notebook that has widgets, otherwise text."""
    # In a notebook without widgets tqdm.auto warns.
    has_widgets = "ipykernel" in sys.modules and importlib.util.find_spec("ipywidgets") is not None
    return importlib.import_module("tqdm.auto" if has_widgets else "tqdm").tqdm


class Bar:
    """A progress bar, shown from the first update on; it can be used in a `with` statement.

    Parameters
    ----------
    unit : of the count, with a blank before it: " samples".
    always : show it everywhere, not only on terminals and in notebooks.
    quiet : show none.
    options : further ones of tqdm, such as `bar_format` and `unit_scale`.
    """

    def __init__(self, unit: str = "", *, always: bool = False, quiet: bool = False, **options: Any) -> None:
        # None: only on a terminal.
        disable = quiet or (False if always else None)
        self._options = {"unit": unit, "leave": False, "disable": disable, **options}
        self._bar: Any = None

    def update(self, done: float, wanted: float, note: str = "", before: float = 0) -> None:
        """Show the progress, with a note beside it; the total may change.

        before : amount done before the start, which does not count for the speed.
        """
        if self._is_hidden():
            return
        if self._bar is None:
            self._bar = tqdm_class()(total=wanted, initial=before, **self._options)
        self._bar.total = wanted
        if note:
            self._bar.set_postfix_str(note, refresh=False)
        self._bar.update(done - self._bar.n)

    def _is_hidden(self) -> bool:
        """Return True if tqdm would show nothing, and need not be imported."""
        disable, stream = self._options["disable"], self._options.get("file") or sys.stderr
        return disable is True or (disable is None and "ipykernel" not in sys.modules and not stream.isatty())

    def say(self, line: str, file: TextIO | None = None) -> None:
        """Print a line above the bar, on stderr if no file is given."""
        file = sys.stderr if file is None else file
        if self._bar is None:
            print(line, file=file)
        else:
            self._bar.write(line, file=file)

    def close(self) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class BatchProgress(NamedTuple):
    """Progress of several renders, such as the points of a sweep.

    share : of the work that there was to do, from 0 to 1; what was there already is none.
    points : number of renders that are done or have failed.
    of : number of all renders.
    name : the one that is under way.
    """

    share: float
    points: int
    of: int
    name: str


class BatchBar(Bar):
    """A bar of the share that is done of several renders, with the time left, to be called with each progress."""

    def __init__(self, *, always: bool = False, quiet: bool = False) -> None:
        super().__init__(always=always, quiet=quiet, bar_format=_BATCH_LAYOUT)

    def __call__(self, progress: BatchProgress) -> None:
        """Show the progress, which does not go back."""
        share = max(progress.share, 0.0 if self._bar is None else float(self._bar.n))
        self.update(share, 1.0, f"{progress.points + 1} of {progress.of}: {progress.name} ")
