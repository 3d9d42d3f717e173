"""Firefox without a window, driven by its own protocol, WebDriver BiDi (w3c.github.io/webdriver-bidi)."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest


@contextmanager
def firefox() -> Iterator[Tab]:
    """A tab of Firefox; the tests that need it skip where there is none."""
    path = os.environ.get("FIREFOX") or shutil.which("firefox") or shutil.which("firefox-esr")
    if path is None:
        pytest.skip("no Firefox: install it (Debian: apt-get install firefox-esr) or set FIREFOX")
    client = pytest.importorskip("websockets.sync.client", reason="pip install -e '.[test]'")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        command = [path, "--headless", "--remote-debugging-port=0", "--profile", profile]
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        try:
            with client.connect(f"{_address(process)}/session", max_size=None) as socket:
                yield Tab(socket)
        finally:
            process.terminate()
            process.wait(30)


def _address(process: Any) -> str:
    for line in process.stderr:
        found = re.search(r"BiDi listening on (\S+)", line)
        if found:
            return found[1]
    raise AssertionError("Firefox ended before it listened")


class Tab:
    """One tab; `problems` are what the console called errors."""

    def __init__(self, socket: Any) -> None:
        self.socket, self.number = socket, itertools.count(1)
        self.problems: list[str] = []
        self._ask("session.new", {"capabilities": {}})
        self._ask("session.subscribe", {"events": ["log.entryAdded"]})
        self.context = self._ask("browsingContext.getTree", {})["contexts"][0]["context"]

    def open(self, path: Any) -> None:
        """Opens a file from disk."""
        where = {"context": self.context, "url": f"file://{path}", "wait": "complete"}
        self._ask("browsingContext.navigate", where)

    def value(self, expression: str) -> Any:
        """A JavaScript expression's value, by JSON; a promise is awaited."""
        text = f"(async () => JSON.stringify(await ({expression})))()"
        told = self._ask(
            "script.evaluate",
            {"expression": text, "target": {"context": self.context}, "awaitPromise": True},
        )
        assert told["type"] == "success", told
        return json.loads(told["result"]["value"])

    def _ask(self, method: str, parameters: dict[str, Any]) -> Any:
        number = next(self.number)
        self.socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            told = json.loads(self.socket.recv(timeout=60))
            if told.get("method") == "log.entryAdded" and told["params"]["level"] == "error":
                self.problems.append(told["params"]["text"])
            if told.get("id") == number:
                assert told["type"] == "success", told
                return told["result"]
