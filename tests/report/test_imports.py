"""What is slow to import is imported where a figure is drawn, a page filled in, or a kernel compiled."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    "modules",
    [
        "raytracer.report.wording, raytracer.report.table, raytracer.report.page, raytracer.report.chart",
        "raytracer.analysis.lens_design.page, raytracer.analysis.lens_design.paper, raytracer.analysis.cost.page",
        "raytracer.analysis.sweep.page, raytracer.analysis.compare.difference_image, raytracer.lightfield.viewer.page",
        "raytracer, raytracer.cli.main, raytracer.rendering.render",
    ],
)
def test_modules_import_neither_matplotlib_nor_jinja_nor_the_compiler(modules):
    code = f"import sys, {modules}; print({{'matplotlib', 'jinja2', 'markupsafe', 'numba'}} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"
