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
    """Something to send: bytes, or a function that gives them.

    Parameters
    ----------
    media_type
        Such as "text/html; charset=utf-8".
    content
        Bytes, or a function that is called in a thread of its own when they are first asked for.
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
            future: Future[Content] = Future()
            if self._keep or not callable(self._content):
                self._future = future
        if callable(self._content):
            # A daemon, so that Ctrl-C ends the command in the middle of a computation.
            threading.Thread(target=_run, args=(self._content, future), daemon=True).start()
        else:
            future.set_result(self._content)
        return future


@dataclass(frozen=True, slots=True)
class Site:
    """What a server answers.

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
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import JSONResponse, Response
    from starlette.routing import Route

    def answer(content: Any, status: int = 200, media: str = "text/plain; charset=utf-8") -> Response:
        kind = JSONResponse if isinstance(content, dict) else Response
        return kind(content, status, safety.HEADERS, None if isinstance(content, dict) else media)

    async def handle(request: Request) -> Response:
        why = safety.refusal(request.scope["headers"], known)
        if why is not None:
            return answer(f"refused: {why}\n", 403)
        name = safety.inside(request.scope["path"], token)
        if name is None:
            return answer("refused: open the address that lumigraph printed\n", 403)
        size = safety.body_size(request.headers)
        if size is None or size > (safety.LARGEST_CALL if request.method == "POST" else 0):
            return answer("refused: the request is too large\n", 413)
        if request.method == "POST":
            return await call(request, name)
        resource = site.resources.get(name)
        if resource is None:
            return answer("nothing here\n", 404)
        try:
            content = await asyncio.wrap_future(resource.future())
        except LumigraphError as error:
            return answer({"error": str(error)}, 422)
        except Exception as error:
            return answer({"error": f"unexpected {type(error).__name__}"}, 500)
        return answer(content, media=resource.media_type)

    async def call(request: Request, name: str) -> Response:
        function = site.calls.get(name.removeprefix("call/")) if name.startswith("call/") else None
        if function is None:
            return answer("nothing here\n", 404)
        if request.headers.get("content-type", "").split(";")[0].strip() != "application/json":
            return answer("refused: a call is application/json\n", 415)
        try:
            given = json.loads(await request.body())
            if not isinstance(given, dict):
                raise ValueError
        except (ValueError, RecursionError):
            return answer({"error": "a call is one JSON object"}, 400)
        try:
            future: Future[Any] = Future()
            threading.Thread(target=_run, args=(lambda: function(given), future), daemon=True).start()
            return answer({"result": await asyncio.wrap_future(future)})
        except LumigraphError as error:
            return answer({"error": str(error)}, 422)
        except Exception as error:
            return answer({"error": f"unexpected {type(error).__name__}"}, 500)

    return Starlette(routes=[Route("/{path:path}", handle, methods=["GET", "POST"])])


def serve(site: Site, *, port: int = 0, host: str = LOOPBACK, ready: Callable[[str], None] = print) -> None:
    """Answer requests until Ctrl-C.

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

    return uvicorn.Server(
        uvicorn.Config(
            app, log_level="critical", access_log=False, server_header=False, lifespan="off", ws="none",
            http="h11", limit_concurrency=256,
            timeout_graceful_shutdown=1, h11_max_incomplete_event_size=16384,
        )
    )  # fmt: skip


def _listener(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(64)
    except (OSError, OverflowError) as error:
        listener.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise LumigraphError(
            f"cannot listen on {host}, port {port}: {reason}. Leave out --port to take a free one."
        ) from None
    return listener


def _run(work: Callable[[], Any], future: "Future[Any]") -> None:
    try:
        future.set_result(work())
    except BaseException as error:
        future.set_exception(error)
