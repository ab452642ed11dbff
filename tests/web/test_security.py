"""Who gets nothing: other pages, other names of this machine, whoever has no token."""

from __future__ import annotations

import socket
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest

from support.serving import Served

PATHS = ("/api/projects", "/api/laws", "/api/targets", "/api/projects/x/logs/y/samples", "/api/nothing")


@pytest.mark.parametrize("path", PATHS)
def test_no_token_is_401(served: Served, path: str) -> None:
    """Of any address, also one that is not there: nobody learns what there is."""
    assert served.client(entered=False).get(path).status_code == 401


@pytest.mark.parametrize("cookie", ["", "x", "é" * 10, "a" * 43])
def test_a_wrong_token_is_401(served: Served, cookie: str) -> None:
    """In the cookie and where the cookie is made."""
    client = served.client(entered=False)
    name = f"stickslip-{served.url.rpartition(':')[2]}"
    header = {"cookie": f"{name}={cookie}".encode()}
    assert client.get("/api/projects", headers=header).status_code == 401
    assert client.post("/api/session", json={"token": cookie}).status_code == 401


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:PORT", "127.0.0.1", "127.0.0.1:1", "127.0.0.1.nip.io:PORT", ""]
)
def test_a_foreign_host_is_403(served: Served, host: str) -> None:
    """A name that was made to point here (DNS rebinding) gets nothing, not even the page."""
    port = served.url.rpartition(":")[2]
    for path in ("/", "/api/projects", "/static/main.js"):
        answer = served.client().get(path, headers={"host": host.replace("PORT", port)})
        assert answer.status_code == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "https://127.0.0.1:PORT", "http://127.0.0.1:1"]
)
def test_a_foreign_origin_is_403(served: Served, origin: str) -> None:
    """With the right cookie too."""
    said = origin.replace("PORT", served.url.rpartition(":")[2])
    for method, path in (("GET", "/api/projects"), ("POST", "/api/projects"), ("POST", "/api/session")):
        answer = served.client().request(method, path, headers={"origin": said}, json={})
        assert answer.status_code == 403
    answer = served.client().get("/api/projects", headers={"sec-fetch-site": "cross-site"})
    assert answer.status_code == 403


def test_its_own_names_are_let_in(served: Served) -> None:
    """localhost and, where the machine has it, IPv6."""
    port = served.url.rpartition(":")[2]
    names = ["localhost", *(["[::1]"] if has_ipv6() else [])]
    for name in names:
        client = httpx.Client(base_url=f"http://{name}:{port}")
        entered = client.post(
            "/api/session", json={"token": served.token}, headers={"origin": f"http://{name}:{port}"}
        )
        assert entered.status_code == 200
        cookie = entered.headers["set-cookie"]
        assert "SameSite=strict" in cookie
        assert "HttpOnly" in cookie


def has_ipv6() -> bool:
    """Whether this machine has ::1."""
    try:
        with socket.socket(socket.AF_INET6) as tried:
            tried.bind(("::1", 0))
    except OSError:
        return False
    return True


@pytest.mark.skipif(sys.platform != "linux", reason="/proc/net/tcp tells on Linux alone")
def test_it_listens_on_this_machine_alone(served: Served) -> None:
    """Not on an address that others reach."""
    port = f"{int(served.url.rpartition(':')[2]):04X}"
    listening = [
        line.split()[1]
        for name in ("tcp", "tcp6")
        for line in Path(f"/proc/net/{name}").read_text("ascii").splitlines()[1:]
        if line.split()[3] == "0A" and line.split()[1].endswith(f":{port}")
    ]
    assert listening
    assert {a.partition(":")[0] for a in listening} <= {"0100007F", "00000000000000000000000001000000"}


@pytest.mark.parametrize("path", ["/", "/static/main.js", "/api/projects", "/nothing"])
def test_every_answer_says_what_a_page_may_load(served: Served, path: str) -> None:
    """From here alone."""
    headers = served.client().get(path).headers
    assert headers["content-security-policy"].startswith("default-src 'self';")
    assert headers["x-content-type-options"] == "nosniff"
    assert "unsafe" not in headers["content-security-policy"]


def test_forms_of_other_pages_are_not_taken(served: Served) -> None:
    """What a page elsewhere may send without being asked has one of three content types."""
    client = served.client()
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"):
        answer = client.post("/api/projects", content=b'{"name": "x"}', headers={"content-type": kind})
        assert answer.status_code == 415


def test_files_of_this_machine_are_not_served(served: Served) -> None:
    """Nor the server's own sources."""
    client = served.client()
    for path in ("/static/../app.py", "/static/%2e%2e/app.py", "/static/..%2fapp.py", "/static//etc/passwd"):
        answer = client.send(client.build_request("GET", served.url + path))
        assert answer.status_code in (404, 405)
        assert "import" not in answer.text


def test_two_projects_do_not_mix(served: Served) -> None:
    """A log, a job and a model belong to one project, whoever asks through another."""
    client = served.client()
    one, other = (client.post("/api/projects", json={"name": n}).json()["id"] for n in ("one", "other"))
    made: dict[str, Any] = client.post(f"/api/projects/{one}/example", json={}).json()
    assert client.get(f"/api/projects/{one}/logs/{made['id']}").status_code == 200
    for path in (f"logs/{made['id']}", f"jobs/{made['job']}/about", f"jobs/{made['job']}/events"):
        assert client.get(f"/api/projects/{other}/{path}").status_code == 404
    assert client.delete(f"/api/projects/{other}/jobs/{made['job']}/run").status_code == 404
