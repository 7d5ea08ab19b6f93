"""The words of scene files for Python: `rt.camera.thin_lens(...)` is `{type: thin_lens, ...}`."""
