"""Code that a TOML file names runs when asked for, and not before."""

from __future__ import annotations

import importlib.util
import os
import py_compile
from pathlib import Path

import pytest

import stickslip as ss
from stickslip.cli import main
from stickslip.core.code_approval import approved_file
from stickslip.core.errors import CodeRefused
from stickslip.identification.identified_file import read_identified
from stickslip.machines.files import machine
from stickslip.rigs.files import read_rig
from stickslip.studies.plan import load, load_run

COULOMB = Path(str(ss.law("coulomb").step.__code__.co_filename)).read_text(encoding="utf-8")
MODEL = 'law = "sent.py"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n'
RUN = """
PLUGINS
[axis]
inertia = 4e-4
[friction]
law = LAW
fc = 0.3
sigma2 = 0.01
[reference]
kind = "sine"
amplitude = 0.1
frequency = 1.0
duration = 0.01
[controller]
linear = "PD"
placement = {bandwidth_hz = 10.0, damping = 1.0}
"""


@pytest.fixture
def sent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that somebody sent: its law leaves a mark when it runs; nobody has approved anything yet."""
    folder = tmp_path / "sent"
    folder.mkdir()
    marking = f"open({str(tmp_path / 'mark')!r}, 'w').close()\n"
    text = COULOMB.replace('"coulomb"', '"sent"').replace("LAW = Law(", f"{marking}LAW = Law(")
    (folder / "sent.py").write_text(text, encoding="utf-8")
    (folder / "model.toml").write_text(MODEL)
    (folder / "direct.toml").write_text(RUN.replace("PLUGINS", "").replace("LAW", '"sent.py"'))
    (folder / "plugins.toml").write_text(
        RUN.replace("PLUGINS", 'plugins = ["sent.py"]').replace("LAW", '"sent"')
    )
    (folder / "through.toml").write_text(
        RUN.replace("PLUGINS", "").replace("LAW", '{model = "model.toml"}').replace("fc = 0.3\n", "")
    )
    tables = "".join(f"[{name}]\n" for name in ("axis", "friction.a", "references.a", "controllers.a"))
    (folder / "study.toml").write_text(f'plugins = ["sent.py"]\n{tables}')
    (folder / "rig.toml").write_text('[rig]\nkind = "sent.py"\n')
    (folder / "machine.toml").write_text(
        'inertia = 4e-4\n[friction]\nlaw = "sent.py"\nfc = 0.3\nsigma2 = 0.01\n'
    )
    monkeypatch.setenv("STICKSLIP_CONFIG", str(tmp_path / "settings"))
    return folder


def ran(folder: Path) -> bool:
    return (folder.parent / "mark").exists()


@pytest.mark.parametrize(
    ("read", "file"),
    [
        (ss.Model.from_file, "model.toml"),
        (read_identified, "model.toml"),
        (load_run, "direct.toml"),
        (load_run, "plugins.toml"),
        (load_run, "through.toml"),
        (load, "study.toml"),
        (read_rig, "rig.toml"),
        (machine, "machine.toml"),
    ],
)
def test_a_file_that_is_data_runs_no_code(sent, read, file):
    named = "model.toml" if file == "through.toml" else file
    with pytest.raises(CodeRefused, match=rf"{named}.*sent\.py.*stickslip\.allow_code"):
        read(sent / file)
    assert not ran(sent)


def test_the_library_has_the_switch(sent):
    with ss.allow_code():
        assert ss.Model.from_file(sent / "model.toml").law.name == "sent"
        assert machine(sent / "machine.toml").contact.friction.law.name == "sent"
        (sent / "sent.py").write_text((sent / "sent.py").read_text() + "# changed\n")
        with ss.allow_code(False), pytest.raises(CodeRefused):
            ss.Model.from_file(sent / "model.toml")
    assert not approved_file().exists()


def test_what_the_user_names_is_asked_for(sent):
    assert ss.Model(str(sent / "sent.py"), fc=0.3).law.name == "sent"
    assert ss.Model.from_file(sent / "model.toml").law.name == "sent"  # the same bytes have run already


@pytest.mark.parametrize(
    "words",
    [
        ("recommend", "model.toml"),
        ("export", "model.toml", "--to", "c99", "--out", "c"),
        ("compare", "model.toml", "model.toml"),
        ("simulate", "direct.toml"),
        ("study", "study.toml"),
        ("cite", "direct.toml"),
        ("rig", "run", "breakaway", "--rig", "rig.toml", "--dry-run"),
        ("analyse", "stability", "--rig", "machine.toml"),
    ],
)
def test_the_command_line_refuses(sent, capsys, monkeypatch, words):
    monkeypatch.chdir(sent)
    assert main(words) == 2
    complaint = capsys.readouterr().err
    assert complaint.count("\n") == 1
    assert "sent.py" in complaint
    assert "--allow-code" in complaint
    assert not ran(sent)
    # The remedy is one that this verb takes; what comes then is the file's own affair.
    assert main([*words, "--allow-code"]) in (0, 1, 2)
    assert ran(sent)


def test_an_approved_file_is_known_by_its_hash(sent, capsys, monkeypatch):
    monkeypatch.chdir(sent)
    words = ["export", "model.toml", "--to", "c99", "--out", "c"]
    assert main([*words, "--allow-code"]) == 0
    assert "approved until it changes" in capsys.readouterr().err
    forget(monkeypatch)
    assert main(words) == 0, "remembered"
    assert capsys.readouterr().err == ""
    (sent / "sent.py").write_text((sent / "sent.py").read_text() + "# changed\n")
    assert main(words) == 2, "other bytes"
    assert oct(approved_file().parent.stat().st_mode)[-3:] == "700"


def test_a_law_named_on_the_command_line_is_approved(sent, capsys, monkeypatch):
    monkeypatch.chdir(sent)
    assert main(["law", "sent.py"]) == 0
    forget(monkeypatch)
    assert main(["export", "model.toml", "--to", "c99", "--out", "c"]) == 0


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in another process."""
    monkeypatch.setattr("stickslip.core.code_approval._ran", set())


def test_compiled_code_beside_an_approved_file_does_not_run(sent):
    own = sent / "sent.py"
    evil = sent / "other.py"
    evil.write_text(own.read_text() + f"open({str(sent / 'evil')!r}, 'w').close()\n")
    cached = importlib.util.cache_from_source(str(own))
    py_compile.compile(
        str(evil), cfile=cached, invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH
    )
    assert os.path.exists(cached)
    assert ss.Model(str(own), fc=0.3).law.name == "sent"
    assert not (sent / "evil").exists()
