"""Regression tests of scenes for pytest: the fixture `rt_regression`.

    def test_scene(rt_regression):
        rt_regression("scene.yaml")

fails if the scene no longer looks as `references/scene.npz` beside the test's file does, by the noise of both.
`pytest --rt-update` renders references that are missing, and anew those that fail.  See docs/regression.md.

pytest imports this in every project of an environment that has rt, so that nothing else is imported before it is used.
"""

import os
import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from raytracer.regression.checking import Checked
    from raytracer.regression.making import Source
    from raytracer.scene.spec import SceneSpec
    from raytracer.stock import Stock

FOLDER = "references"

_PROPERTY = "rt reference"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of rt to pytest's."""
    group = parser.getgroup("rt", "pictures of scenes against references")
    group.addoption(
        "--rt-update",
        action="store_true",
        help="render the references that are missing, and anew those that their scenes no longer look like",
    )
    group.addoption(
        "--rt-report", metavar="DIR", help="folder for pages of what has failed; default: pytest's own for tests"
    )


class Regression:
    """What `rt_regression` is: a call renders a scene and fails the test if it does not look as its reference does."""

    def __init__(self, request: pytest.FixtureRequest, stock: "Stock", pages: pytest.TempPathFactory) -> None:
        self._config, self._node = request.config, request.node
        self._stock, self._pages = stock, pages

    def __call__(
        self,
        scene: "str | os.PathLike[str] | SceneSpec",
        *,
        name: str | None = None,
        overrides: Mapping[str, Any] | None = None,
        width: int | None = None,
        spp: int | None = None,
        seed: int | None = None,
        alpha: float | None = None,
        reference_spp: int | None = None,
    ) -> "Checked":
        """Check a scene against `references/<name>.npz` beside the test's file.

        Parameters
        ----------
        scene : a scene file, from the folder of the test's file, or a scene that the test has built.
        name : of the reference; that of the scene file if None.  A scene that is built needs one.
        overrides : values by dotted path that stand in place of the scene's.
        width : of the picture (px); the reference's if None, and 64 for a new one.
        spp, seed, alpha : of the check, see `regression.checking.check`.
        reference_spp : samples a pixel of a reference that is rendered; 4096 if None.

        Returns
        -------
        What was found, if the scene has passed: its `image`, the `reference` and the `verdict`.
        """
        __tracebackhide__ = True
        from raytracer.errors import InputError, OutputError
        from raytracer.regression import making
        from raytracer.regression.checking import ALPHA, check
        from raytracer.regression.references import save_reference

        path = self._reference(scene, name)
        level = ALPHA if alpha is None else alpha
        judge = partial(check, path, spp=spp, seed=seed, alpha=level, threads=_threads(), stock=self._stock)
        is_update = self._config.getoption("--rt-update")
        result, obstacle = None, ""
        try:
            place = self._node.path.parent / scene if isinstance(scene, str | os.PathLike) else scene
            found, obstacle = self._source(place, path, overrides, width)
            result = None if obstacle else judge(found=found)
            if is_update and (result is None or not result.passed):
                made = making.make(found, spp=reference_spp or making.SPP, threads=_threads(), stock=self._stock)
                save_reference(path, *made)
                self._node.user_properties.append((_PROPERTY, str(path)))
                result = judge(found=found)
        except (InputError, OutputError) as error:
            result, told = None, str(error)
        else:
            told = f"{obstacle}; pytest --rt-update renders it" if result is None else self._told(result)
        if result is None or not result.passed:
            # Out here, where no other error is being handled that pytest would tell of as well.
            pytest.fail(told, pytrace=False)
        return result

    def _reference(self, scene: "str | os.PathLike[str] | SceneSpec", name: str | None) -> Path:
        """Where the reference of a scene is."""
        from raytracer.regression.references import SUFFIX

        if name is None:
            if not isinstance(scene, str | os.PathLike):
                pytest.fail("a scene that is built in code needs a name for its reference: name=...", pytrace=False)
            name = Path(scene).stem
        if name != Path(name).name:
            pytest.fail(f"name={name!r}: is the name of a reference, not a path", pytrace=False)
        folder: Path = self._node.path.parent / FOLDER
        return folder / f"{name}{SUFFIX}"

    def _source(
        self, scene: "Path | SceneSpec", path: Path, overrides: Mapping[str, Any] | None, width: int | None
    ) -> tuple["Source", str]:
        """The scene as it is to be rendered, and why the reference does not do for it, if it does not."""
        from raytracer.errors import InputError, shown
        from raytracer.regression import making
        from raytracer.regression.references import load_reference

        folder = path.parent
        if not path.exists():
            found = making.source(scene, folder, overrides, making.WIDTH if width is None else width)
            return found, f"there is no reference {path}"
        try:
            reference = load_reference(path)
        except InputError as error:
            return making.source(scene, folder, overrides, making.WIDTH if width is None else width), str(error)
        found = making.source(scene, folder, overrides, reference.mean.shape[1] if width is None else width)
        if found.scene != reference.recipe.scene:
            return found, f"{path} is the reference of {reference.recipe.scene or 'a scene that was built in code'}"
        kept = reference.recipe.overrides
        for key in [*kept, *found.overrides]:
            if kept.get(key) != found.overrides.get(key):
                before, now = (shown(values.get(key)) for values in (kept, found.overrides))
                return found, f"{path} was rendered with {key}={before}, and the test asks for {now}"
        return found, ""

    def _told(self, result: "Checked") -> str:
        """Why the test fails; empty if it does not."""
        from raytracer.errors import OutputError
        from raytracer.film.output import write_bytes
        from raytracer.regression.report import report

        if result.passed:
            return ""
        lines = [result.sentence(), f"  reference: {result.path}"]
        if result.verdict is not None:
            given = self._config.getoption("--rt-report")
            folder = Path(given) if given else self._pages.mktemp("rt")
            page = folder / (re.sub(r"[^\w.-]+", "_", f"{self._node.nodeid}-{result.name}") + ".html")
            try:
                write_bytes(page, report([result]))
                lines.append(f"  pictures:  {page}")
            except OutputError as error:
                # What has failed is told all the same.
                lines.append(f"  pictures:  {error}")
            lines.append("  if it is to look like this from now on: pytest --rt-update")
        return "\n".join(lines)


def _threads() -> int | None:
    """Threads of a render, where several processes run tests: the processors are shared among them."""
    from raytracer.scheduling import available_threads

    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    return None if workers == 1 else max(1, available_threads() // workers)


@pytest.fixture(scope="session")
def _rt_stock() -> "Stock":
    """What the renders of a session share."""
    from raytracer.stock import Stock

    return Stock()


@pytest.fixture
def rt_regression(
    request: pytest.FixtureRequest, _rt_stock: "Stock", tmp_path_factory: pytest.TempPathFactory
) -> Regression:
    """Checks a scene against its reference: `rt_regression("scene.yaml")`."""
    return Regression(request, _rt_stock, tmp_path_factory)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the references that were rendered."""
    reports = [report for kind in terminalreporter.stats.values() for report in kind]
    paths = [
        value
        for report in reports
        for key, value in getattr(report, "user_properties", ())
        if key == _PROPERTY and getattr(report, "when", "") == "call"
    ]
    for path in dict.fromkeys(paths):
        terminalreporter.write_line(f"rt: rendered the reference {path}")
