"""Restrict the page's server to requests from its own page; other pages in the same browser are refused.

A browser lets any page connect to a server on this machine and sends the page's origin in `Origin`. After DNS
rebinding, `Host` holds the foreign name. viser checks neither header and has no option for it, so a check is
added to the server that it starts.
"""

from __future__ import annotations

import contextlib
import http
import io
import ipaddress
import socket
import threading
from collections.abc import Callable, Sequence
from typing import Any
from urllib.parse import urlsplit

from ..errors import HybridynError

_starting = threading.Lock()


def start_server(host: str, port: int, label: str) -> Any:
    """Start viser's server with the check of origins.

    Args:
        host, port: Address and port to listen on; the next free port is used if this one is taken.
        label: Title of the page.

    Raises:
        HybridynError: This version of viser starts its server in a way that cannot be checked.
    """
    import viser
    from websockets.asyncio import server

    plain: Callable[..., Any] = server.serve
    guards: list[Callable[..., Any]] = []

    def serve(*arguments: Any, process_request: Callable[..., Any] | None = None, **options: Any) -> Any:
        """Start a server that checks each request."""

        def answer(connection: Any, request: Any) -> Any:
            """Refuse a request of another page, else answer as before."""
            hosts, origins, upgrades = map(request.headers.get_all, ("Host", "Origin", "Upgrade"))
            reason = refusal(hosts, origins, bool(upgrades), host)
            if reason is not None:
                return connection.respond(http.HTTPStatus.FORBIDDEN, f"{reason}\n")
            return None if process_request is None else process_request(connection, request)

        guards.append(answer)
        return plain(*arguments, process_request=answer, **options)

    with _starting, contextlib.redirect_stdout(io.StringIO()):  # standard output is the caller's
        vars(server)["serve"] = serve
        try:
            started = viser.ViserServer(host=host, port=port, label=label, verbose=False)
        finally:
            vars(server)["serve"] = plain
        if not guards:
            started.stop()
            raise HybridynError("this version of viser starts its server in a way that hybridyn cannot guard")
    return started


def refusal(hosts: Sequence[str], origins: Sequence[str], upgrade: bool, listening: str) -> str | None:
    """Return the reason why a request is refused, or None.

    Args:
        hosts: Its `Host` headers.
        origins: Its `Origin` headers.
        upgrade: Whether it requests a protocol upgrade (a WebSocket), as only the page does.
        listening: Address that the server listens on.
    """
    if len(hosts) != 1 or not _is_own(hosts[0], listening):
        return "the request names another host; open the address that hybridyn printed"
    if len(origins) > 1 or any(origin != f"http://{hosts[0]}" for origin in origins):
        return "another page may not connect to this server"
    if upgrade and not origins:
        return "only the page of this server may connect to it"
    return None


def _is_own(host: str, listening: str) -> bool:
    """Check whether a host name, with or without a port, is one of this server, or an address."""
    own = socket.gethostname().lower()
    try:
        name = urlsplit(f"//{host}").hostname or ""
        if name in ("localhost", listening, own, f"{own}.local", socket.getfqdn().lower()):
            return True
        return bool(ipaddress.ip_address(name))  # no other page can have an address for its name
    except ValueError:
        return False
