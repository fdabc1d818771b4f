"""How long the page's stop takes while others ask for the page as fast as they can.

.venv/bin/python benchmarks/stop_delay.py --stops 200 --loops 6
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
import urllib.request
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests" / "reporting" / "workbench"))


def _serve(pipe) -> None:  # noqa: ANN001
    from fake import FakeSource

    from idloop.reporting.workbench.server import Place, Site

    source = FakeSource()
    source.feed(100)
    site = Site(source, Place())
    pipe.send((site.address, site.stop_port, site.key))
    pipe.recv()
    site.close()


def _ask(address: str) -> None:
    while True:
        with urllib.request.urlopen(address, timeout=60) as response:  # noqa: S310 (our own server)
            response.read()


def _timed(address: str, key: str) -> float:
    request = urllib.request.Request(address, method="POST", headers={"X-Idloop-Key": key})  # noqa: S310
    if address.endswith("/stop"):
        request.data = b"{}"
    begun = time.perf_counter()
    with urllib.request.urlopen(request, timeout=60) as response:  # noqa: S310 (our own server)
        response.read()
    return time.perf_counter() - begun


def main() -> int:
    """Run the benchmark from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stops", type=int, default=200, help="stops of each kind (default 200)")
    parser.add_argument("--loops", type=int, default=6, help="processes that ask for the page (default 6)")
    arguments = parser.parse_args()
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    server = context.Process(target=_serve, args=(theirs,), daemon=True)
    server.start()
    address, port, key = ours.recv()
    print(f"{'stop through':24} {'loops':>5} {'count':>6} {'median':>10} {'largest':>10}")
    for count in (0, arguments.loops):
        loops = [context.Process(target=_ask, args=(address,), daemon=True) for _ in range(count)]
        for one in loops:
            one.start()
        time.sleep(2.0 if count else 0.0)
        own = address.rstrip("/").rpartition(":")[0] + f":{port}/stop/{key}"
        for name, where in (("its own server", own), ("the page's server", f"{address}stop")):
            stops = arguments.stops if where is own else max(1, arguments.stops // 10)
            took = [_timed(where, key) for _ in range(stops)]
            print(f"{name:24} {count:5} {stops:6} {1e3 * median(took):7.1f} ms {1e3 * max(took):7.1f} ms", flush=True)
        for one in loops:
            one.kill()
            one.join()
    ours.send("end")
    server.join()
    return 0


if __name__ == "__main__":
    sys.exit(main())
