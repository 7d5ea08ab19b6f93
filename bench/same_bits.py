"""Show that another checkout computes the same bits.

    python bench/same_bits.py BEFORE [AFTER] --keep outputs/bits --jobs 2

Where modules move and nothing else is to change, each picture must keep its bits. Both checkouts (AFTER is this one
unless it is given) render small pictures of all scenes, of the peers' and of the references of the tests, these with
all AOVs; make light fields, focus and measure them; report on the lenses; and explain the scenes. Each does so in
processes and with a kernel cache of its own, by its public interface and command line alone, wherever its modules are.
Arrays are compared bit for bit, strings by themselves. Prints Markdown; exits with 1 if anything differs or fails.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import time
import tomllib
import warnings
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from fnmatch import fnmatchcase
from itertools import zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).resolve().parents[1]

AOVS = (
    "depth distance normal geometric_normal albedo position motion object_id material_id"
    " direct indirect coverage samples variance rays"
)

# Light fields by their scenes, with what makes them small and is recorded; and what is made of each.
FIELDS = {
    "array": "--aov depth -D film.width=64 -D film.height=48 -D camera.rows=5 -D camera.columns=5",
    "small": "--aov depth,rays -D film.width=192 -D film.height=144",
    "lytro": "--aov depth,rays -D film.width=240 -D film.height=180 -D 'camera.sensor={width: 336um, height: 252um}'",
}
FIELD_COMMANDS = (
    "refocus field.lf -o refocused.npy",
    "refocus field.lf -o near.npy --slope 0.7 --interpolation cubic",
    "refocus field.lf -o fourier.npy --method fourier",
    "depth field.lf -o depth.npy --confidence confidence.npy",
    "all-in-focus field.lf -o all_in_focus.npy",
    "views field.lf -o montage.npy",
    "views field.lf -o views --all --format npy",
    "views field.lf -o between.npy --at 0.2mm,-0.1mm --depth",
)
RAYS_COMMAND = "refocus field.lf -o rays.npy --method rays"

# Commands by name; what they print is compared, and the files that they write.
COMMANDS = {
    "schema": "schema",
    "schema of lenses": "schema --lens",
    "explain": "explain {}/scenes/cornell.yaml --all",
    "probe": "probe {}/scenes/cover.yaml --at 0,1,4 --toward 0,0,0 --json",
    "render": "render {}/scenes/cover.yaml -q -D film.width=96 -D film.height=54 --spp 8 --aov depth,normal"
    " -o picture.exr -o picture.png -o picture.hdr -o picture.npy",
    "adaptive": "render {}/scenes/cornell.yaml -q -D film.width=64 -D film.height=64 --spp 256 --noise 5%"
    " --aov samples -o picture.exr -o picture.npy",
}

_FAILURE = "text failure"

# How the command is started whatever module it is in: by the name that pyproject.toml has for it.
_LAUNCH = """import sys; from importlib import import_module; module, name = sys.argv.pop(1).split(":");
sys.argv[0] = "rt"; sys.exit(getattr(import_module(module), name)())"""

# A number of a JSON text that has each on a line of its own.
_NUMBER = re.compile(r"(?<=[ \[])-?\d[-+.\de]*(?=,?$)", re.MULTILINE)


# ---- In the process of a checkout


def rt_command(checkout: Path, words: Sequence[str], folder: Path) -> str:
    """Run `rt` in a folder, and give what it printed; RuntimeError if it does not exit with 0."""
    entry = tomllib.loads((checkout / "pyproject.toml").read_text(encoding="utf-8"))["project"]["scripts"]["rt"]
    command = [sys.executable, "-c", _LAUNCH, entry, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    if done.returncode:
        raise RuntimeError(done.stderr.strip() or f"exit status {done.returncode}")
    return done.stdout


def scene_results(request: Mapping[str, Any], path: Path) -> dict[str, Any]:
    """Render one scene small, and give its arrays and what is said of it."""
    import raytracer as rt

    options: dict[str, Any] = {"spp": request["spp"], "threads": request["threads"]}
    overrides: dict[str, Any] = {}
    if path.suffix == ".npz":
        with np.load(path) as file:
            recipe = json.loads(str(file["settings"]))
        path, overrides = path.parent / recipe["scene"], recipe["overrides"]
        options |= {"seed": recipe["seed"], "aovs": request["aovs"]}
    else:
        spec = rt.load(path)
        width = min(request["width"], spec.film.width)
        height = max(1, round(width * spec.film.height / spec.film.width))
        if spec.camera.type == "light_field":
            # Microlenses need their pixels: a part of the whole picture.
            left, top = (spec.film.width - width) // 2, (spec.film.height - height) // 2
            options["crop"] = (left, top, left + width, top + height)
        else:
            overrides = {"film.width": width, "film.height": height}
        if spec.camera.type == "camera_array":
            overrides |= {"camera.rows": 4, "camera.columns": 4}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        spec = rt.load(path, overrides)
        image = rt.render(spec, **options)
    told = [f"{warning.message}\n" for warning in caught if issubclass(warning.category, rt.SceneWarning)]
    return {
        "radiance": image.radiance,
        "variance": image.variance,
        "display": image.display(),
        **{f"layer {name}": values for name, values in image.layers.items()},
        "text warnings": "".join(told),
        "text settings": json.dumps(dict(image.settings), indent=1, default=str),
        "text explanation": repr(rt.explain(spec)),
    }


def results_of(request: Mapping[str, Any], checkout: Path) -> dict[str, Any]:
    """Make what is asked for; arrays by name, and strings, whose names begin with "text"."""
    if request["kind"] == "scene":
        return scene_results(request, checkout / request["file"])
    with tempfile.TemporaryDirectory() as name:
        folder, results = Path(name), {}
        for number, words in enumerate(request["commands"]):
            printed = rt_command(checkout, shlex.split(words.replace("{}", str(checkout))), folder)
            if "--json" in words:
                results[f"numbers {number}"] = np.array(re.findall(_NUMBER, printed), dtype=np.float64)
                printed = re.sub(_NUMBER, "0", printed)
            results[f"text printed {number}"] = printed
        for file in sorted(folder.rglob("*.*")):
            if file.suffix == ".npy":
                results[str(file.relative_to(folder))] = np.load(file)
            elif file.suffix != ".lf":
                results[f"bytes of {file.name}"] = np.frombuffer(file.read_bytes(), np.uint8)
        return results


def work(checkout: Path) -> None:
    """Answer requests that come line by line, by the sources of a checkout."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    import raytracer as rt

    if not Path(rt.__file__).resolve().is_relative_to(checkout):
        raise RuntimeError(f"{rt.__file__} is not of {checkout}")
    for line in sys.stdin:
        request = json.loads(line)
        try:
            results = results_of(request, checkout)
        except Exception as error:  # noqa: BLE001 - whatever happens is what the row says
            results = {_FAILURE: f"{type(error).__name__}: {error}"}
        save(Path(request["out"]), results, checkout)
        print("done", file=answers, flush=True)


def save(path: Path, results: dict[str, Any], checkout: Path) -> None:
    """Write results whole or not at all; strings do not say which checkout they are of."""
    aside = path.with_suffix(".part.npz")
    for name, value in results.items():
        results[name] = np.asarray(value.replace(str(checkout), "CHECKOUT") if isinstance(value, str) else value)
    np.savez(aside, **results)
    aside.replace(path)


# ---- What there is to make


def requests_of(checkout: Path, patterns: Sequence[str], width: int, spp: int) -> dict[str, dict[str, Any]]:
    """List the requests to a checkout, by names that do not depend on where its peers are."""
    peers, references = checkout / "bench" / "peers", checkout / "tests" / "references"
    scenes = [path for path in (checkout / "scenes").glob("**/*.yaml") if path.parent.name != "lenses"]
    scenes += [*(peers if peers.exists() else checkout / "peers").glob("*.yaml"), *references.glob("*.npz")]
    found: dict[str, dict[str, Any]] = {}
    for path in sorted(scenes):
        file = path.relative_to(checkout)
        name = str(file.with_suffix("")).removeprefix("bench/")
        found[name] = {"kind": "scene", "file": str(file), "width": width, "spp": spp, "aovs": AOVS.split()}
    for name, options in FIELDS.items():
        steps = [*FIELD_COMMANDS, *[RAYS_COMMAND] * ("rays" in options), "info field.lf"]
        first = f"render {{}}/scenes/lightfield/{name}.yaml -o field.lf -q --spp {spp} {options}"
        found[f"fields/{name}"] = {"kind": "run", "commands": [f"lightfield {step}" for step in (first, *steps)]}
    for path in sorted((checkout / "scenes" / "lenses").glob("*.yaml")):
        found[f"lenses/{path.stem}"] = {"kind": "run", "commands": [f"lens {{}}/scenes/lenses/{path.name} --json"]}
    for name, words in COMMANDS.items():
        found[f"commands/{name}"] = {"kind": "run", "commands": [words]}
    return {name: what for name, what in found.items() if any(fnmatchcase(name, f"*{part}*") for part in patterns)}


def out_files(checkout: Path, folder: Path, requests: Mapping[str, Mapping[str, Any]]) -> dict[str, Path]:
    """Return the file of each request's results; other settings, commits or changes since have other files."""
    git = [["git", "-C", str(checkout), *words.split()] for words in ("rev-parse HEAD", "diff HEAD")]
    done = [subprocess.run(command, capture_output=True, check=False) for command in git]
    sources = str(checkout) if any(one.returncode for one in done) else repr([one.stdout for one in done])
    files = {}
    for name, request in requests.items():
        digest = hashlib.sha256(json.dumps([request, sources]).encode()).hexdigest()[:12]
        files[name] = folder / f"{re.sub('[^a-z0-9]+', '-', name)}-{digest}.npz"
    return files


def failed(path: Path) -> bool:
    """Tell whether a file of results holds none."""
    with np.load(path) as file:
        return _FAILURE in file


# ---- Processes


class Side(NamedTuple):
    """A checkout, the Python that runs it, and the folder of its kernels."""

    checkout: Path
    python: str
    kernels: Path

    def start(self) -> subprocess.Popen[str]:
        """Start a process that answers requests."""
        variables = {"PYTHONPATH": str(self.checkout), "PYTHONSAFEPATH": "1", "RAYTRACER_CACHE_DIR": str(self.kernels)}
        command, pipe = [self.python, str(Path(__file__).resolve()), "--worker", str(self.checkout)], subprocess.PIPE
        return subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env={**os.environ, **variables})

    def make(self, requests: Mapping[str, Mapping[str, Any]], files: Mapping[str, Path], jobs: int) -> None:
        """Make all that is asked for, by as many processes, which stay warm."""
        waiting = iter(list(requests))
        shared = {"threads": max(1, (os.cpu_count() or 1) // jobs)}

        def drive(_: int) -> None:
            process = None
            for name in waiting:
                began = time.monotonic()
                process = process or self.start()
                answer = ""
                with suppress(BrokenPipeError):
                    request = json.dumps({**requests[name], **shared, "out": str(files[name])})
                    print(request, file=process.stdin, flush=True)
                    answer = process.stdout.readline()
                if not answer:
                    save(files[name], {_FAILURE: f"the process ended with {process.wait()}"}, self.checkout)
                    process = None
                print(f"  {self.checkout}: {name}, {time.monotonic() - began:.1f} s", file=sys.stderr, flush=True)
            if process is not None:
                process.communicate()

        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(drive, range(jobs)))


# ---- Comparison


def difference(before: np.ndarray, after: np.ndarray) -> tuple[float, int] | None:
    """Give the largest difference of two arrays, and in how many pixels (numbers, if no picture) their bits differ."""
    if (before.dtype, before.shape) != (after.dtype, after.shape):
        return np.inf, before.size
    bytes_of = [np.frombuffer(array.tobytes(), np.uint8).reshape(-1, array.itemsize) for array in (before, after)]
    other = (bytes_of[0] != bytes_of[1]).any(axis=1)
    if not other.any():
        return None
    pixels = other.reshape(-1, before.shape[2] if before.ndim == 3 else 1).any(axis=1)
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(after.reshape(-1)[other].astype(np.float64) - before.reshape(-1)[other].astype(np.float64))
    return float(np.max(apart[~np.isnan(apart)], initial=0.0)), int(pixels.sum())


def compared(name: str, before: Path | None, after: Path | None) -> tuple[list[str], list[str]]:
    """Compare two results, either of which may not be there: the row of the table, and what is to be said besides."""
    if before is None or after is None:
        return [name, "only " + ("after" if before is None else "before"), *[""] * 4], []
    with np.load(before) as one, np.load(after) as other:
        old, new = dict(one), dict(other)
    arrays: dict[str, tuple[float, int]] = {}
    texts = []
    for key in dict.fromkeys([*old, *new]):
        if key == _FAILURE:
            sides = [f"{side[key]}" for side in (old, new) if key in side]
            return [name, "failed", *[""] * 4], [f"{name}: {' / now: '.join(dict.fromkeys(sides))}"]
        if key not in old or key not in new:
            arrays[f"{key} (only {'before' if key in old else 'after'})"] = (np.inf, 0)
        elif key.startswith("text "):
            if (was := str(old[key])) != (now := str(new[key])):
                pairs = zip_longest(was.splitlines(), now.splitlines())
                line = next((f"`{one}`, now `{other}`" for one, other in pairs if one != other), "its end")
                texts.append(f"{name}, {key.removeprefix('text ')}: {line}")
        elif (found := difference(old[key], new[key])) is not None:
            arrays[key] = found
    verdict = " and ".join(["**differs**"] * bool(arrays) + ["text differs"] * bool(texts)) or "same"
    values = str(sum(array.size for key, array in old.items() if not key.startswith("text ")))
    largest, pixels = (max(part) for part in zip((0.0, 0), *arrays.values(), strict=True))
    return [name, verdict, values, *((f"{largest:.3g}", str(pixels)) if arrays else ("", "")), ", ".join(arrays)], texts


def main() -> None:
    """Make, compare, print."""
    if sys.argv[1:2] == ["--worker"]:
        work(Path(sys.argv[2]))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="a checkout")
    parser.add_argument("after", type=Path, nargs="?", default=ROOT, help="another; default: this one")
    parser.add_argument("--only", action="append", metavar="PATTERN", help="as scenes/c* or lens; may repeat")
    parser.add_argument("--spp", type=int, default=8, help="default: 8")
    parser.add_argument("--width", type=int, default=96, help="pixels of a picture; default: 96")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep what BEFORE makes, and take what is kept")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time; default: 1")
    parser.add_argument("--python", default=sys.executable, help="for checkouts without .venv; default: this one")
    arguments = parser.parse_args()
    made = []
    with tempfile.TemporaryDirectory() as scratch:
        kept = (arguments.keep or Path(scratch)).resolve()
        for when, checkout in (("before", arguments.before.resolve()), ("after", arguments.after.resolve())):
            requests = requests_of(checkout, arguments.only or ["*"], arguments.width, arguments.spp)
            files = out_files(checkout, kept / when, requests)
            (kept / when).mkdir(parents=True, exist_ok=True)
            there = {name for name, file in files.items() if when == "before" and file.exists() and not failed(file)}
            missing = {name: request for name, request in requests.items() if name not in there}
            own = checkout / ".venv" / "bin" / "python"
            # AFTER has no kernels of an earlier run.
            kernels = (kept if when == "before" else Path(scratch)) / f"kernels_{when}"
            Side(checkout, str(own) if own.exists() else arguments.python, kernels).make(missing, files, arguments.jobs)
            made.append(files)
        results = [compared(name, *(files.get(name) for files in made)) for name in dict.fromkeys([*made[0], *made[1]])]
    head = ["", "verdict", "values", "largest difference", "pixels", "where"]
    print("".join(f"| {' | '.join(row)} |\n" for row in [head, ["---"] * len(head), *(row for row, _ in results)]))
    print("".join(f"- {text}\n" for _, texts in results for text in texts))
    same = sum(row[1] == "same" for row, _ in results)
    print(f"{same} of {len(results)} are the same.")
    sys.exit(same < len(results) or not results)


if __name__ == "__main__":
    main()
