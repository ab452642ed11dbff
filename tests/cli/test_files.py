"""A file that stickslip did not write, or that somebody edited, is not written over unless --force is given."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from stickslip.cli import _files, main
from stickslip.core.errors import InputError

DATA = Path(__file__).parents[1] / "data"
MODEL = (
    'law = "coulomb"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n[correlation]\nmatrix = [[1.0]]\n'
    '[[estimates]]\nname = "fc"\nunit = "N·m"\nvalue = 0.3\nstd = 0.01\nlower = 0.28\nupper = 0.32\nidentified = true\n'
)
FOREIGN = b"[notes]\nmine = true\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(MODEL)
    return tmp_path


LOG = str(Path(__file__).parents[2] / "src" / "stickslip" / "demo.csv")
VERBS = [
    (["law", "coulomb", "--plot", "out.svg"], "out.svg"),
    (["export", "m.toml", "--to", "c99", "--out", "c", "--name", "m"], "c/m.c"),
    (["compare", "m.toml", "m.toml", "--plot", "out.svg"], "out.svg"),
    (["simulate", str(DATA / "one_run.toml"), "--out", "out.npz"], "out.npz"),
]
REFUSED = [
    *VERBS,
    (["law", "coulomb", "--plot"], "law-coulomb.png"),
    (["identify", LOG, "--out", "axis"], "axis/model.toml"),
    (["identify", LOG, "--out", "out.toml"], "out.toml"),
    (["identify", LOG, "--out", "axis"], "axis/report.html"),
    (["recommend", "m.toml", "--out", "out.toml"], "out.toml"),
    (["analyse", "spectrum", LOG, "--plot", "out.svg"], "out.svg"),
    (["demo", "--out", "d"], "d/demo.csv"),
]


@pytest.mark.parametrize(("words", "file"), REFUSED, ids=[f"{w[0]} {f}" for w, f in REFUSED])
def test_a_foreign_file_is_not_written_over(folder, capsys, words, file):
    (folder / file).parent.mkdir(exist_ok=True)
    (folder / file).write_bytes(FOREIGN)
    assert main(words) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert file in complaint
    assert "--force" in complaint
    assert (folder / file).read_bytes() == FOREIGN


@pytest.mark.parametrize(("words", "file"), VERBS, ids=[w[0] for w, _ in VERBS])
def test_its_own_is_replaced_until_somebody_edits_it(folder, capsys, words, file):
    assert main(words) == 0
    assert main(words) == 0, "its own"
    with (folder / file).open("ab") as edited:
        edited.write(b"\n")
    before = (folder / file).read_bytes()
    assert main(words) == 2
    assert "edited since" in capsys.readouterr().err
    assert (folder / file).read_bytes() == before
    assert main([*words, "--force"]) == 0
    assert (folder / file).read_bytes() != before


def test_what_is_no_ordinary_file_is_never_replaced(folder):
    os.mkfifo(folder / "pipe.svg")
    with pytest.raises(InputError, match="not a regular file"):
        _files.refuse_foreign([folder / "pipe.svg"], force=True)


def test_a_picture_that_cannot_be_written_is_one_line(folder, capsys):
    (folder / "file").write_text("no folder")
    for words in (
        ["law", "coulomb", "--plot", "file/x.png"],
        ["compare", "m.toml", "m.toml", "--plot", "file/x.png"],
        ["analyse", "spectrum", LOG, "--plot", "file/x.png"],
    ):
        assert main(words) == 2
        complaint = capsys.readouterr().err
        assert complaint.startswith("stickslip: cannot write file/x.png (")
        assert complaint.endswith("choose another place with --plot\n")


RESULTS = [
    (["study", "s.toml", "--no-report", "--out", "."], "metrics.csv"),
    (["study", "s.toml", "--no-report", "--out", "."], "manifest.json"),
    (["study", "s.toml", "--no-report", "--out", "."], "report.html"),
    (["study", "s.toml", "--no-report", "--out", "."], "inputs/s.toml"),
    # Without further starts and ablation, whose 72 machines are built before the folder is looked at.
    (["study", "thesis-rig", "--seeds", "0", "--no-ablation", "--out", "."], "metrics.csv"),
    (["sweep", "thesis-robustness", "--cases", "2", "--no-report", "--out", "."], "summary.csv"),
]


@pytest.mark.parametrize(("words", "file"), RESULTS, ids=[f"{w[1]} {f}" for w, f in RESULTS])
def test_results_go_into_no_folder_that_holds_other_files_of_their_names(folder, capsys, words, file):
    (folder / "s.toml").write_text((DATA / "small_study.toml").read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "motion.csv").write_bytes((DATA / "motion.csv").read_bytes())
    (folder / file).parent.mkdir(exist_ok=True)
    (folder / file).write_bytes(FOREIGN)
    assert main(words) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert f"holds {file.split('/')[0]} already" in complaint
    assert (folder / file).read_bytes() == FOREIGN


def test_a_study_goes_on_in_its_own_folder_and_no_other_does(folder, capsys):
    (folder / "s.toml").write_text((DATA / "small_study.toml").read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "motion.csv").write_bytes((DATA / "motion.csv").read_bytes())
    words = ["study", "s.toml", "--no-report", "--out", "found"]
    assert main(words) == 0
    (folder / "found" / "manifest.json").unlink()  # as where it was interrupted
    assert main(words) == 0
    capsys.readouterr()
    (folder / "t.toml").write_text((folder / "s.toml").read_text(encoding="utf-8"), encoding="utf-8")
    assert main(["study", "t.toml", "--no-report", "--out", "found"]) == 2
    assert "found holds the study 's'" in capsys.readouterr().err
