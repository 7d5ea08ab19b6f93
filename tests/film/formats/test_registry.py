"""The registry of image formats: what its lists hold today, and formats that every list takes in by one file each."""

import shutil
import subprocess
import sys
import textwrap

import numpy as np
import PIL.Image

from raytracer.film.formats import registry
from tests.repository import ROOT

SCENE = """
film: {width: 6, height: 4}
render: {spp: 1}
camera: {type: pinhole, look_from: [0, 0, 3], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: [0.2, 0.4, 0.8]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: [0.8, 0.3, 0.1]}}
"""

# A linear format with layers, maps and animations: arrays by name, as NumPy packs them.
FORMAT = '''
    """A toy."""

    import io

    import numpy as np

    from raytracer.film.formats.base.image_format import ImageFormat


    def pack(**arrays):
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        return buffer.getvalue()


    def decode_layers(data, wanted):
        with np.load(io.BytesIO(data)) as file:
            return {name: file[name].astype(float) for name in file if wanted is None or name in wanted}, {}


    FORMAT = ImageFormat(
        (".toy",),
        is_linear=True,
        has_layers=True,
        media_type="image/toy",
        encode=lambda image, layers: pack(radiance=image.radiance, **image.layers, **layers),
        encode_map=lambda values: pack(values=values),
        encode_frames=lambda frames, duration, boomerang: pack(frames=frames, duration=duration, boomerang=boomerang),
        decode=lambda data: decode_layers(data, None)[0]["radiance"],
        decode_layers=decode_layers,
        order=1000,
    )
'''

PROGRAM = """
    import io
    import sys
    from pathlib import Path
    from types import SimpleNamespace

    import numpy as np

    import raytracer.film.formats
    raytracer.film.formats.__path__.append(sys.argv[1])

    from raytracer.analysis.compare import compare
    from raytracer.analysis.sweep.output_layout import normalize_formats
    from raytracer.cli.base.app import main
    from raytracer.cli.lightfield.base import check_outputs
    from raytracer.cli.lightfield.depth import _encode_confidence
    from raytracer.film import animation, image_file
    from raytracer.film.formats.registry import animation_suffixes, display_suffixes, image_formats, map_suffixes
    from raytracer.lightfield.decoding.raw_image import has_largest_value
    from raytracer.scene.assets import read_image

    # It is rendered to, with layers, and read as a picture, as layers, as a texture and for a comparison.
    outputs = [word for name in ("a.toy", "a.npy", "b.ppm", "b.png") for word in ("-o", name)]
    assert main(["render", "scene.yaml", *outputs, "--aov", "depth"]) == 0
    radiance = np.load("a.npy")
    assert (image_file.load("a.toy") == radiance).all()
    layers, _ = image_file.load_layers("a.toy")
    assert layers["depth"].shape == (4, 6)
    texture = read_image("a.toy")
    assert (texture.texels == radiance.astype(np.float32)).all() and not texture.integer
    assert compare("a.toy", "a.npy").metrics["rmse"] == 0.0
    assert not has_largest_value("a.toy")

    # Sweeps write it, maps and animations too.
    assert normalize_formats(["exr", "toy"]) == ("toy", "exr")
    maps = [Path("confidence.toy")]
    check_outputs(maps, map_suffixes(), "a map")
    sure = np.eye(3)
    data = _encode_confidence(SimpleNamespace(confidence=sure), image_formats()[".toy"])
    assert (np.load(io.BytesIO(data))["values"] == sure).all()
    assert animation_suffixes() == (".gif", ".webp", ".png", ".toy")
    frames = np.zeros((2, 3, 4, 3), np.uint8)
    packed = np.load(io.BytesIO(animation.encode(list(frames), "toy", fps=10)))
    assert packed["frames"].shape == frames.shape and packed["duration"] == 100

    # So is docs/examples/ppm.py, which is for a display.
    assert (image_file.load("b.ppm") == image_file.load("b.png")).all()
    assert display_suffixes() == (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".ppm")

    # Messages name them.
    assert main(["render", "scene.yaml", "-o", "a.xyz"]) == 2
    assert main(["render", "scene.yaml", "-o", "a.png", "--aov", "depth"]) == 2
    assert main(["sweep", "scene.yaml", "-D", "render.seed=1,2", "--animate", "mp4"]) == 2
"""


def test_the_lists_of_suffixes():
    assert " ".join(registry.writable_suffixes()) == ".png .jpg .jpeg .exr .hdr .npy .lf .pfm"
    assert " ".join(registry.image_suffixes()) == ".png .jpg .jpeg .tif .tiff .exr .hdr .npy .pfm"
    assert " ".join(registry.picture_suffixes()) == ".png .jpg .jpeg .exr .hdr .npy .pfm"
    assert " ".join(registry.display_suffixes()) == ".png .jpg .jpeg .tif .tiff"
    textures = ".png .jpg .jpeg .bmp .tga .tif .tiff .webp .exr .hdr .npy .pfm"
    assert " ".join(registry.texture_suffixes()) == textures
    assert " ".join(registry.layered_suffixes()) == ".exr .lf"
    assert " ".join(registry.map_suffixes()) == ".png .exr .npy .pfm"
    assert " ".join(registry.map_suffixes(with_image=False)) == ".png .npy .pfm"
    assert " ".join(registry.animation_suffixes()) == ".gif .webp .png"
    assert " ".join(registry.animation_suffixes(with_images=False)) == ".gif .webp"


def test_what_is_declared_agrees():
    for suffix, each in registry.image_formats().items():
        assert suffix in each.suffixes
        assert not (each.is_linear and each.decode_display), f"{suffix} is linear, and holds what a display shows"
        assert each.is_linear or not each.decode or each.decode_display, f"{suffix} is for a display, and not read so"
        assert not each.decode_layers or each.has_layers, f"{suffix} has no layers to decode"


def test_every_list_takes_in_new_files(tmp_path):
    folder = tmp_path / "formats"
    folder.mkdir()
    (folder / "toy.py").write_text(textwrap.dedent(FORMAT))
    shutil.copy(ROOT / "docs" / "examples" / "ppm.py", folder)
    (tmp_path / "scene.yaml").write_text(SCENE)
    command = [sys.executable, "-c", textwrap.dedent(PROGRAM), str(folder)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = " ".join(done.stderr.split())
    assert "known: .png, .jpg, .jpeg, .exr, .hdr, .npy, .lf, .pfm, .ppm, .toy" in told
    # Another program agrees on what is in the file.
    with PIL.Image.open(tmp_path / "b.ppm") as ppm, PIL.Image.open(tmp_path / "b.png") as png:
        np.testing.assert_array_equal(np.asarray(ppm), np.asarray(png))
    assert "--aov depth: only .exr and .lf and .toy files hold layers: add -o NAME.exr" in told
    assert "--animate mp4: must be one of gif, webp, png, toy" in told
