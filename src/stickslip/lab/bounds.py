"""What a process of the lab may take."""

from __future__ import annotations

from contextlib import suppress


def bound(**most: int) -> None:
    """Bound this process, by the names of `resource`: ``RLIMIT_AS`` in bytes, ``RLIMIT_CPU`` in s of processor time.

    Where the system has no such limit (Windows), or refuses it (macOS, of memory), the time that is given for an answer
    is the only bound.
    """
    try:
        import resource
    except ImportError:
        return
    for name, value in most.items():
        what = getattr(resource, name, None)
        if what is None:
            continue
        hard = resource.getrlimit(what)[1]
        with suppress(ValueError, OSError):
            resource.setrlimit(what, (value if hard < 0 else min(value, hard), hard))
