"""What a shared library exports and what it was made for: ELF, PE and Mach-O, a few struct reads each."""

from __future__ import annotations

import struct
from dataclasses import dataclass

MACHINES = {
    62: "x86_64",
    183: "aarch64",
    0x8664: "x86_64",
    0x01000007: "x86_64",
    0x0100000C: "aarch64",
}


@dataclass(frozen=True)
class Binary:
    """System, processor, exported functions; for macOS also the oldest version and the name."""

    system: str
    machine: str
    exports: frozenset[str]
    needs: tuple[str, ...] = ()
    oldest: tuple[int, int] | None = None
    name: str = ""
    signed: bool = False


def text_at(data: bytes, offset: int) -> str:
    return data[offset : data.index(b"\0", offset)].decode()


def read(data: bytes) -> list[Binary]:
    """The libraries in a file; several in a universal one."""
    if data[:4] == b"\x7fELF":
        return [elf(data)]
    if data[:2] == b"MZ":
        return [portable_executable(data)]
    (magic,) = struct.unpack_from(">I", data)
    if magic != 0xCAFEBABE:
        return [mach_o(data)]
    (count,) = struct.unpack_from(">I", data, 4)
    found = []
    for k in range(count):
        cpu, _, offset, size, align = struct.unpack_from(">5I", data, 8 + 20 * k)
        assert offset % (1 << align) == 0
        one = mach_o(data[offset : offset + size])
        assert one.machine == MACHINES[cpu]
        found.append(one)
    return found


def elf(data: bytes) -> Binary:
    """The dynamic symbols that are defined, and the libraries that are needed."""
    (machine,) = struct.unpack_from("<H", data, 18)
    (sections,) = struct.unpack_from("<Q", data, 40)
    size, count = struct.unpack_from("<HH", data, 58)
    heads = [struct.unpack_from("<IIQQQQIIQQ", data, sections + k * size) for k in range(count)]
    exports, needs = set(), []
    for _, kind, _, _, offset, length, link, _, _, entry in heads:
        names = heads[link][4] if link < count else 0
        if kind == 11:  # SHT_DYNSYM
            for k in range(length // entry):
                name, info, _, section, _, _ = struct.unpack_from(
                    "<IBBHQQ", data, offset + k * entry
                )
                if section and info >> 4:
                    exports.add(text_at(data, names + name))
        if kind == 6:  # SHT_DYNAMIC
            for k in range(length // entry):
                tag, value = struct.unpack_from("<QQ", data, offset + k * entry)
                if tag == 1:
                    needs.append(text_at(data, names + value))
    return Binary("linux", MACHINES[machine], frozenset(exports), tuple(needs))


def portable_executable(data: bytes) -> Binary:
    """The export and import tables."""
    (head,) = struct.unpack_from("<I", data, 0x3C)
    machine, count = struct.unpack_from("<HH", data, head + 4)
    (optional,) = struct.unpack_from("<H", data, head + 20)
    sections = [
        struct.unpack_from("<8sIIII", data, head + 24 + optional + 40 * k) for k in range(count)
    ]

    def place(address: int) -> int:
        for _, length, start, raw, offset in sections:
            if start <= address < start + max(length, raw):
                return offset + address - start
        raise ValueError(address)

    directory = head + 24 + 112
    table = place(struct.unpack_from("<I", data, directory)[0])
    (names,) = struct.unpack_from("<I", data, table + 24)
    addresses = struct.unpack_from("<I", data, table + 32)[0]
    exports = {
        text_at(data, place(struct.unpack_from("<I", data, place(addresses) + 4 * k)[0]))
        for k in range(names)
    }
    needs = []
    imported = place(struct.unpack_from("<I", data, directory + 8)[0])
    while (name := struct.unpack_from("<I", data, imported + 12)[0]) != 0:
        needs.append(text_at(data, place(name)))
        imported += 20
    return Binary("windows", MACHINES[machine], frozenset(exports), tuple(needs))


def mach_o(data: bytes) -> Binary:
    """The external symbols that are defined, LC_BUILD_VERSION or LC_VERSION_MIN_MACOSX, LC_ID_DYLIB."""
    magic, cpu, _, kind, count, _, _, _ = struct.unpack_from("<8I", data)
    assert magic == 0xFEEDFACF
    assert kind == 6  # MH_DYLIB
    offset, exports, oldest, name, needs, signed = 32, set(), None, "", [], False
    for _ in range(count):
        command, size = struct.unpack_from("<II", data, offset)
        if command == 0x2:  # LC_SYMTAB
            symbols, number, strings, _ = struct.unpack_from("<4I", data, offset + 8)
            for k in range(number):
                at, flags, section, _, _ = struct.unpack_from("<IBBHQ", data, symbols + 16 * k)
                if flags & 0x01 and flags & 0x0E == 0x0E and section and not flags & 0x10:
                    exports.add(text_at(data, strings + at).removeprefix("_"))
        elif command == 0x32:  # LC_BUILD_VERSION
            system, version = struct.unpack_from("<II", data, offset + 8)
            assert system == 1  # macOS
            oldest = (version >> 16, version >> 8 & 0xFF)
        elif command == 0x24:  # LC_VERSION_MIN_MACOSX
            (version,) = struct.unpack_from("<I", data, offset + 8)
            oldest = (version >> 16, version >> 8 & 0xFF)
        elif command == 0x1D:  # LC_CODE_SIGNATURE, without which arm64 loads nothing
            signed = True
        elif command in (0xD, 0xC):  # LC_ID_DYLIB, LC_LOAD_DYLIB
            (at,) = struct.unpack_from("<I", data, offset + 8)
            if command == 0xD:
                name = text_at(data, offset + at)
            else:
                needs.append(text_at(data, offset + at))
        offset += size
    return Binary("darwin", MACHINES[cpu], frozenset(exports), tuple(needs), oldest, name, signed)
