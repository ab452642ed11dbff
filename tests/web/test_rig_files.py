"""Rigs and machines that were sent: offered with what they are, and a real one only after a sentence of its own."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from test_rig_view import at_rest

import stickslip.machines
from support.serving import Served, drop, ended

SERVO = (Path(stickslip.machines.__file__).parent / "library" / "thesis-dry.toml").read_text(encoding="utf-8")
VIRTUAL = '[rig]\nkind = "virtual"\nmachine = "servo.toml"\nwithout = ["cogging"]\n'
DRIVE = """
[rig]
kind = "ds402"
node = {node}
bus = {bus}
watchdog_time = 0.2
timeout = 0.1
[rig.limits]
torque = 1.0
speed = 60.0
"""
SOCKETCAN = DRIVE.format(node=5, bus='{interface = "socketcan", channel = "can0"}')
PENDULUM = """
import math
from stickslip.rigs.files import limits_in
from stickslip.rigs.rig import Capabilities, Measurement, RigKind, Watchdog
open({mark!r}, "w").close()


class Pendulum:
    name, sample_time = "pendulum", 1e-3

    def __init__(self, limits):
        self.limits, self.time, self.position, self.velocity = limits, 0.0, 0.0, 0.0
        self.capabilities = Capabilities({watchdog}, real_clock=False)

    def open(self):
        return Measurement(self.time, self.position, 0.0)

    def exchange(self, torque):
        self.velocity += 1e-3 * (torque - 0.2 * math.sin(self.position) - 2e-3 * self.velocity) / 2e-3
        self.position += 1e-3 * self.velocity
        self.time += 1e-3
        return Measurement(self.time, self.position, torque)

    def pause(self, seconds):
        for _ in range(round(seconds / 1e-3)):
            self.exchange(0.0)
        return self.open()

    def close(self):
        pass


RIG = RigKind("pendulum", lambda table: Pendulum(limits_in(table)), "a pendulum")
"""
OWN = '[rig]\nkind = "pendulum.py"\n[rig.limits]\ntorque = 0.5\nspeed = 20.0\n'
NODE, CHANNEL = 7, "239.74.163.2"
CHANGE = struct.Struct("<qdqd")
"""Of the drive's torque, in its own log: ns, N·m, SYNC, state"""


def project_of(client: Any) -> str:
    """A new project."""
    identifier: str = client.post("/api/projects", json={"name": "rigs"}).json()["id"]
    return identifier


def sent(client: Any, project: str, **files: str) -> tuple[str, dict[str, Any]]:
    """Send files (by name, `_` for the dot); the address of the rig, and what is known of it."""
    given = [{"name": name.replace("_", "."), "text": text} for name, text in files.items()]
    answer = client.post(f"/api/projects/{project}/sent", json={"files": given})
    assert answer.status_code == 201, answer.json()
    made = answer.json()
    assert made["kind"] == "rigs"
    ended(client, project, made["job"], 300.0)
    address = f"/api/projects/{project}/rigs/{made['id']}"
    return address, client.get(address).json()


def allowed(client: Any, project: str, address: str) -> dict[str, Any]:
    """What is known of a rig when its code was let run."""
    sha = client.get(address).json()["asks"]["sha256"]
    job = client.post(f"{address}/approval", json={"sha256": sha}).json()["job"]
    ended(client, project, job, 300.0)
    about: dict[str, Any] = client.get(address).json()
    return about


def planned(client: Any, project: str, asked: dict[str, Any]) -> dict[str, Any]:
    """The job that made the plan."""
    job = client.post(f"/api/projects/{project}/rig/plan", json=asked).json()["job"]
    return ended(client, project, job, 300.0)


def begun(client: Any, project: str, asked: dict[str, Any]) -> dict[str, str]:
    """Job and log of a run that was armed."""
    answer = client.post(f"/api/projects/{project}/rig/run", json={**asked, "armed": True})
    assert answer.status_code == 201, answer.json()
    made: dict[str, str] = answer.json()
    return made


def frames_until(served: Served, project: str, job: str, enough: int = 10) -> list[dict[str, Any]]:
    """Live signals as the page hears them, which says all the while that it is there."""
    page, out = served.client(), []
    base = f"/api/projects/{project}/rig/{job}"
    with served.client().stream("GET", f"{base}/live") as answer:
        for line in answer.iter_lines():
            page.post(f"{base}/alive", json={})
            if line.startswith("data: "):
                out.append(json.loads(line.removeprefix("data: ")))
            if sum("time" in one for one in out) >= enough or (out and "end" in out[-1]):
                break
    return out


@pytest.mark.slow
def test_a_virtual_rig_with_a_machine_runs_with_live_channels(served: Served) -> None:
    """It needs no sentence; when its live signals are no longer heard, it stops."""
    client = served.client()
    project = project_of(client)
    _, about = sent(client, project, rig_toml=VIRTUAL, servo_toml=SERVO)
    assert about["state"] == "ready", about["problem"]
    assert about["rig"] == "virtual servo without cogging"
    assert about["sentence"] == ""
    assert about["limits"]["torque"] == 1.085
    assert "kind virtual" in about["facts"]
    asked = {"rig": about["id"], "procedure": "stickslip", "options": {"cycles": "60"}}
    plan = planned(client, project, asked)
    assert plan["state"] == "done", plan["error"]
    assert plan["result"]["rig"] == about["rig"]
    assert client.post(f"/api/projects/{project}/rig/run", json=asked).status_code == 409
    made = begun(client, project, asked)
    again = client.post(f"/api/projects/{project}/rig/run", json={**asked, "armed": True})
    assert again.status_code == 409
    frames = [f for f in frames_until(served, project, made["job"]) if "time" in f]
    assert len(frames) == 10
    times = [t for f in frames for t in f["time"]]
    assert times == sorted(times)
    assert all(len(f["channels"]["position"]) == len(f["time"]) for f in frames)
    assert any(v for f in frames for v in f["channels"]["torque_command"])
    at_rest(served, project, made["log"])


@pytest.mark.slow
def test_a_machine_alone_is_a_virtual_rig(served: Served) -> None:
    """Of the machine's own name."""
    client = served.client()
    project = project_of(client)
    _, about = sent(client, project, servo_toml=SERVO)
    assert (about["state"], about["name"], about["rig"]) == ("ready", "servo", "virtual servo")
    assert about["sent"] == ["servo.toml"]
    plan = planned(client, project, {"rig": about["id"], "procedure": "stickslip", "options": {}})
    assert plan["state"] == "done", plan["error"]


@pytest.mark.slow
def test_a_kind_of_ones_own_is_read_then_confirmed_then_armed(served: Served, tmp_path: Path) -> None:
    """Its code asks first; then it counts as a real machine, as any that the page does not simulate."""
    client, mark = served.client(), tmp_path / "mark"
    project = project_of(client)
    code = PENDULUM.format(mark=str(mark), watchdog='Watchdog(0.0, "it ends with the process")')
    address, about = sent(client, project, mine_toml=OWN, pendulum_py=code)
    assert about["state"] == "asks"
    assert about["asks"]["text"] == code
    asked = {"rig": about["id"], "procedure": "presliding", "options": {"frequency": "1"}}
    assert client.post(f"/api/projects/{project}/rig/plan", json=asked).status_code == 409
    assert client.post(f"/api/projects/{project}/rig/run", json={**asked, "armed": True}).status_code == 409
    assert not mark.exists()
    about = allowed(client, project, address)
    assert mark.exists()
    assert about["state"] == "ready", about["problem"]
    assert about["sentence"].startswith("This moves a real machine: pendulum")
    for wrong in ({}, {"understood": True}, {"understood": ""}, {"understood": about["sentence"][:-1]}):
        answer = client.post(f"/api/projects/{project}/rig/run", json={**asked, "armed": True, **wrong})
        assert answer.status_code == 409
        assert "This moves a real machine" in answer.json()["error"]
    assert client.get(f"/api/projects/{project}").json()["logs"] == []


@pytest.mark.slow
def test_one_real_machine_moves_at_a_time(served: Served, tmp_path: Path) -> None:
    """In all projects; the same stop as for any run ends it, with its torque at zero."""
    client = served.client()
    code = PENDULUM.format(mark=str(tmp_path / "mark"), watchdog='Watchdog(0.0, "it ends with the process")')
    asked: dict[str, dict[str, Any]] = {}
    for project in (project_of(client), project_of(client)):
        address, about = sent(client, project, mine_toml=OWN, pendulum_py=code)
        if about["state"] == "asks":  # the same code is approved in the other project, too
            about = allowed(client, project, address)
        asked[project] = {"rig": about["id"], "procedure": "breakaway", "options": {}}
        asked[project]["understood"] = about["sentence"]
    project, other = asked
    made = begun(client, project, asked[project])
    refused = client.post(f"/api/projects/{other}/rig/run", json={**asked[other], "armed": True})
    assert refused.status_code == 409
    assert "in another project" in refused.json()["error"]
    frames = frames_until(served, project, made["job"], 3)
    assert sum("time" in one for one in frames) == 3, frames[-1]
    assert client.delete(f"/api/projects/{project}/jobs/{made['job']}/run").json()["state"] == "cancelled"
    at_rest(served, project, made["log"])
    frames = frames_until(served, project, made["job"], 10**9)
    assert (frames[-1]["end"], frames[-1]["killed"]) == ("cancelled", False)


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"rig_toml": VIRTUAL}, "'servo.toml', which was not uploaded; drop both"),
        ({"rig_toml": OWN}, "'pendulum.py', which was not uploaded; drop both"),
        ({"rig_toml": '[rig]\nkind = "replay"\nfile = "run.npz"\n'}, "'run.npz', which was not uploaded; drop both"),
        ({"rig_toml": VIRTUAL.replace("servo", "x/servo"), "servo_toml": SERVO}, "name it without a folder"),
        ({"rig_toml": VIRTUAL.replace("servo", "../servo"), "servo_toml": SERVO}, "which was not uploaded; put"),
        ({"rig_toml": '[rig]\nkind = "replay"\nfile = "/dev/zero"\n'}, "which was not uploaded; put"),
        ({"rig_toml": SOCKETCAN.replace("can0", "/dev/../etc/passwd")}, "which was not uploaded; put"),
        ({"servo_toml": SERVO.replace('"gms"', '"own.py"')}, "'own.py', which was not uploaded; drop both"),
        ({"rig_toml": SERVO}, "a machine cannot be called rig.toml"),
    ],
)  # fmt: skip
def test_a_rig_that_names_what_is_not_there(served: Served, files: dict[str, str], said: str) -> None:
    """One line, and nothing is kept."""
    client = served.client()
    project = project_of(client)
    given = [{"name": name.replace("_", "."), "text": text} for name, text in files.items()]
    answer = client.post(f"/api/projects/{project}/sent", json={"files": given})
    assert answer.status_code == 400
    assert said in answer.json()["error"]
    assert client.get(f"/api/projects/{project}").json()["rigs"] == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (SOCKETCAN.replace("node = 5", "node = 500"), "rig.toml: rig: ds402: node = 500 must be"),
        (SOCKETCAN.replace("speed = 60.0", ""), "rig.toml: rig.limits.speed is missing"),
        (SOCKETCAN.replace("timeout = 0.1", 'watchdog = "none"'), "declares no watchdog"),
        ('[rig]\nkind = "ds403"\n', "ds402"),
    ],
)  # fmt: skip
def test_a_rig_that_cannot_be_used_says_why(served: Served, text: str, said: str) -> None:
    """It is kept with its problem, which names no folder of the machine, and is not run."""
    client = served.client()
    project = project_of(client)
    _, about = sent(client, project, drive_toml=text)
    assert about["state"] == "failed"
    assert said in about["problem"]
    assert str(served.folder) not in about["problem"]
    asked = {"rig": about["id"], "procedure": "presliding", "armed": True}
    assert client.post(f"/api/projects/{project}/rig/run", json=asked).status_code == 409
    for unknown in ("rig-00000000", "../rigs", "log-00000000"):
        answer = client.post(f"/api/projects/{project}/rig/plan", json={**asked, "rig": unknown})
        assert answer.status_code == 404


def test_a_serial_port_is_no_file(served: Served) -> None:
    """A bus behind one is a rig like another."""
    client = served.client()
    text = DRIVE.format(node=5, bus='{interface = "slcan", channel = "/dev/ttyACM0"}')
    _, about = sent(client, project_of(client), drive_toml=text)
    assert about["state"] == "ready", about["problem"]
    assert "bus slcan /dev/ttyACM0" in about["facts"]


def test_a_record_that_is_played_back_says_that_nothing_moves(served: Served) -> None:
    """It is confirmed, too, and what is confirmed is true."""
    client = served.client()
    rows = "".join(f"{1e-3 * n:.3f},{1e-2 * n:.3f},0.1\n" for n in range(200))
    text = '[rig]\nkind = "replay"\nfile = "run.csv"\n'
    project = project_of(client)
    _, about = sent(
        client, project, rig_toml=text, run_csv=f"time (s),position (rad),motor torque (Nm)\n{rows}"
    )
    assert about["state"] == "ready", about["problem"]
    assert about["sentence"].startswith("This replays a record")
    asked = {"rig": about["id"], "procedure": "presliding", "armed": True}
    assert client.post(f"/api/projects/{project}/rig/run", json=asked).status_code == 409


# ---- a drive ---------------------------------------------------------------------------------------------------


class Drive:
    """The emulated drive in a process of its own, and its log."""

    def __init__(self, folder: Path) -> None:
        worker = int("".join(filter(str.isdigit, os.environ.get("PYTEST_XDIST_WORKER", "0"))) or 0)
        self.port, self.log = 47200 + (os.getpid() % 500) + 500 * worker, folder / "drive.log"
        script = Path(__file__).parents[1] / "support" / "drive.py"
        self.process = subprocess.Popen(
            [sys.executable, str(script), CHANNEL, str(self.port), str(NODE), str(self.log)],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self.process.stdout
        assert self.process.stdout.readline() == "ready\n"

    def text(self, node: int) -> str:
        """A rig's file for it."""
        where = f'interface = "udp_multicast", channel = "{CHANNEL}", port = {self.port}, hop_limit = 0'
        return DRIVE.format(node=node, bus=f"{{{where}}}")

    def torques(self) -> list[float]:
        """All that acted, N·m."""
        return [change[1] for change in CHANGE.iter_unpack(self.log.read_bytes())]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Drive]:
    """On a bus of multicast messages, which not every machine has."""
    can = pytest.importorskip("can")
    for needed in ("canopen", "durand", "msgpack"):
        pytest.importorskip(needed)
    try:
        can.Bus(interface="udp_multicast", channel=CHANNEL, port=43199, hop_limit=0).shutdown()
    except (can.CanError, OSError):
        pytest.skip("this machine has no multicast")
    one = Drive(tmp_path_factory.mktemp("drive"))
    yield one
    one.process.kill()
    one.process.wait()


@pytest.mark.slow
def test_a_drive_moves_with_live_channels_and_is_stopped(served: Served, drive: Drive) -> None:
    """The drive's own word: torque acted, and after the stop there is none."""
    client = served.client()
    project = project_of(client)
    _, about = sent(client, project, drive_toml=drive.text(NODE))
    assert about["sentence"].startswith(f"This moves a real machine: ds402 node {NODE} on udp_multicast")
    asked = {"rig": about["id"], "procedure": "presliding", "options": {"frequency": "0.02"}}
    plan = planned(client, project, asked)
    assert plan["state"] == "done", plan["error"]
    assert drive.torques() in ([], [0.0])
    made = begun(client, project, {**asked, "understood": about["sentence"]})
    stream = served.folder / project / "logs" / made["log"] / "live.stream"
    frames = frames_until(served, project, made["job"], 20)
    assert sum("time" in one for one in frames) == 20, frames[-1]
    assert any(abs(t) > 0.0 for t in drive.torques())
    assert stream.is_file()
    until = time.monotonic() + 30.0
    while drive.torques()[-1] != 0.0 and time.monotonic() < until:
        time.sleep(0.05)
    assert drive.torques()[-1] == 0.0
    at_rest(served, project, made["log"])


@pytest.mark.slow
def test_a_drive_that_is_not_there_is_told(served: Served, drive: Drive) -> None:
    """Its plan needs no drive; its run says which did not answer, and nothing has moved."""
    client = served.client()
    project = project_of(client)
    _, about = sent(client, project, drive_toml=drive.text(9))
    asked = {"rig": about["id"], "procedure": "presliding", "options": {"frequency": "1"}}
    assert planned(client, project, asked)["state"] == "done"
    made = begun(client, project, {**asked, "understood": about["sentence"]})
    frames = frames_until(served, project, made["job"], 1)
    assert frames[-1]["end"] == "failed"
    assert "no answer to upload of 1000h" in frames[-1]["error"]
    assert not frames[-1]["killed"]


@pytest.mark.slow
def test_a_person_confirms_before_arming(page: Any, tmp_path: Path) -> None:
    """Dropped, it is chosen in the list; its plan cannot be armed before the sentence is ticked."""
    (tmp_path / "drive.toml").write_text(SOCKETCAN)
    drop(page, tmp_path / "drive.toml")
    page.get_by_role("heading", name="Rig", exact=True).wait_for()
    chosen = page.get_by_label("Rig", exact=True).locator("option:checked").inner_text()
    assert chosen == "drive: kind ds402, ds402 node 5, bus socketcan can0, at most 1 N·m, 60 rad/s"
    page.get_by_label("Procedure", exact=True).select_option("presliding")
    page.get_by_role("button", name="Show the plan").click()
    start, arm = page.get_by_role("button", name="Start"), page.get_by_label("Arm the rig")
    start.wait_for()
    assert arm.is_disabled()
    assert start.is_disabled()
    assert "null" not in page.locator("main").inner_text()
    understood = page.get_by_label("This moves a real machine: ds402 node 5 on socketcan can0")
    understood.check()
    assert start.is_disabled()
    arm.check()
    assert start.is_enabled()
    understood.uncheck()
    assert arm.is_disabled()
    assert not arm.is_checked()
    assert start.is_disabled()
