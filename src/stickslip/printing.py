"""Text from outside, made harmless to what shows it."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Sequence


def printable(text: str, *, encoding: str = "utf-8") -> str:
    r"""A text in which what can not be seen is spelled out, as JSON spells it.

    File names, headers and units of others may hold signs that steer a terminal (escape sequences, backspaces), turn
    the order of reading round (U+202E), are no text at all (bytes of a file name that are no UTF-8) or can not be
    written in `encoding`. Each becomes its number, as ``\u001b``; line ends, tabs and all that can be seen stay. What
    json.dumps gave stays JSON of the same value.

    Parameters
    ----------
    text : str
        The text.
    encoding : str
        What it is to be written in.

    Returns
    -------
    str

    Examples
    --------
    >>> print(printable("slide\x1b[31m.csv, 3 µm"))
    slide\u001b[31m.csv, 3 µm
    """
    return re.sub(r"[^\n\t -~]", lambda sign: sign[0] if _is_seen(sign[0], encoding) else _numbered(sign[0]), text)


def _is_seen(sign: str, encoding: str) -> bool:
    kind = unicodedata.category(sign)
    return kind[0] != "C" and kind not in ("Zl", "Zp") and bool(sign.encode(encoding, "ignore"))


def _numbered(sign: str) -> str:
    halves = sign.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{halves[first : first + 2].hex()}" for first in range(0, len(halves), 2))


def html_table(title: str, headings: Sequence[str], rows: Iterable[Sequence[str]], notes: Sequence[str] = ()) -> str:
    """A table as a notebook shows it: a title, rows, and notes below.

    Examples
    --------
    >>> html_table("a < b", ("name", "value"), [("mass", "2 kg")]).splitlines()[0]
    '<p><b>a &lt; b</b></p>'
    """
    from html import escape

    def cells(row: Sequence[str], tag: str) -> str:
        return "".join(f'<{tag} style="text-align: left">{escape(printable(cell))}</{tag}>' for cell in row)

    remarks = "".join(f"<p>{escape(printable(note))}</p>" for note in notes)
    body = "".join(f"<tr>{cells(row, 'td')}</tr>\n" for row in rows)
    heading = f"<p><b>{escape(printable(title))}</b></p>\n" if title else ""
    return f"{heading}<table><thead><tr>{cells(headings, 'th')}</tr></thead>\n<tbody>{body}</tbody></table>{remarks}"
