"""The page's WebAssembly module in wasmtime, an engine that no browser has: the same calls as web/fmu.js."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import wasmtime


class Module:
    """One instance of a module that studio/live/play.py compiled; `facts` as on the page."""

    def __init__(self, module: bytes, facts: dict[str, Any]) -> None:
        engine = wasmtime.Engine()
        self.store = wasmtime.Store(engine)
        self.compiled = wasmtime.Module(engine, module)
        instance = wasmtime.Instance(self.store, self.compiled, [])
        self.exports = instance.exports(self.store)
        self.memory = self.exports["memory"]
        self.call("_initialize")
        self.facts = facts

    @property
    def imports(self) -> list[str]:
        """What the module asks of its host."""
        return [f"{i.module}.{i.name}" for i in self.compiled.imports]

    def call(self, name: str, *arguments: float) -> Any:
        return self.exports[name](self.store, *arguments)

    def log(self) -> list[str]:
        start, size = self.call("page_log"), self.call("page_log_size")
        text = bytes(self.memory.read(self.store, start, start + size))
        return [m[1:].decode() for m in text.split(b"\0") if m]

    def simulate(self, points: Any, tolerance: float = 0.0) -> Any:
        """A row at each of the communication points [s], as fmpy has it."""
        columns = [v for v in self.facts["variables"] if v["column"]]
        width, numbers = len(columns), [v["reference"] for v in columns]
        times = self._put(struct.pack(f"<{len(points)}d", *points))
        keep = self._put(struct.pack(f"<{width}I", *numbers))
        rows = self._put(bytes(8 * width * len(points)))
        arguments = (0, 0, 0, tolerance, len(points), times, width, keep, rows)
        assert self.call("page_run", *arguments) == 0, self.log()
        data = bytes(self.memory.read(self.store, rows, rows + 8 * width * len(points)))
        values = np.frombuffer(data).reshape(len(points), width)
        kinds = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
        fields = [("time", np.float64), *((v["name"], kinds[v["type"]]) for v in columns)]
        result = np.zeros(len(points), dtype=fields)
        result["time"] = points
        for v, column in zip(columns, values.T, strict=True):
            result[v["name"]] = column
        return result

    def _put(self, data: bytes) -> int:
        """Its place in the module's memory."""
        place = self.call("page_memory", len(data))
        self.memory.write(self.store, data, place)
        return place
