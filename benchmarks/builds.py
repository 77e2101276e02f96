"""CPU seconds in which large pages become kernels, from nothing: no cache.

    python -m benchmarks.builds [PAGE ...]

Each page is built in a process of its own as `Study.add` does it: read, derived, compiled, checked
(CPU seconds of the process and of the C compiler, with the import of SymPy apart). Also the wall
clock, kB of C, and which form the kernels have. A page that is not built after `--limit` CPU
seconds is ended.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from typing import Any

HEAD = (
    "page                  import    read  derive      cc   check |  total   wall   goal     kB"
    "  form"
)


def built(name: str) -> dict[str, Any]:
    """Seconds of every stage of one page, in this process."""
    start = time.perf_counter()
    spent: dict[str, Any] = {}

    def stage(key: str, run: Callable[[], Any]) -> Any:
        before = _seconds()
        value = run()
        spent[key] = sum(_seconds()) - sum(before)
        if key == "compile":
            spent["cc"] = _seconds()[1] - before[1]
        return value

    def imported() -> Any:
        from benchmarks import build_pages
        from softehl.codegen import pipeline
        from softehl.codegen.tools import kernel_cache

        return build_pages.PAGES[name], kernel_cache, pipeline

    (make, goal), kernel_cache, pipeline = stage("import", imported)
    d = stage("read", make)
    files, _ = stage("derive", lambda: kernel_cache.derive([d]))
    folder, _ = stage("compile", lambda: kernel_cache.compiled(files))
    stage("check", lambda: kernel_cache._checked([d], files, folder))
    size = sum(len(text) for file, text in files.items() if file.endswith(".c")) / 1e3
    points = pipeline.form(d).at_points
    return spent | {
        "goal": goal,
        "kB": size,
        "form": "points" if points else "whole",
        "wall": time.perf_counter() - start,
    }


def _seconds() -> tuple[float, float]:
    """CPU seconds of this process and of its children."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time(), children.ru_utime + children.ru_stime


def row(name: str, limit: float) -> str:
    """Line of the table, measured in a process of its own."""
    with tempfile.TemporaryDirectory() as scratch:
        command = [sys.executable, "-m", "benchmarks.builds", "--one", name]
        environment = {**os.environ, "SOFTEHL_CACHE": scratch}
        cap = int(limit)
        done = subprocess.run(
            command,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (cap, cap)),
        )
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or [f"ended after {limit:.0f} s"])[-1]
        return f"{name:22} {last}"
    v = json.loads(done.stdout.splitlines()[-1])
    total = v["read"] + v["derive"] + v["compile"] + v["check"]
    return (
        f"{name:20} {v['import']:7.1f} {v['read']:7.1f} {v['derive']:7.1f} {v['cc']:7.1f} "
        f"{v['check']:7.1f} | {total:6.1f} {v['wall']:6.1f} {v['goal']:6.0f} {v['kB']:6.0f}  "
        f"{v['form']}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.builds", description=__doc__)
    parser.add_argument("pages", nargs="*", help="names of benchmarks.build_pages; all if left out")
    parser.add_argument("--limit", type=float, default=200.0, help="CPU seconds of a page")
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.one:
        print(json.dumps(built(options.pages[0])))
        return 0
    from benchmarks import build_pages

    print(HEAD)
    for name in options.pages or build_pages.PAGES:
        print(row(name, options.limit), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
