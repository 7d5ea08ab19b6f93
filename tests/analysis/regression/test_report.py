"""The page of a check, in a browser: what failed is seen, and the numbers are those of the verdict."""

from pathlib import Path

import numpy as np
import pytest

from raytracer.analysis.compare import z_test
from raytracer.analysis.regression.check import TILE, CheckResult
from raytracer.analysis.regression.reference_file import Recipe, Reference
from raytracer.analysis.regression.report import check_page
from raytracer.film.image import Image
from tests.analysis.regression.made_up import HEIGHT, WIDTH, truth


def result(name, change=1.0, light=1.0, broken=False, **settings):
    rng = np.random.default_rng(len(name))
    mean = light * truth()
    kept = Reference(
        mean, (0.3 * mean) ** 2 / 4096, Recipe("../scene.yaml", {"film.width": WIDTH}, 4096, 12345, "", {})
    )
    variance = (0.3 * mean) ** 2 / 256
    image = Image(change * (mean + np.sqrt(variance) * rng.standard_normal(mean.shape)), change**2 * variance, 256)
    if broken:
        image.radiance[3, 4] = np.nan
    verdict = z_test(image.radiance, image.variance, kept.mean, kept.variance, TILE)
    found = {"scene": "../scene.yaml", "spp": 256, "seed": 12346, "detectable_change": 0.01, **settings}
    path = Path("references") / f"{name}.npz"
    return CheckResult(
        name, path, verdict.passed, verdict.reason, reference=kept, image=image, verdict=verdict, **found
    )


@pytest.fixture
def shown(tmp_path, open_page):
    def show(*results):
        path = tmp_path / "check.html"
        path.write_bytes(check_page(results))
        return open_page(path)

    return show


# Average colour of what an image of the page holds.
MEAN_COLOUR = """async (image) => {
  await image.decode();
  const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight);
  const context = canvas.getContext("2d");
  context.drawImage(image, 0, 0);
  const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
  const sum = [0, 0, 0];
  data.forEach((value, index) => { if (index % 4 < 3) sum[index % 4] += value; });
  return [canvas.width, canvas.height, ...sum.map((value) => value / (data.length / 4))];
}"""


def test_what_failed_comes_first_with_its_pictures_and_numbers(shown):
    good, bad = result("good"), result("bad", 1.01, changes=("the scene",))
    evil = "<img src=x onerror=alert(1)></script><b>"
    gone = CheckResult(evil, Path("gone.npz"), passed=False, reason="gone.yaml: no such file", error=True)
    page = shown(good, bad, gone)
    assert page.title() == "rt check: 2 of 3 failed"
    assert page.locator("h1").inner_text() == "2 of 3 failed"
    assert page.locator("nav a").all_inner_texts() == ["bad", evil, "good"]
    first, second, _ = page.locator("section.result").all()
    assert bad.reason in first.inner_text()
    assert "the scene has changed since the reference was rendered" in first.inner_text()
    assert second.locator("h2").inner_text().startswith(evil)
    assert "gone.yaml: no such file" in second.inner_text()
    assert second.locator("img, b").count() == 0

    # The numbers are those of the verdict.
    rows = first.locator("table").nth(0).locator("tbody tr").all()
    now, kept = (values.mean(axis=(0, 1)) for values in (bad.image.radiance, bad.reference.mean))
    for row, *expected in zip(rows, kept, now, 100 * (now - kept) / kept, bad.verdict.mean_z, strict=True):
        told = [float(text.removesuffix(" %")) for text in row.locator("td").all_inner_texts()[1:]]
        np.testing.assert_allclose(told, expected, rtol=0.05)
    assert first.locator("table").nth(1).locator("tbody tr").nth(0).locator(".bad").count() == 1

    # The pictures are what they are called.
    found = [image.evaluate(MEAN_COLOUR) for image in first.locator("figure > img").all()]
    assert [image[:2] for image in found] == [[WIDTH, HEIGHT]] * 5
    kept, now, *differences = (image[2:] for image in found)
    assert sum(now) > sum(kept)
    assert all(red > blue for red, _, blue in differences)
    wipe = first.locator(".wipe")
    assert wipe.get_attribute("data-pictures") == "2"
    assert wipe.locator(".wipe-label").all_inner_texts() == ["reference", "now"]


def test_what_passed_is_seen_when_it_is_asked_for(shown):
    page = shown(result("one"), result("two"))
    assert page.locator("h1").inner_text() == "2 passed"
    assert page.locator("figure >> visible=true").count() == 0
    page.locator("nav a").nth(1).click()
    page.wait_for_selector("#result-1 figure >> visible=true")
    page.wait_for_selector("#result-1 .wipe-divider")
    assert page.locator("#result-0 figure >> visible=true").count() == 0


def test_light_of_any_strength_and_values_that_are_not_finite_are_shown(shown):
    page = shown(result("dark", 1.1, light=1e-3), result("light", 1.1, light=1e3), result("fair", 1.1, broken=True))
    for image in page.locator("section.result figure:first-child > img").all():
        assert 40.0 < np.mean(image.evaluate(MEAN_COLOUR)[2:]) < 220.0
    sections = page.locator("section.result").all()
    assert ["times its light" in section.inner_text() for section in sections] == [True, True, False]
    assert "not finite" in sections[2].inner_text()
    assert sections[2].locator("figure > img").count() == 5
