"""The page's WebAssembly module in wasmtime, an engine that no browser has: the same calls as web/fmu.js."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import wasmtime


class Module:
    """One instance of a module that page/wasm.py compiled; `facts` as on the page."""

    def __init__(self, module: bytes, facts: dict[str, Any]) -> None:
        engine = wasmtime.Engine()
        self.store = wasmtime.Store(engine)
        self.compiled = wasmtime.Module(engine, module)
        instance = wasmtime.Instance(self.store, self.compiled, [])
        self.exports = instance.exports(self.store)
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
        text = bytes(self.exports["memory"].read(self.store, start, start + size))
        return [m[1:].decode() for m in text.split(b"\0") if m]

    def simulate(self, points: Any, tolerance: float = 0.0) -> Any:
        """A row at each of the communication points [s], as fmpy has it."""
        columns = [v for v in self.facts["variables"] if v["column"]]
        memory = self.exports["memory"]
        references = self.call("page_memory", 4 * len(columns))
        numbers = [v["reference"] for v in columns]
        memory.write(self.store, struct.pack(f"<{len(columns)}i", *numbers), references)
        row = self.call("page_memory", 8 * len(columns))
        kinds = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
        fields = [("time", np.float64), *((v["name"], kinds[v["type"]]) for v in columns)]
        result = np.zeros(len(points), dtype=fields)
        assert self.call("page_instantiate") <= 1, self.log()
        assert self.call("page_setup", tolerance, float(points[-1])) <= 1, self.log()
        assert self.call("page_initialize") <= 1, self.log()
        for k, t in enumerate(points):
            if k:
                before = float(points[k - 1])
                assert self.call("page_step", before, float(t) - before) <= 1, self.log()
            assert self.call("page_read", references, len(columns), row) <= 1, self.log()
            values = bytes(memory.read(self.store, row, row + 8 * len(columns)))
            result[k] = (t, *struct.unpack(f"<{len(columns)}d", values))
        return result
