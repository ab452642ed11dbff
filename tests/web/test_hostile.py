"""Whatever is sent: no traceback, no file outside the project, no memory beyond measure, and the next log is read."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from support.hostile import FILES, NAMES, contents
from support.serving import DEMO, Served, ended, start_server

SMALL = b"time [s],position [rad],torque [Nm]\n" + b"".join(
    b"%.3f,%.3f,0.1\n" % (i / 1000, i / 500) for i in range(80)
)
KINDS = [f"name {i}" for i in range(len(NAMES))] + list(FILES)
MOST = 2**30


@pytest.fixture(scope="module")
def sent(served: Served) -> dict[str, Any]:
    """What became of each of the fifty, sent one after the other to one project."""
    client = served.client()
    project = client.post("/api/projects", json={"name": "hostile"}).json()["id"]
    out: dict[str, Any] = {"project": project, "client": client}
    files = contents()
    assert tuple(files) == FILES
    peak = Peak(served.process.pid)
    for kind in KINDS:
        name, content = (
            (NAMES[int(kind[5:])], SMALL if kind == "name 0" else b"nothing here\n")
            if kind.startswith("name ")
            else (kind, files[kind])
        )
        answer = client.post(f"/api/projects/{project}/logs", params={"name": name}, content=content)
        about = answer.json()
        if answer.status_code == 201:
            while (job := client.get(f"/api/projects/{project}/jobs/{about['job']}/about").json())["state"] not in (
                "done", "failed", "cancelled",
            ):  # fmt: skip
                peak.look()
                time.sleep(0.02)
            about = {**client.get(f"/api/projects/{project}/logs/{about['id']}").json(), "job": job}
        out[kind] = (answer.status_code, about)
    out["peak"] = peak.most
    return out


class Peak:
    """The most memory that the server or a process of its held."""

    def __init__(self, pid: int) -> None:
        self.pid, self.most = pid, 0

    def look(self) -> None:
        """Look again."""
        psutil = pytest.importorskip("psutil")
        server = psutil.Process(self.pid)
        for process in (server, *server.children(recursive=True)):
            try:
                self.most = max(self.most, process.memory_info().rss)
            except psutil.Error:  # it has just ended
                continue


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_hostile_file_is_read_or_refused_in_a_line(sent: dict[str, Any], kind: str) -> None:
    """And stands under an identifier of ours, whatever its name is."""
    status, about = sent[kind]
    assert status in (201, 400, 413), about
    if status != 201:
        assert about["error"]
        return
    assert about["state"] in ("read", "unread")
    problem = about["problem"]
    assert about["readable"] or problem
    assert "Traceback" not in problem
    assert "fault of stickslip" not in problem, problem
    assert "\n" not in problem
    assert about["file"].startswith("upload.")
    assert "/" not in about["file"]


@pytest.mark.slow
def test_nothing_was_written_elsewhere(sent: dict[str, Any], served: Served) -> None:
    """Every file lies in the project's folder, under a name of the server's own."""
    known = {p["id"] for p in sent["client"].get("/api/projects").json()["projects"]}
    assert {p.name for p in served.folder.iterdir()} <= known
    for path in served.folder.rglob("*"):
        assert "evil" not in path.name
    assert not Path("/tmp/stickslip-was-here").exists()
    assert not Path("/tmp/evil.csv").exists()


@pytest.mark.slow
def test_memory_stayed_within_its_limit(sent: dict[str, Any]) -> None:
    """Of the server and of every reader: the archive of 4 GB of zeros is refused, not unpacked."""
    assert 0 < sent["peak"] <= MOST
    status, about = sent["bomb.npz"]
    assert status == 201
    assert not about["readable"]


@pytest.mark.slow
def test_the_next_log_is_read(sent: dict[str, Any]) -> None:
    """After all that."""
    client, project = sent["client"], sent["project"]
    made = client.post(f"/api/projects/{project}/logs?name=demo.csv", content=DEMO.read_bytes()).json()
    ended(client, project, made["job"])
    assert client.get(f"/api/projects/{project}/logs/{made['id']}").json()["view"]["rows"] == 6000


def test_a_file_beyond_the_limit_is_413_and_leaves_nothing(tmp_path: Path) -> None:
    """Whether its length is announced or not."""
    served = start_server(tmp_path / "projects", "--max-upload", "1")
    try:
        client = served.client()
        project = client.post("/api/projects", json={}).json()["id"]

        def unannounced() -> Iterator[bytes]:
            for _ in range(40):
                yield bytes(2**16)

        for content in (bytes(2**21), unannounced()):
            answer = client.post(f"/api/projects/{project}/logs?name=a.csv", content=content)
            assert answer.status_code == 413
        assert client.get(f"/api/projects/{project}").json()["logs"] == []
        assert not list((tmp_path / "projects").rglob("upload*"))
    finally:
        served.process.terminate()
        served.process.wait(120)


# ---- requests that no page of ours sends ----------------------------------------------------------------------------

WORDS = st.sampled_from(
    ["projects", "logs", "models", "settings", "jobs", "studies", "sent", "approval",
     "exports", "comparisons", "targets", "laws", "reading",
     "samples",
     "report", "toml", "events", "about", "run", "example", "session", "PROJECT", "LOG", "..", ".", "%00", "null", "0"]
)  # fmt: skip
PATHS = st.lists(WORDS | st.text(max_size=8), min_size=1, max_size=6)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
KEYS = ("name", "logs", "laws", "method", "loop", "inertia", "model", "setting", "to", "options", "settings",
        "bandwidth",
        "confirm", "axes", "first", "second", "map", "leave_out", "start", "end", "rows", "token",
        "accept", "files", "sha256")  # fmt: skip
QUERY = ["from", "to", "bins", "channels", "name", "show"]
BODIES = st.dictionaries(st.sampled_from(KEYS), JSON | st.just("PROJECT") | st.just(["LOG"]), max_size=6)


@pytest.fixture(scope="module")
def target(served: Served) -> tuple[Any, str, str]:
    """A project with a log."""
    client = served.client()
    project = client.post("/api/projects", json={}).json()["id"]
    made = client.post(f"/api/projects/{project}/example", json={}).json()
    ended(client, project, made["job"])
    return client, project, made["id"]


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    method=st.sampled_from(["GET", "POST", "PUT", "PATCH", "DELETE", "HEAD", "OPTIONS"]), path=PATHS, body=BODIES,
    query=st.dictionaries(st.sampled_from(QUERY), st.text(max_size=10), max_size=3),
    raw=st.none() | st.binary(max_size=60),
)  # fmt: skip
def test_no_request_breaks_the_server(
    target: tuple[Any, str, str], method: str, path: list[str], body: dict[str, Any], query: dict[str, str],
    raw: bytes | None,
) -> None:  # fmt: skip
    """Two hundred requests that no page of ours sends: each is answered, none with an error of the server's."""
    client, project, log = target
    from urllib.parse import quote

    known = {"PROJECT": f"projects/{project}", "LOG": f"logs/{log}"}
    address = "/".join(known.get(p, p if p == "%00" else quote(p, safe="")) for p in path)
    content = raw if raw is not None else dumped({k: known_in(v, project, log) for k, v in body.items()})
    if method == "DELETE" and log in address:
        method = "GET"  # the log is needed by the next
    if address.endswith("events") or (method == "POST" and address.endswith(("example", "logs", "models"))):
        method = "PUT"  # each would begin work, which is no matter of answering
    answer = client.request(
        method, f"/api/{address}", params=query, content=content, headers={"content-type": "application/json"}
    )
    assert answer.status_code < 500, (method, address, content)
    assert "Traceback" not in answer.text


def dumped(body: Any) -> bytes:
    """JSON, with what JSON has no numbers for."""
    import json

    return json.dumps(body).encode("utf-8", "surrogatepass")


def known_in(value: Any, project: str, log: str) -> Any:
    """The value, with identifiers that there are."""
    return project if value == "PROJECT" else [log] if value == ["LOG"] else value


BAD_FORMS: list[tuple[str, dict[str, Any]]] = [
    ("models", {"logs": []}), ("models", {"logs": "LOG"}), ("models", {"logs": ["../x"]}), ("models", {"logs": None}),
    ("models", {"logs": ["LOG"], "method": "__import__"}), ("models", {"logs": ["LOG"], "laws": ["/tmp/evil.py"]}),
    ("models", {"logs": ["LOG"], "inertia": "x"}), ("models", {"logs": ["LOG"], "inertia": 1e999}),
    ("settings", {"model": "../../x"}), ("settings", {"model": ["x"]}), ("exports", {"model": "x", "to": "c99"}),
    ("exports", {"setting": {"a": 1}}), ("comparisons", {"first": "x", "second": "x"}), ("comparisons", {}),
]  # fmt: skip


@pytest.mark.parametrize(("path", "body"), BAD_FORMS)
def test_a_form_that_is_wrong_is_told_so(
    target: tuple[Any, str, str], path: str, body: dict[str, Any]
) -> None:
    """In a line, before any work begins; a law's file in particular is no name of a law."""
    client, project, log = target
    said = {k: [log if x == "LOG" else x for x in v] if isinstance(v, list) else v for k, v in body.items()}
    answer = client.post(
        f"/api/projects/{project}/{path}", content=dumped(said), headers={"content-type": "application/json"}
    )
    assert answer.status_code in (400, 404, 409)
    assert answer.json()["error"]
    assert os.linesep not in answer.json()["error"]
