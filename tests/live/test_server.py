"""The server answers the page that it has sent, and nobody else."""

import asyncio
import http.client
import socket
import urllib.parse

import aiohttp
import pytest

from raytracer.live.engine import STEPS
from raytracer.live.server import FRAME_SECONDS, FRAME_SHARE, LiveServer
from raytracer.util.errors import InputError
from tests.live.conftest import done
from tests.repository import ROOT


@pytest.fixture
def ask(server):
    """Ask for a path below the token's, or another; returns the status and the whole answer."""
    address = urllib.parse.urlparse(server.address)

    def asked(path="", method="GET", token=address.path, **headers):
        connection = http.client.HTTPConnection("127.0.0.1", address.port)
        connection.request(method, token + path, headers={"Host": address.netloc, **headers})
        answer = connection.getresponse()
        content = answer.read().decode()
        connection.close()
        return answer, content

    asked.port, asked.path = address.port, address.path
    return asked


def test_the_page_its_style_and_its_script_come_from_here_alone(ask):
    answer, page = ask()
    assert answer.status == 200
    assert '<script src="view.js">' in page
    assert "http" not in page
    for name, kind in (("view.js", "text/javascript"), ("view.css", "text/css")):
        answer, content = ask(name)
        assert answer.getheader("Content-Type").startswith(kind)
        assert "https://" not in content
    policy = answer.getheader("Content-Security-Policy")
    assert policy.startswith("default-src 'self';")
    assert "unsafe" not in policy
    assert answer.getheader("Cache-Control") == "no-store"
    assert answer.getheader("Access-Control-Allow-Origin") is None


@pytest.mark.parametrize(
    ("path", "settings"),
    [
        ("", {"token": "/"}),
        ("", {"token": "/wrong/"}),
        ("view.js", {"token": "/%C3%A4/"}),
        ("view.js/", {}),
        ("view.html", {}),
        ("..%2f..%2fetc/passwd", {}),
        ("../view.js", {}),
        ("socket/x", {}),
        ("", {"Host": "evil.example"}),
        ("", {"Host": "127.0.0.1"}),
        ("", {"Host": "127.0.0.1:1"}),
        ("", {"Origin": "http://evil.example"}),
        ("", {"Origin": "null"}),
        ("view.js", {"method": "POST"}),
        ("", {"method": "OPTIONS", "Origin": "http://evil.example"}),
        ("socket", {"Connection": "Upgrade", "Upgrade": "websocket", "Origin": "http://evil.example"}),
        ("socket", {"Connection": "Upgrade", "Upgrade": "websocket"}),
    ],
)
def test_whoever_lacks_the_token_or_comes_from_elsewhere_is_refused(ask, path, settings):
    answer, content = ask(path, **settings)
    assert answer.status == 403
    assert content.startswith("403: ")
    assert ask.path.strip("/") not in content


def test_the_page_may_be_asked_for_by_the_machines_name(ask):
    assert ask(Host=f"localhost:{ask.port}", Origin=f"http://localhost:{ask.port}")[0].status == 200
    assert ask(Host=f"127.0.0.1:{ask.port}", Origin=f"http://localhost:{ask.port}")[0].status == 403


def test_it_listens_to_this_machine_alone(ask):
    others = {found[4][0] for found in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {"127.0.0.1"}
    for address in others:
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((address, ask.port), timeout=5.0)


def test_a_port_that_is_taken_is_said_so(live, ask):
    with pytest.raises(InputError, match=f"port {ask.port}: .*in use"):
        LiveServer(live, ask.port)


def test_what_is_no_message_of_the_page_is_refused_and_harms_nothing(ask, live):
    done(live)

    async def talk():
        address = f"http://127.0.0.1:{ask.port}"
        replies = []
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{address}{ask.path}socket", origin=address) as page,
        ):
            for text in ("{", "[]", '{"do": "set"}', '{"do": "values", "x": [], "y": 0}', '{"do": "set", "values": 3}'):
                await page.send_str(text)
            while len(replies) < 3:
                message = await page.receive(timeout=20.0)
                if message.type == aiohttp.WSMsgType.TEXT and (reply := message.json())["kind"] == "refused":
                    replies.append(reply["text"])
        return replies

    assert all(text.startswith("not understood: ") for text in asyncio.run(talk()))
    assert ask()[0].status == 200


def test_the_document_has_the_numbers_of_the_program():
    text = " ".join((ROOT / "docs" / "live.md").read_text(encoding="utf-8").split())
    assert (STEPS, FRAME_SECONDS) == ((8, 4), 1 / 5)
    assert "The first picture has an eighth of the width and of the height, the next one a quarter" in text
    assert f"take {100 * sum(step**-2 for step in STEPS):.0f} % of the time of one pass" in text
    assert "at most five times a second" in text
    assert f"no more than a {FRAME_SHARE:.0f}th of one processor's time" in text
