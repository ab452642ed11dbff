"""Files are written whole or not at all, and nothing next to them is touched."""

from __future__ import annotations

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.whole_files import draft_of, prepared_folder, write_whole

resource = pytest.importorskip("resource", reason="the size of files is limited on POSIX systems only")

DEMO = Path(ss.__file__).with_name("demo.csv")
DATA = Path(__file__).parent / "data"
MODEL = ss.Model("coulomb", fc=0.3, sigma2=0.01)
RECORD = ss.Record(np.arange(2000.0), {"position": np.zeros(2000)}, {"position": "rad"})
WRITERS: dict[str, Callable[[Path], object]] = {
    "record.npz": RECORD.save,
    "machine.toml": lambda path: ss.load_machine("thesis-dry").write(path),
    "c": lambda path: ss.export(MODEL, "c99", path),
    "text": lambda path: write_whole(path, "x" * 5000),
}


@contextmanager
def full_disk(room: int) -> Iterator[None]:
    """No file grows beyond `room` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_what_was_there(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    with full_disk(300), pytest.raises(ss.InputError, match="cannot write"):
        WRITERS[name](tmp_path / name)
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before


def test_a_full_disk_leaves_no_part_of_an_export(tmp_path: Path) -> None:
    """The small header fits, the source does not."""
    made = ss.export(MODEL, "c99")
    sizes = sorted(len(content) for content in made.files.values())
    with full_disk((sizes[0] + sizes[-1]) // 2), pytest.raises(ss.InputError, match="cannot write"):
        made.save(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (["demo", "--log", "out.csv"], "out.csv"),
        (["law", "coulomb", "--plot", "out.svg"], "out.svg"),
        (["export", "m.toml", "--to", "c99", "--out", "c"], "c/m.h"),
        (["simulate", str(DATA / "one_run.toml"), "--out", "out.npz"], "out.npz"),
    ],
)
def test_a_verb_on_a_full_disk_leaves_no_half_file(tmp_path, monkeypatch, capsys, words, file) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text('law = "coulomb"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n')
    assert main(words) == 0  # compiled
    capsys.readouterr()
    for path in (tmp_path / file).parent.glob(f"{Path(file).stem}.*"):
        if path.name != "m.toml":
            path.unlink()
    with full_disk(900):
        assert main(words) == 2
    assert f"cannot write {file}" in capsys.readouterr().err
    assert not (tmp_path / file).exists()
    assert not list(tmp_path.rglob("*.part"))


@pytest.mark.parametrize("name", WRITERS)
def test_files_of_similar_names_stay(tmp_path: Path, name: str) -> None:
    """Those that earlier versions wrote first, and took for their own."""
    names = [f"{name}.part", ".stickslip", "c/coulomb.c.part", "c/.stickslip"]
    for own in names:
        (tmp_path / own).parent.mkdir(exist_ok=True)
        (tmp_path / own).write_text("mine")
    WRITERS[name](tmp_path / name)
    assert [(tmp_path / own).read_text() for own in names] == ["mine"] * len(names)


def test_a_link_stays_a_link_and_a_mode_a_mode(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "real").chmod(0o600)
    (tmp_path / "link").symlink_to("real")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"
    assert stat.S_IMODE((tmp_path / "real").stat().st_mode) == 0o600


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    """As /dev/null, which would be replaced by a file."""
    os.mkfifo(tmp_path / "pipe")
    for odd, said in ((tmp_path / "pipe", "a pipe or device"), (tmp_path, "a folder"), (Path("a\0b"), "NUL")):
        with pytest.raises(ss.InputError, match=said):
            write_whole(odd, "x")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)
    with pytest.raises(ss.InputError, match="File name too long"):
        write_whole(tmp_path / ("x" * 300), "x")
    with pytest.raises(ss.InputError, match="not Unicode"):
        write_whole(tmp_path / "text", "\ud800")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["pipe"]


def test_a_name_as_long_as_the_file_system_takes(tmp_path: Path) -> None:
    write_whole(tmp_path / ("x" * 255), "x")
    prepared_folder(tmp_path / ("y" * 255))


def test_a_draft_is_removed_after_any_error(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), draft_of(tmp_path / "out"):
        raise ZeroDivisionError
    assert not list(tmp_path.iterdir())
