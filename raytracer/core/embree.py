"""Ray casting by Embree: the library, scenes built from geometry, and `intersect` and `occluded` for kernels.

The only module that knows ctypes and `embreex`.  The `embreex` wheel ships the whole Embree 4 library; its own
classes take triangles only and give no pointer, so the C interface is called directly: through ctypes to build,
and as an external function inside compiled kernels to trace.

References: Wald et al. 2014, "Embree: A Kernel Framework for Efficient CPU Ray Tracing", ACM TOG 33(4);
Embree 4 API reference (rtcNewScene, rtcSetSharedGeometryBuffer, rtcIntersect8, RTC_GEOMETRY_TYPE_INSTANCE_ARRAY).
"""

import contextlib
import ctypes
import os
import weakref
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import llvmlite.binding
import numpy as np
from numpy.typing import ArrayLike, NDArray

from raytracer.core.compiler.declarations import external_function
from raytracer.core.compiler.dispatch import kernel
from raytracer.core.embree_library import EmbreeError, find_library
from raytracer.core.geometry import Geometry, Primitive

PACKET = 8
"""Rays that one call traces together (lanes of a packet): on AVX2, the cover took 3.4 s by 16, 3.1 s by 8."""

_ERRORS = {
    1: "unknown error",
    2: "invalid argument",
    3: "invalid operation",
    4: "out of memory",
    5: "unsupported CPU",
    6: "cancelled",
}

_NO_MEMORY = 4

_TYPES = {Primitive.TRIANGLE: 0, Primitive.SPHERE: 50, Primitive.DISC: 52}
_INSTANCE_ARRAY = 122
_FORMATS = {
    ("u", 1): 0x5001,
    ("u", 3): 0x5003,
    ("f", 3): 0x9003,
    ("f", 4): 0x9004,
    # Poses: a matrix of 3 x 4, and a quaternion decomposition.
    ("f", 12): 0x9134,
    ("f", 16): 0xB001,
}
_INDEX_BUFFER, _VERTEX_BUFFER, _NORMAL_BUFFER, _TRANSFORM_BUFFER = 0, 1, 3, 23
_COMPACT, _ROBUST = 2, 4
_BUILD_QUALITY_HIGH = 2


_PATH = find_library()
if hasattr(os, "add_dll_directory"):
    # Windows would not find the TBB library beside Embree's by itself.
    os.add_dll_directory(str(_PATH.parent))
_LIBRARY = ctypes.CDLL(str(_PATH))
llvmlite.binding.load_library_permanently(str(_PATH))

_ErrorFunction = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p)


def _declare(name: str, result: Any, *arguments: Any) -> Any:
    function = getattr(_LIBRARY, name)
    function.restype, function.argtypes = result, arguments
    return function


_ptr, _uint, _size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
_new_device = _declare("rtcNewDevice", _ptr, ctypes.c_char_p)
_release_device = _declare("rtcReleaseDevice", None, _ptr)
_set_error_function = _declare("rtcSetDeviceErrorFunction", None, _ptr, _ErrorFunction, _ptr)
_device_error = _declare("rtcGetDeviceError", ctypes.c_int, _ptr)
_new_scene = _declare("rtcNewScene", _ptr, _ptr)
_release_scene = _declare("rtcReleaseScene", None, _ptr)
_set_scene_flags = _declare("rtcSetSceneFlags", None, _ptr, _uint)
_set_build_quality = _declare("rtcSetSceneBuildQuality", None, _ptr, _uint)
_commit_scene = _declare("rtcCommitScene", None, _ptr)
_new_geometry = _declare("rtcNewGeometry", _ptr, _ptr, _uint)
_release_geometry = _declare("rtcReleaseGeometry", None, _ptr)
_commit_geometry = _declare("rtcCommitGeometry", None, _ptr)
_set_time_steps = _declare("rtcSetGeometryTimeStepCount", None, _ptr, _uint)
_attach = _declare("rtcAttachGeometryByID", None, _ptr, _ptr, _uint)
_share = _declare("rtcSetSharedGeometryBuffer", None, _ptr, _uint, _uint, _uint, _ptr, _size, _size, _size)
_intersect1 = _declare("rtcIntersect1", None, _ptr, _ptr, _ptr)
_set_instanced = _declare("rtcSetGeometryInstancedScenes", None, _ptr, ctypes.POINTER(_ptr), _size)


class Device:
    """An Embree device: its worker threads for building, and its error reports.

    Parameters
    ----------
    config : Embree's configuration string, such as "isa=avx2" or "threads=1".
    """

    def __init__(self, config: str = "") -> None:
        self._errors: list[str] = []
        handle = _new_device(config.encode())
        if not handle:
            code = _device_error(None)
            raise EmbreeError(f"Embree could not start: {_ERRORS.get(code, code)}")
        self.handle: int = handle

        # Embree calls back on the thread that failed; the exception is raised by `check` where Python can see it.
        errors = self._errors
        self._callback = _ErrorFunction(
            lambda _, code, text: errors.append(f"{_ERRORS.get(code, code)}: {(text or b'').decode(errors='replace')}")
        )
        _set_error_function(handle, self._callback, None)
        self._finalizer = weakref.finalize(self, _release_device, handle)

    def check(self) -> None:
        """Raise the first error that was reported since the last check.

        Raises
        ------
        EmbreeError : with Embree's own words.
        MemoryError : there was not enough for it.
        """
        if self._errors:
            first = self._errors[0]
            self._errors.clear()
            if first.startswith(_ERRORS[_NO_MEMORY]):
                raise MemoryError(f"Embree: {first}")
            raise EmbreeError(f"Embree: {first}")


class InstanceArray(NamedTuple):
    """Placements of groups in the scene, many at once.

    Attributes
    ----------
    group : uint32 (n,), the group of each placement.
    poses : float32, one array a time step, all of one kind: (n, 12), rows of a 3x4 matrix from the group's space to the
        world's; or (n, 16), the fields of an RTCQuaternionDecomposition, between which Embree turns at a constant rate.
    """

    group: NDArray[np.uint32]
    poses: tuple[NDArray[np.float32], ...]


class RayHit(NamedTuple):
    """The hit of one ray: its distance (m) and Embree's numbers, -1 for no instance."""

    distance: float
    geometry: int
    primitive: int
    instance: int
    placement: int


class Accel:
    """A built Embree scene, which kernels take by its `address`.  It is freed with this object.

    Parameters
    ----------
    geometries : by the geometry number that their hits have.
    groups : the geometries of each group, likewise; a group is in the scene only where it is placed.
    placements : hits of entry k have the instance number `first_instance` + k, and the placement's index in it.
    first_instance : greater than the number of any geometry.

    Raises
    ------
    EmbreeError : Embree refused a geometry or ran out of memory.
    """

    def __init__(
        self,
        geometries: Mapping[int, Geometry] | Sequence[Geometry],
        groups: Sequence[Mapping[int, Geometry]] = (),
        placements: Sequence[InstanceArray] = (),
        *,
        first_instance: int = 0,
        robust: bool = True,
        device: Device | None = None,
    ) -> None:
        self.device = device or Device()
        # Buffers are shared with Embree, so they live as long as the scene; the device too.
        self._buffers: list[Any] = [self.device]
        self._handles: list[int] = []
        self._finalizer = weakref.finalize(self, _release, self._handles, self._buffers)
        self._flags = _ROBUST if robust else 0
        scenes = [self._build(group, {}, []) for group in groups]
        numbered = geometries if isinstance(geometries, Mapping) else dict(enumerate(geometries))
        self.address = self._build(numbered, dict(enumerate(placements, first_instance)), scenes)

    def cast(self, origin: ArrayLike, direction: ArrayLike, *, beyond: float = 0.0, time: float = 0.0) -> RayHit | None:
        """Find the nearest hit of a single ray, None for a miss; kernels trace packets instead.

        Parameters
        ----------
        origin, direction : (3,); the direction a unit vector, so that distances are in metres.
        beyond : distance (m) at which the ray starts.
        time : fraction of the exposure, 0 to 1.
        """
        floats = _aligned(np.float32, _ROWS)
        ints = floats.view(np.uint32)
        floats[ORIGIN : ORIGIN + 3], floats[DIRECTION : DIRECTION + 3] = origin, direction
        floats[TNEAR], floats[TIME], floats[TFAR] = beyond, time, np.inf
        ints[MASK] = ints[GEOMETRY] = ints[INSTANCE] = MISS
        _intersect1(self.address, floats.ctypes.data, None)
        if ints[GEOMETRY] == MISS:
            return None
        placed = ints[INSTANCE] != MISS
        instance, placement = (int(ints[INSTANCE]), int(ints[PLACEMENT])) if placed else (-1, -1)
        return RayHit(float(floats[TFAR]), int(ints[GEOMETRY]), int(ints[PRIMITIVE]), instance, placement)

    def _build(
        self, geometries: Mapping[int, Geometry], placements: Mapping[int, InstanceArray], scenes: Sequence[int]
    ) -> int:
        """Build and commit a scene of geometries, and of placements of scenes that are built already."""
        handle = _new_scene(self.device.handle)
        self.device.check()
        self._handles.append(handle)
        _set_scene_flags(handle, self._flags)
        _set_build_quality(handle, _BUILD_QUALITY_HIGH)
        for number, geometry in geometries.items():
            self._attach(handle, number, geometry)
        for number, placed in placements.items():
            self._place(handle, number, placed, scenes)
        _commit_scene(handle)
        self.device.check()
        return int(handle)

    def _attach(self, scene: int, number: int, geometry: Geometry) -> None:
        """Give one geometry's buffers to the scene."""
        with self._new_geometry(scene, number, _TYPES[geometry.primitive], len(geometry.vertices)) as item:
            for step, vertices in enumerate(geometry.vertices):
                self._share(item, _VERTEX_BUFFER, step, vertices)
                if geometry.normals is not None:
                    self._share(item, _NORMAL_BUFFER, step, geometry.normals)
            if geometry.indices is not None:
                self._share(item, _INDEX_BUFFER, 0, geometry.indices)

    def _place(self, scene: int, number: int, placed: InstanceArray, scenes: Sequence[int]) -> None:
        """Add an instance array to the scene: for 10,000 placements it takes 0.9 MB, where instances take 3.3 MB."""
        # Embree 4.4 shows the first scene in an array of one placement, whatever the index says.
        alone = len(placed.group) == 1
        shown, group = ([scenes[placed.group[0]]], np.zeros(1, np.uint32)) if alone else (scenes, placed.group)
        with self._new_geometry(scene, number, _INSTANCE_ARRAY, len(placed.poses)) as item:
            _set_instanced(item, (_ptr * len(shown))(*shown), len(shown))
            self._share(item, _INDEX_BUFFER, 0, group[:, None])
            for step, poses in enumerate(placed.poses):
                self._share(item, _TRANSFORM_BUFFER, step, poses)

    @contextlib.contextmanager
    def _new_geometry(self, scene: int, number: int, kind: int, steps: int) -> Iterator[int]:
        """Make a geometry whose buffers are shared in a `with` block, and add it to the scene."""
        item = _new_geometry(self.device.handle, kind)
        self.device.check()
        try:
            if steps > 1:
                _set_time_steps(item, steps)
            yield item
            _commit_geometry(item)
            _attach(scene, item, number)
            self.device.check()
        finally:
            _release_geometry(item)

    def _share(self, item: int, kind: int, slot: int, rows: NDArray[Any]) -> None:
        """Share an array of shape (n, width), float32 or uint32, with Embree."""
        if rows.dtype.itemsize != 4 or not rows.flags.c_contiguous:
            raise EmbreeError("geometry buffers must be contiguous arrays of 32-bit numbers")
        width = rows.shape[1]
        form = _FORMATS[rows.dtype.kind, width]
        self._buffers.append(rows)
        _share(item, kind, slot, form, rows.ctypes.data, 0, 4 * width, rows.shape[0])


def _release(handles: list[int], buffers: list[Any]) -> None:
    # The scene that instances the others was built last.
    for handle in reversed(handles):
        _release_scene(handle)
    buffers.clear()


class RayPackets(NamedTuple):
    """Rays and their hits, lane after lane, in packets of the layout of RTCRayHit8.

    Attributes
    ----------
    floats : float32 (packets, _ROWS, PACKET), the fields of rays and hits.
    ints : uint32, the same memory.
    valid : int32 (PACKET,), -1 for the lanes of the packet in work that hold a ray.
    """

    floats: NDArray[np.float32]
    ints: NDArray[np.uint32]
    valid: NDArray[np.int32]


# Rows of a packet: RTCRay8, then RTCHit8; words of a single ray, RTCRay, then RTCHit.
ORIGIN, TNEAR, DIRECTION, TIME, TFAR, MASK, RAY_ID, FLAGS = 0, 3, 4, 7, 8, 9, 10, 11
NORMAL, U, V, PRIMITIVE, GEOMETRY, INSTANCE, PLACEMENT = 12, 15, 16, 17, 18, 19, 20
_ROWS = 24
_PACKET_BYTES = 4 * _ROWS * PACKET
_LANES = np.uintp(PACKET)

# In 32-bit words: 64 bytes, which is enough for every packet width.
_ALIGNMENT = 16

MISS = np.uint32(0xFFFFFFFF)


def _aligned(dtype: type[np.float32 | np.int32], size: int) -> NDArray[Any]:
    """Allocate zeros (size,) of 32-bit numbers, at a multiple of 64 bytes."""
    memory = np.zeros(size + _ALIGNMENT, dtype)
    skip = (-memory.ctypes.data // 4) % _ALIGNMENT
    return memory[skip : skip + size]


def ray_packets(rays: int = PACKET) -> RayPackets:
    """Make packets for so many rays, aligned to 64 bytes as the widest instruction set requires.

    All constant fields are set.
    """
    packets = -(-rays // PACKET)
    floats = _aligned(np.float32, packets * _ROWS * PACKET).reshape(packets, _ROWS, PACKET)
    ints = floats.view(np.uint32)
    ints[:, MASK] = MISS
    return RayPackets(floats, ints, _aligned(np.int32, PACKET))


# Called with the addresses of which lanes are valid, of the scene, of the rays, and of nothing.
_rtc_intersect8, _rtc_occluded8 = external_function("rtcIntersect8", 4), external_function("rtcOccluded8", 4)


@kernel
def intersect(accel, rays, count):
    """Find the nearest hits of the first `count` rays; a miss leaves MISS in the field GEOMETRY.

    A hit of a geometry that is not in a group leaves MISS in INSTANCE; else this names the Placements, and PLACEMENT
    which of them.
    """
    for packet in range((count + PACKET - 1) // PACKET):
        for lane in range(PACKET):
            rays.valid[lane] = -1 if packet * PACKET + lane < count else 0
            rays.ints[packet, GEOMETRY, lane] = MISS
            rays.ints[packet, INSTANCE, lane] = MISS
        _rtc_intersect8(rays.valid.ctypes.data, accel, rays.floats.ctypes.data + packet * _PACKET_BYTES, 0)


@kernel
def occluded(accel, rays, count):
    """Find out which of the first `count` rays are occluded: TFAR becomes -inf for these."""
    for packet in range((count + PACKET - 1) // PACKET):
        for lane in range(PACKET):
            rays.valid[lane] = -1 if packet * PACKET + lane < count else 0
        _rtc_occluded8(rays.valid.ctypes.data, accel, rays.floats.ctypes.data + packet * _PACKET_BYTES, 0)


@kernel
def load_float(rays, lane, field):
    """Read a field of a lane, float32."""
    at = np.uintp(lane)
    return rays.floats[at // _LANES, field, at % _LANES]


@kernel
def load_int(rays, lane, field):
    """Read a field of a lane, uint32."""
    at = np.uintp(lane)
    return rays.ints[at // _LANES, field, at % _LANES]


@kernel
def store_float(rays, lane, field, value):
    """Write a field of a lane."""
    at = np.uintp(lane)
    rays.floats[at // _LANES, field, at % _LANES] = value


@kernel
def set_ray(rays, lane, origin, direction, tfar):
    """Write a ray into a lane; `direction` is a unit vector, so that distances are `t`."""
    for axis in range(3):
        store_float(rays, lane, ORIGIN + axis, origin[axis])
        store_float(rays, lane, DIRECTION + axis, direction[axis])
    store_float(rays, lane, TNEAR, 0.0)
    store_float(rays, lane, TFAR, tfar)
