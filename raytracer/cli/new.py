"""`rt new`: writes a scene to begin with, whose comments say what its keys mean."""

from pathlib import Path
from typing import Annotated, Literal

from typer import Argument, Option

from raytracer.cli.base.outputs import check_files, report_written

EXAMPLE = """\b
Examples:
  rt new
  rt new pinhole room.yaml
  rt new lens portrait.yaml && rt render portrait.yaml --preview
"""

_CAMERAS = {
    "thin_lens": """\
camera:
  type: thin_lens            # an ideal lens: sharp at one distance, blurred before and behind it
  look_from: [0, 0.9, 3.2]   # where the camera stands, in metres: x to the right, y up, and z towards you
  look_at: [0, 0.3, 0]       # what is in the middle of the picture
  sensor: full_frame         # 36 mm x 23.9 mm; others: aps_c, one_inch, or {width: 10 mm, height: 10 mm}
  focal_length: 50 mm        # longer: a narrower view; or give vfov, the vertical angle of view in degrees
  f_number: 2                # smaller: a wider opening, and more blur
  focus_on: glass            # the name of an object; or focus_distance: 3 m
  exposure: auto             # metered; or as on a camera: shutter: 1/1000 s, iso: 100
""",
    "pinhole": """\
camera:
  type: pinhole              # no lens: everything is sharp
  look_from: [0, 0.9, 3.2]   # where the camera stands, in metres: x to the right, y up, and z towards you
  look_at: [0, 0.3, 0]       # what is in the middle of the picture
  vfov: 27                   # vertical angle of view, in degrees
  exposure: auto             # metered; or as on a camera: shutter: 1/1000 s, iso: 100
""",
    "lens": """\
camera:
  type: lens                 # a lens of glass, with the errors of a real one
  lens: {lens}
                             # its surfaces, in a file of their own; `rt lens {lens}` tells more of it
  look_from: [0, 0.9, 3.2]   # where the camera stands, in metres: x to the right, y up, and z towards you
  look_at: [0, 0.3, 0]       # what is in the middle of the picture
  sensor: full_frame         # 36 mm x 23.9 mm, behind the lens; a smaller one sees less
  f_number: 2                # larger: a smaller opening, less blur, and fewer of the lens's errors
  focus_on: glass            # the name of an object; or focus_distance: 3 m
  exposure: auto             # metered; or as on a camera: shutter: 1/1000 s, iso: 100
""",
    "lightfield": """\
# All views in one file, and a page in which they are focused and looked around in:
#   rt lightfield render {scene} -o {stem}.lf
#   rt lightfield view {stem}.lf

camera:
  type: camera_array         # cameras side by side, each a pinhole
  look_from: [0, 0.9, 3.2]   # where the middle one stands, in metres: x to the right, y up, and z towards you
  look_at: [0, 0.3, 0]       # what is in the middle of its picture
  vfov: 27                   # vertical angle of view of each, in degrees
  rows: 5
  columns: 5
  spacing: 20 mm             # from one camera to the next
  convergence_distance: 3.3  # metres at which all cameras see a thing at the same place of their pictures
  exposure: auto             # metered; or as on a camera: shutter: 1/1000 s, iso: 100
""",
}

_FILM = "film: {width: 480, height: 320}  # pixels; `rt render --size 1920x1280` gives more of them for one picture\n"
_FILM_OF_VIEWS = "film: {width: 120, height: 80}   # pixels of each view\n"

_REST = """\
render: {spp: 64}                # samples per pixel: four times as many halve the noise

environment: {type: gradient, horizon: [0.9, 0.8, 0.7], zenith: [0.2, 0.35, 0.7]}   # seen by rays that meet nothing

materials:                       # by names of your own, which objects call them by
  floor: {type: lambertian, albedo: {type: checker, scale: 0.3, even: 0.2, odd: 0.6}}
  clay: {type: lambertian, albedo: [0.7, 0.25, 0.15]}    # shares of red, green and blue light; or '#d98a6c'
  glass: {type: dielectric, ior: 1.5}                    # its index of refraction
  brass: {type: metal, albedo: [0.9, 0.75, 0.45], fuzz: 0.05}   # fuzz: 0 is a mirror
  glow: {type: emitter, radiance: [14, 12, 9]}           # what it is on is a lamp

objects:                         # metres; a name is what focus_on, and -D objects.clay.radius=0.5, mean
  - {type: quad, corner: [-50, 0, 50], edges: [[100, 0, 0], [0, 0, -500]], material: floor}
  - {type: sphere, name: clay, center: [-0.5, 0.2, 0.6], radius: 0.2, material: clay}
  - {type: sphere, name: glass, center: [0, 0.3, -0.1], radius: 0.3, material: glass}
  - {type: sphere, name: brass, center: [0.8, 0.4, -1.6], radius: 0.4, material: brass}
  - {type: quad, name: lamp, corner: [-2.5, 2.5, -1], edges: [[1.5, 0.7, 0], [0, 0, 2]], material: glow}
"""

_LENS = """\
# A. W. Tronnier, US patent 2,673,491 (1954), f = 1 scaled to 50 mm; millimetres, from the front to the film.
name: Double Gauss 50 mm f/2
focal_length: 50
f_number: 2
image_circle: 43.3
surfaces:
  - {type: spherical, radius: 29.475, thickness: 3.76, material: {index: 1.67125, abbe: 47.1}, aperture: 25.2}
  - {type: spherical, radius: 84.83, thickness: 0.12, aperture: 25.2}
  - {type: spherical, radius: 19.275, thickness: 4.025, material: {index: 1.67125, abbe: 47.1}, aperture: 23}
  - {type: spherical, radius: 40.77, thickness: 3.275, material: {index: 1.69842, abbe: 30.1}, aperture: 23}
  - {type: spherical, radius: 12.75, thickness: 5.705, aperture: 18}
  - {type: stop, thickness: 4.5, aperture: 17.1}
  - {type: spherical, radius: -14.495, thickness: 1.18, material: {index: 1.60266, abbe: 38.4}, aperture: 17}
  - {type: spherical, radius: 40.77, thickness: 6.065, material: {index: 1.65953, abbe: 57}, aperture: 20}
  - {type: spherical, radius: -20.385, thickness: 0.19, aperture: 20}
  - {type: spherical, radius: 437.065, thickness: 3.22, material: {index: 1.7174, abbe: 48.1}, aperture: 20}
  - {type: spherical, radius: -39.73, aperture: 20}
"""


def new(
    kind: Annotated[
        Literal["thin_lens", "pinhole", "lens", "lightfield"],
        Argument(metavar="KIND", help="Its camera: thin_lens, pinhole, lens or lightfield."),
    ] = "thin_lens",
    file: Annotated[Path, Argument(metavar="FILE", help="Scene file to write.")] = Path("scene.yaml"),
    quiet: Annotated[bool, Option("--quiet", "-q", help="Do not say what was written.")] = False,
) -> None:
    """Write a small scene with a camera of some kind, which renders as it is, and whose comments say what keys mean.

    A file that is there is never overwritten.
    """
    from raytracer.util.atomic_write import write_bytes
    from raytracer.util.errors import InputError

    if file.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(f"{file}: a scene file ends in .yaml; did you mean {file}.yaml?")
    files = {file: _scene_text(kind, file)}
    if kind == "lens":
        files[_lens_file(file)] = _LENS
    for path in files:
        if path.exists():
            raise InputError(f"{path}: is there already, and is not overwritten; name another file")
    check_files(files)
    for path, text in files.items():
        write_bytes(path, text.encode())
    report_written(*files, quiet=quiet)


def _lens_file(scene: Path) -> Path:
    """Name the file of the lens that is before a scene's camera."""
    return scene.with_name(f"{scene.stem}-lens.yaml")


def _scene_text(kind: str, file: Path) -> str:
    """Write the scene with a camera of some kind."""
    camera = _CAMERAS[kind]
    for name, value in (("lens", _lens_file(file).name), ("scene", str(file)), ("stem", str(file.with_suffix("")))):
        camera = camera.replace(f"{{{name}}}", value)
    film = _FILM_OF_VIEWS if kind == "lightfield" else _FILM
    return f"# Render it: rt render {file} --preview\n{camera}{film}{_REST}"
