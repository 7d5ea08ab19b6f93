"""Estimate the memory of a render before it starts, and compare it with the memory that there is.

All constants are measured, on Linux with glibc, by the peak of the resident memory of processes that did one thing; an
estimate was within a quarter of the peak for every render tried (docs/reliability.md).
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from raytracer.core.error_estimate.halves import FIRST_SPP
from raytracer.core.geometry import Geometry, Primitive
from raytracer.rendering.compilation import has_kernel
from raytracer.rendering.film_region import empty_tile
from raytracer.rendering.tile_job import film_arrays
from raytracer.rendering.tile_scheduler import TILE_SIZE
from raytracer.scene.cache import RenderCache
from raytracer.scene.pack.scene import PackedScene
from raytracer.util.errors import InputError
from raytracer.util.machine import memory_limits

if TYPE_CHECKING:
    from raytracer.core.embree import InstanceArray

ERROR_ESTIMATOR_BYTES = 48
"""Bytes of a pixel for `error_estimate.halves.ErrorEstimator`, from the first samples on that it keeps."""

EXPOSED_BYTES, SENSOR_BYTES = 100, 330
"""Bytes of a pixel of a photograph, besides: exposed copies, and the numbers that a simulated sensor draws."""

# Bytes of a pixel of a film without AOVs: `film.Film`.
_FILM_BYTES = 64

# Bytes of a pixel, while the film is searched for fireflies.
_FIREFLY_BYTES = 64

# Bytes of a pixel of plain radiance, while an image is made of the film; its layers are as large as the film's.
_DEVELOPING_BYTES = 24

# Bytes for the denoiser: of a pixel, its scratch memory, which it bounds, and its inputs and outputs; and for all.
_SCRATCH_BYTES, _MAX_SCRATCH, _DENOISED_BYTES, _DENOISER_BYTES = 840, 3 * 10**9, 72, 60 * 10**6

# Bytes of a scene's kernel: of its code and tables; and of these with the compiler and what it leaves, which take from
# 154 MB, with parts at hand, to 292 MB.
_KERNEL_BYTES, _COMPILER_BYTES = 15 * 10**6, 200 * 10**6

# Bytes of a thread: its workspace, its stack and the allocator's arena.
_THREAD_BYTES = 300_000

_GIGABYTE, _MEGABYTE = 1e9, 1e6

# A peak may be this part of its estimate: what may fit the machine is not refused.
_ESTIMATE_MARGIN = 0.8


class StructureMemory(NamedTuple):
    """Bytes of the ray caster's structure: the peak, while it is built; and afterwards."""

    peak: int
    resident: int


# Bytes of a primitive in the ray caster's structure, without the buffers, which the packed scene has: of still ones, of
# moving ones with two poses, and what each further pose adds.
_BYTES_PER_PRIMITIVE = {
    Primitive.TRIANGLE: (StructureMemory(100, 68), StructureMemory(136, 57), 15),
    Primitive.SPHERE: (StructureMemory(35, 35), StructureMemory(122, 43), 15),
    Primitive.DISC: (StructureMemory(35, 35), StructureMemory(122, 43), 15),
}
_BYTES_PER_INSTANCE = (StructureMemory(109, 77), StructureMemory(247, 168), 15)


def structure_bytes(
    geometries: Mapping[int, Geometry], groups: Sequence[Mapping[int, Geometry]], placements: "Sequence[InstanceArray]"
) -> StructureMemory:
    """Estimate the memory of `embree.Accel` for a scene, besides the buffers that it is given."""
    parts = [(_BYTES_PER_INSTANCE, len(placed.group), len(placed.poses)) for placed in placements]
    for geometry in (geometry for group in (geometries, *groups) for geometry in group.values()):
        count = len(geometry.vertices[0] if geometry.indices is None else geometry.indices)
        parts.append((_BYTES_PER_PRIMITIVE[geometry.primitive], count, len(geometry.vertices)))
    peak = resident = 0
    for (still, moving, per_pose), count, poses in parts:
        each, more = (still, 0) if poses == 1 else (moving, (poses - 2) * per_pose)
        peak, resident = peak + count * (each.peak + more), resident + count * (each.resident + more)
    return StructureMemory(peak, resident)


class PictureMemory(NamedTuple):
    """The memory of a picture that is rendered at once.

    pixels : number of pixels.
    film (bytes) : of a pixel of the film, AOVs included.
    spp : samples a pixel, None without a limit.
    photograph (bytes) : of a pixel besides, `EXPOSED_BYTES` or `SENSOR_BYTES` for a photograph.
    with_checkpoints : True if checkpoints are written.
    denoise : True if the picture is denoised.
    """

    pixels: int
    film: int
    spp: int | None = None
    photograph: int = 0
    with_checkpoints: bool = False
    denoise: bool = False

    def bytes(self) -> int:
        """Return the most bytes that it takes, from the first sample to the end of its development."""
        film = self.film + (0 if self.spp is not None and self.spp < FIRST_SPP else ERROR_ESTIMATOR_BYTES)
        # A checkpoint copies the film, while the film is neither searched nor developed.
        copied = film if self.with_checkpoints else 0
        developed = _DEVELOPING_BYTES + self.film - _FILM_BYTES + self.photograph
        most = self.pixels * (film + max(copied, _FIREFLY_BYTES, developed))
        if not self.denoise:
            return most
        scratch = min(self.pixels * _SCRATCH_BYTES, _MAX_SCRATCH) + _DENOISER_BYTES
        return max(most, self.pixels * (film + _DEVELOPING_BYTES + _DENOISED_BYTES) + scratch)


class MemoryEstimate(NamedTuple):
    """The most memory that a process takes.

    now (bytes) : memory that it has.
    parts (bytes) : memory that is added, by what it is for.
    """

    now: int
    parts: Mapping[str, int]

    @property
    def total(self) -> int:
        """Return all bytes."""
        return self.now + sum(self.parts.values())


def picture_memory(
    packed: PackedScene,
    pixels: int,
    spp: int | None,
    aovs: Sequence[str],
    *,
    denoise: bool = False,
    with_checkpoints: bool = False,
) -> PictureMemory:
    """Estimate the memory of so many pixels of a scene's picture, with these AOVs.

    Raises
    ------
    InputError : there is no AOV of that name.
    """
    spec = packed.spec
    tile = empty_tile(packed, aovs, denoise=denoise)
    film = sum(array.nbytes for array in film_arrays(tile)) // TILE_SIZE**2
    if spec.camera.simulated_sensor() is not None:
        photograph = SENSOR_BYTES
    else:
        settings = spec.camera.exposure_settings(spec.film.width, spec.film.height)
        is_plain = spec.film.white_balance is None and settings is None
        photograph = 0 if is_plain else EXPOSED_BYTES
    return PictureMemory(pixels, film, spp, photograph, with_checkpoints, denoise)


def structure_memory(packed: PackedScene, cache: RenderCache | None = None) -> StructureMemory:
    """Estimate the memory that the ray caster's structure of a scene will add; none if it is there already."""
    is_cached = cache is not None and cache.has_structure(packed.accel_input())
    if is_cached or packed.built is not None:
        return StructureMemory(0, 0)
    return structure_bytes(packed.objects.geometries, packed.objects.groups, packed.objects.placements)


def kernel_bytes(packed: PackedScene, aovs: Sequence[str], *, denoise: bool = False) -> int:
    """Estimate the memory of a scene's kernel with these AOVs, and of compiling it unless that is done."""
    is_compiled = has_kernel(packed.scene, empty_tile(packed, aovs, denoise=denoise))
    return _KERNEL_BYTES if is_compiled else _COMPILER_BYTES


def estimate_memory(structure: StructureMemory, picture: PictureMemory, kernel: int, threads: int) -> MemoryEstimate:
    """Estimate the memory of this process once a scene is packed: structure, kernel and picture."""
    rest = {"the picture": picture.bytes(), "the kernel and its threads": kernel + threads * _THREAD_BYTES}
    # Either while the structure is built, or later.
    later = structure.resident + sum(rest.values())
    if structure.peak > later:
        return MemoryEstimate(resident_bytes(), {_STRUCTURE: structure.peak})
    return MemoryEstimate(resident_bytes(), {_STRUCTURE: structure.resident, **rest})


_STRUCTURE = "the ray caster's structure"


def resident_bytes() -> int:
    """Return the resident memory of this process."""
    import psutil

    return int(psutil.Process().memory_info().rss)


def check_memory(needed: MemoryEstimate, limit: int | None = None) -> None:
    """Check that there is as much memory as is needed.

    limit (bytes) : memory that the process may take; what the machine has if None.  What the machine has is compared
        with four fifths of the estimate, and swap counts, so that nothing is refused that would have fitted.

    Raises
    ------
    InputError : there is not.
    """
    if limit is not None:
        if needed.total > limit:
            raise InputError(_refusal_message(needed, f"{_format_bytes(limit)} allowed by --max-memory"))
        return
    added = needed.total - needed.now
    for bound in memory_limits():
        if _ESTIMATE_MARGIN * added > bound.bytes:
            raise InputError(_refusal_message(needed, f"{_format_bytes(needed.now + bound.bytes)} {bound.source}"))


def _refusal_message(needed: MemoryEstimate, available: str) -> str:
    parts = {**needed.parts, "the program and the packed scene": needed.now}
    largest = max(parts, key=lambda name: parts[name])
    return (
        f"this would take about {_format_bytes(needed.total)} of memory, and there are {available}; "
        f"{_format_bytes(parts[largest])} of it are {largest}{_HELP.get(largest, '')}"
    )


_HELP = {
    "the picture": ": a smaller film, --crop, fewer AOVs or no --denoise take less, as do the views of an array by "
    "rt lightfield render --memory",
    _STRUCTURE: ": fewer triangles take less, as do instances of one group in place of copies",
}


def _format_bytes(size: float) -> str:
    return f"{size / _GIGABYTE:.3g} GB" if size >= _GIGABYTE else f"{size / _MEGABYTE:.0f} MB"
