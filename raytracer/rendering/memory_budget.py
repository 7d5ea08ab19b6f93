"""What a render takes in memory, estimated before it starts, and what there is.

All constants are measured, on Linux with glibc, by the peak of the resident memory of processes that did one thing; an
estimate was within a quarter of the peak for every render tried (docs/reliability.md).
"""

import contextlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from raytracer.development import recording_of
from raytracer.errands import arrays_of
from raytracer.errors import InputError
from raytracer.geometry import Geometry, Primitive
from raytracer.noise.halves import FIRST
from raytracer.preparation import film_for, view
from raytracer.scene.pack import Packed
from raytracer.scheduling import TILE
from raytracer.stock import Stock

if TYPE_CHECKING:
    from raytracer.embree import Placements

TALLY_BYTES = 48
"""Of a pixel, for what its error is told by: `noise.Tally`, from the first samples on that it keeps."""

EXPOSED_BYTES, SENSOR_BYTES = 100, 330
"""Of a pixel of a photograph, besides: exposed copies, and the numbers that a simulated sensor draws."""

# Of a pixel of a film without AOVs: `film.Film`.
_FILM_BYTES = 64

# Of a pixel, while the film is looked at for fireflies.
_LOOKING_BYTES = 64

# Of a pixel of plain radiance, while an image is made of the film; its layers are as large as what they are made of.
_DEVELOPING_BYTES = 24

# For the denoiser: of a pixel, its scratch memory, which it bounds, and what goes in and comes out; and for all.
_SCRATCH_BYTES, _MOST_SCRATCH, _DENOISED_BYTES, _DENOISER = 840, 3 * 10**9, 72, 60 * 10**6

# Code and tables of a scene's kernel, halfway between what taking it from the cache needs (65 MB) and compiling (160).
_KERNEL_BYTES = 110 * 10**6

# Of a thread: its workspace, its stack and the allocator's room.
_THREAD_BYTES = 300_000

_GIGABYTE, _MEGABYTE = 1e9, 1e6

# How far a peak may lie below its estimate: what may fit the machine is not refused.
_CERTAIN = 0.8


class Room(NamedTuple):
    """Bytes a primitive that the ray caster takes for its structure: while it builds it, and afterwards.

    For what moves they are those with two poses, and those that each further one adds.
    """

    building: int
    held: int
    moving_building: int
    moving_held: int
    pose: int


# Its own memory, without the buffers, which the packed scene has.
_ROOMS = {
    Primitive.TRIANGLE: Room(100, 68, 136, 57, 15),
    Primitive.SPHERE: Room(35, 35, 122, 43, 15),
    Primitive.DISC: Room(35, 35, 122, 43, 15),
}
_PLACED = Room(109, 77, 247, 168, 15)


class Structure(NamedTuple):
    """Bytes of the ray caster's structure: at most, while it is built; and afterwards."""

    building: int
    held: int


def structure_bytes(
    geometries: Mapping[int, Geometry], groups: Sequence[Mapping[int, Geometry]], placements: "Sequence[Placements]"
) -> Structure:
    """What `embree.Accel` takes for a scene, besides the buffers that it is given."""
    found = [
        _room(_ROOMS[geometry.primitive], _count(geometry), len(geometry.vertices))
        for group in (geometries, *groups)
        for geometry in group.values()
    ]
    found += [_room(_PLACED, len(placed.group), len(placed.poses)) for placed in placements]
    return Structure(sum(one.building for one in found), sum(one.held for one in found))


def _count(geometry: Geometry) -> int:
    return len(geometry.vertices[0] if geometry.indices is None else geometry.indices)


def _room(room: Room, count: int, poses: int) -> Structure:
    if poses == 1:
        return Structure(count * room.building, count * room.held)
    more = (poses - 2) * room.pose
    return Structure(count * (room.moving_building + more), count * (room.moving_held + more))


class Picture(NamedTuple):
    """What is rendered at once.

    pixels, how many; film, bytes of one, AOVs included, as kernels gather it; spp, samples, None without a limit;
    photograph, bytes of a pixel besides, `EXPOSED_BYTES` or `SENSOR_BYTES` where one is taken; keeps, whether
    checkpoints are written; denoises, whether Open Image Denoise cleans it.
    """

    pixels: int
    film: int
    spp: int | None = None
    photograph: int = 0
    keeps: bool = False
    denoises: bool = False

    def bytes(self) -> int:
        """What it takes at most, from the first sample to the end of its development."""
        gathered = self.film + (0 if self.spp is not None and self.spp < FIRST else TALLY_BYTES)
        # A checkpoint copies all that was gathered, while the film is neither looked at nor developed.
        copied = gathered if self.keeps else 0
        developed = _DEVELOPING_BYTES + self.film - _FILM_BYTES + self.photograph
        most = self.pixels * (gathered + max(copied, _LOOKING_BYTES, developed))
        if not self.denoises:
            return most
        scratch = min(self.pixels * _SCRATCH_BYTES, _MOST_SCRATCH) + _DENOISER
        return max(most, self.pixels * (gathered + _DEVELOPING_BYTES + _DENOISED_BYTES) + scratch)


class Estimate(NamedTuple):
    """Bytes that a process takes at most: what it has now, and what is added, by what that is for."""

    now: int
    parts: Mapping[str, int]

    @property
    def total(self) -> int:
        """All of it."""
        return self.now + sum(self.parts.values())


def picture_of(
    packed: Packed, pixels: int, spp: int | None, aovs: Sequence[str], *, denoises: bool = False, keeps: bool = False
) -> Picture:
    """So many pixels of a scene's picture, with these AOVs.

    Raises
    ------
    InputError : there is no AOV of that name.
    """
    spec = packed.spec
    recording = recording_of(spec, packed, TILE, TILE, aovs, denoise=denoises)
    sheet = view(film_for(packed.scene, TILE, TILE), aovs=None if recording is None else recording.view)
    film = sum(array.nbytes for array in arrays_of(sheet)) // TILE**2
    if spec.camera.simulated_sensor() is not None:
        photograph = SENSOR_BYTES
    else:
        is_plain = spec.film.white_balance is None and spec.camera.photograph(spec.film.width, spec.film.height) is None
        photograph = 0 if is_plain else EXPOSED_BYTES
    return Picture(pixels, film, spp, photograph, keeps, denoises)


def structure_of(packed: Packed, stock: Stock | None = None) -> Structure:
    """What the ray caster's structure of a scene will add; nothing if it is there already."""
    shapes = packed.geometries, packed.groups, packed.placements
    first, robust = len(packed.scene.primitives), packed.robust
    is_kept = stock is not None and stock.has_structure(*shapes, first_instance=first, robust=robust)
    return Structure(0, 0) if is_kept or packed.built is not None else structure_bytes(*shapes)


def estimate(structure: Structure, picture: Picture, threads: int) -> Estimate:
    """What this process will take once a scene is packed: the ray caster's structure, the kernel and the picture."""
    rest = {"the picture": picture.bytes(), "the kernel and its threads": _KERNEL_BYTES + threads * _THREAD_BYTES}
    # Either while the structure is built, or later.
    later = structure.held + sum(rest.values())
    if structure.building > later:
        return Estimate(resident_bytes(), {_STRUCTURE: structure.building})
    return Estimate(resident_bytes(), {_STRUCTURE: structure.held, **rest})


_STRUCTURE = "the ray caster's structure"


def resident_bytes() -> int:
    """The memory that this process has now."""
    import psutil

    return int(psutil.Process().memory_info().rss)


class Limit(NamedTuple):
    """Bytes that this process may add to what it has, and who says so."""

    bytes: int
    whose: str


def check(needed: Estimate, most: int | None = None) -> None:
    """Make sure that what is needed is there.

    Parameters
    ----------
    most : bytes that the process may take; what the machine has if None.  What the machine has is compared with four
        fifths of the estimate, and swap counts, so that nothing is refused that would have fitted.

    Raises
    ------
    InputError : it is not.
    """
    if most is not None:
        if needed.total > most:
            raise InputError(_refusal(needed, f"{_shown(most)} allowed by --max-memory"))
        return
    added = needed.total - needed.now
    for limit in limits():
        if _CERTAIN * added > limit.bytes:
            raise InputError(_refusal(needed, f"{_shown(needed.now + limit.bytes)} {limit.whose}"))


def _refusal(needed: Estimate, there: str) -> str:
    parts = {**needed.parts, "the program and the packed scene": needed.now}
    largest = max(parts, key=lambda name: parts[name])
    return (
        f"this would take about {_shown(needed.total)} of memory, and there are {there}; "
        f"{_shown(parts[largest])} of it are {largest}{_HELP.get(largest, '')}"
    )


_HELP = {
    "the picture": ": a smaller film, --crop, fewer AOVs or no --denoise take less, as do the views of an array by "
    "rt lightfield render --memory",
    _STRUCTURE: ": fewer triangles take less, as do instances of one group in place of copies",
}


def _shown(size: float) -> str:
    return f"{size / _GIGABYTE:.3g} GB" if size >= _GIGABYTE else f"{size / _MEGABYTE:.0f} MB"


# ---- What there is


def limits() -> Iterator[Limit]:
    """All that bounds what this process may add to its memory, as far as it is known here."""
    import psutil

    machine = psutil.virtual_memory()
    yield Limit(int(machine.available) + int(psutil.swap_memory().free), "free on this machine")
    with contextlib.suppress(ImportError):
        # Windows has none.
        import resource

        soft, _ = resource.getrlimit(resource.RLIMIT_AS)
        if soft != resource.RLIM_INFINITY:
            left = max(0, soft - int(psutil.Process().memory_info().vms))
            yield Limit(left, "left of the limit on this process's address space (ulimit -v)")
    if sys.platform == "linux":
        found = control_group_bytes()
        if found is not None:
            yield Limit(found, "left of the limit on this control group (container or job)")


def control_group_bytes(mounts: Path = Path("/sys/fs/cgroup"), groups: Path = Path("/proc/self/cgroup")) -> int | None:
    """Bytes that the control groups of this process leave it, the least of all; None where none has a limit.

    Parameters
    ----------
    mounts, groups : where Linux shows the groups, and those of this process.

    References: Linux, Documentation/admin-guide/cgroup-v2.rst (memory.max, memory.current, memory.stat) and
        cgroup-v1/memory.rst.
    """
    with contextlib.suppress(OSError):
        lines = [line.split(":", 2) for line in groups.read_text().splitlines()]
        found: list[int] = []
        for line in lines:
            if len(line) != 3:
                continue
            _, controllers, path = line
            if controllers == "":
                found += _groups_left(mounts, path, _V2)
            elif "memory" in controllers.split(","):
                found += _groups_left(mounts / "memory", path, _V1)
        return min(found, default=None)
    return None


class _Names(NamedTuple):
    """What the files of a control group are called, and the word for pages that the system gives back at need."""

    most: str
    now: str
    statistics: str
    files: str
    swap_most: str
    swap_now: str


_V2 = _Names("memory.max", "memory.current", "memory.stat", "file", "memory.swap.max", "memory.swap.current")
_V1 = _Names("memory.limit_in_bytes", "memory.usage_in_bytes", "memory.stat", "total_cache", "", "")


def _groups_left(mount: Path, path: str, names: _Names) -> Iterator[int]:
    """What a group, and those that it is in, leave."""
    import psutil

    inside = [part for part in path.split("/") if part not in ("", "..", ".")]
    for depth in range(len(inside), -1, -1):
        folder = mount.joinpath(*inside[:depth])
        most, now = _number(folder / names.most), _number(folder / names.now)
        if most is None or now is None:
            continue
        cached = 0
        with contextlib.suppress(OSError, ValueError):
            statistics = dict(line.split(None, 1) for line in (folder / names.statistics).read_text().splitlines())
            cached = int(statistics.get(names.files, 0))
        swap = int(psutil.swap_memory().free)
        if names.swap_most:
            swap_most, swap_now = _number(folder / names.swap_most), _number(folder / names.swap_now)
            swap = swap if swap_most is None else min(swap, max(0, swap_most - (swap_now or 0)))
        yield max(0, most - now + cached + swap)


def _number(path: Path) -> int | None:
    """The number in a file; None if there is none, as where it says `max`."""
    with contextlib.suppress(OSError, ValueError):
        return int(path.read_text())
    return None
