"""How fast and how large are the live pages?  For each model: the page's size, the time to the first paint,
and the time from moving a slider to the new curves (median and slowest of `MOVES`), in headless Chromium.

    python benchmarks/page.py [models/NAME.py ...]
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from browser import Page, chromium

from lagfmu.studio.live.command import write_page

MOVES = 15
MODELS = Path(__file__).parent.parent / "models"


def main() -> None:
    """Prints one line a model."""
    files = [Path(a) for a in sys.argv[1:]] or sorted(MODELS.glob("*.py"))
    print(f"{'model':20} {'kB':>5} {'paint ms':>9} {'median ms':>10} {'slowest ms':>11}")
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        for file in files:
            path = write_page(file, Path(folder, f"{file.stem}.html"))
            page = Page(browser, viewport={"width": 1280, "height": 900})
            page.goto(path)
            page.until("lagfmu.runs")
            page.tab.wait_for_timeout(1500)
            script = (
                "() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0"
            )
            paint = page.tab.evaluate(script)
            name, start, step = page.tab.evaluate(
                """() => {
                    const slider = document.querySelector("#dials input[data-name]");
                    return [slider.dataset.name, Number(slider.value), Number(slider.step)];
                }"""
            )
            times = []
            for k in range(MOVES):
                page.slide(name, start + step * (1 + k % 3))
                times.append(page.tab.evaluate("() => lagfmu.latency"))
            size = path.stat().st_size / 1e3
            median, slowest = statistics.median(times), max(times)
            print(f"{file.stem:20} {size:5.0f} {paint:9.0f} {median:10.0f} {slowest:11.0f}")
            page.context.close()


if __name__ == "__main__":
    main()
