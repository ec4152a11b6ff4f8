"""Clients that come and say nothing, or never end what they say, do not keep the others from the page."""

import contextlib
import http.client
import signal
import socket
import subprocess
import sys
import time

import pytest

SERVER = """
import sys
from lumigraph.viewer import Site, connections, serve
from lumigraph.viewer.server import Resource
connections.MOST, connections.TO_REQUEST, connections.TO_PROGRESS = (float(word) for word in sys.argv[1:])
large = Resource("application/octet-stream", bytes(64 << 20))
serve(Site({"": Resource("text/html", b"page"), "large": large}), ready=lambda at: print(at, flush=True))
"""


@pytest.fixture
def serving():
    running = []

    def start(most, to_request, to_progress=60):
        words = [sys.executable, "-c", SERVER, str(most), str(to_request), str(to_progress)]
        process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        running.append(process)
        assert process.stdout is not None
        host, _, path = process.stdout.readline().strip().removeprefix("http://").partition("/")
        return int(host.rpartition(":")[2]), f"/{path}"

    yield start
    for process in running:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)


@pytest.fixture
def idle():
    with contextlib.ExitStack() as open_ones:

        def connect(port, said=b""):
            connection = open_ones.enter_context(socket.create_connection(("127.0.0.1", port), timeout=10))
            connection.sendall(said)
            return connection

        yield connect


def page(port, path):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
    with contextlib.closing(connection):
        connection.request("GET", path)
        answer = connection.getresponse()
        return answer.status, answer.read()


HALF_A_BODY = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 50\r\n\r\n{"


@pytest.mark.parametrize("said", [b"", b"GET / HT", HALF_A_BODY])
def test_more_idle_connections_than_there_may_be_do_not_block_the_page(serving, idle, said):
    port, path = serving(40, 60)
    slow = [idle(port, said) for _ in range(100)]
    assert page(port, path) == (200, b"page")
    assert len(slow) == 100


@pytest.mark.parametrize("said", [b"", b"GET / HT"])
def test_a_request_that_does_not_end_is_cut_off(serving, idle, said):
    port, path = serving(500, 0.5)
    slow = [idle(port, said) for _ in range(5)]
    start = time.monotonic()
    for connection in slow:
        with contextlib.suppress(ConnectionResetError):
            assert connection.recv(1) == b""
    assert time.monotonic() - start < 8
    assert page(port, path) == (200, b"page")


def test_a_reader_that_takes_nothing_is_cut_off(serving, idle):
    port, path = serving(500, 60, 1)
    slow = idle(port, f"GET {path}large HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
    time.sleep(5)
    count = 0
    with contextlib.suppress(ConnectionResetError):
        while content := slow.recv(1 << 20):
            count += len(content)
    assert count < 64 << 20
    assert page(port, path) == (200, b"page")
