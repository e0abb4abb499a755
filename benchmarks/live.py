"""How long from a sample to the screen in the live view, at 4 channels and 20 kHz?

``python benchmarks/live.py [SECONDS]`` watches a virtual rig in headless Chromium. The time runs from the oldest sample
of what is drawn anew to the frame after the one in which it was drawn, when it has been painted, by the clock that both
programs share.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

KEEP = """window.late = [];
document.addEventListener('live-drawn', (event) => {
  const drawn = performance.now();
  requestAnimationFrame(() => window.late.push(event.detail + performance.now() - drawn));
});"""


def until(page: Any, what: str, seconds: float = 120.0) -> None:
    """Wait for something to be so on the page, whose policy takes no code for its own waiting."""
    end = time.monotonic() + seconds
    while not page.evaluate(what):
        if time.monotonic() > end:
            raise SystemExit(f"after {seconds:g} s not so: {what}")
        time.sleep(0.1)


def measured(address: str, seconds: float) -> Any:
    """Milliseconds of each drawing."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or "/usr/bin/chromium"
    with sync_playwright() as play, play.chromium.launch(executable_path=chromium, args=["--no-sandbox"]) as browser:
        page = browser.new_page(viewport={"width": 1360, "height": 1000})
        page.add_init_script(KEEP)
        page.goto(address)
        page.click("#tab-live")
        until(page, "document.querySelectorAll('#live-device option').length > 0")
        page.click("#live-open")
        until(page, "window.late.length > 20")
        page.evaluate("window.late = []")
        time.sleep(seconds)
        return np.array(page.evaluate("window.late"))


def main(seconds: float) -> None:
    """Start a lab, watch, and tell."""
    with tempfile.TemporaryDirectory() as folder:
        rig = Path(folder, "rig.toml")
        rig.write_text('[devices.rig]\nkind = "sim"\nfs = 20000\n')
        command = [sys.executable, "-m", "stickslip", "lab", "--port", "0", "--no-browser", "--config", str(rig)]
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        assert server.stdout is not None
        try:
            late = measured(server.stdout.readline().split()[-1], seconds)
        finally:
            server.terminate()
            server.wait()
    low, high = np.percentile(late, [50, 95])
    print(f"{len(late)} drawings in {seconds:g} s: median {low:.0f} ms, 95 % within {high:.0f} ms")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0)
