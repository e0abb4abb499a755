"""What the lab understands, for machines: an OpenAPI document made of its own route table."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from starlette.routing import BaseRoute, Route

import stickslip as ss

Endpoint = TypeVar("Endpoint", bound=Callable[..., Any])
ERROR = {"type": "object", "properties": {"error": {"type": "string"}}, "required": ["error"]}
REFUSALS = {
    400: "the request is not understood, or came to another host", 401: "no token", 403: "another origin",
    404: "there is no such thing", 405: "no such method", 413: "too large", 422: "the library refuses, and says why",
}  # fmt: skip
KINDS = {"int": "integer", "float": "number"}


def described(
    summary: str,
    *,
    answer: Mapping[str, Any] | None = None,
    body: Mapping[str, Any] | None = None,
    media: str = "application/json",
    gives: str = "application/json",
    status: int = 200,
    query: Mapping[str, Mapping[str, Any]] | None = None,
) -> Callable[[Endpoint], Endpoint]:
    """Say of an endpoint what it takes and gives, as JSON schemas; what is not described is not in the document."""

    def noted(endpoint: Endpoint) -> Endpoint:
        given: dict[str, Any] = {"description": summary}
        if status != 204:
            given["content"] = {gives: {"schema": answer or {}}}
        operation: dict[str, Any] = {"summary": summary, "responses": {str(status): given}}
        schemas = (query or {}).items()
        operation["parameters"] = [{"name": name, "in": "query", "schema": schema} for name, schema in schemas]
        if body is not None:
            operation["requestBody"] = {"required": True, "content": {media: {"schema": body}}}
        endpoint.openapi = operation  # type: ignore[attr-defined]
        return endpoint

    return noted


def document(routes: Sequence[BaseRoute]) -> dict[str, Any]:
    """The OpenAPI document of the described routes."""
    paths: dict[str, dict[str, Any]] = {}
    for route in routes:
        description = getattr(route.endpoint, "openapi", None) if isinstance(route, Route) else None
        if description is None or not isinstance(route, Route):
            continue
        place = paths.setdefault(re.sub(r"{(\w+):\w+}", r"{\1}", route.path), {})
        inputs = description["parameters"] + [
            {"name": name, "in": "path", "required": True, "schema": {"type": KINDS.get(kind, "string")}}
            for name, kind in re.findall(r"{(\w+)(?::(\w+))?}", route.path)
        ]
        content = {"application/json": {"schema": ERROR}}
        refusals = {str(code): {"description": meaning, "content": content} for code, meaning in REFUSALS.items()}
        for method in sorted((route.methods or set()) - {"HEAD"}):
            responses = {**refusals, **description["responses"]}
            place[method.lower()] = {**description, "parameters": inputs, "responses": responses}
    return {
        "openapi": "3.1.0",
        "info": {"title": "stickslip lab", "version": ss.__version__},
        "components": {"securitySchemes": {"token": {"type": "http", "scheme": "bearer"}}},
        "security": [{"token": []}],
        "paths": paths,
    }
