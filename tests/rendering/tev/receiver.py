"""A viewer as small as can be: reads packets of tev's protocol, and makes pictures of them."""

import socket
import struct
import threading

import numpy as np


class Fields:
    """The fields of a packet, read one after the other."""

    def __init__(self, packet: bytes) -> None:
        self._packet, self._at = packet, 0

    def take(self, form: str):
        values = struct.unpack_from("<" + form, self._packet, self._at)
        self._at += struct.calcsize("<" + form)
        return values[0] if len(values) == 1 else values

    def text(self) -> str:
        end = self._packet.index(b"\0", self._at)
        text, self._at = self._packet[self._at : end].decode(), end + 1
        return text

    def floats(self):
        return np.frombuffer(self._packet, "<f4", offset=self._at)


class Receiver:
    """A viewer; `images` has its pictures by name, `operations` what it was told, of the connections so far."""

    def __init__(self, port: int = 0) -> None:
        self.images, self.operations, self.focused = {}, [], []
        self._server = socket.create_server(("127.0.0.1", port))
        self.address = f"127.0.0.1:{self._server.getsockname()[1]}"
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *error) -> None:
        self._server.close()

    def wait(self) -> None:
        """Wait until the connection has ended."""
        self._thread.join(10.0)
        assert not self._thread.is_alive()

    def _serve(self) -> None:
        try:
            connection, _ = self._server.accept()
        except OSError:
            # Nobody came.
            return
        with connection, connection.makefile("rb") as stream:
            while head := stream.read(4):
                (length,) = struct.unpack("<I", head)
                self.take(head + stream.read(length - 4))

    def take(self, packet: bytes) -> None:
        fields = Fields(packet)
        length, operation, focus, name = fields.take("I"), fields.take("B"), fields.take("B"), fields.text()
        assert length == len(packet)
        self.operations.append(operation)
        self.focused += [name] if focus else []
        {4: self._create, 6: self._update}[operation](name, fields)

    def _create(self, name: str, fields: Fields) -> None:
        width, height, channels = fields.take("iii")
        assert [fields.text() for _ in range(channels)] == ["R", "G", "B"]
        self.images[name] = np.zeros((height, width, channels), np.float32)

    def _update(self, name: str, fields: Fields) -> None:
        count = fields.take("i")
        assert [fields.text() for _ in range(count)] == ["R", "G", "B"]
        x, y, width, height = fields.take("iiii")
        offsets, strides = (fields.take(f"{count}q") for _ in range(2))
        data, pixels = fields.floats(), np.arange(width * height)
        last = np.array(offsets) + (width * height - 1) * np.array(strides)
        assert len(data) == last.max() + 1
        for channel, (offset, stride) in enumerate(zip(offsets, strides, strict=True)):
            part = data[offset + stride * pixels].reshape(height, width)
            self.images[name][y : y + height, x : x + width, channel] = part
