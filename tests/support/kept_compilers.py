"""C compilers that keep what they compiled, by content, beside the compiled kernels.

The same files, compiled with the same options by the same compiler, give the same file: hundreds of tests compile an
export that no change has touched. What a compiler says (a warning, an error) is not kept, nor what it makes of files
that lie elsewhere than in the folder where it is called.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shlex
import shutil
import tempfile
import time
from pathlib import Path

COMPILERS = ("gcc", "g++", "clang", "avr-g++")
DAYS = 20.0
"""What was not used for so long is removed."""
MARK = "STICKSLIP_TESTS_COMPILERS"
SCRIPT = """#!/bin/sh
real={real} kept={kept}
out= last=
for word; do
    # Paths in the folder alone; no list of files or dependencies, and one result, whose name is given.
    case $word in
        /* | *../* | -I/* | @* | -M* | -E | -S | -) exec "$real" "$@" ;;
    esac
    [ "$last" = -o ] && out=$word
    last=$word
done
[ -n "$out" ] || exec "$real" "$@"
files=$(find -L . -type f ! -path "./$out" | sort)
[ "$(echo "$files" | wc -l)" -le 40 ] || exec "$real" "$@"
grep -rqE '^ *# *include *"(/|\\.\\.)' . && exec "$real" "$@"
around="$CPATH $C_INCLUDE_PATH $CPLUS_INCLUDE_PATH $LIBRARY_PATH"
hashes=$(echo "$files" | tr '\\n' '\\0' | xargs -0 sha256sum)
key=$(printf '%s\\n' "$@" "$around" "$hashes" | sha256sum | cut -c1-40)
# As compilers do: a library that a process has loaded is not written over.
if cp --remove-destination "$kept/$key" "$out" 2>/dev/null; then
    touch "$kept/$key"
    exit 0
fi
said=$("$real" "$@" 2>&1)
code=$?
[ -z "$said" ] || printf '%s\\n' "$said" >&2
if [ $code = 0 ] && [ -z "$said" ] && cp -p "$out" "$kept/.$key.$$"; then
    mv "$kept/.$key.$$" "$kept/$key"
fi
exit $code
"""


def put_first() -> list[str]:
    """Put the compilers that this machine has before all others in PATH, once for all workers; the folders made."""
    if MARK in os.environ or os.name != "posix":
        return []
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    home = Path(os.environ.get("STICKSLIP_CACHE") or os.path.join(cache, "stickslip")).absolute() / "c"
    folder = Path(tempfile.mkdtemp(prefix="stickslip-compilers-"))
    for name in COMPILERS:
        if (real := shutil.which(name)) is None:
            continue
        about = Path(real).resolve().stat()
        which = (Path(real).resolve(), about.st_size, about.st_mtime_ns, platform.libc_ver())
        made = hashlib.sha256(repr(which).encode()).hexdigest()
        kept = home / f"{name}-{made[:16]}"
        kept.mkdir(parents=True, exist_ok=True)
        forget(kept)
        script = folder / name
        script.write_text(SCRIPT.format(real=shlex.quote(real), kept=shlex.quote(str(kept))))
        script.chmod(0o755)
    os.environ[MARK] = str(folder)
    os.environ["PATH"] = f"{folder}{os.pathsep}{os.environ['PATH']}"
    return [str(folder)]


def forget(kept: Path) -> None:
    """Remove what no run has used for a while."""
    for path in kept.iterdir():
        if time.time() - path.stat().st_mtime > 86400.0 * DAYS:
            path.unlink(missing_ok=True)
