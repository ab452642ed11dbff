"""Compiled code in the cache: what one process has compiled with other laws around it, another one reads alone."""

from __future__ import annotations

import os
import subprocess
import sys

TEXTS = """
from stickslip.jit import loaded

SHARED = "@compile_inner\\ndef _half(v):\\n    return 0.5 * v\\n"
HEAD = "from stickslip.jit import compile_entry, compile_inner\\n"
ENTRY = "@compile_entry('steady')\\ndef steady(v, p):\\n    return _half(v) + {}\\n"
for name, number in {which}:
    print(loaded(name, HEAD + SHARED + ENTRY.format(number)).steady.address != 0)
"""


def test_code_that_shares_a_function_with_another_file_is_read_alone(tmp_path):
    """The function is compiled once, for the first file; the second one's code names that file."""
    surroundings = {**os.environ, "STICKSLIP_CACHE": str(tmp_path)}
    for which in ((("first", 1.0), ("second", 2.0)), (("second", 2.0),)):
        code = TEXTS.replace("{which}", repr(which))
        line = [sys.executable, "-c", code]
        done = subprocess.run(line, env=surroundings, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-500:]
        assert done.stdout.split() == ["True"] * len(which)
