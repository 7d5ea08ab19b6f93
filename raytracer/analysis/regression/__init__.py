"""Regression tests of scenes against small reference pictures, judged by the noise of both.

`render_reference` renders a reference, `check` renders its scene again and compares the two by their noise, and
`report` shows failures on a page.  `rt reference`, `rt check` and the fixture `rt_regression` use these.
"""
