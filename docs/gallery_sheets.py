"""Settings that pictures of docs/gallery show side by side: those of the camera lecture and of real lenses."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class Variant(NamedTuple):
    """A setting of a scene: what stands below its picture, and the keys that it changes, as `-D` does.

    stretch : how many times as wide as recorded the picture is shown, which undoes what an anamorphic lens did.
    """

    caption: str
    keys: Mapping[str, Any]
    stretch: float = 1.0


class Sheet(NamedTuple):
    """How the settings of a scene are shown: how many in a row, each how wide and high at most (px); spp.

    scene : name of the scene, where the picture has a name of its own.
    """

    columns: int
    width: int
    spp: int
    variants: Sequence[Variant]
    scene: str | None = None


def _one_key(key: str, captions: Mapping[str, Any]) -> list[Variant]:
    """Settings that differ in the value of one key, by their captions."""
    return [Variant(caption, {key: value}) for caption, value in captions.items()]


ENGRAVED = (
    (1.4, "1/500"), (2, "1/250"), (2.8, "1/125"), (4, "1/60"), (5.6, "1/30"), (8, "1/15"), (11, "1/8"), (16, "1/4"),
    (22, "1/2"), (32, "1"),
)  # fmt: skip
"""What stands on a lens and its camera for f/2^(k/2) and 2^(k-10) s, k from 1 to 10."""

LECTURE = {
    "focal_lengths": Sheet(
        3, 400, 128, _one_key("camera.focal_length", {f"{length} mm": length for length in (17, 24, 35, 50, 100, 200)})
    ),
    "dolly_zoom": Sheet(
        3,
        400,
        128,
        [
            Variant(
                f"{length} mm from {0.088 * length:.3g} m",
                {"camera.focal_length": length, "camera.look_from": [0, 1.4, 0.088 * length]},
            )
            for length in (17, 50, 200)
        ],
    ),
    "sensor_sizes": Sheet(
        3,
        400,
        128,
        [
            *(Variant(f"{name}, 28 mm", {"camera.sensor": name}) for name in ("full_frame", "aps_c", "1-inch")),
            *(
                Variant(
                    f"{name}, 75 mm equivalent",
                    {"camera.sensor": name, "camera.focal_length": None, "camera.equivalent_focal_length": 75},
                )
                for name in ("full_frame", "four_thirds", "1/2.3-inch")
            ),
        ],
    ),
    "aperture": Sheet(
        3,
        400,
        256,
        [
            Variant(f"f/{n}, {time} s", {"camera.f_number": n, "camera.shutter": time})
            for n, time in ((1.4, "1/500"), (4, "1/60"), (22, "1/2"))
        ],
    ),
    "equivalent_exposures": Sheet(
        5,
        240,
        256,
        [
            Variant(f"f/{n}, {time} s", {"camera.f_number": 2 ** (k / 2), "camera.shutter": 2.0 ** (k - 10)})
            for k, (n, time) in enumerate(ENGRAVED, start=1)
        ],
    ),
    "shutter": Sheet(
        2,
        480,
        128,
        [
            Variant(f"1/{rate} s, ISO {iso}", {"camera.shutter": f"1/{rate} s", "camera.iso": iso})
            for rate, iso in ((240, 3200), (120, 1600), (60, 800), (30, 400), (15, 200), (8, 100))
        ],
    ),
    "propeller": Sheet(
        4,
        300,
        128,
        [
            Variant("global shutter", {"camera.shutter.readout": 0}),
            Variant("rolling, 1/60 s, down", {"camera.shutter.readout": "1/60"}),
            Variant("rolling, 1/25 s, down", {}),
            Variant("rolling, 1/25 s, right", {"camera.shutter.direction": "right"}),
        ],
    ),
    "train": Sheet(
        2,
        480,
        128,
        [
            Variant("global shutter", {"camera.shutter.readout": 0}),
            Variant("rolling shutter, 1/30 s, down", {}),
            Variant("rolling shutter, 1/30 s, up", {"camera.shutter.direction": "up"}),
            Variant(
                "focal plane, 1/250 s, down",
                {"camera.shutter.readout": "1/250", "camera.shutter.curtain": "focal_plane"},
            ),
        ],
    ),
    "iso_noise": Sheet(
        2,
        480,
        512,
        [
            Variant(f"ISO {iso}, 1/{iso * 16 // 100} s", {"camera.iso": iso, "camera.shutter": 100 / 16 / iso})
            for iso in (100, 1600, 6400, 25600)
        ],
    ),
    "focus_breathing": Sheet(
        3,
        400,
        128,
        _one_key("camera.focus_on", {f"on the {name}": name for name in ("last ball", "green ball", "red ball")}),
    ),
    "bokeh": Sheet(
        3,
        400,
        512,
        [
            Variant("round", {}),
            Variant("six blades", {"camera.aperture_shape": {"type": "polygon", "blades": 6}}),
            Variant(
                "five blades, curved", {"camera.aperture_shape": {"type": "polygon", "blades": 5, "curvature": 0.5}}
            ),
            Variant("anamorphic", {"camera.aperture_shape": {"type": "round", "anamorphic": 2}}),
            Variant("vignetted by a rim", {"camera.vignetting": {"diameter": 60, "distance": 90}}),
            Variant("a mask", {"camera.aperture_shape": {"type": "image", "file": "heart.png"}}),
        ],
    ),
    "frozen_drop": Sheet(
        3,
        400,
        256,
        [
            Variant(f"flash of 1/{rate} s", {f"lights[{k}].duration": f"1/{rate} s" for k in range(2)})
            for rate in (20000, 1000, 60)
        ],
    ),
    "light_trails": Sheet(
        3,
        400,
        1024,
        [
            Variant(f"{time} s, ISO {iso}", {"camera.shutter": f"{time} s", "camera.iso": iso})
            for time, iso in (("1/16", 12800), ("1", 800), ("8", 100))
        ],
    ),
    "pinhole": Sheet(
        3,
        400,
        128,
        [
            Variant("hole of 6 mm, 1/80 s", {"camera.diameter": 6, "camera.shutter": 1 / 80}),
            Variant("1 mm, 0.45 s", {"camera.diameter": 1, "camera.shutter": 0.45}),
            Variant("0.35 mm, 3.7 s", {"camera.diameter": 0.35, "camera.shutter": 3.7}),
        ],
    ),
    "hangar": Sheet(
        1,
        800,
        128,
        [
            Variant("a camera of 16.8 m, with a hole of 6 mm", {}),
            Variant(
                "the same hole, in a box of 90 mm",
                {
                    "camera.focal_length": 90,
                    "camera.sensor": {"width": 181.07, "height": 51.43},
                    "camera.shutter": "11.6 ms",
                },
            ),
        ],
    ),
    "pinhole_and_lens": Sheet(
        2,
        480,
        256,
        [
            Variant(
                "hole of 0.3 mm, 1.44 s", {"camera.type": "pinhole", "camera.f_number": 167, "camera.shutter": 1.44}
            ),
            Variant("lens at f/2, 1/4840 s", {}),
        ],
    ),
    "bracketing": Sheet(
        5,
        240,
        1024,
        [
            Variant(f"{stops:+d} EV" if stops else "0 EV", {"camera.exposure_compensation": stops})
            for stops in range(-2, 3)
        ],
    ),
    "hand_shake": Sheet(
        3,
        400,
        256,
        [
            Variant(f"1/{rate} s, ISO {2.5 * rate:g}", {"camera.shutter": 1 / rate, "camera.iso": 2.5 * rate})
            for rate in (1000, 200, 15)
        ],
    ),
    "panning": Sheet(
        1,
        480,
        256,
        [
            Variant(
                "1/1000 s",
                {
                    "camera.motion": None,
                    "camera.shutter": {"open": "-1/2000 s", "close": "1/2000 s"},
                    "camera.iso": 3300,
                },
            ),
            Variant("1/30 s", {"camera.motion": None}),
            Variant("1/30 s, panned", {}),
        ],
    ),
    "wagon_wheel": Sheet(
        4,
        240,
        256,
        [
            Variant(
                f"frame {k + 1}, {words}",
                {"camera.shutter": {"open": f"{k}/24 s", "duration": duration}, "camera.iso": iso},
            )
            for duration, words, iso in (("1/2000 s", "1/2000 s", 300), ("1/24 s", "1/24 s", 3.6))
            for k in range(4)
        ],
    ),
    "star_trails": Sheet(
        3,
        400,
        2048,
        [
            Variant(f"{time}, ISO {iso}", {"camera.shutter": time, "camera.iso": iso})
            for time, iso in (("30 s", 6400), ("15 min", 213), ("2 h", 27))
        ],
    ),
    "silky_water": Sheet(
        3,
        320,
        512,
        [
            Variant(f"{time}, f/{n}", {"camera.shutter": time, "camera.f_number": n})
            for time, n in (("1/1000 s", 2), ("1/8 s", 22), ("2 s", 90))
        ],
    ),
    "three_settings": Sheet(
        3,
        320,
        256,
        [
            *(
                Variant(
                    f"f/{n}",
                    {"camera.f_number": 2 ** (k + 0.5), "camera.shutter": "1/512 s", "camera.iso": 25 * 4 ** (k + 1)},
                )
                for k, n in ((0, 1.4), (2, 5.6), (4, 22))
            ),
            *(
                Variant(
                    f"{time} s", {"camera.f_number": 2**4.5, "camera.shutter": 0.5 / 4**k, "camera.iso": 100 * 4**k}
                )
                for k, time in ((3, "1/125"), (2, "1/30"), (0, "1/2"))
            ),
            *(
                Variant(
                    f"ISO {iso}",
                    {
                        "camera.iso": iso,
                        "camera.shutter": 100 / 32 / iso,
                        "camera.sensor": {"format": "full_frame", "noise": True},
                    },
                )
                for iso in (100, 1600, 25600)
            ),
        ],
        scene="equivalent_exposures",
    ),
    "building_up": Sheet(
        4,
        240,
        256,
        [
            Variant(f"after {4**k}/64 of the time", {"camera.iso": 6400, "camera.shutter": 4**k / 65536})
            for k in range(4)
        ],
        scene="iso_noise",
    ),
    "bullet": Sheet(
        3,
        400,
        128,
        [
            Variant(f"flash of 1/{rate} s", {f"lights[{k}].duration": f"1/{rate} s" for k in range(2)})
            for rate in (1000000, 20000, 1000)
        ],
    ),
    "slit": Sheet(
        3,
        400,
        256,
        [
            Variant(
                f"{words}, flash after {milliseconds} ms",
                {
                    "camera.shutter": {"duration": duration, "readout": "1/250", "curtain": "focal_plane"},
                    # Without an offset both flash after 4 ms, when the first curtain has arrived.
                    **{f"lights[{k}].offset": f"{milliseconds - 4} ms" for k in range(2)},
                },
            )
            for words, duration, milliseconds in (
                *(("1/1000 s", "1/1000", milliseconds) for milliseconds in range(1, 5)),
                ("1/2000 s", "1/2000", 2),
                ("1/250 s", "1/250", 4),
            )
        ],
        scene="frozen_drop",
    ),
    "no_lens": Sheet(
        2,
        400,
        256,
        [
            Variant("no lens, 1/80000 s", {}),
            Variant(
                "35 mm, f/11, 1/160 s",
                {"camera.type": "pinhole", "camera.focal_length": 35, "camera.f_number": 11, "camera.shutter": 1 / 160},
            ),
        ],
    ),
}


OPTICS = {
    "spherical_aberration": Sheet(
        1,
        720,
        4096,
        [
            Variant("plano-convex singlet, f/4", {}),
            Variant("f/8", {"camera.f_number": 8}),
            Variant(
                "an ideal lens, f/4",
                {
                    "camera": {
                        "type": "thin_lens",
                        "sensor": {"width": 12, "height": 2},
                        "focal_length": 100,
                        "f_number": 4,
                        "focus_distance": 2,
                    }
                },
            ),
        ],
    ),
    "coma": Sheet(2, 480, 2048, [Variant("hyperboloid, f/2.5", {}), Variant("f/5", {"camera.f_number": 5})]),
    "field_curvature": Sheet(
        2,
        480,
        512,
        [
            Variant("achromat, focus 4 m away", {}),
            Variant("focus 6 m away", {"camera.focus_distance": 6}),
        ],
    ),
    "fisheye": Sheet(
        2,
        480,
        256,
        [
            Variant("fisheye, 10 mm", {}),
            Variant("wide-angle, 22 mm", {"camera.lens": "../lenses/wide-22mm.yaml", "camera.sensor": "full_frame"}),
        ],
    ),
    "chromatic_fringes": Sheet(
        2,
        480,
        1024,
        [Variant("singlet of flint", {}), Variant("achromat", {"camera.lens": "../lenses/achromat-100mm.yaml"})],
    ),
    "swirly_bokeh": Sheet(
        3,
        400,
        512,
        [
            Variant("double Gauss, f/2", {}),
            Variant("f/4", {"camera.f_number": 4}),
            Variant(
                "Petzval, f/2.2",
                {
                    "camera.lens": "../lenses/petzval-100mm.yaml",
                    "camera.f_number": 2.2,
                    "camera.look_from": [0, 0.27, 1.3],
                },
            ),
        ],
    ),
    "anamorphic_bokeh": Sheet(
        1,
        800,
        512,
        [
            Variant("anamorphic, desqueezed 2x", {}, 2.0),
            Variant(
                "double Gauss",
                {
                    "camera.lens": "../lenses/double-gauss-50mm.yaml",
                    "camera.sensor": {"width": 33.2, "height": 12.45},
                    "film.width": 800,
                },
            ),
        ],
    ),
    "flare": Sheet(
        3,
        400,
        4096,
        [
            Variant("no reflections", {"camera.flare": False}),
            Variant("bare glass", {"camera.dispersion": False}),
            Variant("coated", {"camera.lens": "../lenses/double-gauss-50mm-coated.yaml"}),
        ],
    ),
}

SHEETS = {"lecture": LECTURE, "optics": OPTICS}
"""Scenes of which several settings are shown, by their folders."""
