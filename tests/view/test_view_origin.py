"""The server of `hybridyn view` accepts connections of its own page only."""

import contextlib
import io
import socket
from collections.abc import Iterator
from unittest.mock import Mock

import pytest

from hybridyn.errors import HybridynError
from hybridyn.view.own_origin import refusal, start_server
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.waiting import PATIENCE

viser = needs("view")
HOME = "127.0.0.1"


@pytest.mark.parametrize(
    ("host", "origin", "listening"),
    [
        ("127.0.0.1:8080", "http://127.0.0.1:8080", HOME),
        ("localhost:8080", "http://localhost:8080", HOME),
        ("[::1]:8080", "http://[::1]:8080", "::1"),
        ("localhost:9000", "http://localhost:9000", HOME),  # through a tunnel
        ("192.168.1.7:8080", "http://192.168.1.7:8080", "0.0.0.0"),
        ("robots.lab:8080", "http://robots.lab:8080", "robots.lab"),
        (f"{socket.gethostname().lower()}:8080", f"http://{socket.gethostname().lower()}:8080", "0.0.0.0"),
    ],
)
def test_its_own_page_is_let_in(host: str, origin: str, listening: str) -> None:
    assert refusal([host], [origin], True, listening) is None
    assert refusal([host], [], False, listening) is None


@pytest.mark.parametrize(
    ("hosts", "origins", "upgrade", "listening"),
    [
        (["127.0.0.1:8080"], ["http://evil.example"], True, HOME),
        (["127.0.0.1:8080"], ["https://evil.example:8080"], False, HOME),
        (["127.0.0.1:8080"], ["http://127.0.0.1:9999"], True, HOME),
        (["127.0.0.1:8080"], ["http://127.0.0.1:8080.evil.example"], True, HOME),
        (["127.0.0.1:8080"], ["null"], True, HOME),
        (["127.0.0.1:8080"], ["file://"], True, HOME),
        (["127.0.0.1:8080"], [], True, HOME),
        (["127.0.0.1:8080"], ["http://127.0.0.1:8080", "http://evil.example"], True, HOME),
        (["evil.example:8080"], ["http://evil.example:8080"], True, HOME),  # a name turned to this machine
        (["evil.example:8080"], [], False, HOME),
        (["evil.example:8080"], ["http://evil.example:8080"], True, "0.0.0.0"),
        (["127.0.0.1.evil.example"], ["http://127.0.0.1.evil.example"], True, HOME),
        (["localhost.evil.example"], ["http://localhost.evil.example"], True, HOME),
        (["127.0.0.1:8080", "evil.example"], ["http://127.0.0.1:8080"], True, HOME),
        (["[oops"], ["http://[oops"], True, HOME),
        ([""], [], False, HOME),
        ([], [], False, HOME),
    ],
)
def test_no_other_is(hosts: list[str], origins: list[str], upgrade: bool, listening: str) -> None:
    assert refusal(hosts, origins, upgrade, listening) is not None


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    server = start_server(HOME, 0, "test")
    yield server.get_port()
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def answer(port: int, *headers: str) -> str:
    """Send a request and give the first line of what comes back."""
    lines = ["GET / HTTP/1.1", *headers, "", ""]
    with socket.create_connection((HOME, port), timeout=PATIENCE) as connection:
        connection.sendall("\r\n".join(lines).encode())
        return connection.makefile("rb").readline().decode().strip()


HANDSHAKE = (
    "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==", f"Sec-WebSocket-Protocol: viser-v{viser.__version__}",
)  # fmt: skip


def test_the_server_asks(port: int) -> None:
    own = f"{HOME}:{port}"
    assert answer(port, f"Host: {own}") == "HTTP/1.1 200 OK"
    assert answer(port, f"Host: {own}", f"Origin: http://{own}", *HANDSHAKE).split()[1] == "101"
    assert answer(port, f"Host: {own}", "Origin: http://evil.example", *HANDSHAKE).split()[1] == "403"
    assert answer(port, f"Host: {own}", *HANDSHAKE).split()[1] == "403"
    assert answer(port, "Host: evil.example", "Origin: http://evil.example", *HANDSHAKE).split()[1] == "403"
    assert answer(port, "Host: evil.example").split()[1] == "403"


def test_a_server_that_is_not_guarded_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from websockets.asyncio import server

    other = Mock()
    before = server.serve
    monkeypatch.setattr(viser, "ViserServer", Mock(return_value=other))
    refused(lambda: start_server(HOME, 0, "test"), HybridynError, "cannot guard")
    other.stop.assert_called_once()
    assert server.serve is before
