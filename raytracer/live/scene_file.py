"""The scene file that is looked at: when it has changed, what it says, and the values that are tried on top of it."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from raytracer.live.camera_controls import camera_overrides
from raytracer.scene.files import FileStamp, input_files
from raytracer.scene.load import load
from raytracer.scene.overrides import apply_overrides
from raytracer.scene.spec import SceneSpec
from raytracer.schema.yaml_edit import edit_values
from raytracer.util.atomic_write import write_bytes
from raytracer.util.errors import InputError
from raytracer.util.path_sandbox import AllowFiles

_BOM = "\ufeff".encode()


class SceneFile:
    """A scene file with overrides of two kinds: those given once and for all, and those that are tried.

    path : of the file.
    tried : values by dotted path that are not in the file.
    """

    def __init__(self, path: str, overrides: Mapping[str, Any], allow_files: AllowFiles = ()) -> None:
        self.path = path
        self._overrides, self._allow_files = dict(overrides), allow_files
        self.tried: dict[str, Any] = {}
        self._spec: SceneSpec | None = None
        self._files: tuple[Path, ...] = (Path(path),)
        self._stamps: dict[Path, FileStamp] = {}
        self._looked_at: dict[Path, FileStamp] = {}

    def has_changed(self) -> bool:
        """Tell if the file, or one that it names, is another than when it was last read; not while it is away.

        Nor while it is still written, often from an empty file on: it must be as it was when this was last asked.
        """
        before, stamps = self._looked_at, self._stamp()
        self._looked_at = stamps
        return Path(self.path) in stamps and stamps == before != self._stamps

    def _stamp(self) -> dict[Path, FileStamp]:
        stamps: dict[Path, FileStamp] = {}
        for path in self._files:
            with suppress(OSError):
                status = path.stat()
                stamps[path] = status.st_size, status.st_mtime_ns
        return stamps

    def load(self) -> SceneSpec:
        """Read the file; values that are tried stay, but for those that the file now says otherwise.

        Raises
        ------
        SceneError : the file is wrong.
        """
        # Before it is read, so that a change meanwhile is seen the next time.
        self._stamps = self._stamp()
        spec = load(self.path, self._overrides, allow_files=self._allow_files)
        before, self._spec = self._spec, spec
        self._files = tuple(dict.fromkeys((Path(self.path), *(file.path for file in input_files(spec)))))
        self._stamps = {**self._stamp(), Path(self.path): self._stamps.get(Path(self.path), (0, 0))}
        if before is not None and before.camera != spec.camera:
            self.tried = {}
        try:
            return apply_overrides(spec, self.tried)
        except InputError:
            self.tried = {}
            return spec

    def try_camera(self, values: Mapping[str, Any]) -> SceneSpec:
        """Try values of the camera.

        Raises
        ------
        InputError : they do not suit it; those before stay.
        """
        if self._spec is None:
            raise InputError(f"{self.path} is wrong; mend it first")
        now = apply_overrides(self._spec, self.tried)
        tried = {**self.tried, **camera_overrides(now, values)}
        spec = apply_overrides(self._spec, tried)
        self.tried = tried
        return spec

    def forget(self) -> SceneSpec:
        """Go back to what the file says."""
        if self._spec is None:
            raise InputError(f"{self.path} is wrong; mend it first")
        self.tried = {}
        return self._spec

    def write(self) -> None:
        """Write the tried values into the file, and leave every other byte as it is.

        Raises
        ------
        InputError : the file is wrong, or says a value in a way that cannot be changed in place.
        OutputError : it cannot be written.
        """
        file = Path(self.path)
        data = file.read_bytes()
        start = _BOM if data.startswith(_BOM) else b""
        text = data[len(start) :].decode()
        changes = {tuple(key.split(".")): value for key, value in self.tried.items()}
        if changes:
            write_bytes(file, start + edit_values(text, changes, self.path).encode())
