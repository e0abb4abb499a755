"""The lab's door: who may speak with it, what it answers, and that nothing said to it ends it."""

from __future__ import annotations

import json
import re
import threading
from collections.abc import Iterator
from email.message import Message
from http.cookiejar import CookieJar
from http.server import BaseHTTPRequestHandler, HTTPServer
from types import SimpleNamespace
from typing import Any
from urllib.request import HTTPCookieProcessor, Request, build_opener

import pytest

starlette = pytest.importorskip("starlette", reason="the extra [lab] is not installed")
from starlette.testclient import TestClient  # noqa: E402
from starlette.websockets import WebSocketDisconnect  # noqa: E402

import stickslip as ss  # noqa: E402
from labs import received  # noqa: E402
from stickslip.lab.server import lab_app  # noqa: E402

COMPLIANT = ss.systems.scenario_case("THESIS compliant 2.5Hz fk=1.1 Ky=192000 z.0174(k+Ky)").lasting(cycles=40)
STATE = json.loads(ss.systems.export_system(COMPLIANT, format="json"))
TOKEN, PORT = "a-token", 8723
HOME = f"http://127.0.0.1:{PORT}"
BEARER = {"authorization": f"Bearer {TOKEN}"}


@pytest.fixture(scope="module")
def client() -> Iterator[TestClient]:
    with TestClient(lab_app(token=TOKEN, port=PORT), base_url=HOME, raise_server_exceptions=False) as found:
        yield found


def test_the_address_with_its_token_is_exchanged_for_a_cookie(client: TestClient) -> None:
    answer = client.get(f"/?token={TOKEN}", follow_redirects=False)
    inside = answer.headers["location"]
    assert answer.status_code == 303
    assert re.fullmatch(r"/[\w-]{22}/", inside)
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=lax" in cookie
    assert f"path={inside.lower()}" in cookie
    for address in (inside, f"{inside}alive"):
        assert client.get(address).status_code == 200
    assert "stickslip lab" in client.get(inside).text
    assert client.get("/", headers={"cookie": answer.headers["set-cookie"]}).status_code == 401
    client.cookies.clear()
    assert client.get(inside).status_code == 401


def test_a_browser_without_the_secret_path_is_told_and_led_to_where_it_knows(client: TestClient) -> None:
    answer = client.get("/", headers={"accept": "text/html,*/*"})
    assert answer.status_code == 401
    assert '<script src="/enter.js">' in answer.text
    assert "script-src 'self'" in answer.headers["content-security-policy"]
    assert "location.replace" in client.get("/enter.js").text
    assert client.get("/enter.js", headers={"host": "evil.example"}).status_code == 400


def test_another_port_of_this_host_gets_no_cookie_of_the_lab(client: TestClient) -> None:
    """A browser sends a cookie to every port of its host: ours is for a path that no other program knows."""
    jar = CookieJar()
    with HTTPServer(("127.0.0.1", 0), Listener) as other:
        answering = threading.Thread(target=other.serve_forever)
        answering.start()
        try:
            said = client.get(f"/?token={TOKEN}", follow_redirects=False).headers["set-cookie"]
            message = Message()
            message["Set-Cookie"] = said
            jar.extract_cookies(SimpleNamespace(info=lambda: message), Request(f"{HOME}/?token={TOKEN}"))
            assert len(jar) == 1
            browser = build_opener(HTTPCookieProcessor(jar))
            for path in ("/", "/files", "/play", "/?token=guess"):
                with browser.open(f"http://127.0.0.1:{other.server_port}{path}") as answer:
                    assert answer.read() == b"None"
        finally:
            other.shutdown()
            answering.join()


class Listener(BaseHTTPRequestHandler):
    """Another program on this machine, which says what cookie it got."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(str(self.headers.get("cookie")).encode())

    def log_message(self, *_: Any) -> None:
        """Nothing."""


@pytest.mark.parametrize("foreign", ['a={"x": 1}; ', "foo; ", "a[b]=1; "])
def test_cookies_of_other_programs_on_this_machine_lock_nobody_out(client: TestClient, foreign: str) -> None:
    inside = client.get(f"/?token={TOKEN}", follow_redirects=False).headers["location"]
    client.cookies.clear()
    assert client.get(f"{inside}alive", headers={"cookie": f"{foreign}stickslip-{PORT}={TOKEN}"}).status_code == 200


@pytest.mark.parametrize("path", ["/", "/alive", "/catalog", "/lab.js", "/openapi.json", "/nothing"])
def test_who_does_not_know_the_token_gets_one_sentence(client: TestClient, path: str) -> None:
    for headers in ({}, {"authorization": "Bearer guess"}, {"cookie": f"stickslip-{PORT}=guess"}):
        answer = client.get(path, headers=headers)
        assert answer.status_code == 401
        assert answer.json()["error"].endswith(".")


@pytest.mark.parametrize(
    "host", ["evil.example", f"evil.example:{PORT}", "127.0.0.1", "127.0.0.1:80", "[::1]:8723", ""]
)
def test_a_foreign_host_is_refused(client: TestClient, host: str) -> None:
    assert client.get("/alive", headers={**BEARER, "host": host}).status_code == 400


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:8723", "http://127.0.0.1:1"])
def test_a_foreign_origin_is_refused(client: TestClient, origin: str) -> None:
    assert client.post("/export", headers={**BEARER, "origin": origin}, json=STATE).status_code == 403
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(f"ws://127.0.0.1:{PORT}/play", headers={**BEARER, "origin": origin}),
    ):
        pass


@pytest.mark.parametrize("headers", [{}, {"authorization": "Bearer guess"}, {**BEARER, "host": "evil.example"}])
@pytest.mark.parametrize("path", ["/play", "/map"])
def test_a_socket_opens_for_the_page_alone(client: TestClient, path: str, headers: dict[str, str]) -> None:
    with (
        pytest.raises(WebSocketDisconnect),
        client.websocket_connect(f"ws://127.0.0.1:{PORT}{path}", headers=headers),
    ):
        pass


def test_the_page_may_load_and_reach_nothing_but_the_lab(client: TestClient) -> None:
    for path in ("/", "/alive", "/nothing", "/play.js"):
        headers = client.get(path, headers=BEARER).headers
        policy = dict(part.strip().split(" ", 1) for part in headers["content-security-policy"].split(";"))
        assert policy["default-src"] == "'none'"
        assert policy["script-src"] == policy["style-src"] == "'self'"
        assert policy["frame-ancestors"] == "'none'"
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["cache-control"] == "no-store"


def test_the_page_names_no_address_but_its_own(client: TestClient) -> None:
    for path in (
        "/",
        "/lab.css",
        "/lab.js",
        "/play.js",
        "/map.js",
        "/controls.js",
        "/stage.js",
        "/canvas.js",
        "/socket.js",
    ):
        text = client.get(path, headers=BEARER).text
        assert "https://" not in text
        assert "http://" not in text
        assert "innerHTML =" not in text or path == "/map.js"  # a constant form; what is told is set as text


def test_what_is_too_large_is_refused_while_it_streams(client: TestClient) -> None:
    def endless() -> Iterator[bytes]:
        for _ in range(40):
            yield b"x" * 100_000

    answer = client.post("/open", headers=BEARER, content=endless())
    assert answer.status_code == 413
    assert "1 MB" in answer.json()["error"]


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("GET", "/nothing", None, 404),
        ("GET", "/../../etc/passwd", None, 404),
        ("GET", "/%2e%2e/server.py", None, 404),
        ("DELETE", "/alive", None, 405),
        ("GET", "/scenarios/nope", None, 422),
        ("POST", "/export", b"{", 400),
        ("POST", "/export", b"[" * 100_000, 400),
        ("POST", "/export", b"[]", 422),
        ("POST", "/export", b"{}", 422),
        ("POST", "/open", b"\xff\xfe", 422),
        ("POST", "/open", b"a = .3", 422),
    ],
)
def test_what_has_no_answer_gets_one_sentence(
    client: TestClient, method: str, path: str, body: Any, status: int
) -> None:
    answer = client.request(method, path, headers=BEARER, content=body)
    assert answer.status_code == status
    assert answer.json()["error"].endswith(".")


def test_what_is_understood_stands_in_the_openapi_document(client: TestClient) -> None:
    document = client.get("/openapi.json", headers=BEARER).json()
    assert document["openapi"].startswith("3.1")
    assert {"/catalog", "/export", "/open", "/scenarios/{name}"} <= set(document["paths"])
    assert document["paths"]["/scenarios/{name}"]["get"]["parameters"][0]["in"] == "path"


def test_the_catalog_offers_every_law_drive_and_scenario(client: TestClient) -> None:
    catalog = client.get("/catalog", headers=BEARER).json()
    assert set(catalog["laws"]) == set(ss.scenarios.LAWS)
    assert set(catalog["drives"]) == set(ss.scenarios.DRIVES)
    presets = client.get("/scenarios", headers=BEARER).json()["presets"]
    assert [name for preset in presets for name in preset["names"]] == list(ss.scenarios.names())
    told = [each["about"] for kind in ("laws", "drives") for each in catalog[kind].values()]
    assert not [words for words in told if "\\" in words or ":math:" in words or "`" in words]


@pytest.mark.parametrize("kind", ["laws", "drives"])
def test_each_parameter_is_offered_in_the_unit_that_a_file_takes(client: TestClient, kind: str) -> None:
    """The unit that the page shows is one that the library reads for that parameter."""
    for name, part in client.get("/catalog", headers=BEARER).json()[kind].items():
        for each in part["parameters"]:
            if "unit" not in each or "default" in each or each["unit"] == "m or N":
                continue
            table = {"name": name, each["name"]: f"1 {each['unit']}"}
            state = {**STATE, "law" if kind == "laws" else "drive": table}
            refused = client.post("/export", headers=BEARER, json=state).json().get("error", "")
            assert "measured in" not in refused, (name, each, refused)


@pytest.mark.parametrize(
    "message", ["", "rubbish", "[]", "{}", '{"want": "run"}', '{"want": "rm", "id": 1}', "[" * 9999, b"\x00\xff"]
)
@pytest.mark.parametrize("path", ["/play", "/map"])
def test_a_socket_survives_what_it_does_not_understand(client: TestClient, path: str, message: str | bytes) -> None:
    with client.websocket_connect(f"ws://127.0.0.1:{PORT}{path}", headers=BEARER) as socket:
        (socket.send_text if isinstance(message, str) else socket.send_bytes)(message)  # type: ignore[arg-type]
        header, _ = received(socket)
        assert header["kind"] == "error"
        assert header["error"].endswith(".")
        if path == "/play":
            socket.send_text(json.dumps({"id": 2, "want": "run", "state": STATE}))
            assert received(socket)[0]["kind"] == "run"
