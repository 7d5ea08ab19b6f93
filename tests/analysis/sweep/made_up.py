"""A sweep that nobody rendered: pictures of noise, and numbers of which each is its own."""

import numpy as np
import PIL.Image

from raytracer.analysis.sweep.results import Axis, PointResult, Sweep, SweepPoint

WIDTH, HEIGHT = 48, 32

F_NUMBER = Axis("camera.f_number", (1.4, 2.0, 2.8, 4.0), ("1.4", "2", "2.8", "4"))
FOCUS = Axis("camera.focus_distance", (2.0, 5.0, 10.0), ("2", "5", "10"))
ALBEDO = Axis("materials.<b>&amp;.albedo", ([1, 0, 0], [0, 1, 0]), ("[1,0,0]", "[0,1,0]"))


def picture(point):
    seed = sum(number * 10**place for place, number in enumerate(point.index))
    return np.random.default_rng(seed).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)


def images(taken):
    return picture(taken.point) if taken.status == "done" else None


def made_up(folder, axes=(F_NUMBER, FOCUS), *, zipped=False, failed=(), missing=()):
    shape = (len(axes[0].values),) if zipped else tuple(len(axis.values) for axis in axes)
    taken = []
    for number, place in enumerate(np.ndindex(shape)):
        index = place * len(axes) if zipped else place
        values = {axis.key: axis.values[end] for axis, end in zip(axes, index, strict=True)}
        name = " ".join(f"{axis.key.split('.')[-1]}={axis.labels[end]}" for axis, end in zip(axes, index, strict=True))
        point = SweepPoint(index, values, name, f"{number:064x}")
        if index in failed:
            taken.append(PointResult(point, "failed", "camera: <i>no</i> & never"))
        elif index in missing:
            taken.append(PointResult(point, "missing"))
        else:
            taken.append(_done(point, number))
            if folder is not None:
                PIL.Image.fromarray(picture(point)).save(folder / f"{name}.png")
    return Sweep("scene.yaml", axes, zipped, tuple(taken), folder)


def _done(point, number):
    return PointResult(
        point,
        "done",
        files=(f"{point.name}.png", f"{point.name}.exr"),
        camera={
            "vfov_deg": 20.0,
            "focus_distance_m": 2.0 + number,
            "far_limit_m": 12.3456789 + number if number % 2 else float("inf"),
        },
        exposure={"shutter_s": 0.008, "iso": 100.0},
        seconds={"load": 0.01, "render": 1.0 + 0.01 * number, "total": 1.2345 + 0.1 * number},
        samples=64.0,
        rays=123_456_789 + number,
        error={"relative": 0.0123 + 0.001 * number, "low": 0.011, "high": 0.014},
        warnings=("the lens is <wide>",) if number == 0 else (),
    )
