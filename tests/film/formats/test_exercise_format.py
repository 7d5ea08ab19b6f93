"""The exercise docs/examples/ppm.py: a new image format is one file, found without a change to any other."""

import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import PIL.Image
import pytest

from raytracer.film import check_writable
from raytracer.util.errors import InputError
from tests.repository import ROOT

SCENE = """
film: {width: 6, height: 4}
render: {spp: 1}
camera: {type: pinhole, look_from: [0, 0, 3], look_at: [0, 0, 0], vfov: 40}
environment: {type: constant, radiance: [0.2, 0.4, 0.8]}
objects:
  - {type: sphere, center: [0, 0, 0], radius: 1, material: {type: lambertian, albedo: [0.8, 0.3, 0.1]}}
"""

# Renders by the command, then reads the file by its suffix, and names the suffixes that are known.
PROGRAM = """
    import sys
    import raytracer.film.formats
    raytracer.film.formats.__path__.append(sys.argv[1])
    from raytracer.cli.base.app import main
    from raytracer.film.formats.registry import display_suffixes, writable_suffixes
    from raytracer.film.image_file import load
    assert main(["render", "scene.yaml", "-o", "a.ppm", "-o", "a.png"]) == 0
    assert (load("a.ppm") == load("a.png")).all()
    assert main(["render", "scene.yaml", "-o", "a.xyz"]) == 2
    print(*writable_suffixes())
    print(*display_suffixes())
"""


def test_a_format_is_added_by_one_file(tmp_path: Path) -> None:
    folder = tmp_path / "formats"
    folder.mkdir()
    shutil.copy(ROOT / "docs" / "examples" / "ppm.py", folder)
    (tmp_path / "scene.yaml").write_text(SCENE)
    command = [sys.executable, "-c", textwrap.dedent(PROGRAM), str(folder)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-2:] == [
        ".png .jpg .jpeg .exr .hdr .npy .lf .ppm",
        ".png .jpg .jpeg .ppm",
    ]
    assert "known: .png, .jpg, .jpeg, .exr, .hdr, .npy, .lf, .ppm" in " ".join(done.stderr.split())

    # Another program agrees on what is in the file.
    with PIL.Image.open(tmp_path / "a.ppm") as ppm, PIL.Image.open(tmp_path / "a.png") as png:
        assert ppm.size == (6, 4)
        np.testing.assert_array_equal(np.asarray(ppm), np.asarray(png))


def test_without_the_file_the_format_is_not_known(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"unknown suffix '\.ppm'"):
        check_writable(tmp_path / "a.ppm")
