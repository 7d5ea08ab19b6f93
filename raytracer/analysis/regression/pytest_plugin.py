"""Regression tests of scenes for pytest: the fixture `rt_regression`.

    def test_scene(rt_regression):
        rt_regression("scene.yaml")

fails if the scene no longer looks as `references/scene.npz` beside the test's file does, by the noise of both.
`pytest --rt-update` renders references that are missing, and anew those that fail.  See docs/regression.md.

pytest imports this in every project of an environment that has rt, so nothing else is imported before it is used.
"""

import os
import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from raytracer.analysis.regression.check import CheckResult
    from raytracer.analysis.regression.render_reference import ReferenceScene
    from raytracer.scene.cache import RenderCache
    from raytracer.scene.spec import SceneSpec

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
    """The fixture `rt_regression`: a call renders a scene, and fails the test if it differs from its reference."""

    def __init__(self, request: pytest.FixtureRequest, cache: "RenderCache", pages: pytest.TempPathFactory) -> None:
        self._config, self._node = request.config, request.node
        self._cache, self._pages = cache, pages

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
    ) -> "CheckResult":
        """Check a scene against `references/<name>.npz` beside the test's file.

        Parameters
        ----------
        scene : a scene file, from the folder of the test's file, or a scene that the test has built.
        name : of the reference; that of the scene file if None.  A scene that is built needs one.
        overrides : values by dotted path that stand in place of the scene's.
        width : of the picture (px); the reference's if None, and 64 for a new one.
        spp, seed, alpha : of the check, see `regression.check.CheckOptions`.
        reference_spp : samples a pixel of a reference that is rendered; 4096 if None.

        Returns
        -------
        The result, if the scene has passed: its `image`, the `reference` and the `verdict`.
        """
        __tracebackhide__ = True
        from raytracer.analysis.regression.check import ALPHA, CheckOptions, check_reference
        from raytracer.analysis.regression.reference_file import save_reference
        from raytracer.analysis.regression.render_reference import SPP, render_reference
        from raytracer.util.errors import InputError, OutputError

        path = self._reference(scene, name)
        options = CheckOptions(spp, seed, ALPHA if alpha is None else alpha)
        run_check = partial(check_reference, path, options, threads=_threads(), cache=self._cache)
        is_update = self._config.getoption("--rt-update")
        result, obstacle = None, ""
        try:
            place = self._node.path.parent / scene if isinstance(scene, str | os.PathLike) else scene
            to_render, obstacle = self._source(place, path, overrides, width)
            result = None if obstacle else run_check(scene=to_render)
            if is_update and (result is None or not result.passed):
                made = render_reference(to_render, spp=reference_spp or SPP, threads=_threads(), cache=self._cache)
                save_reference(path, *made)
                self._node.user_properties.append((_PROPERTY, str(path)))
                result = run_check(scene=to_render)
        except (InputError, OutputError) as error:
            result, message = None, str(error)
        else:
            message = f"{obstacle}; pytest --rt-update renders it" if result is None else self._failure_message(result)
        if result is None or not result.passed:
            # Out here, where no other error is being handled that pytest would tell of as well.
            pytest.fail(message, pytrace=False)
        return result

    def _reference(self, scene: "str | os.PathLike[str] | SceneSpec", name: str | None) -> Path:
        """Return the path of the reference of a scene."""
        from raytracer.analysis.regression.reference_file import SUFFIX

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
    ) -> tuple["ReferenceScene", str]:
        """Prepare the scene to be rendered, and say why the reference cannot be used, if so."""
        from raytracer.analysis.regression.reference_file import load_reference
        from raytracer.analysis.regression.render_reference import WIDTH, prepare_reference_scene
        from raytracer.util.errors import InputError, format_value

        reference, obstacle = None, f"there is no reference {path}"
        if path.exists():
            try:
                reference = load_reference(path)
            except InputError as error:
                obstacle = str(error)
        if width is None:
            width = WIDTH if reference is None else reference.mean.shape[1]
        to_render = prepare_reference_scene(scene, path.parent, overrides, width)
        if reference is None:
            return to_render, obstacle
        if to_render.scene != reference.recipe.scene:
            return to_render, f"{path} is the reference of {reference.recipe.scene or 'a scene that was built in code'}"
        overrides_then = reference.recipe.overrides
        for key in [*overrides_then, *to_render.overrides]:
            if overrides_then.get(key) != to_render.overrides.get(key):
                before, now = (format_value(values.get(key)) for values in (overrides_then, to_render.overrides))
                return to_render, f"{path} was rendered with {key}={before}, and the test asks for {now}"
        return to_render, ""

    def _failure_message(self, result: "CheckResult") -> str:
        """Write why the test fails; "" if it does not."""
        from raytracer.analysis.regression.report import check_page
        from raytracer.util.atomic_write import write_bytes
        from raytracer.util.errors import OutputError

        if result.passed:
            return ""
        lines = [result.sentence(), f"  reference: {result.path}"]
        if result.verdict is not None:
            given = self._config.getoption("--rt-report")
            folder = Path(given) if given else self._pages.mktemp("rt")
            page = folder / (re.sub(r"[^\w.-]+", "_", f"{self._node.nodeid}-{result.name}") + ".html")
            try:
                write_bytes(page, check_page([result]))
                lines.append(f"  pictures:  {page}")
            except OutputError as error:
                # What has failed is told all the same.
                lines.append(f"  pictures:  {error}")
            lines.append("  if it is to look like this from now on: pytest --rt-update")
        return "\n".join(lines)


def _threads() -> int | None:
    """Return the threads of a render: where several processes run tests, they share the processors."""
    from raytracer.rendering.worker_pool import available_threads

    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    return None if workers == 1 else max(1, available_threads() // workers)


@pytest.fixture(scope="session")
def _rt_cache() -> "RenderCache":
    """Make the cache that the renders of a session share."""
    from raytracer.scene.cache import RenderCache

    return RenderCache()


@pytest.fixture
def rt_regression(
    request: pytest.FixtureRequest, _rt_cache: "RenderCache", tmp_path_factory: pytest.TempPathFactory
) -> Regression:
    """Check a scene against its reference: `rt_regression("scene.yaml")`."""
    return Regression(request, _rt_cache, tmp_path_factory)


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
