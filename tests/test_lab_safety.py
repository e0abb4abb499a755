"""Nobody but this machine's own page is answered, and nothing that is sent brings the lab down."""

from __future__ import annotations

import http.client
import io
import os
import pickle
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any

import httpx2 as httpx
import numpy as np
import pytest
import schemathesis
import soundfile
import uvicorn
from click.testing import CliRunner
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import stickslip as ss
from labs import Lab, running_lab
from stickslip.cli.program import main
from stickslip.lab import data
from stickslip.lab import server as gate
from stickslip.lab.server import PatientProtocol, lab_app

ENDED = ("done", "refused", "broken", "cancelled")


@pytest.fixture(scope="module")
def lab() -> Iterator[Lab]:
    with running_lab() as lab:
        yield lab


@pytest.fixture(scope="module")
def client(lab: Lab) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=lab.base, headers=lab.headers, timeout=600) as client:
        yield client


def send(client: httpx.Client, name: str, contents: bytes) -> str:
    answer = client.post("/files", params={"name": name}, content=contents)
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def asked(client: httpx.Client, key: str, question: str = "describe", **more: Any) -> dict[str, Any]:
    job = client.post("/jobs", json={"question": question, "records": [[key]], **more}).json()["id"]
    client.get(f"/jobs/{job}/events")  # which end as the job does
    told = client.get(f"/jobs/{job}").json()
    assert told["state"] in ENDED
    return told


def paths(app: Starlette) -> list[tuple[str, str]]:
    found = [("GET", "/"), ("GET", "/lab.js"), ("GET", "/openapi.json")]
    for route in app.routes:
        if isinstance(route, Route):
            place = route.path.replace("{key}", "0" * 32).replace("{name}", "x")
            found += [(method, place) for method in sorted(route.methods or ())]
    return found


ROUTES = paths(lab_app(token="t", port=1))


@pytest.fixture(scope="module")
def anyone(lab: Lab) -> Iterator[httpx.Client]:
    """Somebody without the token; to be made it takes half a second, in which it reads whom TLS trusts."""
    with httpx.Client(base_url=lab.base, timeout=600) as anyone:
        yield anyone


@pytest.mark.parametrize(("method", "path"), ROUTES)
def test_every_door_wants_our_host_our_page_and_the_token(
    lab: Lab, anyone: httpx.Client, method: str, path: str
) -> None:
    known = lab.headers
    ours = f"127.0.0.1:{lab.port}"
    assert anyone.request(method, path).status_code == 401
    assert anyone.request(method, path, headers={"Authorization": "Bearer wrong"}).status_code == 401
    for host in ("evil.example", f"evil.example:{lab.port}", "127.0.0.1", f"127.0.0.1.evil.example:{lab.port}"):
        assert anyone.request(method, path, headers={**known, "Host": host}).status_code == 400
    for origin in ("http://evil.example", "null", "http://127.0.0.1:1", f"https://{ours}"):
        assert anyone.request(method, path, headers={**known, "Origin": origin}).status_code == 403
    answer = anyone.request(method, path, headers={**known, "Origin": f"http://{ours}"})
    assert answer.status_code not in (401, 403), "who is ours is let in, to be answered by what is behind the door"
    assert answer.status_code != 400 or "this lab answers" not in answer.text.lower()
    assert answer.status_code < 500
    assert "content-security-policy" in answer.headers


def test_the_lab_listens_on_this_machine_alone(lab: Lab) -> None:
    """No socket of it is bound to another address than 127.0.0.1."""
    inodes = set()
    for link in Path(f"/proc/{lab.process.pid}/fd").iterdir():
        target = os.readlink(link) if link.is_symlink() else ""
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    bound = [
        fields[1]
        for table in ("tcp", "tcp6")
        for fields in (line.split() for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:])
        if fields[9] in inodes and fields[3] == "0A"
    ]
    assert bound == [f"0100007F:{lab.port:04X}"]


def test_the_page_may_run_its_own_scripts_and_nothing_else(client: httpx.Client) -> None:
    policy = client.get("/").headers["content-security-policy"]
    rules = {words.split()[0]: words.split()[1:] for words in policy.split(";") if words.strip()}
    assert rules["default-src"] == ["'none'"]
    assert rules["script-src"] == ["'self'"]
    assert not {"'unsafe-inline'", "'unsafe-eval'", "*", "https:"} & {each for rule in rules.values() for each in rule}
    assert rules["frame-ancestors"] == ["'none'"]


def test_a_report_runs_nothing_whatever_it_is_called(client: httpx.Client, tmp_path: Path) -> None:
    time = np.arange(2000) / 500
    friction = 1.5 * np.sign(np.cos(2 * np.pi * time)) + np.random.default_rng(1).normal(0, 0.01, time.size)
    record = ss.Record.of({"x": np.sin(2 * np.pi * time) / 6.28, "friction": friction}, fs=500)
    name = "<img src=x onerror=alert(1)>.csv"
    key = send(client, name, ss.write_record(record, tmp_path / "a.csv").read_bytes())
    job = client.post("/jobs", json={"question": "analyze", "records": [[key]]}).json()["id"]
    while client.get(f"/jobs/{job}").json()["state"] not in ENDED:
        pass
    page = client.get(f"/jobs/{job}/report")
    assert page.status_code == 200
    assert "<img src=x" not in page.text
    assert "&lt;img src=x" in page.text
    policy = page.headers["content-security-policy"]
    assert policy.startswith("sandbox; default-src 'none'")
    assert "script-src" not in policy
    assert "'self'" not in policy.replace("frame-ancestors 'self'", "")


@pytest.mark.parametrize(
    "path",
    [
        "/../pyproject.toml",
        "/%2e%2e/%2e%2e/server.py",
        "/..%2fserver.py",
        "//etc/passwd",
        "/jobs/../../etc/passwd",
        "/jobs/%2e%2e%2f%2e%2e/report",
        "/vendor/../../server.py",
    ],
)
def test_no_path_leads_out_of_the_page(lab: Lab, path: str) -> None:
    with closing(http.client.HTTPConnection("127.0.0.1", lab.port)) as door:
        door.request("GET", path, headers=lab.headers)
        answer = door.getresponse()
        assert answer.status in (400, 404, 405)
        assert b"import" not in answer.read()


class Bomb:
    """Unpickled anywhere, it leaves a file behind."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return os.system, (f"touch {self.path}",)


@pytest.mark.parametrize("name", ["a.pkl", "a.mat", "a.lvm", "a.npy"])
def test_a_pickle_is_never_opened(client: httpx.Client, tmp_path: Path, name: str) -> None:
    mark = tmp_path / "gone-off"
    array = np.array([Bomb(mark)], dtype=object)
    np.save(tmp_path / "a.npy", array, allow_pickle=True)
    contents = (tmp_path / "a.npy").read_bytes() if name == "a.npy" else pickle.dumps(Bomb(mark))
    answer = asked(client, send(client, name, contents))
    assert answer["state"] == "refused"
    assert name in answer["message"]
    assert not mark.exists()


def test_the_token_is_in_no_argument_of_the_browser(tmp_path: Path) -> None:
    """Everybody on a machine sees the arguments of its programs; a file of the user's leads the browser in."""
    told, browser = tmp_path / "told", tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$@" > {told}.part\nmv {told}.part {told}\n', encoding="utf-8")
    browser.chmod(0o755)
    with running_lab(browser=browser) as lab:
        until = time.monotonic() + 600
        while not told.exists() and time.monotonic() < until:
            time.sleep(0.02)
        said = told.read_text("utf-8")
        assert lab.token not in said
        page = Path(said.strip().removeprefix("file://"))
        assert page.stat().st_mode & 0o777 == 0o600
        assert lab.address in page.read_text("utf-8")
        with httpx.Client(base_url=lab.base, headers=lab.headers, timeout=600) as client:
            assert client.get("/catalog").status_code == 200
        while page.exists() and time.monotonic() < until:
            time.sleep(0.02)
        assert not page.exists()


def test_what_a_killed_lab_left_is_removed_by_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left, other = tmp_path / f"stickslip-lab-{gone.pid}-abc", tmp_path / "stickslip-lab-notes"
    running = tmp_path / f"stickslip-lab-{os.getpid()}-abc"
    for place in (left, running, other):
        (place / "files").mkdir(parents=True)
    (tmp_path / f"stickslip-lab-{gone.pid}-link").symlink_to(running)
    data.remove_left()
    assert not left.exists()
    assert (running / "files").exists()
    assert (other / "files").exists()


def test_a_port_for_the_administrator_is_refused_in_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(door: socket.socket, address: tuple[str, int]) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(socket.socket, "bind", refused)
    answer = CliRunner().invoke(main, ["lab", "--port", "80"])
    assert answer.exit_code == 2
    assert answer.stderr.count("\n") == 1
    assert "port 80 may not be used" in answer.stderr
    assert "--port" in answer.stderr


def test_a_request_that_is_too_large_is_refused(client: httpx.Client) -> None:
    for path in ("/jobs", "/export", "/open"):
        assert client.post(path, content=b"x" * (3 << 20)).status_code == 413


def test_what_the_lab_says_it_understands_it_bears(lab: Lab, client: httpx.Client) -> None:
    """Every operation of the lab's own OpenAPI document, with requests that fit it and requests that do not."""
    document = client.get("/openapi.json").json()
    schema = schemathesis.openapi.from_dict(document)
    schema.config.update(base_url=lab.base)
    operations = [result.ok() for result in schema.get_all_operations()]
    assert {operation.path for operation in operations} >= {"/files", "/jobs", "/jobs/{key}"}
    for operation in operations:
        bears(operation, lab)
    assert client.get("/alive").status_code == 200


def bears(operation: Any, lab: Lab) -> None:
    wild = {"derandomize": True, "deadline": None, "phases": [Phase.generate], "database": None,
            "suppress_health_check": list(HealthCheck)}  # fmt: skip
    modes = schemathesis.GenerationMode

    @settings(max_examples=8, **wild)
    @given(case=st.one_of(*(operation.as_strategy(generation_mode=mode) for mode in modes)))
    def check(case: Any) -> None:
        answer = case.call(headers=lab.headers, timeout=600)
        assert answer.status_code < 500 or answer.status_code in (503, 507), case.as_curl_command()
        if answer.status_code >= 400 and case.method != "HEAD":
            assert set(answer.json()) == {"error"}, case.as_curl_command()

    check()


def sockets(app: Starlette) -> list[str]:
    return [route.path for route in app.routes if isinstance(route, WebSocketRoute)]


SOCKETS = sockets(lab_app(token="t", port=1))


@pytest.mark.parametrize("path", SOCKETS)
def test_a_socket_wants_our_page_and_the_token(lab: Lab, path: str) -> None:
    place = f"ws://127.0.0.1:{lab.port}{path}"
    for headers in ({}, {"Authorization": "Bearer wrong"}, {**lab.headers, "Origin": "http://evil.example"}):
        with pytest.raises(InvalidStatus) as refused:
            connect(place, additional_headers=headers)
        assert refused.value.response.status_code == 403


@pytest.mark.parametrize("path", SOCKETS)
def test_a_socket_bears_whatever_comes(lab: Lab, client: httpx.Client, path: str) -> None:
    noise = np.random.default_rng(11)
    words = [b'{"id": 1, "want": "run", "state": {"system": {"mass": 1e308}}}', b"[" * 5000, b'{"id": NaN}', b"null",
             b'{"id": 1, "want": "run"}', b'{"id": {}, "want": []}', b'"' + b"x" * 100_000 + b'"']  # fmt: skip
    for number in range(40):
        place = f"ws://127.0.0.1:{lab.port}{path}"
        with connect(place, additional_headers=lab.headers) as talk, suppress(ConnectionClosed):
            for _ in range(5):
                some = noise.bytes(int(noise.integers(0, 400)))
                talk.send(some)
                talk.send(some.decode("latin-1"))
            talk.send(words[number % len(words)].decode())
            talk.send(words[number % len(words)])
    assert client.get("/alive").status_code == 200


def raw(lab: Lab, contents: bytes) -> None:
    with socket.create_connection(("127.0.0.1", lab.port), timeout=600) as door:
        door.sendall(contents)
        door.settimeout(0.2)
        with suppress(TimeoutError, ConnectionError):
            door.recv(4096)


def test_bytes_that_are_no_request_harm_nobody(lab: Lab, client: httpx.Client) -> None:
    noise = np.random.default_rng(5)
    for number in range(10):
        raw(lab, noise.bytes(500))
        raw(lab, b"GET / HTTP/1.1\r\nHost: " + noise.bytes(50).replace(b"\n", b"") + b"\r\n\r\n")
        raw(
            lab, b"POST /files HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nContent-Length: %d\r\n\r\nabc" % (lab.port, 10**number)
        )
    assert client.get("/alive").status_code == 200


HALVES = {
    "nothing": "",
    "a part of a line": "GET /al",
    "a part of a head": "GET /alive HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nAuth",
    "a socket's half": "GET /play HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n",
    "a body that nobody wants": "POST /jobs HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Length: 900\r\n\r\nabc",
    "a second request's half": "GET /alive HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\nGET /al",
}

WELCOME = HALVES["a body that nobody wants"].replace("Content", "Authorization: Bearer t\r\nContent")


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The port of a lab's protocol, which waits a fifth of a second for eight connections, half of that for more."""
    monkeypatch.setattr(PatientProtocol, "patience", 0.2)
    monkeypatch.setattr(PatientProtocol, "hurry", 0.1)
    monkeypatch.setattr(PatientProtocol, "most", 8)
    monkeypatch.setattr(gate, "SILENCE", 0.2)

    async def reads(request: Request) -> Response:
        return PlainTextResponse(str(len(await request.body())))

    with socket.socket() as door:
        door.bind(("127.0.0.1", 0))
        door.listen()
        port = door.getsockname()[1]
        app = Starlette(
            routes=[Route("/alive", reads), Route("/jobs", reads, methods=["POST"])],
            middleware=[Middleware(gate.Guard, token="t", port=port)],
            exception_handlers=lab_app(token="t", port=port).exception_handlers,
        )
        server = uvicorn.Server(uvicorn.Config(app, http=PatientProtocol, lifespan="off", log_config=None))
        serving = threading.Thread(target=server.run, kwargs={"sockets": [door]})
        serving.start()
        try:
            yield port
        finally:
            server.should_exit = True
            serving.join()
    assert not PatientProtocol.waiting


def everything_of(door: socket.socket) -> bytes:
    """What comes until the other side closes, which it does."""
    door.settimeout(600)
    said = b""
    with suppress(ConnectionError):
        while some := door.recv(4096):
            said += some
    return said


@pytest.mark.parametrize("half", HALVES)
def test_half_a_request_is_closed_after_a_while(impatient: int, half: str) -> None:
    with socket.create_connection(("127.0.0.1", impatient)) as door:
        door.sendall(HALVES[half].format(port=impatient).encode())
        everything_of(door)


def test_one_byte_now_and_then_keeps_no_half_request_open(impatient: int) -> None:
    for half in ("a part of a head", "a body that nobody wants"):
        with socket.create_connection(("127.0.0.1", impatient)) as door, suppress(ConnectionError):
            door.sendall(HALVES[half].format(port=impatient).encode())
            while True:  # ends when the other side has closed
                time.sleep(0.02)
                door.sendall(b"a")


def test_a_body_that_stops_coming_is_answered_so_and_closed(impatient: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PatientProtocol, "patience", 2.0)
    with socket.create_connection(("127.0.0.1", impatient)) as door:
        door.sendall(WELCOME.format(port=impatient).encode())
        said = everything_of(door)
    assert said.startswith(b"HTTP/1.1 408")
    assert b"send it again" in said


def test_a_sender_that_goes_in_the_middle_is_no_fault(
    impatient: int, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PatientProtocol, "patience", 600.0)
    for _ in range(3):
        with socket.create_connection(("127.0.0.1", impatient)) as door:
            door.sendall(WELCOME.format(port=impatient).encode())
    assert alive(impatient)
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


def test_of_too_many_half_requests_most_are_closed_soon_and_others_served(
    impatient: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PatientProtocol, "patience", 600.0)
    monkeypatch.setattr(PatientProtocol, "hurry", 2.0)
    with ExitStack() as all_:
        halves = [all_.enter_context(socket.create_connection(("127.0.0.1", impatient))) for _ in range(40)]
        for door in halves:
            door.sendall(b"GET /al")
        assert alive(impatient)
        for door in halves[9:]:
            everything_of(door)
        assert len(PatientProtocol.waiting) <= 9  # and that of who asked whether it is alive
        halves[0].sendall(b"ive HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        assert halves[0].recv(12) == b"HTTP/1.1 400"


def test_none_is_closed_before_what_it_sent_was_read(impatient: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many come at once, who sends a request is answered."""
    monkeypatch.setattr(PatientProtocol, "patience", 600.0)
    monkeypatch.setattr(PatientProtocol, "hurry", 20.0)
    with ExitStack() as many:
        for _ in range(100):
            many.enter_context(socket.create_connection(("127.0.0.1", impatient)))
        with ThreadPoolExecutor(8) as users:
            assert all(users.map(alive, [impatient] * 40))


def alive(port: int) -> bool:
    answer = httpx.get(f"http://127.0.0.1:{port}/alive", headers={"Authorization": "Bearer t"}, timeout=600)
    return answer.status_code == 200


def test_an_upload_that_breaks_off_leaves_nothing(lab: Lab, client: httpx.Client) -> None:
    (place,) = Path(os.environ.get("TMPDIR", "/tmp")).glob(f"stickslip-lab-{lab.process.pid}-*/files")
    before = set(place.iterdir())
    head = f"POST /files?name=a.csv HTTP/1.1\r\nHost: 127.0.0.1:{lab.port}\r\nAuthorization: Bearer {lab.token}\r\n"
    raw(lab, (head + "Content-Length: 5000000\r\n\r\n").encode() + b"x" * 2_000_000)
    until = time.monotonic() + 600
    while set(place.iterdir()) != before and time.monotonic() < until:
        time.sleep(0.05)
    assert set(place.iterdir()) == before


def test_twenty_at_once_are_all_answered(lab: Lab, client: httpx.Client) -> None:
    def user(number: int) -> tuple[int, float]:
        sound = io.BytesIO()
        soundfile.write(sound, np.linspace(0, (number + 1) / 32, 300), 8000, format="WAV", subtype="DOUBLE")
        with httpx.Client(base_url=lab.base, headers=lab.headers, timeout=600) as mine:
            answer = asked(mine, send(mine, f"user{number}.wav", sound.getvalue()))
        (record,) = answer["answer"]["records"]
        return record["rows"], record["channels"][0]["high"]

    with ThreadPoolExecutor(20) as users:
        waiting = [users.submit(user, number) for number in range(20)]
        meanwhile = 0
        while not all(one.done() for one in waiting):
            assert client.get("/alive").status_code == 200
            meanwhile += 1
            time.sleep(0.02)
        assert [one.result() for one in waiting] == [(300, (number + 1) / 32) for number in range(20)]
    assert meanwhile > 20  # oftener than there is work that it could have waited for


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_all_is_removed_at_the_end(number: signal.Signals) -> None:
    with running_lab() as lab:
        (place,) = Path(os.environ.get("TMPDIR", "/tmp")).glob(f"stickslip-lab-{lab.process.pid}-*")
        with httpx.Client(base_url=lab.base, headers=lab.headers, timeout=600) as client:
            send(client, "a.csv", b"a,b\n1,2\n")
        assert len(list((place / "files").iterdir())) == 1
        lab.process.send_signal(number)
        code = lab.process.wait(600)
    assert not place.exists()
    assert number != signal.SIGINT or code == 0, "Ctrl-C is how the lab is ended, and no failure"


def test_more_than_one_ctrl_c_ends_it_as_quietly() -> None:
    program = [sys.executable, "-m", "stickslip", "lab", "--no-browser", "--port", "0"]
    with subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as lab:
        assert lab.stdout is not None
        while "Ctrl-C" not in lab.stdout.readline():
            assert lab.poll() is None
        for _ in range(3):
            lab.send_signal(signal.SIGINT)
            time.sleep(0.05)
        assert lab.stdout.read().strip() == "The lab has ended."
    assert lab.returncode == 0
