"""The server: what it gives to whom, and what it refuses."""

from __future__ import annotations

import http.client
import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from lfstereo.cli.main import main
from lfstereo.focus.refocus import refocus
from lfstereo.lightfield.encoding import srgb16
from lfstereo.lightfield.views import display_gain
from lfstereo.viewer.server import PageServer
from lfstereo.viewer.shelf import find_items

from .conftest import COLUMNS, ROWS, light_field

CODES_16 = 700
"""Largest difference of 16-bit codes from exact refocusing, about 1 % of white."""


@pytest.fixture(scope="module")
def server(result_folder: Path, field_file: Path) -> Iterator[PageServer]:
    with PageServer(find_items(result_folder.parent)) as serving:
        thread = threading.Thread(target=serving.serve_forever, args=(0.05,))
        thread.start()
        yield serving
        serving.shutdown()
        thread.join()


def ask(server: PageServer, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    """Send one request, the path as it is written."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port)
    connection.putrequest("GET", path, skip_host=True)
    for name, value in ({"Host": f"127.0.0.1:{server.server_port}"} | headers).items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, dict(answer.getheaders()), body


def below(server: PageServer, path: str) -> tuple[int, dict[str, str], bytes]:
    return ask(server, f"/{server.token}/{path}")


def test_listens_on_this_computer_alone(server: PageServer) -> None:
    assert server.server_address[0] == "127.0.0.1"
    assert len(server.token) >= 32


def test_pages_of_all_items(server: PageServer) -> None:
    assert [item.name for item in server.items] == ["a result", "field.h5"]
    for index, title in enumerate((b"left &lt;b&gt;.h5", b"field.h5")):
        status, headers, body = below(server, f"?item={index}")
        assert status == 200
        assert headers["Content-Type"] == "text/html; charset=utf-8"
        assert headers["Cache-Control"] == "no-store"
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert title in body


def test_other_hosts_and_tokens_are_refused(server: PageServer) -> None:
    good = f"/{server.token}/"
    assert ask(server, good, Host=f"localhost:{server.server_port}")[0] == 200
    for host in ("evil.example", f"evil.example:{server.server_port}", "127.0.0.1", ""):
        status, _, body = ask(server, good, Host=host)
        assert status == 403
        assert b"<html" not in body
    for path in ("/", "/x/", f"/{server.token[:-1]}/", f"/{server.token}x/", f"/{server.token}"):
        assert ask(server, path)[0] == 404


@pytest.mark.parametrize(
    "path",
    [
        "nothing",
        "item/0",
        "item/2/refocus?slope=0",
        "item/-1/refocus",
        "item/0/other",
        "?item=7",
        "?item=x",
        "item/0/file/",
        "item/0/file/..%2f..%2frig.toml",
        "item/0/file/../../../rig.toml",
        "item/0/file/%2e%2e/rig.toml",
        "item/0/file/report.html",
        "item/0/file/focal_stack_left",
        "item/0/file/focal_stack_left/slice_00_d090.00px.png",
        "item/1/file/run.toml",
        "item/0/refocus/more?slope=0&radius=2&tilt_x=0&tilt_y=0",
    ],
)
def test_nothing_else_is_served(server: PageServer, path: str) -> None:
    assert below(server, path)[0] == 404


def test_files_of_a_result(server: PageServer, result_folder: Path) -> None:
    status, headers, body = below(server, "item/0/file/mesh.glb")
    assert (status, body) == (200, (result_folder / "mesh.glb").read_bytes())
    assert headers["Content-Disposition"] == 'attachment; filename="mesh.glb"'
    assert below(server, "item/0/file/overview.png")[1]["Content-Type"] == "image/png"


def test_a_link_out_of_the_result_is_not_followed(server: PageServer, result_folder: Path) -> None:
    outside = result_folder.parent.parent / "rig.toml"
    (result_folder / "valid.png").rename(result_folder / "kept.png")
    (result_folder / "valid.png").symlink_to(outside)
    try:
        assert below(server, "item/0/file/valid.png")[0] == 404
    finally:
        (result_folder / "valid.png").unlink()
        (result_folder / "kept.png").rename(result_folder / "valid.png")


def test_refocuses(server: PageServer) -> None:
    status, headers, body = below(server, "item/1/refocus?slope=0.4&radius=2.5&tilt_x=0&tilt_y=0")
    assert (status, headers["Content-Type"]) == (200, "image/jpeg")
    picture = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (ROWS, COLUMNS, 3)
    other = below(server, "item/1/refocus?slope=-0.4&radius=2.5&tilt_x=0&tilt_y=0")[2]
    assert other != body


def test_exports_what_is_shown(server: PageServer) -> None:
    status, headers, body = below(server, "item/1/export?slope=0.4&radius=2.5&tilt_x=0&tilt_y=0")
    assert status == 200
    assert headers["Content-Disposition"] == 'attachment; filename="refocused_slope_+0.4000.png"'
    found = cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_UNCHANGED)[..., ::-1].astype(int)
    field = light_field()
    exact = srgb16(refocus(field, [0.4])[0] * np.float32(display_gain(field))).astype(int)
    assert found.dtype.itemsize and body[24] == 16, "bit depth in the PNG header"
    assert np.abs(found - exact)[8:-8, 8:-8].max() < CODES_16


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("slope=x&radius=2&tilt_x=0&tilt_y=0", "slope: found 'x'"),
        ("radius=2&tilt_x=0&tilt_y=0", "slope: found ''"),
        ("slope=nan&radius=2&tilt_x=0&tilt_y=0", "slope: found 'nan'"),
        ("slope=0&radius=-1&tilt_x=0&tilt_y=0", "radius = -1"),
        ("slope=99&radius=2&tilt_x=0&tilt_y=0", "slope = 99"),
    ],
)
def test_impossible_wishes(server: PageServer, query: str, message: str) -> None:
    status, _, body = below(server, f"item/1/refocus?{query}")
    assert status == 400
    assert message in body.decode()


def test_a_browser_that_hangs_up_is_no_fault(server: PageServer, capsys: pytest.CaptureFixture[str]) -> None:
    for fault in (BrokenPipeError(), KeyError("a bug")):
        try:
            raise fault
        except (BrokenPipeError, KeyError):
            server.handle_error(None, ("127.0.0.1", 1))
        assert ("a bug" in capsys.readouterr().err) == isinstance(fault, KeyError)


def test_command_refuses(
    tmp_path: Path, result_folder: Path, server: PageServer, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", str(tmp_path / "none"), "--no-browser"]) == 3
    assert "no such file or folder" in capsys.readouterr().err
    assert main(["view", str(result_folder), "--no-browser", "--port", "70000"]) == 3
    assert "--port 70000" in capsys.readouterr().err
    assert main(["view", str(result_folder), "--no-browser", "--port", str(server.server_port)]) == 3
    assert "cannot be used" in capsys.readouterr().err


def test_command_serves_until_interrupted(
    result_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(self: PageServer) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(PageServer, "serve_forever", interrupted)
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert main(["view", str(result_folder)]) == 0
    assert capsys.readouterr().out.splitlines()[0] == opened[0]
