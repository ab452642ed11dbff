"""A folder of a project that somebody sent: its claims run no code, read no file elsewhere, and arm no rig."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest

import stickslip as ss
from stickslip.core.code_approval import approved_file
from support.serving import Served, ended, settled, start_server

COULOMB = Path(str(ss.law("coulomb").step.__code__.co_filename)).read_text(encoding="utf-8")
MODEL = 'law = "evil.py"\n[parameters]\nfc = 0.3\nsigma2 = 0.01\n[axis]\ninertia = 4e-4\n'
PLAIN = MODEL.replace("evil.py", "coulomb")
DRIVE = """
[rig]
kind = "ds402"
node = 5
bus = {interface = "socketcan", channel = "can0"}
watchdog_time = 0.2
timeout = 0.1
[rig.limits]
torque = 1.0
speed = 60.0
"""


class SentFolder:
    """A project folder as it comes out of an archive."""

    def __init__(self, served: Served, number: int) -> None:
        self.project = f"2026-01-01-{number:08x}"
        self.folder = served.folder / self.project
        self.base = f"/api/projects/{self.project}"
        self.folder.mkdir(exist_ok=True)
        self.write("project.json", {"name": "from somebody else"})

    def write(self, path: str, content: Any) -> Path:
        """A file in it; what is no text becomes JSON."""
        file = self.folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return file


@pytest.fixture
def sent(served: Served) -> SentFolder:
    """An empty one."""
    return SentFolder(served, len(list(served.folder.glob("*"))) + 1)


@pytest.fixture
def evil(tmp_path: Path) -> tuple[str, Path]:
    """A law that leaves a mark when its code runs, and where."""
    mark = tmp_path / "mark"
    marking = f"# {tmp_path}\nopen({str(mark)!r}, 'w').close()\n"
    return COULOMB.replace("LAW = Law(", f"{marking}LAW = Law("), mark


def test_a_project_does_not_approve_its_own_code(
    served: Served, sent: SentFolder, evil: tuple[str, Path]
) -> None:
    """Whatever it calls approved and done: the code is shown, and its export fails."""
    code, mark = evil
    digest = hashlib.sha256(code.encode()).hexdigest()
    model = "models/model-00000001"
    sent.write(f"{model}/about.json", {"name": "m", "state": "done", "has_model": True, "approved": [digest]})
    sent.write(f"{model}/model.toml", MODEL)
    sent.write(f"{model}/evil.py", code)
    client = served.client()
    export = client.post(f"{sent.base}/exports", json={"model": "model-00000001", "to": "c99"}).json()
    assert ended(client, sent.project, export["job"])["state"] == "failed"
    assert not mark.exists()
    about = settled(client, f"{sent.base}/models/model-00000001")
    assert (about["state"], about["asks"]["sha256"]) == ("asks", digest)
    assert digest not in (approved_file().read_text() if approved_file().is_file() else "")


def test_what_is_approved_is_what_was_shown(served: Served, sent: SentFolder, evil: tuple[str, Path]) -> None:
    """A project that shows harmless text next to the digest of other code gets the text approved, and not the code."""
    code, mark = evil
    digest = hashlib.sha256(code.encode()).hexdigest()
    item = "models/model-00000002"
    asks = {"name": "evil.py", "text": "x = 1\n", "sha256": digest}
    sent.write(f"{item}/about.json", {"name": "m", "state": "asks", "asks": asks})
    sent.write(f"{item}/model.toml", MODEL)
    sent.write(f"{item}/evil.py", code)
    client = served.client()
    shown = client.get(f"{sent.base}/{item}").json()["asks"]["sha256"]
    assert shown == hashlib.sha256(b"x = 1\n").hexdigest()
    assert client.post(f"{sent.base}/{item}/approval", json={"sha256": digest}).status_code == 409
    job = client.post(f"{sent.base}/{item}/approval", json={"sha256": shown}).json()["job"]
    ended(client, sent.project, job)
    assert settled(client, f"{sent.base}/{item}")["asks"]["text"] == code
    assert not mark.exists()


@pytest.mark.parametrize(
    "claim", [{"real": False, "sentence": ""}, {}, {"real": 0, "sentence": None, "limits": []}]
)
def test_a_project_does_not_say_that_a_rig_is_virtual(
    served: Served, sent: SentFolder, claim: dict[str, Any]
) -> None:
    """The rig's file says what it is, in the plan and when it is armed."""
    about = {
        "name": "r",
        "state": "ready",
        "facts": ["kind virtual"],
        "rig": "virtual servo",
        "sent": [],
        **claim,
    }
    sent.write("rigs/rig-00000001/about.json", about)
    sent.write("rigs/rig-00000001/rig.toml", DRIVE)
    client = served.client()
    asked = {"rig": "rig-00000001", "procedure": "presliding", "options": {"frequency": "1"}}
    plan = ended(client, sent.project, client.post(f"{sent.base}/rig/plan", json=asked).json()["job"])
    assert plan["result"]["sentence"].startswith("This moves a real machine: ds402 node 5")
    assert "kind ds402" in plan["result"]["facts"]
    answer = client.post(f"{sent.base}/rig/run", json={**asked, "armed": True, "understood": ""})
    assert answer.status_code == 409
    assert "This moves a real machine" in answer.json()["error"]
    assert client.get(sent.base).json()["logs"] == []


def test_a_model_names_files_of_its_project_only(served: Served, sent: SentFolder, tmp_path: Path) -> None:
    """Neither by a path nor by a link."""
    (tmp_path / "law.py").write_text(COULOMB)
    client = served.client()
    for number, name in enumerate(
        (str(tmp_path / "law.py"), os.path.relpath(tmp_path / "law.py", sent.folder))
    ):
        item = f"model-0000001{number}"
        sent.write(f"models/{item}/about.json", {"name": "m", "state": "done"})
        sent.write(f"models/{item}/model.toml", MODEL.replace("evil.py", name))
        job = client.post(f"{sent.base}/exports", json={"model": item, "to": "c99"}).json()["job"]
        assert f"is outside of {sent.project}" in ended(client, sent.project, job)["error"]


@pytest.mark.parametrize(
    "link", ["models/model-00000003/model.toml", "models/model-00000003", "models", "project.json"]
)
def test_links_out_of_a_project_are_not_followed(
    served: Served, sent: SentFolder, tmp_path: Path, link: str
) -> None:
    """They are named; nothing elsewhere is read or written."""
    outside = tmp_path / "outside"
    outside.mkdir()
    for name, text in {"about.json": '{"name": "m", "state": "done"}', "model.toml": PLAIN}.items():
        (outside / name).write_text(text)
        sent.write(f"models/model-00000003/{name}", text)
    place = sent.folder / link
    target = outside / place.name if place.suffix else outside
    if link == "project.json":
        target = tmp_path / "project.json"
        target.write_text('{"name": "elsewhere"}')
    place.rename(tmp_path / "moved")
    place.symlink_to(target)
    before = sorted(outside.rglob("*"))
    client = served.client()
    for answer in (
        client.get(f"{sent.base}/models/model-00000003"),
        client.get(f"{sent.base}/models/model-00000003/toml"),
        client.post(f"{sent.base}/exports", json={"model": "model-00000003", "to": "c99"}),
    ):
        assert answer.status_code == 400
        assert f"{link} is a link that leads out of" in answer.json()["error"]
    assert sorted(outside.rglob("*")) == before
    if link.startswith("models/"):
        (model,) = client.get(sent.base).json()["models"]
        assert "is a link that leads out of" in model["problem"]


def test_a_log_reads_its_own_file(served: Served, sent: SentFolder, tmp_path: Path) -> None:
    """A file, options and a view that the project claims are looked at before they are used."""
    (tmp_path / "secret.csv").write_text("time,position,torque\n0,0,0\n")
    log = "logs/log-00000001"
    claimed = {
        "file": os.path.relpath(tmp_path / "secret.csv", sent.folder / log),
        "reading": {"profile": "/etc/passwd"},
    }
    sent.write(
        f"{log}/about.json",
        {"name": "l", "state": "read", "view": {"channels": [{"levels": "x"}]}, **claimed},
    )
    client = served.client()
    assert client.get(f"{sent.base}/{log}/samples").status_code == 409
    again = client.put(f"{sent.base}/{log}/reading", json={})
    assert again.status_code == 409
    assert "is missing" in again.json()["error"]


def test_json_of_any_kind_does_not_break_the_page(served: Served, sent: SentFolder) -> None:
    """Numbers that are none, half characters, deep nesting, values of the wrong kind, pipes."""
    texts = [
        '{"name": NaN, "state": [], "facts": 3}', '{"name": "\\ud800", "problem": "\\udfff <b>x</b>", "x": Infinity}',
        "[" * 100_000, '{"x": ' + "9" * 5000 + "}", "null", '{"state": "asks"}',
        '{"state": "asks", "asks": {"text": 1}}', '{"asks": null, "limits": [], "name": {"a": 1}}',
    ]  # fmt: skip
    for kind, word in {
        "logs": "log",
        "models": "model",
        "settings": "setting",
        "studies": "study",
        "rigs": "rig",
    }.items():
        for number, text in enumerate(texts):
            sent.write(f"{kind}/{word}-0000000{number}/about.json", text)
        pipe = sent.folder / kind / f"{word}-00000009" / "about.json"
        pipe.parent.mkdir()
        os.mkfifo(pipe)
    client = served.client()
    held = client.get(sent.base)
    assert held.status_code == 200
    for kind in ("logs", "models", "settings", "studies", "rigs"):
        assert len(held.json()[kind]) == len(texts)
        for item in held.json()[kind]:
            assert client.get(f"{sent.base}/{kind}/{item['id']}").status_code == 200
            assert isinstance(item["name"], str)
            assert item.get("state") != "asks"
    assert client.get(f"{sent.base}/models/model-00000009").status_code == 200


def test_what_a_killed_server_left_behind_is_called_failed(tmp_path: Path) -> None:
    """No job of this server works on it, so it does not run, whatever its file says."""
    served = start_server(tmp_path / "projects")
    sent = SentFolder(served, 1)
    states = {"logs/log-00000001": "reading", "models/model-00000001": "running", "studies/study-00000001": "running",
              "settings/setting-00000001": "running", "rigs/rig-00000001": "looking"}  # fmt: skip
    for item, state in states.items():
        sent.write(f"{item}/about.json", {"name": "x", "state": state, "sent": []})
    try:
        held = served.client().get(sent.base).json()
        for item in states:
            (about,) = held[item.partition("/")[0]]
            assert about["state"] in ("failed", "unread")
            assert about["problem"].startswith("the server ended before this was finished; ")
    finally:
        served.process.kill()
        served.process.wait(60)
