"""What is answered, and what is refused."""

import asyncio
import builtins
import http.client
import io
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import unquote

import pytest

from lumigraph.cli.options import Common
from lumigraph.cli.serving import announce
from lumigraph.errors import LumigraphError
from lumigraph.viewer import Site, safety, serve
from lumigraph.viewer.server import Resource, application

HOST = b"127.0.0.1:8000"
SITE = Site(
    {"": Resource("text/html", b"page"), "app/main.js": Resource("text/javascript", b"code"),
     "late": Resource("application/octet-stream", lambda: b"worked"),
     "wrong": Resource("application/octet-stream", lambda: _fail())},
    {"sum": lambda given: given["a"] + given["b"], "fail": lambda given: _fail()},
)  # fmt: skip


def finished(coroutine):
    """What a coroutine gives, run in a thread of its own: a browser's tests keep a loop in this one."""
    with ThreadPoolExecutor(1, thread_name_prefix="asked") as pool:
        return pool.submit(asyncio.run, coroutine).result(60)


def _fail():
    raise LumigraphError("the light is out.")


def answer(path, *, method="GET", headers=(), body=b"", host=HOST, known=None):
    """Status, headers and body for a request given as the server would hand it on."""
    app = application(SITE, "secret", safety.hosts(8000) if known is None else known)
    sent, scope = [], {
        "type": "http", "method": method, "path": path, "raw_path": path.encode("utf-8", "replace"),
        "query_string": b"", "headers": [(b"host", host), *headers], "scheme": "http", "root_path": "",
        "http_version": "1.1", "server": ("127.0.0.1", 8000), "client": ("127.0.0.1", 1),
    }  # fmt: skip

    async def receive():
        return {"type": "http.request", "body": body, "more_body": False}

    async def send(message):
        sent.append(message)

    finished(app(scope, receive, send))
    return (
        sent[0]["status"], {k.decode(): v.decode() for k, v in sent[0]["headers"]},
        b"".join(m.get("body", b"") for m in sent[1:]),
    )  # fmt: skip


def posted(name, given, **more):
    body = given if isinstance(given, bytes) else json.dumps(given).encode()
    headers = [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
    return answer(f"/secret/call/{name}", method="POST", body=body, headers=headers, **more)


def test_the_page_and_its_parts_are_answered_behind_the_token():
    assert answer("/secret/")[::2] == (200, b"page")
    assert answer("/secret/app/main.js")[2] == b"code"
    assert answer("/secret/late")[2] == b"worked"


@pytest.mark.parametrize(
    "path", ["/", "/secre/", "/secrets/", "/secret", "/wrong/app/main.js", "", "/ſecret/"]
)
def test_without_the_token_nothing_is_answered(path):
    status, _, body = answer(path)
    assert status == 403
    assert b"page" not in body


@pytest.mark.parametrize(
    "host", [b"evil.example:8000", b"127.0.0.1:9", b"127.0.0.1", b"", b"localhost.evil:8000"]
)
def test_foreign_hosts_are_refused(host):
    assert answer("/secret/", host=host)[::2] == (403, b"refused: foreign host\n")


def test_two_hosts_are_refused():
    assert answer("/secret/", headers=[(b"host", HOST)])[0] == 403


@pytest.mark.parametrize(
    "origin", [b"http://evil.example", b"null", b"https://127.0.0.1:8000", b"http://127.0.0.1:9"]
)
def test_foreign_origins_are_refused(origin):
    assert answer("/secret/", headers=[(b"origin", origin)])[::2] == (403, b"refused: foreign origin\n")


def test_its_own_origin_is_answered():
    assert answer("/secret/", headers=[(b"origin", b"http://127.0.0.1:8000")])[0] == 200


@pytest.mark.parametrize("path", ["/secret/", "/nothing", "/secret/nothing", "/secret/wrong"])
def test_every_answer_carries_the_safe_headers(path):
    headers = answer(path)[1]
    for name, value in safety.HEADERS.items():
        assert headers[name.lower()] == value
    assert "unsafe" not in safety.POLICY
    assert "default-src 'none'" in safety.POLICY


def traversals():
    """1,000 and more ways to leave the table, plain, encoded once and twice, with symlinks that exist."""
    targets = [
        "etc/passwd",
        "proc/self/environ",
        "app/main.js",
        "link",
        "link/passwd",
        "c:/windows/win.ini",
        "",
    ]
    ups = [
        "../",
        "..\\",
        "....//",
        "%2e%2e/",
        "%2e%2e%2f",
        "..%2f",
        "..%5c",
        "%252e%252e%252f",
        "..%c0%af",
        "..;/",
    ]
    starts = ["", "app/", "data/0/", "/", "//", "app/main.js/", "./", "app/%00"]
    return [start + up * n + target for start in starts for up in ups for n in (1, 6) for target in targets]


def test_no_path_of_a_request_is_ever_opened(monkeypatch, tmp_path):
    (tmp_path / "link").symlink_to("/etc")
    monkeypatch.chdir(tmp_path)
    opened = []

    def watched(original):
        def call(*arguments, **options):
            if threading.current_thread().name.startswith("asked"):
                opened.append(arguments)
            return original(*arguments, **options)

        return call

    paths = traversals()
    assert len(paths) > 1000
    app = application(SITE, "secret", safety.hosts(8000))
    with monkeypatch.context() as patch:
        for module, name in ((os, "open"), (os, "stat"), (builtins, "open"), (io, "open"), (Path, "open")):
            patch.setattr(module, name, watched(getattr(module, name)))
        statuses = finished(_statuses(app, [f"/secret/{p}" for p in paths]))
    wanted = [200 if unquote(p) in SITE.resources else 404 for p in paths]
    assert statuses == wanted
    assert sum(status == 200 for status in statuses) == 0
    assert not opened


async def _statuses(app, paths):
    found = []

    async def receive():
        return {"type": "http.request", "body": b"", "more_body": False}

    async def send(message):
        if message["type"] == "http.response.start":
            found.append(message["status"])

    for path in paths:
        scope = {
            "type": "http", "method": "GET", "path": unquote(path), "query_string": b"", "root_path": "",
            "headers": [(b"host", HOST)], "scheme": "http",
            "http_version": "1.1", "server": ("127.0.0.1", 8000),
        }  # fmt: skip
        await app(scope, receive, send)
    return found


def test_calls_take_and_give_json():
    assert json.loads(posted("sum", {"a": 1, "b": 2})[2]) == {"result": 3}


def test_calls_that_fail_say_why():
    status, _, body = posted("fail", {})
    assert (status, json.loads(body)) == (422, {"error": "the light is out."})
    assert posted("sum", {})[0] == 500
    assert json.loads(answer("/secret/wrong")[2]) == {"error": "the light is out."}


@pytest.mark.parametrize("body", [b"", b"[1]", b"{", b"\xff", b"[" * 60000])
def test_calls_that_are_no_json_object_are_refused(body):
    assert posted("sum", body)[0] == 400


def test_calls_by_unknown_names_are_not_found():
    assert posted("rm", {})[0] == 404


def test_calls_of_another_type_are_refused():
    headers = [(b"content-type", b"text/plain"), (b"content-length", b"2")]
    assert answer("/secret/call/sum", method="POST", body=b"{}", headers=headers)[0] == 415


@pytest.mark.parametrize(
    ("method", "headers"),
    [
        ("GET", [(b"content-length", b"1")]),
        ("GET", [(b"transfer-encoding", b"chunked")]),
        ("POST", [(b"content-length", b"65537")]),
        ("POST", [(b"transfer-encoding", b"chunked")]),
        ("POST", [(b"content-length", b"-1")]),
        ("POST", [(b"content-length", "٣".encode())]),
    ],
)
def test_requests_that_are_too_large_are_refused_before_they_are_read(method, headers):
    assert answer("/secret/call/sum", method=method, headers=headers)[0] == 413


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "PATCH"])
def test_other_methods_are_refused(method):
    assert answer("/secret/", method=method)[0] == 405


def test_a_taken_port_is_told():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(LumigraphError, match=rf"port {port}.*Leave out --port"):
            serve(SITE, port=port)


def test_it_listens_on_the_loopback_interface_alone_and_ends_with_ctrl_c():
    code = (
        "from lumigraph.viewer import Site, serve\n"
        "from lumigraph.viewer.server import Resource\n"
        "serve(Site({'': Resource('text/html', b'page')}), ready=lambda a: print(a, flush=True))"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        watchdog = threading.Timer(300, run.kill)  # a busy machine starts it in a minute
        watchdog.start()
        address = run.stdout.readline().strip()
        host, port, token = address.removeprefix("http://").removesuffix("/").replace(":", "/").split("/")
        connection = http.client.HTTPConnection(host, int(port), timeout=100)
        connection.request("GET", f"/{token}/")
        assert connection.getresponse().read() == b"page"
        connection.close()
        listening = Path(f"/proc/{run.pid}/net/tcp")
        if listening.exists():
            here = [
                line.split()[1] for line in listening.read_text().splitlines()[1:] if line.split()[3] == "0A"
            ]
            assert f"0100007F:{int(port):04X}" in here
            assert f"00000000:{int(port):04X}" not in here
        run.send_signal(signal.SIGINT)
        assert run.wait(100) == 0
        assert run.stderr.read() == ""
        watchdog.cancel()
    assert len(token) >= 32


def test_tokens_differ(monkeypatch):
    found = []
    monkeypatch.setattr("uvicorn.Server.run", lambda self, sockets: None)
    for _ in range(2):
        serve(SITE, ready=found.append)
    assert found[0].rsplit("/", 2)[1] != found[1].rsplit("/", 2)[1]


def test_a_browser_is_given_a_private_file_and_not_the_address(tmp_path, monkeypatch, capsys):
    opened = threading.Event()
    given = []
    monkeypatch.setenv("LUMIGRAPH_CACHE", str(tmp_path))
    monkeypatch.setattr("webbrowser.open", lambda uri: (given.append(uri), opened.set()))
    address = "http://127.0.0.1:8000/" + "t" * 32 + "/"
    announce(address, Common(), no_open=False)
    assert opened.wait(30)
    assert capsys.readouterr().out == f"{address}\n"
    (uri,) = given
    assert "t" * 32 not in uri
    assert uri.startswith("file://")
    (path,) = tmp_path.iterdir()
    assert path.as_uri() == uri
    assert path.stat().st_mode & 0o777 == 0o600
    assert f'content="0; url={address}"' in path.read_text()


def test_the_file_for_the_browser_goes_when_the_program_ends(tmp_path):
    program = "import sys; from pathlib import Path; from lumigraph.viewer.address import redirecting; "
    program += "print(redirecting('http://a/', Path(sys.argv[1])).is_file())"
    run = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True)
    assert run.stdout == "True\n"
    assert list(tmp_path.iterdir()) == []


def test_the_file_for_the_browser_never_takes_the_place_of_another(tmp_path):
    from lumigraph.viewer.address import redirecting

    (tmp_path / "no folder").write_text("a file")
    one, two = redirecting("http://a/", tmp_path), redirecting("http://b/?'\"<", tmp_path)
    assert one != two
    assert "'" not in two.read_text().partition("url=")[2].partition('"')[0]
    away = redirecting("http://c/", tmp_path / "no folder")  # in the system's folder for such files
    assert away.stat().st_mode & 0o777 == 0o600
    away.unlink()


def test_what_is_computed_is_computed_once_and_kept():
    calls = []
    kept = Resource("a/b", lambda: calls.append(1) or b"x")
    fresh = Resource("a/b", lambda: calls.append(1) or b"x", keep=False)
    assert [kept.future().result(5) for _ in range(3)] == [b"x"] * 3
    assert len(calls) == 1
    assert [fresh.future().result(5) for _ in range(2)] == [b"x"] * 2
    assert len(calls) == 3
