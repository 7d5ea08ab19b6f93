"""Follow docs/tutorial.md, and show what it renders side by side in docs/gallery/tutorial.jpg (`make gallery`)."""

import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs.gallery_paper import GALLERY, save_small, sheet  # noqa: E402

PAGE = ROOT / "docs" / "tutorial.md"
LENS = ROOT / "scenes" / "lenses" / "double-gauss-50mm.yaml"
PANELS = {
    "table.png": "through a pinhole",
    "sunny.png": "at f/2 on a sunny day",
    "near.png": "a light field, focused at 2 m",
    "far.png": "the same, focused at 4.4 m",
}


def write_scenes(folder: Path) -> None:
    """Write the files that a reader of the page makes: its scenes, and the lens."""
    blocks = re.findall(r"^```yaml\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    table, sunny, gauss, array = map(yaml.safe_load, blocks)
    (folder / "table.yaml").write_text(blocks[0])
    changed = {"sunny": table | sunny, "gauss": table | sunny | gauss, "array": table | array}
    for name, scene in changed.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(scene))
    shutil.copy(LENS, folder)


def main() -> None:
    """Run the commands that make the panels or what these are made of."""
    text = PAGE.read_text(encoding="utf-8").replace(" \\\n", " ")
    commands = re.findall(r"^(?:\$ )?rt (.*)$", text, re.MULTILINE)
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        write_scenes(Path(folder))
        for command in commands:
            words = shlex.split(command)
            if {*PANELS, "table.lf"} & {words[place + 1] for place, word in enumerate(words) if word == "-o"}:
                more = ["--spp", "256"] if words[0] == "render" else []
                rt = Path(sysconfig.get_path("scripts")) / "rt"
                subprocess.run([rt, *(word for word in words if word != "--preview"), *more], cwd=folder, check=True)
        for name in PANELS:
            with Image.open(Path(folder) / name) as picture:
                pictures.append(np.asarray(picture.convert("RGB").resize((480, 320), Image.Resampling.LANCZOS)))
    save_small(sheet(pictures, list(PANELS.values()), 2), GALLERY / "tutorial.jpg")


if __name__ == "__main__":
    main()
