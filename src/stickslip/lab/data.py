"""What the page asks of records: files sent, questions asked in processes of their own, answers fetched.

Files are kept under names of ours in a folder of this run until they are not needed."""

from __future__ import annotations

import asyncio
import json
import os
import re
import secrets
import shutil
import stat
import tempfile
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import BaseRoute, Route

import stickslip as ss
from stickslip.lab.jobs import Job, Jobs, Limits
from stickslip.lab.openapi import described

LARGEST = 2 << 30  # bytes of one file
ALTOGETHER = 8 << 30  # bytes of all that are kept at a time
AT_ONCE = 1 << 20  # bytes written in one go, away from the event loop
UNUSED = 3600.0  # seconds after which a file that nobody asks about is removed
LONGEST_LABEL = 120
PREFIX = "stickslip-lab-"  # of a run's folder; its process comes next
LONGEST_ASK = 1 << 18  # bytes
SWEPT_EVERY = 60.0  # seconds
SCRIPTS = re.compile(r"<script\b.*?</script>", re.DOTALL)  # of our own page, whose data holds no "<"
# A report is a page of its own: it runs nothing and asks nothing of anyone.
REPORT_HEADERS = {
    "Content-Security-Policy": "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; "
    "media-src data:; font-src data:; frame-ancestors 'self'",
    "X-Frame-Options": "SAMEORIGIN",
}

Key = Annotated[str, Field(pattern=r"^[0-9a-f]{32}$")]
Text = Annotated[str, Field(max_length=400)]
Value = Text | Annotated[float, Field(allow_inf_nan=False)] | None


@dataclass(frozen=True)
class Upload:
    """A file that was sent: under which name it is kept, what its sender calls it, and how many bytes it has."""

    key: str
    label: str
    path: Path
    size: int


class Uploads:
    """The files of this run; no name that a page sends becomes a path."""

    def __init__(self, folder: Path, *, largest: int = LARGEST, altogether: int = ALTOGETHER) -> None:
        self.folder, self.largest, self.altogether = folder, largest, altogether
        self._kept: dict[str, Upload] = {}
        self._used: dict[str, float] = {}
        self._size = 0  # of what is kept, and of what is coming

    async def receive(self, chunks: AsyncIterator[bytes], *, label: str, stated: int = 0) -> Upload:
        """Write a body to disk as it comes; one that is too large ends there, and nothing of it stays."""
        key, path = self._place(label)
        self._require_room(stated, stated)
        size = 0
        try:
            with path.open("xb") as file:
                async for some in _in_pieces(chunks):
                    size += len(some)
                    self._size += len(some)
                    self._require_room(size)
                    await asyncio.to_thread(file.write, some)
            if not size:
                raise HTTPException(400, "The file is empty; a record has at least one row; choose another file.")
        except BaseException as error:
            self._size -= size
            path.unlink(missing_ok=True)
            if isinstance(error, OSError):
                raise HTTPException(
                    507, f"The file can not be kept ({error.strerror}); make room on the disk."
                ) from error
            raise
        return self._keep(Upload(key, _shown(label), path, size))

    async def write(self, writer: Callable[[Path], None], *, label: str) -> Upload:
        """Keep a file that the lab itself writes."""
        key, path = self._place(label)
        try:
            await asyncio.to_thread(writer, path)
            size = path.stat().st_size
            self._require_room(size, size)
        except BaseException:
            _remove(path)
            raise
        self._size += size
        return self._keep(Upload(key, label, path, size))

    def get(self, key: str) -> Upload:
        """The file of that key, which is then not unused."""
        if key not in self._kept:
            raise HTTPException(404, "This file is not here (any more); drop it again.")
        self._used[key] = time.monotonic()
        return self._kept[key]

    def remove(self, key: str) -> None:
        """Remove a file, at once and for good."""
        upload = self.get(key)
        del self._kept[key], self._used[key]
        self._size -= upload.size
        _remove(upload.path)

    def remove_unused(self, *, before: float) -> None:
        """Remove what nobody asked about since that time."""
        for key in [key for key, used in self._used.items() if used < before]:
            self.remove(key)

    def _place(self, label: str) -> tuple[str, Path]:
        # its own ending only helps the readers, who go by what is in it
        key, ending = secrets.token_hex(16), f".{label.rpartition('.')[2].strip().lower()}"
        ending = ending if re.fullmatch(r"\.[a-z0-9]{1,8}", ending) else ".dat"
        return key, self.folder / f"{key}{ending}"

    def _keep(self, upload: Upload) -> Upload:
        self._kept[upload.key] = upload
        self._used[upload.key] = time.monotonic()
        return upload

    def _require_room(self, size: int, more: int = 0) -> None:
        """Refuse a file of `size` bytes, `more` of which have not been counted yet."""
        if size > self.largest:
            sentence = (
                f"The file is larger than {_in_bytes(self.largest)}; the lab takes no more; use the command line."
            )
            raise HTTPException(413, sentence)
        if self._size + more > self.altogether:
            sentence = f"The files here would be larger than {_in_bytes(self.altogether)} together; remove some first."
            raise HTTPException(413, sentence)


def _remove(path: Path) -> None:
    """Remove a file, and what was written beside it."""
    for leftover in path.parent.glob(f"{path.name}*"):
        leftover.unlink(missing_ok=True)


async def _in_pieces(chunks: AsyncIterator[bytes]) -> AsyncIterator[bytes]:
    """The chunks in pieces worth a write."""
    piece = bytearray()
    while True:
        chunk = await anext(chunks, None)
        piece += chunk or b""
        if piece and (chunk is None or len(piece) >= AT_ONCE):
            yield bytes(piece)
            piece.clear()
        if chunk is None:
            return


def _shown(label: str) -> str:
    """A name as it may be shown: its last part, without signs that can not be seen."""
    name = "".join(sign for sign in label.replace("\\", "/").rpartition("/")[2] if sign.isprintable()).strip()
    return name[-LONGEST_LABEL:] or "file"


def _in_bytes(size: int) -> str:
    return f"{size / (1 << 20):g} MiB"


class Reading(BaseModel):
    """How files are read; the fields are those of :class:`~stickslip.rig.RigSettings`."""

    model_config = ConfigDict(extra="forbid")

    channels: Annotated[dict[Text, Text], Field(max_length=64)] = {}
    units: Annotated[dict[Text, Text], Field(max_length=64)] = {}
    fs: Value = None
    time: Text | None = None
    delimiter: Text | None = None
    decimal: Literal[".", ","] | None = None
    rows: Text | None = None
    repair: Annotated[list[Text], Field(max_length=16)] = []


class Options(BaseModel):
    """What a question is told."""

    model_config = ConfigDict(extra="forbid")


class Constants(Options):
    """What is known of the rig."""

    mass: Value = None
    stiffness: Value = None


class AnalyzeOptions(Constants):
    """Of all questions about friction; a normal load for each record."""

    damping: Value = None
    damper: Literal["ground", "base"] | None = None
    contact: Literal["ground", "base"] | None = None
    normal: Annotated[list[Value], Field(max_length=16)] = []
    method: Text | None = None
    twins: bool = False


class DecayOptions(Constants):
    """Of a free decay."""

    method: Literal["all", "waveform", "thesis"] | None = None
    channel: Text | None = None
    restoring: Literal["linear", "pendulum"] | None = None


class WaveletOptions(Constants):
    """Of a map over time and frequency."""

    channel: Text | None = None
    frequencies: Text | None = None
    wavelet_frequency: Annotated[float, Field(gt=0, le=1000)] | None = None
    normalisation: Literal["energy", "amplitude"] | None = None


class SqueakOptions(Options):
    """Of squeaks."""

    channel: Text | None = None
    frequencies: Text | None = None
    contact: Literal["ground", "base"] | None = None
    normal: Annotated[list[Value], Field(max_length=16)] = []
    lever: Value = None


class FitOptions(Constants):
    """Of a friction law, or a curve."""

    damping: Value = None
    damper: Literal["ground", "base"] | None = None
    contact: Literal["ground", "base"] | None = None
    laws: Text | None = None
    calibration: Annotated[float, Field(gt=0, lt=1)] | None = None
    curve: Text | None = None


OPTIONS: dict[str, type[Options]] = {
    "describe": Options, "analyze": AnalyzeOptions, "decay": DecayOptions, "wavelet": WaveletOptions,
    "squeak": SqueakOptions, "fit": FitOptions,
}  # fmt: skip


class Ask(BaseModel):
    """A question: of which records, each some files; how they are read; what else is told."""

    model_config = ConfigDict(extra="forbid")

    question: Literal["describe", "analyze", "decay", "wavelet", "squeak", "fit"]
    records: Annotated[
        list[Annotated[list[Key], Field(min_length=1, max_length=8)]], Field(min_length=1, max_length=16)
    ]
    reading: Reading = Reading()
    options: dict[str, Any] = {}


def schema_of(model: type[BaseModel]) -> dict[str, Any]:
    """The JSON schema of a model, whole: what it refers to is written out."""
    schema = model.model_json_schema()
    parts = schema.pop("$defs", {})

    def whole(node: Any) -> Any:
        if isinstance(node, dict):
            part = node.get("$ref")
            return whole(parts[part.rpartition("/")[2]]) if part else {k: whole(v) for k, v in node.items()}
        return [whole(item) for item in node] if isinstance(node, list) else node

    written: dict[str, Any] = whole(schema)
    return written


def object_of(**properties: str) -> dict[str, Any]:
    """The JSON schema of an object that has all of these."""
    kinds = {name: {"type": kind} for name, kind in properties.items()}
    return {"type": "object", "required": list(properties), "properties": kinds}


FILE = object_of(id="string", name="string", size="integer")
STATUS = object_of(state="string", words="string", share="number", message="string")


@dataclass(frozen=True)
class Data:
    """The files and the analyses of this run of the lab, in a folder of its own."""

    folder: Path
    uploads: Uploads
    jobs: Jobs


@asynccontextmanager
async def open_data(limits: Limits | None = None, **sizes: int) -> AsyncIterator[Data]:
    """The files and analyses of one run; all of it is stopped and removed at the end."""
    remove_left()
    with tempfile.TemporaryDirectory(prefix=f"{PREFIX}{os.getpid()}-", ignore_cleanup_errors=True) as place:
        folders = Path(place, "files"), Path(place, "analyses")
        for folder in folders:
            folder.mkdir(mode=0o700)
        data = Data(Path(place), Uploads(folders[0], **sizes), Jobs(folders[1], limits))
        sweeping = asyncio.create_task(_sweep(data))
        try:
            yield data
        finally:
            sweeping.cancel()
            await asyncio.gather(sweeping, return_exceptions=True)
            await data.jobs.close()


def remove_left() -> None:
    """Remove the folders of labs that were killed: those of ours whose process is gone."""
    if not hasattr(os, "getuid"):  # Windows, where asking whether a process is there would end it
        return
    for place in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        number = place.name.removeprefix(PREFIX).partition("-")[0]
        with suppress(OSError):
            state = place.lstat()
            if number.isdigit() and stat.S_ISDIR(state.st_mode) and state.st_uid == os.getuid() and _gone(int(number)):
                shutil.rmtree(place)


def _gone(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (PermissionError, OverflowError):
        return False
    return False


@asynccontextmanager
async def lifespan(app: Starlette) -> AsyncIterator[None]:
    """The files and analyses of an app, from its start to its end."""
    async with open_data() as data:
        app.state.data = data
        yield


async def _sweep(data: Data) -> None:
    """Remove what nobody has asked about for long."""
    while True:
        await asyncio.sleep(SWEPT_EVERY)
        before = time.monotonic() - UNUSED
        data.uploads.remove_unused(before=before)
        await data.jobs.remove_ended(before=before)


def _of(request: Request) -> Data:
    data: Data = request.app.state.data
    return data


@described(
    "Keep a file",
    query={"name": {"type": "string"}},
    body={"type": "string", "format": "binary"},
    media="application/octet-stream",
    answer=FILE,
    status=201,
)
async def send_file(request: Request) -> Response:
    """Keep a file; its own name is a label."""
    stated = request.headers.get("content-length", "")
    upload = await _of(request).uploads.receive(
        request.stream(),
        label=request.query_params.get("name", ""),
        stated=int(stated) if stated.isascii() and stated.isdigit() else 0,
    )
    return JSONResponse({"id": upload.key, "name": upload.label, "size": upload.size}, status_code=201)


@described("Keep the bundled record as if it had been sent", answer=FILE, status=201)
async def example(request: Request) -> Response:
    """Keep the bundled record, as if it had been sent."""
    upload = await _of(request).uploads.write(_example, label="example.csv")
    return JSONResponse({"id": upload.key, "name": upload.label, "size": upload.size}, status_code=201)


def _example(path: Path) -> None:
    ss.write_record(ss.datasets.demo(), path)


@described("Remove a file", status=204)
async def remove_file(request: Request) -> Response:
    """Remove a file."""
    _of(request).uploads.remove(request.path_params["key"])
    return Response(status_code=204)


@described("How large a file may be", answer=object_of(largest="integer"))
async def limits(request: Request) -> Response:
    """How large a file may be."""
    return JSONResponse({"largest": _of(request).uploads.largest})


@described("Start an analysis", body=schema_of(Ask), answer=object_of(id="string"), status=202)
async def ask(request: Request) -> Response:
    """Start an analysis."""
    request_of = _question_of(await _body(request))
    data = _of(request)
    files = [[data.uploads.get(key) for key in record] for record in request_of.records]
    names = {upload.path.name: upload.label for record in files for upload in record}
    question = {
        "question": request_of.question,
        "reading": request_of.reading.model_dump(exclude_defaults=True),
        "options": request_of.options,
        "records": [[str(upload.path) for upload in record] for record in files],
    }
    return JSONResponse({"id": data.jobs.start(question, names=names).key}, status_code=202)


async def _body(request: Request) -> bytes:
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > LONGEST_ASK:
            raise HTTPException(413, f"The question is longer than {LONGEST_ASK} bytes; state fewer channels.")
    return bytes(body)


def _question_of(body: bytes) -> Ask:
    try:
        question = Ask.model_validate_json(body)
        options = OPTIONS[question.question].model_validate(question.options).model_dump(exclude_defaults=True)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"]) or "the question"
        raise HTTPException(422, f"{place} can not be understood ({first['msg']}); correct it.") from error
    return question.model_copy(update={"options": options})


@described("Where an analysis stands, with its answer when it is done", answer=STATUS)
async def status(request: Request) -> Response:
    """Where an analysis stands, with its answer when it is done."""
    job = _job(request)
    return JSONResponse({**job.report(), "answer": job.answer})


@described("Where an analysis stands, at each change", gives="text/event-stream")
async def events(request: Request) -> Response:
    """Where an analysis stands, told at each change (server-sent events)."""
    job, jobs = _job(request), _of(request).jobs

    async def lines() -> AsyncIterator[str]:
        async for state in jobs.watch(job):
            yield ": still here\n\n" if state is None else f"data: {json.dumps(state)}\n\n"

    return StreamingResponse(lines(), media_type="text/event-stream", headers={"Cache-Control": "no-store"})


@described("Stop an analysis, or remove its answer", answer=STATUS)
async def cancel(request: Request) -> Response:
    """Stop an analysis, or remove its answer."""
    job = _job(request)
    await _of(request).jobs.cancel(job)
    return JSONResponse(job.report())


@described("The report of an analysis", gives="text/html")
async def report(request: Request) -> Response:
    """The report of an analysis: to look at, as it is without scripts, or with ?keep=1 to keep."""
    page = _kept(_job(request), Path("results", "report.html"))
    if request.query_params.get("keep"):
        return FileResponse(page, media_type="text/html", filename="report.html", headers=REPORT_HEADERS)
    still = SCRIPTS.sub("", await asyncio.to_thread(page.read_text, "utf-8"))
    return HTMLResponse(still, headers=REPORT_HEADERS)


@described("The numbers of an analysis", answer={"type": "object"})
async def results(request: Request) -> Response:
    """The numbers of an analysis, to keep."""
    path = _kept(_job(request), Path("results", "results.json"))
    return FileResponse(path, media_type="application/json", filename="results.json")


@described("All that an analysis wrote", gives="application/zip")
async def folder(request: Request) -> Response:
    """All that an analysis wrote, as one ZIP file."""
    return FileResponse(_kept(_job(request), Path("results.zip")), media_type="application/zip", filename="results.zip")


def _job(request: Request) -> Job:
    return _of(request).jobs.get(request.path_params["key"])


def _kept(job: Job, path: Path) -> Path:
    """A file that a finished analysis left, if it is one of its own."""
    file = job.folder / path
    whole = job.state == "done" and file.is_file() and file.resolve() == job.folder.resolve() / path
    if not whole:
        raise HTTPException(404, "The analysis left nothing of that kind; see whether it is done.")
    return file


routes: list[BaseRoute] = [
    Route("/files", send_file, methods=["POST"]),
    Route("/files", limits, methods=["GET"]),
    Route("/files/example", example, methods=["POST"]),
    Route("/files/{key}", remove_file, methods=["DELETE"]),
    Route("/jobs", ask, methods=["POST"]),
    Route("/jobs/{key}", status, methods=["GET"]),
    Route("/jobs/{key}", cancel, methods=["DELETE"]),
    Route("/jobs/{key}/events", events, methods=["GET"]),
    Route("/jobs/{key}/results.zip", folder, methods=["GET"]),
    Route("/jobs/{key}/results.json", results, methods=["GET"]),
    Route("/jobs/{key}/report", report, methods=["GET"]),
]
