"""Sphinx extension: equations as MathML, and no page that would load anything from a network."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx

# What a browser fetches by itself; the target of a link waits for a click.
LOADED = re.compile(
    r"<(?:script|img|iframe|audio|video|source|embed)\b[^>]*\bsrc=[\"']?(?P<src>(?:https?:)?//[^\"'\s>]+)"
    r"|<link\b(?=[^>]*\brel=[\"']?(?:stylesheet|preload|icon|shortcut|modulepreload|preconnect))"
    r"[^>]*\bhref=[\"']?(?P<href>(?:https?:)?//[^\"'\s>]+)"
    r"|(?:@import\s+|url\()[\"']?(?P<css>(?:https?:)?//[^\"'\s)]+)",
    re.IGNORECASE,
)


def loaded_from_network(text: str) -> list[str]:
    """The addresses that a page or a style sheet would load by itself."""
    return [next(filter(None, found.groups())) for found in LOADED.finditer(text)]


def _check(app: Sphinx, failure: Exception | None) -> None:
    from sphinx.errors import ExtensionError

    if failure or app.builder.format != "html":
        return
    for path in sorted(Path(app.outdir).rglob("*")):
        for address in loaded_from_network(path.read_text("utf-8")) if path.suffix in (".html", ".css") else ():
            raise ExtensionError(f"{path.relative_to(app.outdir)} loads {address}: the pages have to work offline")


def _inline(translator: Any, node: nodes.math) -> None:
    _append(translator, node, "{}")


def _display(translator: Any, node: nodes.math_block) -> None:
    _append(translator, node, '<div class="equation">{}</div>\n', display="block")


def _append(translator: Any, node: nodes.Element, frame: str, **how: str) -> None:
    from docutils.nodes import SkipNode
    from latex2mathml.converter import convert

    translator.body.append(frame.format(convert(node.astext(), **how)))
    raise SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """What Sphinx calls."""
    app.add_html_math_renderer("mathml", (_inline, None), (_display, None))
    app.connect("build-finished", _check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
