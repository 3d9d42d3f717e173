"""Chromium without a window and without a network, as the tests of the live page use it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)

SLOW = "GPU stall due to ReadPixels"  # of WebGL in software: who takes a picture of it waits


def program() -> str | None:
    """The browser's path: $CHROMIUM, or what is on the path."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


@contextmanager
def chromium() -> Iterator[Any]:
    """A browser of playwright's; the tests that need it skip where there is none."""
    path = program()
    if path is None:
        pytest.skip("no Chromium: install it (Debian: apt-get install chromium) or set CHROMIUM")
    api = pytest.importorskip("playwright.sync_api", reason="pip install -e '.[test]'")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=list(FLAGS))
        yield browser
        browser.close()


class Page:
    """One page of a browser with the network off, in which a `script` runs first if there is one; keeps what
    went wrong."""

    def __init__(self, browser: Any, script: str = "", **options: Any) -> None:
        self.context = browser.new_context(offline=True, **options)
        if script:
            self.context.add_init_script(script)
        self.tab = self.context.new_page()
        self.size, self.scheme = self.tab.viewport_size, options.get("color_scheme", "light")
        self.tab.set_default_timeout(8000)
        self.problems: list[str] = []
        self.requests: list[str] = []
        self.tab.on(
            "console",
            lambda m: (
                self.problems.append(m.text)
                if m.type in ("error", "warning") and SLOW not in m.text
                else None
            ),
        )
        self.tab.on("pageerror", lambda error: self.problems.append(str(error)))
        self.tab.on("request", lambda request: self.requests.append(request.url))

    def goto(self, path: Any) -> None:
        """Opens a file, or an address."""
        self.tab.goto(f"file://{path}" if "://" not in str(path) else str(path))

    def clear(self) -> None:
        """As it was before it opened anything."""
        self.tab.goto("about:blank")
        self.tab.set_viewport_size(self.size)
        self.tab.emulate_media(media="screen", color_scheme=self.scheme)
        self.tab.mouse.move(0, 0)
        self.problems.clear()
        self.requests.clear()

    def run(self, settings: dict[str, Any] | None = None) -> dict[str, Any]:
        """await window.lagfmu.run(settings)"""
        found: dict[str, Any] = self.tab.evaluate("s => lagfmu.run(s)", settings or {})
        return found

    def refusal(self, settings: dict[str, Any]) -> str:
        """The message with which a run is refused."""
        script = "s => lagfmu.run(s).then(() => 'not refused', e => e.message)"
        return str(self.tab.evaluate(script, settings))

    def until(self, expression: str, seconds: float = 30.0) -> Any:
        """The expression's value once it is true.  (The page's own policy forbids playwright's waiting,
        which evaluates text in the page.)"""
        for _ in range(int(seconds / 0.05)):
            found = self.tab.evaluate(f"() => {expression}")
            if found:
                return found
            self.tab.wait_for_timeout(50)
        raise AssertionError(f"{expression} did not become true within {seconds} s")

    def slide(self, name: str, value: float) -> None:
        """Moves the slider of a parameter, start value or input, and waits for the curves."""
        before = self.until("lagfmu.runs")
        script = """([name, value]) => {
            const slider = document.querySelector(`input[data-name="${name}"]`);
            slider.value = value;
            slider.dispatchEvent(new Event("input"));
        }"""
        self.tab.evaluate(script, [name, value])
        self.until(f"lagfmu.runs > {before}")

    def violations(self) -> list[str]:
        """What axe-core finds wrong, controls below 24 pixels among it: rule and first element of each."""
        package = pytest.importorskip("axe_playwright_python", reason="pip install -e '.[test]'")
        self.tab.evaluate((files(package) / "axe.min.js").read_text(encoding="utf-8"))
        script = "() => axe.run({ rules: { 'target-size': { enabled: true } } })"
        found = self.tab.evaluate(script)["violations"]
        return [f"{v['id']}: {v['nodes'][0]['html'][:200]}" for v in found]
