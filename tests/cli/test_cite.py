"""`stickslip cite`: the sources of laws, files, records and studies; every key that is cited exists."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from stickslip.cli import main
from stickslip.models import plugins
from stickslip.report.citations import INTEGRATORS, bibliography, cited_by

DATA = Path(__file__).parents[1] / "data"


def keys_in(text: str) -> set[str]:
    return set(re.findall(r"^@\w+\{([^,]+),", text, re.MULTILINE))


def test_every_key_of_every_law_and_integrator_exists() -> None:
    known = bibliography()
    cited = cited_by(plugins.law_names()) | {key for keys in INTEGRATORS.values() for key in keys}
    assert cited <= set(known)
    assert {"canudas1995", "thesis", "dormand1980"} <= cited


def test_the_bibliography_is_read_whole() -> None:
    """Every entry is found, braces balanced, no key twice."""
    import stickslip

    text = Path(stickslip.__file__).with_name("references.bib").read_text()
    assert sorted(re.findall(r"^@\w+\{([^,]+),", text, re.MULTILINE)) == sorted(bibliography())
    for key, entry in bibliography().items():
        assert entry.count("{") == entry.count("}"), key


def test_every_key_in_a_docstring_is_in_the_bibliography() -> None:
    import stickslip

    cited = {
        key
        for path in Path(stickslip.__file__).parent.rglob("*.py")
        for key in re.findall(r"``([a-z]+(?:19|20)\d\d[a-z]?)``", path.read_text(encoding="utf-8"))
    }
    assert {"fuller1987", "broyden1965"} <= cited <= set(bibliography())


@pytest.mark.parametrize(
    ("argv", "keys"),
    [
        ([], {"stickslip"}),
        (["lugre"], {"stickslip", "thesis", "canudas1995", "barabanov2000"}),
        (["thesis"], {"stickslip", "thesis", "canudas1995", "albender2005", "dormand1980", "armstrong1994"}),
    ],
)
def test_what_is_printed(argv, keys, capsys) -> None:
    assert main(["cite", *argv]) == 0
    found = keys_in(capsys.readouterr().out)
    assert keys <= found
    assert argv or found == keys


def test_files_records_and_studies(tmp_path: Path, monkeypatch, capsys) -> None:
    for name in ("small_study.toml", "motion.csv", "one_run.toml"):
        shutil.copy(DATA / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    assert (
        main(["study", "small_study.toml", "--no-report", "--only", "PD,sine,nominal", "--out", "out"]) == 0
    )
    assert main(["simulate", "one_run.toml", "--out", "one.npz"]) == 0
    capsys.readouterr()
    study = {"canudas1995", "albender2005", "thesis"}
    for things, keys in (
        (["small_study.toml"], study),
        (["out"], study),
        (["out/manifest.json"], study),
        (["one_run.toml"], {"albender2005"}),
        (["one.npz"], {"albender2005"}),
    ):
        assert main(["cite", *things]) == 0
        found = keys_in(capsys.readouterr().out)
        assert keys <= found, things
        assert ("canudas1995" in found) == ("canudas1995" in keys), things


@pytest.mark.parametrize(
    ("thing", "said"),
    [
        ("lugree", "is not a law"),
        ("none.toml", "cannot read"),
        ("none.npz", "no record at"),
        (".", "no manifest"),
    ],
)
def test_bad_things_get_one_line(thing, said, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["cite", thing]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
