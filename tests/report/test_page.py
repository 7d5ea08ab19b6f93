"""A page as a file: all of it is in it, and data stay data."""

import io
import json
import re
from base64 import b64decode
from html.parser import HTMLParser

import numpy as np
import PIL.Image
import pytest

from raytracer.report import page as html

EVIL = '</script><script>alert("1")</script><!-- \u2028 &amp; \udcff'


class Elements(HTMLParser):
    """Start tags with their attributes, and the data of the page."""

    def __init__(self, content):
        super().__init__()
        self.tags = []
        self.title = ""
        self.data = ""
        self.feed(content.decode())

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        tag, attributes = self.tags[-1] if self.tags else ("", {})
        if tag == "title":
            self.title += data
        if attributes.get("id") == "data":
            self.data += data


def test_data_come_back_as_they_were():
    data = {EVIL: [EVIL, 1, 2.5, None, True, np.float64(0.25), np.arange(3)], "ends": (float("inf"), -np.inf, np.nan)}
    page = Elements(html.page("sweep", "a sweep", data))
    assert json.loads(page.data) == {EVIL: [EVIL, 1, 2.5, None, True, 0.25, [0, 1, 2]], "ends": ["inf", "-inf", "nan"]}


def test_data_and_title_make_no_elements():
    plain, evil = (Elements(html.page("sweep", text, {"a": text})) for text in ("x", EVIL))
    assert [tag for tag, _ in evil.tags] == [tag for tag, _ in plain.tags]
    assert evil.title.startswith('</script><script>alert("1")')


@pytest.mark.parametrize(("name", "parts"), [("sweep", ("wipe",)), ("wipe", ())])
def test_nothing_is_fetched(name, parts):
    page = Elements(html.page(name, "a page", {}, parts=parts))
    (policy,) = (a["content"] for _, a in page.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.split("; ")[0] == "default-src 'none'"
    assert "img-src data:" in policy.split("; ")
    addresses = [a[key] for _, a in page.tags for key in ("src", "href") if key in a]
    assert all(address is not None and address.startswith(("data:", "#")) for address in addresses)


def test_no_script_makes_html_of_texts():
    content = html.page("sweep", "a sweep", {}, parts=("wipe",)).decode()
    assert "class Wipe" in content
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function", content)


def test_what_is_no_data_is_refused():
    with pytest.raises(TypeError):
        html.page("sweep", "a sweep", {"a": object()})


@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (5, 7, 4)])
@pytest.mark.parametrize("encode", [html.png, html.webp])
def test_pictures_are_held_as_they_are(encode, shape):
    pixels = np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)
    got = decoded(encode(pixels), encode.__name__)
    got = got[..., : shape[2]] if len(shape) == 3 else got[..., 0] if got.ndim == 3 else got
    np.testing.assert_array_equal(got, pixels)


def test_pictures_with_losses_are_near():
    pixels = np.broadcast_to(np.linspace(0, 255, 64).astype(np.uint8)[:, None, None], (64, 64, 3))
    for address in (html.webp(pixels, 90), html.jpeg(pixels, 90)):
        assert np.abs(decoded(address, "(webp|jpeg)").astype(int) - pixels).max() <= 6


def decoded(address, kind):
    head, content = address.split(",")
    assert re.fullmatch(f"data:image/{kind};base64", head)
    with PIL.Image.open(io.BytesIO(b64decode(content))) as file:
        return np.asarray(file)
