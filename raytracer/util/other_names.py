"""Names that other programs, or plain English, use for what a scene file calls otherwise."""

from collections.abc import Container
from typing import Final

OTHER_NAMES: Final = {
    # Types.
    "perspective": ("thin_lens", "pinhole"),
    "realistic": ("lens",),
    "panorama": ("equirectangular",),
    "spherical": ("equirectangular",),
    "diffuse": ("lambertian",),
    "matte": ("lambertian",),
    "glass": ("dielectric",),
    "mirror": ("metal",),
    "conductor": ("rough_conductor",),
    "plastic": ("principled",),
    "disney": ("principled",),
    "pbr": ("principled",),
    "emission": ("emitter", "radiance"),
    "emissive": ("emitter",),
    "diffuse_light": ("emitter",),
    "area_light": ("emitter",),
    "arealight": ("emitter",),
    "cube": ("box",),
    "rectangle": ("quad",),
    "plane": ("quad",),
    "obj": ("mesh",),
    "ply": ("mesh",),
    "trimesh": ("mesh",),
    "distant": ("sun",),
    "directional": ("sun",),
    "infinite": ("image", "constant"),
    "envmap": ("image",),
    "hdri": ("image",),
    "bitmap": ("image",),
    "imagemap": ("image",),
    "checkerboard": ("checker",),
    # Keys.
    "position": ("look_from", "center"),
    "origin": ("look_from",),
    "eye": ("look_from",),
    "from": ("look_from",),
    "lookfrom": ("look_from",),
    "target": ("look_at",),
    "to": ("look_at",),
    "lookat": ("look_at",),
    "fov": ("vfov",),
    "field_of_view": ("vfov",),
    "vup": ("up",),
    "fstop": ("f_number",),
    "f_stop": ("f_number",),
    "fnumber": ("f_number",),
    "focal_distance": ("focus_distance",),
    "focus_dist": ("focus_distance",),
    "exposure_time": ("shutter",),
    "shutter_speed": ("shutter",),
    "background": ("environment",),
    "sky": ("environment",),
    "world": ("environment",),
    "settings": ("render",),
    "image": ("film", "file"),
    "output": ("film",),
    "resolution": ("width and height",),
    "size": ("width and height",),
    "samples": ("spp",),
    "samples_per_pixel": ("spp",),
    "quality": ("spp",),
    "bounces": ("max_depth",),
    "depth": ("max_depth",),
    "color": ("albedo", "base_color", "radiance"),
    "colour": ("albedo", "color", "base_color", "radiance"),
    "reflectance": ("albedo",),
    "kd": ("albedo",),
    "intensity": ("radiance", "irradiance"),
    "strength": ("radiance",),
    "refractive_index": ("ior",),
    "int_ior": ("ior",),
    "path": ("file",),
    "filename": ("file",),
    "rotate": ("transform",),
    "rotation": ("transform",),
    "scale": ("transform",),
    "translate": ("transform",),
    "to_world": ("transform",),
    "objs": ("objects",),
    "shapes": ("objects",),
    "meshes": ("objects",),
}
"""Names here by names elsewhere, in lower case: of pbrt 4, Mitsuba 3, Blender, Ray Tracing in One Weekend, three.js."""

EXPLAINED: Final = {
    "light": "a light stands in the list `lights`, or is an object whose material is an `emitter`",
}
"""Names that newcomers write in the wrong place, and sentences that tell the right one."""


def name_here(name: str, known: Container[str]) -> str | None:
    """Return what is known here by another name; None if there is nothing of that name."""
    for here in OTHER_NAMES.get(name.lower(), ()):
        if all(part in known for part in here.split(" and ")):
            return here
    return None
