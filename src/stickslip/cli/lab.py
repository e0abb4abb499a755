"""stickslip lab"""

from __future__ import annotations

import secrets
import webbrowser
from collections.abc import Callable
from pathlib import Path

import click

from stickslip.cli.terminal import say

PORT = 8723


@click.command()
@click.option(
    "--port", type=click.IntRange(0, 65535), default=PORT, show_default=True, help="Where it listens; 0: any."
)
@click.option(
    "--config", type=click.Path(path_type=Path), metavar="RIG.TOML", help="The rig whose devices are watched."
)
@click.option(
    "--records", type=click.Path(path_type=Path, file_okay=False, exists=True), metavar="DIR",
    help="Where the live view records; the current folder unless given.",
)  # fmt: skip
@click.option("--no-browser", is_flag=True, help="Print the address alone; open no browser.")
def lab(port: int, config: Path | None, records: Path | None, no_browser: bool) -> None:
    """Open the lab in the browser: play with a contact, map its regimes, ask records, watch a rig as it is measured.

    It runs on this machine alone, for whoever has the address that it prints; nothing leaves the machine. Ctrl-C ends
    it.

    \b
    stickslip lab
    stickslip lab --port 9000 --no-browser
    """
    from stickslip.lab import serving  # the server is imported where it is wanted

    with serving.listening(port) as door:
        token = secrets.token_urlsafe(24)
        address = f"http://127.0.0.1:{door.getsockname()[1]}/?token={token}"

        def opened(doorway: Callable[[str], Path]) -> None:
            say(f"The lab is open at {address}\nCtrl-C ends it.")
            if not no_browser:
                webbrowser.open(doorway(address).as_uri())

        try:
            serving.serve(door, token=token, opened=opened, rig=config, records=records)
        except KeyboardInterrupt:  # the server has shut down by then, and hands the signal on
            say("The lab has ended.")
