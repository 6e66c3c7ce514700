"""Who may speak with the page's server: the page that it served, and no other page in the same browser.

A browser lets any page connect to a server on this machine, and says in `Origin` which page it was; a page
whose name was turned to this machine's address says in `Host` the name that it used. viser looks at neither,
and offers no place to, so the server that it starts is given one.
"""

from __future__ import annotations

import contextlib
import http
import io
import ipaddress
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any
from urllib.parse import urlsplit

from ..errors import HybridynError

_starting = threading.Lock()


def start_server(host: str, port: int, label: str) -> Any:
    """Start viser's server, guarded.

    Args:
        host: Address to listen at.
        port: Port to listen at; the next free one is taken.
        label: Title of the page.

    Raises:
        HybridynError: viser starts it in another way than the one that is guarded.
    """
    import viser

    banner = contextlib.redirect_stdout(io.StringIO())  # standard output is the caller's
    with banner, _guarding(host) as guards:
        server = viser.ViserServer(host=host, port=port, label=label, verbose=False)
        if not guards:
            server.stop()
            raise HybridynError("this version of viser serves pages in a way that hybridyn cannot guard")
    return server


@contextlib.contextmanager
def _guarding(listening: str) -> Iterator[list[Callable[..., Any]]]:
    """Guard each server that is started inside this context; gives the guards."""
    from websockets.asyncio import server

    plain: Callable[..., Any] = server.serve
    guards: list[Callable[..., Any]] = []

    def serve(*arguments: Any, process_request: Callable[..., Any] | None = None, **options: Any) -> Any:
        def answer(connection: Any, request: Any) -> Any:
            headers = request.headers
            upgrade = bool(headers.get_all("Upgrade"))
            reason = refusal(headers.get_all("Host"), headers.get_all("Origin"), upgrade, listening)
            if reason is not None:
                return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")
            return None if process_request is None else process_request(connection, request)

        guards.append(answer)
        return plain(*arguments, process_request=answer, **options)

    with _starting:
        vars(server)["serve"] = serve
        try:
            yield guards
        finally:
            vars(server)["serve"] = plain


def refusal(hosts: Sequence[str], origins: Sequence[str], upgrade: bool, listening: str) -> str | None:
    """Say why a request is refused, or give None.

    Args:
        hosts: Its `Host` headers.
        origins: Its `Origin` headers.
        upgrade: Whether it asks for more than a file, which only the page does.
        listening: Address that the server listens at.
    """
    if len(hosts) != 1 or not _is_own(hosts[0], listening):
        return "this server is not known by that name; open the address that hybridyn printed"
    if len(origins) > 1 or any(origin != f"http://{hosts[0]}" for origin in origins):
        return "another page may not speak with this server"
    if upgrade and not origins:
        return "only the page of this server may speak with it"
    return None


def _is_own(host: str, listening: str) -> bool:
    """Tell whether a name, with a port or without, is this server's."""
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return False
    if name in (listening, "localhost"):
        return True
    here = _address(listening)
    wide = here is None or not here.is_loopback
    address = _address(name)
    if address is not None:  # no other page can have an address for its name
        return wide or address.is_loopback
    own = socket.gethostname().lower()
    return wide and name in (own, f"{own}.local", socket.getfqdn().lower())


def _address(name: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(name)
    except ValueError:
        return None
