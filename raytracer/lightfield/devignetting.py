"""Devignetting by a white picture: what a camera takes of something evenly bright tells how much light pixels get.

A lens of glass keeps light from the pixels behind the rim of its pupil, the more the farther they are from the axis.
Divided by the white picture, all that got light are as bright as those in the middle; and each counts in a photograph
by the light that it got, so that noise that was divided by little counts little.

References: Dansereau, Pizarro, Williams 2013, "Decoding, Calibration and Rectification for Lenselet-Based Plenoptic
Cameras", CVPR, sec. 4.1.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.film.light_field.field import LIT_LAYER, LightField, Samples
from raytracer.film.light_field.views import Views
from raytracer.lightfield.coverage import require_lit
from raytracer.lightfield.decoding.raw_image import LEAST_LIGHT
from raytracer.plugins.environments.constant import Constant
from raytracer.plugins.materials.lambertian import Lambertian
from raytracer.plugins.shapes.sphere import Sphere
from raytracer.scene.pack.scene import pack as pack_scene
from raytracer.scene.spec import SceneSpec
from raytracer.util.errors import InputError
from raytracer.util.progress import Update, report_progress

FloatArray = NDArray[np.float64]

_SAME = 1e-6
"""Largest difference of places and sizes, relative to the pitch of views and pixels, by which two geometries agree."""

_UNSEEN_RADIUS = 1e-6
"""Radius (m) of the object behind the camera, since a scene has to have one."""


def white_scene(spec: SceneSpec) -> SceneSpec:
    """Put the camera of a scene, focused as it is there, before white all around: a radiance of 1.

    A simulated sensor adds no noise, and is never full: it is the lens that is measured.

    Raises
    ------
    InputError : the camera has no views, or cannot focus.
    """
    layout = spec.camera.layout(spec.film.width, spec.film.height)
    if layout is None or layout.views.rows * layout.views.columns == 1:
        raise InputError("a white picture is of a camera with microlenses, or with many views: this one has no views")
    camera: Any = spec.camera
    if camera.focused_object() is not None or camera.focused_place() is not None:
        camera = pack_scene(spec).spec.camera
    changes: dict[str, Any] = {"medium": None}
    if camera.simulated_sensor() is not None:
        changes["sensor"] = camera.sensor.model_copy(update={"noise": False})
    camera = camera.model_copy(update=changes)
    frame = camera.frame()
    x, y, z = (float(a - b) for a, b in zip(frame.origin, frame.forward, strict=True))
    unseen = Sphere(center=(x, y, z), radius=_UNSEEN_RADIUS, material="unseen")
    return spec.model_copy(
        update={
            "camera": camera,
            "render": spec.render.model_copy(update={"max_depth": 1}),
            "environment": Constant(radiance=(1.0, 1.0, 1.0)),
            "materials": {"unseen": Lambertian()},
            "objects": (unseen,),
            **{key: {} for key in ("textures", "media", "groups")},
            "medium": None,
            "lights": (),
        }
    )


class _View(NamedTuple):
    """A devignetted view: its place, radiance, layers, and samples of microlenses or None."""

    place: tuple[int, int]
    radiance: FloatArray
    layers: dict[str, Any]
    samples: FloatArray | None


def devignette(field: LightField, white: LightField) -> LightField:
    """Divide a light field by that of a white picture of the same camera.

    What got the light of the middle of the picture keeps its radiance, and all else becomes as bright; the layer `lit`
    holds the light of each pixel, by which it counts in photographs.  Single rays are left out.

    Raises
    ------
    InputError : the two are of different cameras, or the white is black in its middle.
    """
    views = list(_divided(field, white, None))
    size = (field.views.rows, field.views.columns)

    def stacked(parts: list[Any]) -> NDArray[Any]:
        return np.asarray(parts).reshape(*size, *np.shape(parts[0]))

    layers = {name: stacked([view.layers[name] for view in views]) for name in views[0].layers}
    samples = None
    if field.samples is not None:
        samples = Samples(field.samples.place, stacked([view.samples for view in views]))
    radiance = stacked([view.radiance for view in views])
    return LightField(radiance, field.views, layers, None, field.settings, samples)


def write_devignetted(path: Path, field: LightField, white: LightField, update: Update | None = None) -> None:
    """Write what `devignette` makes to an `.lf` file, view by view.

    Raises
    ------
    InputError : as `devignette`.
    OutputError : the file cannot be written.
    """
    from raytracer.film.light_field.lf import Writer

    places = None if field.samples is None else field.samples.place
    with Writer(path, field.views, settings=field.settings, microlenses=places) as writer:
        for view in _divided(field, white, update):
            writer.put_view(*view.place, view.radiance, view.layers, view.samples)


def _divided(field: LightField, white: LightField, update: Update | None) -> Iterator[_View]:
    """Divide view by view."""
    _check_same(field.views, white.views)
    if (field.samples is None) != (white.samples is None):
        raise InputError("the white picture is of other microlenses")
    full = light_in_the_middle(white)
    for place in report_progress(list(np.ndindex(field.views.rows, field.views.columns)), update):
        light = white.view(*place) / full
        samples = None
        if field.samples is not None and white.samples is not None:
            samples = _divide(field.samples.value[place], np.asarray(white.samples.value[place]) / full, np.nan)
        layers: dict[str, Any] = {name: np.asarray(layer[place]) for name, layer in field.layers.items()}
        yield _View(place, _divide(field.view(*place), light, 0.0), layers | _lit_layer(light, white, place), samples)


def _divide(values: Any, light: FloatArray, unlit: float) -> FloatArray:
    """Divide values by the light that they had of 1; those that had too little of it become `unlit`."""
    is_lit = light >= LEAST_LIGHT
    return np.asarray(np.where(is_lit, np.asarray(values, dtype=np.float64) / np.where(is_lit, light, 1.0), unlit))


def _lit_layer(light: FloatArray, white: LightField, place: tuple[int, int]) -> dict[str, Any]:
    """Make the layer of the light of a view's pixels; what is divided by too little in any channel is dark."""
    lit = np.where((light >= LEAST_LIGHT).all(axis=-1), light.mean(axis=-1), 0.0)
    within = white.lit(*place)
    return {LIT_LAYER: (lit if within is None else np.where(within, lit, 0.0)).astype(np.float32)}


def light_in_the_middle(white: LightField) -> FloatArray:
    """Measure the light (3,) of the middle third of the view from the middle of the lens."""
    views = white.views
    row, column = views.nearest()
    require_lit(white, row, column)
    rows, columns = (slice(size // 3, size - size // 3) for size in (views.height, views.width))
    full = white.view(row, column)[rows, columns].mean(axis=(0, 1))
    if not (full > 0.0).all():
        raise InputError("the white picture is black in its middle")
    return np.asarray(full)


def _check_same(views: Views, white: Views) -> None:
    """Make sure that two light fields are of the same views."""
    size = views.position.shape, views.width, views.height
    if size != (white.position.shape, white.width, white.height):
        sizes = (f"{it.columns} x {it.rows} views of {it.width} x {it.height}" for it in (views, white))
        raise InputError("the white picture is of another camera: {}, not {}".format(*reversed(list(sizes))))
    step = np.abs(views.position).max()
    moved = np.abs(views.position - white.position).max() > _SAME * step
    planes = np.abs(np.subtract(views.plane, white.plane)).max() > _SAME * views.plane.pixel
    if moved or planes or abs(views.inverse_focus - white.inverse_focus) * step > _SAME * views.plane.pixel:
        raise InputError("the white picture is of another camera, or of another focus or zoom of it")
