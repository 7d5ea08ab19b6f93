"""The local server of a live view: one page, its style, its script and its socket, for who has the token.

It listens to this machine alone.  A request has to name the machine as the page does (else a foreign name could be made
to lead here), to come from the page itself if it says where from, and to begin with the token, which only the printed
address has.
"""

import asyncio
import hmac
import json
import secrets
import threading
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from time import perf_counter
from typing import Any

from aiohttp import WSMsgType, web

from raytracer.live.page import page_files
from raytracer.live.picture import RADIANCE
from raytracer.live.view import LiveView
from raytracer.report.page import to_plain
from raytracer.util.errors import InputError, OutputError

HOST = "127.0.0.1"

FRAME_SECONDS = 0.2
"""Shortest time between two frames of one render."""

FRAME_SHARE = 25.0
"""Frames are so rare that making one, and drawing it, each take at most a 25th of the time of one processor."""

# Seconds that a page may say that a frame takes to be drawn.
_MAX_DRAWING = 0.2

# What a page may send at once: a few keys.
_MAX_MESSAGE = 4096

_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class LiveServer:
    """A server of a view, in a thread of its own; a context manager, which ends it.

    address : of its page, with the token.
    """

    def __init__(self, view: LiveView, port: int = 0) -> None:
        """Serve a view.

        port : 0 for one that is free.

        Raises
        ------
        InputError : the port is taken, or not for this user.
        """
        self._view, self._port = view, port
        self._token = secrets.token_urlsafe(24)
        self._files = page_files()
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        self._ready = threading.Event()
        self._failures: list[OSError] = []
        self._thread = threading.Thread(target=self._run, name="live server", daemon=True)
        self._thread.start()
        self._ready.wait()
        for failure in self._failures:
            self._thread.join()
            raise InputError(f"port {port}: {failure.strerror or failure}")
        self.address = f"http://{HOST}:{self._port}/{self._token}/"

    def __enter__(self) -> "LiveServer":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the server, and wait for it."""
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()

    # ---- The thread

    def _run(self) -> None:
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._loop.run_until_complete(self._loop.shutdown_default_executor())
            self._loop.close()
            self._ready.set()

    async def _serve(self) -> None:
        app = web.Application(middlewares=[self._guard], client_max_size=_MAX_MESSAGE)
        app.on_response_prepare.append(self._add_headers)
        app.router.add_get("/{token}/socket", self._socket)
        app.router.add_get("/{token}/{name:[a-z.]*}", self._file)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.5)
        await runner.setup()
        site = web.TCPSite(runner, HOST, self._port)
        try:
            await site.start()
            self._port = runner.addresses[0][1]
            self._ready.set()
            await self._ended.wait()
        except OSError as error:
            self._failures.append(error)
        finally:
            await runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse all that the page itself does not ask for, whatever else is wrong with it."""
        if not self._is_allowed(request):
            return web.Response(status=403, text="403: not for you\n")
        try:
            return await handler(request)
        except web.HTTPException:
            return web.Response(status=403, text="403: there is nothing here\n")

    def _is_allowed(self, request: web.Request) -> bool:
        hosts = (f"{HOST}:{self._port}", f"localhost:{self._port}")
        host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
        # Browsers always say where a socket comes from.
        is_own = origin == f"http://{host}" or (origin is None and not request.path.endswith("/socket"))
        token = request.path.split("/")[1] if request.path.count("/") == 2 else ""
        has_token = hmac.compare_digest(token.encode(errors="replace"), self._token.encode())
        return host in hosts and is_own and has_token

    @staticmethod
    async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
        response.headers.update(_HEADERS)
        response.headers.pop("Server", None)

    async def _file(self, request: web.Request) -> web.Response:
        name = request.match_info["name"] or "index.html"
        if name not in self._files:
            raise web.HTTPNotFound
        kind, content = self._files[name]
        return web.Response(body=content, content_type=kind, charset="utf-8")

    async def _socket(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(max_msg_size=_MAX_MESSAGE, compress=False, heartbeat=20.0)
        await socket.prepare(request)
        await _Client(self._view, socket, self._ended).run()
        return socket


class _Client:
    """One page that is open: it gets the state and the picture when they change, and what it asks for."""

    def __init__(self, view: LiveView, socket: web.WebSocketResponse, ended: asyncio.Event) -> None:
        self._view, self._socket, self._ended = view, socket, ended
        self._news = asyncio.Event()
        self._layer = RADIANCE
        # The mark of the frame that the page has.
        self._sent: Any = None
        # When the next frame of the same render may be sent.
        self._due = 0.0
        self._is_ready = True
        self._tasks: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Serve the page until it is closed, or the server ends."""
        loop = asyncio.get_running_loop()

        def tell() -> None:
            # The loop may have ended just now.
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(self._news.set)

        stop_listening = self._view.listen(tell)
        sending, ending = asyncio.create_task(self._send()), asyncio.create_task(self._end())
        try:
            async for message in self._socket:
                if message.type == WSMsgType.TEXT:
                    self._take(message.data)
        finally:
            stop_listening()
            for task in (sending, ending, *self._tasks):
                task.cancel()
                with suppress(asyncio.CancelledError, ConnectionError):
                    await task

    async def _end(self) -> None:
        await self._ended.wait()
        await self._socket.close()

    async def _send(self) -> None:
        """Send the state when it changes, and frames as often as the page takes them and rendering allows."""
        state: str | None = None
        while not self._socket.closed:
            text = _json({"kind": "state", **self._view.state()})
            if text != state:
                state = text
                await self._socket.send_str(text)
            mark: Any = self._view.mark()
            is_other = mark is not None and (self._sent is None or mark[:4] != self._sent[:4])
            if self._is_ready and mark is not None and mark != self._sent and (is_other or perf_counter() >= self._due):
                began = perf_counter()
                self._sent, self._is_ready = mark, False
                await self._send_frame()
                self._due = began + max(FRAME_SECONDS, FRAME_SHARE * (perf_counter() - began))
            self._news.clear()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._news.wait(), FRAME_SECONDS)

    async def _send_frame(self) -> None:
        layer = self._layer

        def encode() -> bytes | None:
            frame = self._view.frame(layer)
            return None if frame is None else frame.encode()

        content = await asyncio.to_thread(encode)
        if content is not None:
            await self._socket.send_bytes(content)

    def _take(self, text: str) -> None:
        """Take a message of the page."""
        try:
            message = json.loads(text)
        except ValueError:
            return
        if not isinstance(message, dict):
            return
        if message.get("do") == "ready":
            self._is_ready = True
            # What drawing has taken, in ms, is taken from the render, where both have the same processors.
            drawing = message.get("drawing")
            if isinstance(drawing, int | float):
                seconds = 1e-3 * drawing
                self._due = max(self._due, perf_counter() + FRAME_SHARE * min(seconds, _MAX_DRAWING))
            self._news.set()
            return
        if message.get("do") == "layer":
            self._layer, self._sent = str(message.get("name")), None
            self._news.set()
            return
        task = asyncio.create_task(self._answer(message))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _answer(self, message: dict[str, Any]) -> None:
        try:
            reply = await asyncio.to_thread(self._view.handle, message)
        except (InputError, OutputError) as error:
            reply = {"kind": "refused", "text": str(error)}
        except (KeyError, TypeError, ValueError) as error:
            reply = {"kind": "refused", "text": f"not understood: {error}"}
        if reply is not None and not self._socket.closed:
            await self._socket.send_str(_json(reply))


def _json(reply: Mapping[str, Any]) -> str:
    return json.dumps(to_plain(reply), allow_nan=False)
