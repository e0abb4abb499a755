"""The record sets: what is stated of each, and that only the very files that were referenced get through."""

from __future__ import annotations

import gc
import hashlib
import threading
import warnings
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pooch
import pytest

from stickslip import datasets
from stickslip.datasets import SetFile, Source
from stickslip.errors import RecordError

CONTENT = b"t,x\n0,1\n1,2\n"
SHA256 = hashlib.sha256(CONTENT).hexdigest()


class QuietHandler(SimpleHTTPRequestHandler):
    def log_message(self, *args: object) -> None:
        """Keep the test's output clean."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    folder = tmp_path / "served"
    folder.mkdir()
    (folder / "rig 1.csv").write_bytes(CONTENT)
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(QuietHandler, directory=str(folder))) as http:
        thread = threading.Thread(target=http.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{http.server_port}"
        http.shutdown()
        thread.join()


@pytest.fixture
def fetching(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """A catalogue with one set of one file, an empty cache, and no local folder."""
    monkeypatch.delenv(datasets.FOLDER_VARIABLE, raising=False)
    monkeypatch.setattr(pooch, "os_cache", lambda project: tmp_path / "cache" / project)
    pooch.get_logger().setLevel("WARNING")

    def offer(url: str, *, sha256: str = SHA256, licence: str = "CC0 1.0") -> None:
        source = Source(
            "rig", "one rig", "https://rig.example", licence, "A. Rig (2024)", {"r.csv": SetFile(sha256, url)}
        )
        monkeypatch.setattr(datasets, "_catalogue", lambda: {"rig": source})

    yield offer
    with warnings.catch_warnings():  # pooch leaves the connection of a refused request to the garbage collector
        warnings.simplefilter("ignore", ResourceWarning)
        gc.collect()


def test_every_set_states_where_it_is_from_and_what_it_may_be_used_for() -> None:
    for name in datasets.names():
        source = datasets.info(name)
        assert source.title
        assert source.citation
        assert source.address.startswith("https://")
        assert all(len(file.sha256) == 64 for file in source.files.values())
        addresses = [file.url for file in source.files.values() if file.url]
        assert bool(addresses) == source.fetchable, f"{name}: fetched if and only if a licence is stated"
        assert all(url.startswith("https://raw.githubusercontent.com/") for url in addresses)


def test_sets_without_a_licence_are_known_but_not_fetched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(datasets.FOLDER_VARIABLE, raising=False)
    with pytest.raises(RecordError, match=r"emps is not fetched.*no licence.*github\.com/forgi86"):
        datasets.fetch("emps")


def test_an_unknown_name_lists_the_choices() -> None:
    with pytest.raises(RecordError, match=r"'frame'.*frame_base_excited"):
        datasets.fetch("frame")
    with pytest.raises(RecordError, match=r"no file 'x'.*DATA_EMPS"):
        datasets.fetch("emps", files=["x"])


def test_fetch_shows_licence_and_citation_once_and_keeps_the_file(fetching, server, capsys) -> None:
    fetching(f"{server}/rig%201.csv")
    found = datasets.fetch("rig")
    shown = capsys.readouterr().err
    assert "CC0 1.0" in shown
    assert "A. Rig (2024)" in shown
    assert "https://rig.example" in shown
    assert [path.read_bytes() for path in found.files] == [CONTENT]
    assert (found.licence, found.citation, found.address) == ("CC0 1.0", "A. Rig (2024)", "https://rig.example")
    fetching("http://127.0.0.1:9/gone.csv")  # the cache answers
    assert datasets.fetch("rig").files == found.files
    assert capsys.readouterr().err == ""


def test_a_wrong_checksum_is_refused_and_leaves_nothing(fetching, server, tmp_path) -> None:
    fetching(f"{server}/rig%201.csv", sha256="0" * 64)
    with pytest.raises(RecordError, match="does not have the sha256 000000000000"):
        datasets.fetch("rig")
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]


@pytest.mark.parametrize("path", ["http://127.0.0.1:9/r.csv", "SERVER/absent.csv"], ids=["offline", "not found"])
def test_no_network_ends_in_one_sentence(fetching, server, path) -> None:
    fetching(path.replace("SERVER", server))
    with pytest.raises(RecordError, match="could not be fetched") as refused:
        datasets.fetch("rig")
    assert "\n" not in str(refused.value)
    assert datasets.FOLDER_VARIABLE in str(refused.value)


def test_the_local_folder_is_checked_too(fetching, tmp_path, monkeypatch) -> None:
    fetching("http://127.0.0.1:9/r.csv", licence="")
    monkeypatch.setenv(datasets.FOLDER_VARIABLE, str(tmp_path))
    with pytest.raises(RecordError, match=r"r\.csv is not there"):
        datasets.fetch("rig")
    file = tmp_path / "rig" / "r.csv"
    file.parent.mkdir()
    file.write_bytes(CONTENT)
    assert datasets.fetch("rig").files == (file,)
    file.write_bytes(CONTENT + b"2,3\n")
    with pytest.raises(RecordError, match="does not have the sha256"):
        datasets.fetch("rig")


def test_the_sets_here_are_whole(dataset) -> None:
    for name in datasets.names():
        folder = dataset(name)
        assert {path.name for path in folder.iterdir()} == set(datasets.info(name).files)
