"""Small pictures kept as references, and whether scenes still look like them.

`making.make` renders a reference, `checking.check` renders its scene again and judges the two by the noise of both, and
`report.report` shows on a page what failed.  `rt reference`, `rt check` and the fixture `rt_regression` of
`raytracer.pytest_plugin` are made of these.
"""
