"""How soon is the lab there, how much does its page weigh, and how soon after a slider's event are the traces redrawn?

    python benchmarks/lab.py [--events 200]

In headless Chromium with the exact engine: 40 cycles of stick-slip, four traces. The time runs from the slider's input
event to the end of drawing (`drawn`), and to the frame after, in which it is seen (`seen`).
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

STATE = {
    "system": {"mass": 2.42, "stiffness": 2310.0},
    "law": {"name": "Coulomb", "kinetic": 1.1},
    "drive": {"name": "HarmonicBase", "amplitude": 0.00065, "frequency": 2.5},
    "run": {"cycles": 40},
}
SLIDE = """async ([count, gap]) => {
  const slider = document.querySelector('input[type=range][aria-label="kinetic friction, slider"]');
  const drawn = [], seen = [];
  for (let k = 0; k < count; k++) {
    const took = await new Promise((done) => {
      document.addEventListener("traces-drawn", (event) => {
        const begun = performance.now() - event.detail.took;
        requestAnimationFrame(() => { const shown = new MessageChannel();
          shown.port1.onmessage = () => done([event.detail.took, performance.now() - begun]);
          shown.port2.postMessage(0); });
      }, { once: true });
      slider.value = 400 + ((k * 37) % 200);
      slider.dispatchEvent(new Event("input", { bubbles: true }));
    });
    drawn.push(took[0]); seen.push(took[1]);
    await new Promise((go) => setTimeout(go, gap));
  }
  return { drawn, seen };
}"""
WEIGHT = """() => ["resource", "navigation"].flatMap((kind) => performance.getEntriesByType(kind))
  .map((each) => [each.name, each.encodedBodySize])"""


@contextmanager
def lab() -> Iterator[tuple[str, float]]:
    """A lab of its own: its address, and the seconds until it answered."""
    begun = time.perf_counter()
    command = [sys.executable, "-m", "stickslip", "lab", "--port", "0", "--no-browser"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})
    assert server.stdout is not None
    try:
        address = server.stdout.readline().split()[-1]
        home, _, token = address.partition("/?token=")
        asked = urllib.request.Request(f"{home}/alive", headers={"Authorization": f"Bearer {token}"})
        urllib.request.urlopen(asked, timeout=10).read()
        yield address, time.perf_counter() - begun
    finally:
        server.terminate()
        server.wait()


def measured(address: str, *, events: int, gap: int) -> dict[str, Any]:
    """What a browser finds at the address."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or "/usr/bin/chromium"
    with sync_playwright() as play, play.chromium.launch(executable_path=chromium, args=["--no-sandbox"]) as browser:
        page = browser.new_page(viewport={"width": 1360, "height": 900})
        page.add_init_script(
            "document.addEventListener('traces-drawn', () => { window.ready ??= performance.now(); }, true);"
        )
        page.goto(address)
        page.wait_for_function("() => window.ready")
        ready = page.evaluate("() => window.ready") / 1000
        weight = sum(size for _, size in page.evaluate(WEIGHT))
        page.evaluate("(state) => import('./lab.js').then((page) => page.lab.openInPlay(state))", STATE)
        page.wait_for_timeout(2500)
        found = page.evaluate(SLIDE, [events, gap])
    return {"ready [s]": ready, "page [KB]": weight / 1000, **found}


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--events", type=int, default=200)
    parser.add_argument("--gap", type=int, default=30, help="ms between a redrawn trace and the next event")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    with lab() as (address, up):
        record = measured(address, events=options.events, gap=options.gap)
    result = {"server up [s]": up, "page ready [s]": record["ready [s]"], "page [KB]": record["page [KB]"]}
    for name in ("drawn", "seen"):
        for share in (50, 95):
            result[f"slider to {name}, {share}th percentile [ms]"] = float(np.percentile(record[name], share))
    print(
        json.dumps(result) if options.json else "\n".join(f"{name:45s} {value:8.3g}" for name, value in result.items())
    )


if __name__ == "__main__":
    main()
