"""Code that another user could have put there is not run: compiled kernels and approvals."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from stickslip.core import code_approval
from stickslip.core.code_approval import approve, approved_file, demand
from stickslip.core.errors import CodeRefused, InputError, UnusedPlace
from stickslip.core.ownership import exposure_of

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows keeps owners and rights elsewhere")
FOLDER = "from stickslip.jit import cache_folder; print(cache_folder())"


def test_a_folder_of_ones_own_is_safe(tmp_path: Path) -> None:
    assert exposure_of(tmp_path) == ""


@pytest.mark.parametrize("place", [".", "a", "a/b"])
def test_a_folder_that_others_can_change_is_named(tmp_path: Path, place: str) -> None:
    """Itself or one above it; in a folder such as /tmp nobody replaces what belongs to others."""
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / place).chmod(0o777)
    assert exposure_of(tmp_path / "a/b").endswith(f"can write to {tmp_path / place}")
    (tmp_path / place).chmod(0o1777)
    assert (exposure_of(tmp_path / "a/b") == "") is (place != "a/b")


@pytest.mark.skipif(os.geteuid() != 0, reason="only the administrator gives files away")
def test_a_folder_of_somebody_else_is_named(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir(mode=0o700)
    os.chown(tmp_path / "a", 12345, 12345)
    assert "belongs to another user (number 12345)" in exposure_of(tmp_path / "a")


def test_a_link_is_as_safe_as_what_it_leads_to(tmp_path: Path) -> None:
    (tmp_path / "open/a").mkdir(parents=True)
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "link").symlink_to("open/a")
    assert "open" in exposure_of(tmp_path / "link")


@pytest.mark.parametrize(("mode", "used"), [(0o700, True), (0o755, True), (0o777, False)])
def test_compiled_code_is_kept_where_nobody_else_writes(tmp_path: Path, mode: int, used: bool) -> None:
    """Else it is compiled into a folder that ends with the process, and a warning says so."""
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(mode)
    environment = {**os.environ, "STICKSLIP_CACHE": str(cache)}
    done = subprocess.run(
        [sys.executable, "-c", FOLDER], env=environment, capture_output=True, text=True, check=True
    )
    folder = Path(done.stdout.strip())
    assert folder.is_relative_to(cache) is used
    assert ("UnusedPlace: compiled code is not read from" in done.stderr) is not used
    assert folder.exists() is used


def test_approvals_that_others_can_write_count_for_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import hashlib

    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "settings"))
    monkeypatch.setattr(code_approval, "_ran", set())
    approve("x.py", hashlib.sha256(b"code").hexdigest())
    demand("x.py", b"code", "x.toml: law")
    approved_file().chmod(0o666)
    with pytest.warns(UnusedPlace, match="are ignored"), pytest.raises(CodeRefused):
        demand("x.py", b"code", "x.toml: law")
    with pytest.raises(InputError, match="not kept"):
        approve("y.py", "0" * 64)
