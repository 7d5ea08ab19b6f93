"""Parts of files, and repairs of what mutations break first, so that they reach what lies behind: lengths and sums."""

import base64
import io
import json
import struct
import zlib

import numpy as np


def npy(array, order="C"):
    buffer = io.BytesIO()
    np.save(buffer, np.asarray(array, order=order))
    return buffer.getvalue()


def with_header(text, numbers, version=1):
    """A .npy file with a header of the right length, whatever it says."""
    length = struct.pack("<H" if version == 1 else "<I", min(len(text), 2**16 - 1))
    return b"\x93NUMPY" + bytes([version, 0]) + length + text + numbers


def with_sums(data):
    """A PNG file whose chunks have the checksums that belong to them."""
    result, start = [data[:8]], 8
    while start + 12 <= len(data):
        length = int.from_bytes(data[start : start + 4], "big")
        chunk = data[start + 4 : start + 8 + length]
        if len(chunk) < 4 + length:
            break
        result.append(data[start : start + 4] + chunk + struct.pack(">I", zlib.crc32(chunk)))
        start += 12 + length
    return b"".join([*result, data[start:]])


def glb(text, binary):
    """A .glb file with chunks of the right lengths."""
    parts = [(text + b" " * (-len(text) % 4), b"JSON")]
    if binary is not None:
        parts.append((binary + bytes(-len(binary) % 4), b"BIN\x00"))
    chunks = b"".join(struct.pack("<I", len(part)) + kind + part for part, kind in parts)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


# ---- JSON that stays JSON

_MOST_CHANGES = 12

_VALUES = (
    0, 1, 2, 3, 4, 5, 7, -1, -5, 12, 255, 2**16, 2**31, 2**32 - 1, 2**53, 2**64, 10**9, 10**30, 10**400, 0.5, -0.0,
    1e300, 1e-300, float("nan"), float("inf"), True, False, None, "", "x", "VEC2", "VEC3", "SCALAR", "MAT4", "..",
    "data:,", "data:;base64,AAAA", "data:;base64,?", "http://example.org/a.bin", "/dev/zero", "../a.bin", "model.gltf",
    "%00", "\ud800", [], {}, [0], [1], [0, 0], [0, 1, 2], [[]], [{}], {"a": 1}, [1.0] * 3, [0.0] * 4, [1e200] * 16,
    [0.0] * 16, 5120, 5121, 5122, 5123, 5125, 5126, 6,
)  # fmt: skip


def _places(document):
    """Every container within a document, with each of its keys."""
    found, waiting = [], [document]
    while waiting:
        holder = waiting.pop()
        for key, value in holder.items() if isinstance(holder, dict) else enumerate(holder):
            found.append((holder, key))
            if isinstance(value, dict | list):
                waiting.append(value)
    return found


def altered(document, choices):
    """`document` after as many changes as `choices` has fours of bytes, but a few: where, how, with which value."""
    places = _places(document)
    for start in range(0, min(len(choices) - 3, 4 * _MOST_CHANGES), 4):
        where, how, which = struct.unpack_from("<HBB", choices, start)
        holder, key = places[where % len(places)]
        # What an earlier change has taken away stays away.
        if not (key in holder if isinstance(holder, dict) else key < len(holder)):
            continue
        if how % 4 == 0 and isinstance(holder, dict):
            del holder[key]
        elif how % 4 == 1 and isinstance(holder, list):
            holder.insert(key, _copied(holder[which % len(holder)]))
        elif how % 4 == 2:
            other, name = places[which * 7 % len(places)]
            holder[key] = _copied(other[name]) if isinstance(other, dict) and name in other else which
        else:
            holder[key] = _copied(_VALUES[which % len(_VALUES)])
    return document


def _copied(value):
    return json.loads(json.dumps(value)) if isinstance(value, dict | list) else value


def uri(data):
    return f"data:application/octet-stream;base64,{base64.b64encode(data).decode()}"
