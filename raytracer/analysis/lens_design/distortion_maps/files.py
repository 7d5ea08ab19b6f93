"""Files of a distortion map: JSON values, NumPy's archive, OpenCV's YAML, and text for a terminal."""

import io
import json
import math
from typing import Any

import numpy as np

from raytracer.analysis.lens_design.distortion_maps.distortion_map import DistortionMap
from raytracer.analysis.lens_design.distortion_maps.pixel_grid import FloatArray
from raytracer.analysis.lens_design.performance.lens_study import to_plain


def as_dict(distortion: DistortionMap) -> dict[str, Any]:
    """Convert all but the maps to JSON values."""
    radii = np.linspace(
        0.0, 0.5 * distortion.grid.pitch * math.hypot(distortion.grid.width, distortion.grid.height), 65
    )
    across = np.stack([radii, np.zeros_like(radii)], axis=-1)
    content = {
        "lens": distortion.name,
        **distortion.setting,
        "ideal": distortion.ideal,
        "image_width": distortion.grid.width,
        "image_height": distortion.grid.height,
        "pixel_mm": distortion.grid.pitch,
        "focal_length_mm": distortion.scale,
        "camera_matrix": distortion.camera_matrix(),
        "largest_px": distortion.largest_px(),
        "models": [model._asdict() for model in distortion.models],
        "missing": dict(distortion.missing),
        "film_mm": radii,
        "ideal_mm": distortion.undistorted(across)[:, 0],
    }
    values: dict[str, Any] = to_plain(content)
    return values


def to_npz(distortion: DistortionMap) -> bytes:
    """Write maps and models as NumPy's archive.

    `map_x`, `map_y`, `inverse_x`, `inverse_y` are float32 (height, width), as `cv2.remap` takes them.
    """
    there, back = distortion.maps()
    arrays: dict[str, Any] = {
        "map_x": there[..., 0],
        "map_y": there[..., 1],
        "inverse_x": back[..., 0],
        "inverse_y": back[..., 1],
        "camera_matrix": distortion.camera_matrix(),
        **{model.name: model.coefficients for model in distortion.models},
        "about": np.array(json.dumps(as_dict(distortion), allow_nan=False)),
    }
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def to_opencv_yaml(distortion: DistortionMap) -> bytes:
    """Write the first model as `cv2.FileStorage` reads it."""
    model = distortion.models[0]
    lines = [
        "%YAML:1.0",
        "---",
        f"lens: {json.dumps(distortion.name)}",
        f"image_width: {distortion.grid.width}",
        f"image_height: {distortion.grid.height}",
        f"distortion_model: {model.name}",
        *_matrix("camera_matrix", distortion.camera_matrix()),
        *_matrix("distortion_coefficients", model.coefficients[None, :]),
        f"rms_px: {model.rms_px!r}",
        f"largest_px: {model.largest_px!r}",
    ]
    return ("\n".join(lines) + "\n").encode()


def _matrix(name: str, values: FloatArray) -> list[str]:
    """Write a matrix as lines of OpenCV's YAML."""
    rows, columns = values.shape
    numbers = ", ".join(repr(float(value)) for value in values.ravel())
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows}",
        f"   cols: {columns}",
        "   dt: d",
        f"   data: [ {numbers} ]",
    ]


def to_text(distortion: DistortionMap) -> str:
    """Describe a distortion map for a terminal."""
    (fx, fy), grid = distortion.scale, distortion.grid
    f = f"{fx:.6g} mm" if fx == fy else f"{fx:.6g} mm across and {fy:.6g} mm down"
    lines = [
        distortion.name,
        f"{grid.width} x {grid.height} pixels of {1000.0 * grid.pitch:.4g} µm",
        f"against the {distortion.ideal} projection, principal distance {f}",
        f"the farthest that a point of the film is off: {distortion.largest_px():.4g} px",
    ]
    for number, model in enumerate(distortion.models):
        names = {4: "k1 k2 k3 k4", 5: "k1 k2 p1 p2 k3", 8: "k1 k2 p1 p2 k3 k4 k5 k6"}[len(model.coefficients)].split()
        numbers = "  ".join(f"{n} = {value:.9g}" for n, value in zip(names, model.coefficients, strict=True))
        chosen = ", which is taken" if number == 0 and len(distortion.models) > 1 else ""
        lines += [
            f"{model.name}: off by {model.rms_px:.3g} px RMS, {model.largest_px:.3g} px at most{chosen}",
            f"  {numbers}",
        ]
    lines += [f"no {name}: {reason}" for name, reason in distortion.missing.items()]
    return "\n".join(lines) + "\n"
