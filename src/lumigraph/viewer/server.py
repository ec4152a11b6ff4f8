"""A small web server for one person: a fixed table of resources behind a random token.

Nothing here knows what is shown. A page is a `Site`: resources by name, and calls that take and give JSON.
No path of a request is ever opened: a name is looked up in the table or is not found.
"""

import asyncio
import json
import secrets
import socket
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from lumigraph.errors import LumigraphError
from lumigraph.viewer import safety

LOOPBACK = "127.0.0.1"

Content = bytes | memoryview
Call = Callable[[dict[str, Any]], Any]


class Resource:
    """Content to send: bytes, or a function that returns them.

    Parameters
    ----------
    media_type
        Such as "text/html; charset=utf-8".
    content
        Bytes, or a function that is called in a separate thread at the first request.
    keep
        Whether the function's bytes are kept for the next request.
    """

    def __init__(self, media_type: str, content: Content | Callable[[], Content], *, keep: bool = True):
        self.media_type = media_type
        self._content = content
        self._keep = keep
        self._future: Future[Content] | None = None
        self._lock = threading.Lock()

    def future(self) -> "Future[Content]":
        """The content, now or when it is ready."""
        with self._lock:
            if self._future is not None:
                return self._future
            if callable(self._content):
                future = _started(self._content)
            else:
                future = Future[Content]()
                future.set_result(self._content)
            if self._keep or not callable(self._content):
                self._future = future
            return future


@dataclass(frozen=True, slots=True)
class Site:
    """Contents that a server answers with: resources and calls.

    Parameters
    ----------
    resources
        By name, such as "app/main.js"; "" is the page itself.
    calls
        By name: functions of a JSON object that give something JSON can hold; posted to "call/NAME".
    """

    resources: Mapping[str, Resource]
    calls: Mapping[str, Call] = field(default_factory=dict)


def application(site: Site, token: str, known: frozenset[str]) -> Any:
    """The ASGI application.

    Parameters
    ----------
    site
        What it answers.
    token
        First part of every path.
    known
        Hosts under which it answers, see `safety.hosts`; empty: any.
    """
    from starlette.requests import Request

    async def app(scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "http":
            response = await _answered(Request(scope, receive), site, token, known)
            await response(scope, receive, send)

    return app


async def _answered(request: Any, site: Site, token: str, known: frozenset[str]) -> Any:
    """The answer to one request; what is wrong with it is looked for before its name."""
    why = safety.refusal(request.scope["headers"], known)
    if why is not None:
        return _response(f"refused: {why}\n", 403)
    name = safety.inside(request.scope["path"], token)
    if name is None:
        return _response("refused: open the address that lumigraph printed\n", 403)
    if request.method not in ("GET", "POST"):
        return _response("refused: only GET and POST\n", 405)
    size = safety.body_size(request.headers)
    if size is None or size > (safety.LARGEST_CALL if request.method == "POST" else 0):
        return _response("refused: the request is too large\n", 413)
    if request.method == "POST":
        return await _called(request, site, name)
    resource = site.resources.get(name)
    if resource is None:
        return _response("nothing here\n", 404)
    return await _finished(resource.future(), lambda content: _response(content, media=resource.media_type))


async def _called(request: Any, site: Site, name: str) -> Any:
    """The answer to a call: one JSON object in, one out."""
    function = site.calls.get(name.removeprefix("call/")) if name.startswith("call/") else None
    if function is None:
        return _response("nothing here\n", 404)
    if request.headers.get("content-type", "").split(";")[0].strip() != "application/json":
        return _response("refused: a call is application/json\n", 415)
    try:
        given = json.loads(await request.body())
    except (ValueError, RecursionError):
        given = None
    if not isinstance(given, dict):
        return _response({"error": "a call is one JSON object"}, 400)
    return await _finished(_started(lambda: function(given)), lambda result: _response({"result": result}))


async def _finished(future: "Future[Any]", shown: Callable[[Any], Any]) -> Any:
    """The answer when a computation has ended; one line where it failed."""
    try:
        return shown(await asyncio.wrap_future(future))
    except LumigraphError as error:
        return _response({"error": str(error)}, 422)
    except Exception as error:
        return _response({"error": f"unexpected {type(error).__name__}"}, 500)


def _response(content: Any, status: int = 200, media: str = "text/plain; charset=utf-8") -> Any:
    from starlette.responses import JSONResponse, Response

    if isinstance(content, dict):
        return JSONResponse(content, status, safety.HEADERS)
    return Response(content, status, safety.HEADERS, media)


def serve(site: Site, *, port: int = 0, host: str = LOOPBACK, ready: Callable[[str], None] = print) -> None:
    """Answer requests until Ctrl-C, under a new token.

    Parameters
    ----------
    site
        What is answered.
    port
        Of the loopback interface; 0 takes any free one.
    host
        Address to listen on. Beyond the loopback interface whoever has the address with its token can look.
    ready
        Called with the address, token included, when requests are answered.

    Raises
    ------
    LumigraphError
        The port is taken or not allowed.
    """
    listener = _listener(host, port)
    port, token = listener.getsockname()[1], secrets.token_urlsafe(24)
    with listener, suppress(KeyboardInterrupt):
        server = _server(application(site, token, safety.hosts(port) if host == LOOPBACK else frozenset()))
        ready(f"http://{host}:{port}/{token}/")
        server.run(sockets=[listener])


def _server(app: Any) -> Any:
    import uvicorn

    from lumigraph.viewer.connections import Connection

    return uvicorn.Server(
        uvicorn.Config(
            app, log_level="critical", access_log=False, server_header=False, lifespan="off", ws="none",
            http=Connection,
            timeout_graceful_shutdown=1, h11_max_incomplete_event_size=16384,
        )
    )  # fmt: skip


def _listener(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(256)
    except (OSError, OverflowError) as error:
        listener.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise LumigraphError(
            f"cannot listen on {host}, port {port}: {reason}. Leave out --port to take a free one."
        ) from None
    return listener


def _started(work: Callable[[], Any]) -> "Future[Any]":
    """Future result of `work`, from a thread that ends with the command, even in the middle of its work."""
    future: Future[Any] = Future()

    def run() -> None:
        try:
            future.set_result(work())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return future
