"""A picture in a viewer while it is rendered: whole at the end, and never at the render's cost."""

import socket
import threading

import numpy as np
import pytest

from raytracer.rendering.compilation import PreparedScene
from raytracer.rendering.observer import PictureSoFar
from raytracer.rendering.options import RenderOptions
from raytracer.rendering.render import prepare_scene, render, render_prepared
from raytracer.rendering.session import RenderSession
from raytracer.rendering.tev import viewer as viewer_module
from raytracer.rendering.tev.viewer import Address, TevViewer, parse_address
from raytracer.scene.load import build
from tests.cli.test_render import SCENE
from tests.rendering.tev.receiver import Receiver

UPDATE = 6
BALANCED = SCENE.replace("height: 16", "height: 16, white_balance: auto")


def scene(text: str = SCENE, **film: int):
    spec = build(text, "ball.yaml")
    return spec.replace({f"film.{key}": value for key, value in film.items()}) if film else spec


def addressed(receiver: Receiver, said: list[str]) -> TevViewer:
    return TevViewer(parse_address(receiver.address), "ball.exr", said.append)


@pytest.mark.parametrize("text", [SCENE, BALANCED], ids=["radiance", "balanced"])
def test_tiles_are_seen_as_they_are_finished_and_once(text):
    prepared = prepare_scene(scene(text, width=40, height=40))
    session = RenderSession(prepared, None, None, None)
    picture = PictureSoFar(session)
    assert picture.look()[1] == []
    session.queue.first_pass(8)
    pixels, windows = picture.look()
    image = session.develop().radiance
    assert np.array_equal(pixels, image)
    seen = np.zeros_like(image)
    for window in windows:
        part = slice(window.top, window.bottom), slice(window.left, window.right)
        assert not seen[part].any()
        seen[part] = pixels[part]
    assert np.array_equal(seen, image)
    assert image.any()
    assert picture.look()[1] == []
    # A row of tiles goes together; a tile that gets more is seen again by itself.
    if session.is_radiance:
        assert windows == [(0, 0, 40, 16), (0, 16, 40, 32), (0, 32, 40, 40)]
        goals = session.queue.counts.copy()
        goals[4] = 16
        session.queue.render_to(goals)
        assert picture.look()[1] == [(16, 16, 32, 32)]


def observed(prepared: PreparedScene, viewer: TevViewer):
    """Render with the viewer looking on; returns the picture."""
    with viewer:
        return render_prepared(prepared, observer=viewer).image


def test_tiles_of_a_crop_have_their_place_in_the_crop():
    session = RenderSession(prepare_scene(scene(), RenderOptions(crop=(3, 2, 20, 15))), None, None, None)
    picture = PictureSoFar(session)
    session.queue.first_pass(8)
    assert (picture.width, picture.height) == (17, 13)
    assert picture.look()[1] == [(0, 0, 17, 13)]


def before_the_end(monkeypatch, action):
    """Do something once all samples are taken, before the picture is developed."""
    finish = RenderSession._finish
    monkeypatch.setattr(RenderSession, "_finish", lambda session, outcome: (action(), finish(session, outcome))[1])


def test_parts_arrive_while_the_render_goes_on(monkeypatch):
    # Two rows a packet.
    monkeypatch.setattr(viewer_module, "_PACKET_BYTES", 2 * 4 * 3 * 24)
    came, said = threading.Event(), []
    with Receiver() as receiver:
        taken = receiver.take

        def take(packet):
            taken(packet)
            if packet[4] == UPDATE:
                came.set()

        monkeypatch.setattr(receiver, "take", take)
        before_the_end(monkeypatch, lambda: came.wait(10.0) or pytest.fail("nothing was seen of the render"))
        image = observed(prepare_scene(scene()), addressed(receiver, said))
        receiver.wait()
    assert said == []
    assert np.array_equal(receiver.images["ball.exr"], image.radiance.astype(np.float32))


def test_without_a_viewer_the_picture_is_the_same_and_one_sentence_says_why():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    prepared, said = prepare_scene(scene()), []
    image = observed(prepared, TevViewer(Address("127.0.0.1", port), "ball.exr", said.append))
    assert np.array_equal(image.radiance, render(scene()).image.radiance)
    (sentence,) = said
    assert sentence.startswith(f"no viewer takes the picture at 127.0.0.1:{port} (Connection refused); the render goes")
    assert not [thread for thread in threading.enumerate() if thread.name == "tev"]


def test_a_viewer_that_comes_later_gets_the_whole_picture(monkeypatch):
    monkeypatch.setattr(viewer_module, "_RETRY_SECONDS", 0.01)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    missed, receivers = threading.Event(), []

    def start_the_viewer():
        assert missed.wait(10.0)
        receivers.append(Receiver(port))

    before_the_end(monkeypatch, start_the_viewer)
    viewer = TevViewer(Address("127.0.0.1", port), "ball.exr", lambda sentence: missed.set())
    image = observed(prepare_scene(scene()), viewer)
    (receiver,) = receivers
    with receiver:
        receiver.wait()
    assert np.array_equal(receiver.images["ball.exr"], image.radiance.astype(np.float32))


def test_a_viewer_that_takes_nothing_holds_up_neither_the_render_nor_its_end(monkeypatch):
    monkeypatch.setattr(viewer_module, "_LAST_SECONDS", 0.2)
    said: list[str] = []
    # It accepts, and never reads: the system's buffers are full soon.
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        viewer = TevViewer(Address(*server.getsockname()), "ball.exr", said.append)
        with viewer:
            viewer._picture = PictureSoFar(RenderSession(prepare_scene(scene()), None, None, None))
            viewer._thread.start()
            viewer._last = np.ones((2000, 2000, 3))
            viewer._ending.set()
    assert not viewer._thread.is_alive()
    assert len(said) == 1


@pytest.mark.parametrize(("text", "address"), [("tev:1", ("tev", 1)), ("[::1]:14158", ("::1", 14158))])
def test_addresses(text, address):
    assert parse_address(text) == address


@pytest.mark.parametrize("text", ["tev", "tev:", "tev:0", "tev:65536", ":14158", "a b:1"])
def test_what_is_no_address_is_refused(text):
    with pytest.raises(ValueError, match="must be HOST:PORT"):
        parse_address(text)
