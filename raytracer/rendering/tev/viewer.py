"""A viewer that shows a picture while it is rendered, from a thread that no render waits for."""

import contextlib
import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from raytracer.film.image import Image
from raytracer.film.window import Window
from raytracer.rendering.observer import PictureSoFar
from raytracer.rendering.tev.packets import create_image, update_image
from raytracer.util.errors import one_line

if TYPE_CHECKING:
    from raytracer.rendering.session import RenderSession

# Seconds between two looks at the picture, which take at most the other part of the thread's time; between two tries to
# reach a viewer; that a viewer has for taking a packet; and for the last ones, at the end of the command.
_INTERVAL, _LOOKING_PART = 0.1, 0.1
_RETRY_SECONDS, _TIMEOUT, _LAST_SECONDS = 2.0, 10.0, 2.0

# Seconds until a host that says nothing counts as one that does not answer: less than at the end of the command.
_CONNECT_SECONDS = 1.5

# Rows of a packet are as many as have so many bytes.
_PACKET_BYTES = 2**22


class Address(NamedTuple):
    """The address of a viewer."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


DEFAULT_ADDRESS = Address("127.0.0.1", 14158)
"""Address at which tev listens unless it is told otherwise."""


def parse_address(text: str) -> Address:
    """Parse `HOST:PORT`.

    Raises
    ------
    ValueError : it is none.
    """
    found = re.fullmatch(r"\[?([^\s\[\]]+?)\]?:(\d{1,5})", text)
    if found is None or not 0 < int(found[2]) < 2**16:
        raise ValueError("must be HOST:PORT, such as 127.0.0.1:14158")
    return Address(found[1], int(found[2]))


class TevViewer:
    """A viewer that speaks tev's protocol; used in a `with` statement, at whose end the last picture is sent.

    Where none answers, or one goes away, it is tried again: whenever a viewer is there, it gets the picture.

    Parameters
    ----------
    address : of the viewer.
    name : of the image, as the viewer lists it.
    say : called with a sentence, once at most, when the viewer cannot be reached.
    """

    def __init__(self, address: Address, name: str, say: Callable[[str], object]) -> None:
        self._address, self._name, self._say = address, name, say
        self._socket: socket.socket | None = None
        self._next_try, self._has_said = 0.0, False
        self._picture: PictureSoFar | None = None
        self._last: NDArray[np.float64] | None = None
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="tev", daemon=True)

    @contextlib.contextmanager
    def observe(self, session: "RenderSession") -> Iterator[None]:
        """Show the picture of a render in a `with` block."""
        self._picture = PictureSoFar(session)
        self._thread.start()
        yield

    def finish(self, image: Image) -> None:
        """Show the finished picture in its place."""
        self._last = image.radiance
        self._ending.set()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._ending.set()
        if self._thread.ident is None:
            return
        self._thread.join(_LAST_SECONDS)
        if self._thread.is_alive() and (connection := self._socket) is not None:
            # What is being sent then fails.
            with contextlib.suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            self._thread.join(_LAST_SECONDS)

    # ---- In the thread

    def _run(self) -> None:
        wait = 0.0
        while not self._ending.wait(wait):
            begin = time.perf_counter()
            self._try(self._send_changes)
            wait = max(_INTERVAL, (time.perf_counter() - begin) / _LOOKING_PART)
        if self._last is not None:
            self._next_try = 0.0
            self._try(self._send_last)
        self._disconnect()
        # The film goes with its render.
        self._picture = self._last = None

    def _try(self, send: Callable[[], None]) -> None:
        """Send something, after connecting if need be; say why if it is the first time that this fails."""
        try:
            if self._connect():
                send()
        except Exception as error:  # noqa: BLE001
            # A render does not depend on who looks at it.
            self._disconnect()
            self._next_try = time.perf_counter() + _RETRY_SECONDS
            if not self._has_said:
                self._has_said = True
                reason = getattr(error, "strerror", None) or error
                self._say(
                    f"no viewer takes the picture at {self._address} ({one_line(str(reason))}); the render goes on "
                    "all the same, and tries again as long as it lasts"
                )

    def _connect(self) -> bool:
        """Connect to the viewer, and begin the image, unless that was done; return False if it is too early."""
        if self._socket is not None:
            return True
        picture = self._picture
        if picture is None or time.perf_counter() < self._next_try:
            return False
        self._socket = socket.create_connection(self._address, _CONNECT_SECONDS)
        self._socket.settimeout(_TIMEOUT)
        self._socket.sendall(create_image(self._name, picture.width, picture.height))
        picture.forget()
        return True

    def _disconnect(self) -> None:
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
        self._socket = None

    def _send_changes(self) -> None:
        if self._picture is not None:
            pixels, windows = self._picture.look()
            for window in windows:
                self._send(pixels, window)

    def _send_last(self) -> None:
        if self._last is not None:
            height, width, _ = self._last.shape
            self._send(self._last, Window(0, 0, width, height))

    def _send(self, pixels: NDArray[np.float64], window: Window) -> None:
        """Send a part of the picture, some rows at a time."""
        rows = max(1, _PACKET_BYTES // (4 * 3 * (window.right - window.left)))
        for top in range(window.top, window.bottom, rows):
            part = pixels[top : min(top + rows, window.bottom), window.left : window.right]
            if self._socket is not None:
                self._socket.sendall(update_image(self._name, window.left, top, part.astype(np.float32)))
