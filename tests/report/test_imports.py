"""What is slow to import is imported where a figure is drawn, a page filled in, or a kernel compiled."""

import subprocess
import sys

MODULES = """\
raytracer.report.wording raytracer.report.table raytracer.report.page raytracer.report.chart raytracer
raytracer.analysis.lens_design.page raytracer.analysis.lens_design.paper raytracer.analysis.cost.page
raytracer.analysis.sweep.page raytracer.analysis.compare.difference_image raytracer.lightfield.viewer.page
raytracer.cli.main raytracer.rendering.render"""

CODE = """
import importlib, sys
for name in sys.argv[1:]:
    importlib.import_module(name)
    print(name, *{"matplotlib", "jinja2", "markupsafe", "numba"} & set(sys.modules))
"""


def test_modules_import_neither_matplotlib_nor_jinja_nor_the_compiler():
    command = [sys.executable, "-c", CODE, *MODULES.split()]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert run.stdout.split() == MODULES.split()
