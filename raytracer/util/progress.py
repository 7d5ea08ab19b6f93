"""Progress bars, on a terminal and in a notebook."""

import importlib.util
import sys
from types import TracebackType
from typing import Any, Self, TextIO


def tqdm_class() -> Any:
    """Return tqdm's class for the environment: a widget in a notebook that has widgets, otherwise text."""
    # In a notebook without widgets tqdm.auto warns.
    if "ipykernel" in sys.modules and importlib.util.find_spec("ipywidgets") is not None:
        from tqdm.auto import tqdm

        return tqdm
    from tqdm import tqdm as textual

    return textual


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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
