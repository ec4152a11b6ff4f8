"""500 clients of the viewer, 100 of them slow: how long the others wait, and what memory stays.

Run it with ``python -m benchmarks.slow_clients --seconds 60``.
"""

import argparse
import asyncio
import os
import random
import subprocess
import sys
import time
from pathlib import Path

SERVER = """
from lumigraph.viewer import Site, serve
from lumigraph.viewer.server import Resource
picture = Resource("application/octet-stream", bytes(200_000))
page = Resource("text/html", bytes(5000))
serve(Site({"": page, "picture": picture}), ready=lambda at: print(at, flush=True))
"""


def resident(pid: int) -> int:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


async def client(port: int, path: str, waits: list[float], end: float) -> None:
    while time.monotonic() < end:
        await asyncio.sleep(random.uniform(0, 20))
        start = time.monotonic()
        try:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            name = random.choice(("", "picture"))
            request = f"GET {path}{name} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n\r\n"
            writer.write(request.encode())
            content = await reader.read(-1)
            writer.close()
            waits.append(time.monotonic() - start if content.startswith(b"HTTP/1.1 200") else float("inf"))
        except OSError:
            waits.append(float("inf"))


async def slow(port: int, path: str, end: float) -> None:
    """One byte of a request each second, or an answer that is not read, again and again."""
    while time.monotonic() < end:
        try:
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            if random.random() < 0.5:
                writer.write(f"GET {path}picture HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
                await asyncio.sleep(5)
            else:
                for letter in b"GET / HTTP/1.1\r\nX: yyyyyyyyyyyyyyyy":
                    writer.write(bytes([letter]))
                    await asyncio.sleep(1)
                    if writer.is_closing() or reader.at_eof():
                        break
            writer.close()
        except OSError:
            await asyncio.sleep(0.5)


async def crowd(port: int, path: str, seconds: float, slow_ones: int) -> list[float]:
    end, waits = time.monotonic() + seconds, []
    others = [slow(port, path, end) for _ in range(slow_ones)]
    tasks = [asyncio.create_task(each) for each in others]
    await asyncio.gather(*(client(port, path, waits, end) for _ in range(400)))
    for task in tasks:
        task.cancel()
    return sorted(waits)


def main() -> None:
    """Print the 50th and 99th percentile of what 400 clients wait, without and with 100 slow ones."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--seconds", type=float, default=60)
    seconds = parser.parse_args().seconds
    with subprocess.Popen([sys.executable, "-c", SERVER], stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        host, _, path = server.stdout.readline().strip().removeprefix("http://").partition("/")
        port = int(host.rpartition(":")[2])
        for slow_ones in (0, 100, 0, 100):
            before = resident(server.pid)
            waits = asyncio.run(crowd(port, f"/{path}", seconds, slow_ones))
            time.sleep(12)
            share = resident(server.pid) / before - 1
            print(
                f"{slow_ones} slow: {len(waits)} answers, {sum(w == float('inf') for w in waits)} failed, "
                f"median {1e3 * waits[len(waits) // 2]:.1f} ms, 99th percentile "
                f"{1e3 * waits[int(0.99 * len(waits))]:.1f} ms, memory {100 * share:+.0f} %"
            )
        server.terminate()


if __name__ == "__main__":
    main()
