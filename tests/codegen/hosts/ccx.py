"""CalculiX with external behaviours, from Debian's source: `python -m tests.codegen.hosts.ccx DIR`.

Prints the path of the program, or nothing and on stderr the reason why there is none. Debian's own
program is compiled without `CALCULIX_EXTERNAL_BEHAVIOURS_SUPPORT`.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

RELEASE = Path("/etc/os-release")
MIRROR = "http://deb.debian.org/debian"
LIBRARIES = ("gfortran", "libspooles-dev", "libarpack2-dev", "liblapack-dev", "dpkg-dev")
CFLAGS = (
    '-w -O1 -I/usr/include/spooles -DARCH="Linux" -DSPOOLES -DARPACK -DMATRIXSTORAGE -DUSE_MT=1 '
    "-DCALCULIX_EXTERNAL_BEHAVIOURS_SUPPORT"
)
FFLAGS = "-w -O1 -fallow-argument-mismatch"
LIBS = "-lspooles -lpthread -larpack -llapack -lblas -lm -ldl -lc"


def program(folder: Path) -> Path | None:
    """The program in a folder, if it was built there."""
    return next((p for p in folder.glob("**/src/ccx_?.??") if os.access(p, os.X_OK)), None)


def lacking() -> str:
    """Reason why it cannot be built here; empty where it can."""
    if shutil.which("apt-get") is None or not RELEASE.exists():
        return "no apt-get: CalculiX is built from Debian's source"
    if os.geteuid() != 0:
        return f"not root: {', '.join(LIBRARIES)} cannot be installed"
    return ""


def build(folder: Path) -> Path | None:
    """Download and compile it; some minutes."""
    lists = folder / "lists"
    (lists / "partial").mkdir(parents=True, exist_ok=True)
    release = re.search(r"VERSION_CODENAME=(\w+)", RELEASE.read_text())
    assert release is not None
    sources = folder / "sources.list"
    sources.write_text(f"deb-src {MIRROR} {release[1]} main\n", encoding="utf-8")
    own = [
        f"Dir::Etc::sourcelist={sources}",
        "Dir::Etc::sourceparts=-",
        f"Dir::State::lists={lists}",
    ]
    options = [word for option in own for word in ("-o", option)]
    _run(["apt-get", "install", "-y", "-qq", *LIBRARIES], folder)
    _run(["apt-get", *options, "update", "-qq"], folder)
    _run(["apt-get", *options, "source", "-qq", "calculix-ccx"], folder)
    (makefile,) = (p for p in folder.glob("*/ccx_*/src/Makefile") if ".pc" not in p.parts)
    settings = [f"CFLAGS={CFLAGS}", f"FFLAGS={FFLAGS}", f"LIBS={LIBS}"]
    _run(["make", f"-j{os.cpu_count()}", *settings], makefile.parent)
    return program(folder)


def _run(command: list[str], folder: Path) -> None:
    subprocess.run(command, cwd=folder, check=True, stdout=sys.stderr, stderr=subprocess.STDOUT)


def main(folder: Path) -> None:
    """See above."""
    folder = folder.resolve()
    found = program(folder)
    reason = "" if found else lacking()
    if reason:
        print(f"CalculiX is left out: {reason}", file=sys.stderr)
    elif found is None:
        try:
            found = build(folder)
        except (subprocess.CalledProcessError, ValueError) as error:
            print(f"CalculiX is left out: {error}", file=sys.stderr)
    print(found or "")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
