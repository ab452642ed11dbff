"""Models and studies from elsewhere: their code is shown and asked for, and never runs silently."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest

import stickslip as ss
from stickslip.core.code_approval import approved_file
from support.serving import Served, drop, ended, settled

COULOMB = Path(str(ss.law("coulomb").step.__code__.co_filename)).read_text(encoding="utf-8")
MODEL = 'law = "sent.py"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n[axis]\ninertia = 4e-4\n'
REST = """
inertia = 4e-4
[{friction}]
law = "sent"
fc = 0.3
sigma2 = 0.01
[{reference}]
kind = "sine"
amplitude = 0.1
frequency = 1.0
duration = 0.2
[{controller}]
linear = "PD"
placement = {{bandwidth_hz = 10.0, damping = 1.0}}
"""
HEAD = 'plugins = ["sent.py"]\n[axis]'
RUN = HEAD + REST.format(friction="friction", reference="reference", controller="controller")
STUDY = HEAD + REST.format(friction="friction.a", reference="references.a", controller="controllers.a")


@pytest.fixture
def law(tmp_path: Path) -> tuple[str, Path]:
    """A law that leaves a mark when its code runs, and where."""
    mark = tmp_path / "mark"
    marking = f"# {tmp_path.name}\nopen({str(mark)!r}, 'w').close()\n"
    return COULOMB.replace('"coulomb"', '"sent"').replace("LAW = Law(", f"{marking}LAW = Law("), mark


def project_of(client: Any) -> str:
    """The address of a new project."""
    return "/api/projects/" + client.post("/api/projects", json={"name": "sent"}).json()["id"]


def looked_at(client: Any, base: str, toml: str, law: str) -> tuple[str, dict[str, Any]]:
    """Send it; the address of the item, and what is known of it when it has been looked at."""
    files = [{"name": "mine.toml", "text": toml}, {"name": "sent.py", "text": law}]
    made = client.post(f"{base}/sent", json={"files": files}).json()
    assert ended(client, base.rpartition("/")[2], made["job"], 300.0)["state"] == "done"
    address = f"{base}/{made['kind']}/{made['id']}"
    return address, client.get(address).json()


@pytest.mark.parametrize("toml", [MODEL, RUN, STUDY], ids=["model", "simulation", "study"])
def test_code_is_shown_and_does_not_run(served: Served, law: tuple[str, Path], toml: str) -> None:
    """Whatever kind of file names it: the text that would run is handed out, and nothing more happens."""
    code, mark = law
    client = served.client()
    address, about = looked_at(client, project_of(client), toml, code)
    assert about["state"] == "asks"
    assert about["asks"]["text"] == code
    assert about["asks"]["sha256"] == hashlib.sha256(code.encode()).hexdigest()
    assert not mark.exists()
    refused = client.post(address + "/run", json={})
    assert refused.status_code in (404, 405, 409)
    for sha in ("", "0" * 64, None, [about["asks"]["sha256"]]):
        assert client.post(address + "/approval", json={"sha256": sha}).status_code in (400, 409)
    assert client.get(address).json()["state"] == "asks"
    assert not mark.exists()


@pytest.mark.slow
def test_approved_code_is_approved_for_this_user(served: Served, law: tuple[str, Path]) -> None:
    """The same bytes run in other projects and on the command line; other bytes ask again."""
    code, mark = law
    client = served.client()
    base = project_of(client)
    address, about = looked_at(client, base, RUN, code)
    sha = about["asks"]["sha256"]
    assert sha not in (approved_file().read_text() if approved_file().is_file() else "")
    job = client.post(f"{address}/approval", json={"sha256": sha}).json()["job"]
    assert ended(client, base.rpartition("/")[2], job, 300.0)["state"] == "done"
    assert client.get(address).json()["state"] == "ready"
    assert mark.exists()
    assert sha in approved_file().read_text()
    assert client.post(f"{address}/approval", json={"sha256": sha}).status_code == 409
    other = project_of(client)
    assert looked_at(client, other, RUN, code)[1]["state"] == "ready"
    assert looked_at(client, other, RUN, f"{code}#\n")[1]["state"] == "asks"


def test_code_that_cannot_be_shown_is_refused(served: Served) -> None:
    """What would run differs from what is shown if the code is not UTF-8."""
    client = served.client()
    base = project_of(client)
    address, _ = looked_at(client, base, MODEL, f"x = {served.url!r}\n")
    folder = served.folder / base.rpartition("/")[2] / "models" / address.rpartition("/")[2]
    (folder / "sent.py").write_bytes(b"# coding: latin-1\nx = '\xe4'\n")
    model = address.rpartition("/")[2]
    (folder / "about.json").write_text(json.dumps({"name": "mine", "state": "done"}))
    job = client.post(f"{base}/exports", json={"model": model, "to": "c99"}).json()["job"]
    assert ended(client, base.rpartition("/")[2], job, 300.0)["state"] == "failed"
    about = settled(client, address)
    assert about["state"] == "failed"
    assert "sent.py is not UTF-8" in about["problem"]


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ([("a.toml", MODEL.replace("sent.py", "../../sent.py"))], "which was not uploaded; put"),
        ([("a.toml", MODEL.replace("sent.py", "/tmp/sent.py"))], "which was not uploaded; put"),
        ([("a.toml", MODEL.replace("sent.py", "~/sent.py"))], "which was not uploaded; put"),
        ([("a.toml", MODEL.replace('"sent.py"', r"'C:\\sent.py'"))], "which was not uploaded; put"),
        ([("../a.toml", MODEL)], "plain names"), ([("a.toml", MODEL), ("b/sent.py", "")], "plain names"),
        ([("a.toml", MODEL), ("about.json", "{}")], "plain names"), ([("a.toml", "x = [")], "is not TOML"),
        ([("a.toml", MODEL), ("b.toml", MODEL)], "one model or study at a time"), ([("sent.py", "")], "one model"),
        ([("a.toml", '[rig]\nkind = "sent.py"\n')], "was not uploaded"), ([("a.toml", "x = 1")], "unknown kind"),
        ([("a.toml", MODEL), ("model.toml", 'x = "a.toml"')], "one model or study|is of an unknown kind"),
        ([], "at most 20"),
    ],
)  # fmt: skip
def test_files_that_are_none_are_told_so(served: Served, files: list[tuple[str, str]], said: str) -> None:
    """Before anything is kept."""
    client = served.client()
    base = project_of(client)
    answer = client.post(f"{base}/sent", json={"files": [{"name": n, "text": t} for n, t in files]})
    assert answer.status_code == 400
    assert any(words in answer.json()["error"] for words in said.split("|")), answer.json()
    held = client.get(base).json()
    assert not held["models"]
    assert not held["studies"]
    assert not held["rigs"]


@pytest.mark.slow
def test_a_person_reads_the_code_and_lets_it_run(page: Any, law: tuple[str, Path], tmp_path: Path) -> None:
    """Dropped together, shown whole; the button works once it is said to have been read, and then the study runs."""
    code, mark = law
    (tmp_path / "mine.toml").write_text(STUDY)
    (tmp_path / "sent.py").write_text(f"{code}# \u202edesrever\n")
    drop(page, tmp_path / "mine.toml", tmp_path / "sent.py")
    page.get_by_role("heading", name="It requires Python code").wait_for()
    assert page.locator(".ask pre").inner_text() == f"{code}# ⟨U+202E⟩desrever\n"
    allow = page.get_by_role("button", name="Run this code")
    assert allow.is_disabled()
    assert not mark.exists()
    page.reload()
    allow.wait_for()
    assert not mark.exists()
    page.get_by_label("I have reviewed it").check()
    allow.click()
    page.get_by_role("button", name="Run", exact=True).click()
    page.get_by_role("link", name="Open the report").wait_for()
    assert mark.exists()
    assert page.locator("tbody tr").count() == 1
    page.get_by_role("link", name="Back to the project").click()
    page.get_by_role("link", name="mine").last.wait_for()


@pytest.mark.slow
def test_a_model_with_its_own_law_goes_all_the_way(served: Served, law: tuple[str, Path]) -> None:
    """Allowed once, it is recommended for and exported, and not asked for again."""
    client = served.client()
    base = project_of(client)
    project = base.rpartition("/")[2]
    address, about = looked_at(client, base, MODEL, law[0])
    model = address.rpartition("/")[2]
    asked = {"model": model, "confirm": 3, "axes": 1, "amplitude": 0.5, "frequency": 0.5}
    assert client.post(f"{base}/settings", json=asked).status_code == 409
    job = client.post(f"{address}/approval", json={"sha256": about["asks"]["sha256"]}).json()["job"]
    assert ended(client, project, job, 300.0)["state"] == "done"
    setting = client.post(f"{base}/settings", json=asked).json()
    assert ended(client, project, setting["job"], 300.0)["state"] == "done"
    export = client.post(f"{base}/exports", json={"setting": setting["id"], "to": "c99"}).json()
    found = ended(client, project, export["job"], 300.0)
    assert found["state"] == "done", found["error"]
    assert "recommended.c" in found["result"]["files"]
    assert os.linesep not in found["error"]
