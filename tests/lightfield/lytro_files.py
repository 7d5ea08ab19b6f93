"""Files as Lytro's cameras write them: containers, packed pixels, metadata, and white pictures in archives.

They are written from the published description of the formats, not by the reader that they test.
"""

import hashlib
import io
import json
import struct
import tarfile

import numpy as np

F01 = {"bits": 12, "endianness": "big", "first": "b", "black": 168, "white": 4095}
ILLUM = {"bits": 10, "endianness": "little", "first": "gr", "black": 64, "white": 1023}
TILE = "r,gr:gb,b"
ORDERS = {"r": "rggb", "gr": "grbg", "gb": "gbrg", "b": "bggr"}
"""Colours of the first two pixels of the first two rows, by the name of the first pixel in the tile."""

MATRIX = np.array([[1.9, -0.7, -0.2], [-0.4, 1.7, -0.3], [-0.1, -0.6, 1.7]])
GAINS = np.array([1.4, 1.0, 1.6])


def name_of(data):
    return "sha1-" + hashlib.sha1(data, usedforsecurity=False).hexdigest()


def container(contents, *parts):
    """A header, the contents, and a section for each of the parts, each filled up to 16 bytes."""
    out = b"\x89LFP\r\n\x1a\n" + struct.pack(">II", 1, 0)
    for letter, data in ((b"M", json.dumps(contents).encode()), *((b"C", part) for part in parts)):
        out += b"\x89LF" + letter + b"\r\n\x1a\n" + struct.pack(">II", 0, len(data))
        out += name_of(data).encode().ljust(80, b"\0") + data + bytes(-len(data) % 16)
    return out


def packed(codes, bits):
    """Bits one after another: of 12, big-endian; of 10, the lower two bits of four pixels in a byte of their own."""
    flat = codes.astype(np.uint64).ravel()
    if bits == 12:
        flat = np.append(flat, np.zeros(len(flat) % 2, np.uint64)).reshape(-1, 2)
        both = flat[:, 0] << np.uint64(12) | flat[:, 1]
        return both.astype(">u4").view(np.uint8).reshape(-1, 4)[:, 1:].tobytes()
    flat = np.append(flat, np.zeros(-len(flat) % 4, np.uint64)).reshape(-1, 4)
    low = sum((flat[:, i] & np.uint64(3)) << np.uint64(2 * i) for i in range(4))
    return np.column_stack([flat >> np.uint64(2), low]).astype(np.uint8).tobytes()


def metadata(width, height, camera, *, colors=False, **lens):
    """Metadata of a photograph; keys of the F01 are in `rawDetails`, those of the Illum are not."""
    levels = {name: dict.fromkeys(("r", "gr", "gb", "b"), camera[name]) for name in ("black", "white")}
    details = {
        "pixelFormat": {"rightShift": 0, **levels},
        "pixelPacking": {"endianness": camera["endianness"], "bitsPerPixel": camera["bits"]},
        "mosaic": {"tile": TILE, "upperLeftPixel": camera["first"]},
    }
    image = {"width": width, "height": height, "orientation": 1}
    is_first = camera is F01
    image |= {"representation": "rawPacked", "rawDetails": details} if is_first else details
    if colors:
        gains = dict(zip(("r", "gr", "gb", "b"), (GAINS[0], GAINS[1], GAINS[1], GAINS[2]), strict=True))
        key = "ccmRgbToSrgbArray" if is_first else "ccm"
        image["color"] = {key: MATRIX.ravel().tolist(), "whiteBalanceGain": gains, "gamma": 0.4167}
    devices = {
        "clock": {"zuluTime": "2014-05-16T13:31:21.000Z"},
        "sensor": {"bitsPerPixel": camera["bits"], "pixelPitch": 1.4e-06},
        "lens": {"zoomStep": 600, "focusStep": 700, **lens},
        "shutter": {"pixelExposureDuration": 0.01},
    }
    model = {"make": "Lytro, Inc.", "model": "F01" if is_first else "ILLUM", "firmware": "v1"}
    return {"image": image, "devices": devices, "camera": model}


def photo(codes, values, *, serial="A303134643", white=None):
    """A container with a raw picture: its contents name metadata and pixels, as those of the F01 or the Illum do."""
    values, private = json.dumps(values).encode(), json.dumps({"camera": {"serialNumber": serial}}).encode()
    bits = 12 if b"rawDetails" in values else 10
    parts = {"metadataRef": values, "privateMetadataRef": private, "imageRef": packed(codes, bits)}
    if white is not None:
        parts["modulationDataRef"] = packed(white, bits)
    frame = {"frame": {name: name_of(part) for name, part in parts.items()}}
    contents = {"picture": {"frameArray": [frame]}} if bits == 12 else {"frames": [frame]}
    return container(contents, *parts.values())


def white_files(whites, serial="A303134643"):
    """Pairs of files by name: of (codes, metadata)."""
    files = {}
    for number, (codes, values) in enumerate(whites):
        frame = {"frame": {"metadata": values, "privateMetadata": {"camera": {"serialNumber": serial}}}}
        told = {"master": {"picture": {"frameArray": [frame]}}}
        files[f"MOD_{number:04d}.TXT"] = json.dumps(told).encode() + b"\0\0"
        files[f"MOD_{number:04d}.RAW"] = packed(codes, 12 if "rawDetails" in values["image"] else 10)
    return files


def package(files):
    """`data.C.0`: a container of files."""
    names = {f"C:\\T1CALIB\\{name}": data for name, data in files.items()}
    contents = {"files": [{"name": name, "dataRef": name_of(data)} for name, data in names.items()]}
    return container(contents, *names.values())


def archive(files):
    """`caldata-SERIAL.tar`."""
    held = io.BytesIO()
    with tarfile.open(fileobj=held, mode="w") as tar:
        for name, data in files.items():
            info = tarfile.TarInfo(f"unitdata/{name}")
            info.size = len(data)
            tar.addfile(info, io.BytesIO(data))
    return held.getvalue()


def mosaic(radiance, camera, *, colors=False):
    """Codes of linear sRGB (height, width, 3), 1 of which is the largest code of the camera's neutral colour."""
    light = radiance @ np.linalg.inv(MATRIX).T / GAINS if colors else radiance
    codes = camera["black"] + (camera["white"] - camera["black"]) * light
    codes = np.clip(np.rint(codes), 0, camera["white"])
    order = ORDERS[camera["first"]]
    out = np.empty(codes.shape[:2], np.uint16)
    for place, (row, column) in enumerate(np.ndindex(2, 2)):
        out[row::2, column::2] = codes[row::2, column::2, "rgb".index(order[place])]
    return out
