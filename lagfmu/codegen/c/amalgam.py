"""The runtime's files -> lagfmu.h and lagfmu.c, as an FMU carries them below sources/.

One file instead of a hundred packs to half the bytes.  Comments stay behind, in lagfmu/runtime/ of the
package; statements stay as they are, but for names: what is static in one file and bears a name that another
file uses too gets the file's name behind its own.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping

HEADER, SOURCE = "lagfmu.h", "lagfmu.c"
HEAD = """/* {file} -- {what} of lagfmu {version}, as far as this FMU needs it, in one file.
 *
 * Its comments, with the equations' sources in the literature: lagfmu/runtime/ of that package. */
"""
TOKENS = re.compile(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])*\'|/\*.*?\*/', re.DOTALL)
OWN_INCLUDE = re.compile(r'^#include "(\w+\.h)"\n', re.MULTILINE)
INCLUDE = re.compile(r"^#include <(\w+\.h)>\n", re.MULTILINE)
GUARD = re.compile(
    r"^#ifndef (LAGFMU_\w+_H)\n#define \1\n(.*)^#endif\n*\Z", re.MULTILINE | re.DOTALL
)
STATIC = re.compile(r"^static [^;{(]*?\b(\w+)(?:\[\w*\])*(?: =|;|\()", re.MULTILINE)
NUMBERS = re.compile(r"^static const \w+ (\w+ = [^;]*);", re.MULTILINE)
CONSTANTS = re.compile(r"^enum \{([^}]*)\}", re.MULTILINE)
TYPE = re.compile(r"^\} (\w+);", re.MULTILINE)
SHARED = re.compile(
    r"^(?!static|typedef|enum|return)\w[\w \*]*?\b(\w+)(?:\[\w*\])*(?: =|\()", re.MULTILINE
)


def amalgamate(runtime: Mapping[str, bytes], version: str) -> dict[str, bytes]:
    """lagfmu.h and lagfmu.c of the runtime's files (name -> text), which lie in layers."""
    texts = {file: _bare(text.decode()) for file, text in runtime.items()}
    headers = _in_layers({f: t for f, t in texts.items() if f.endswith(".h")})
    place = {header[:-2]: k for k, header in enumerate(headers)}
    sources = sorted(
        (f for f in texts if f.endswith(".c")), key=lambda f: (place.get(f[:-2], len(place)), f)
    )
    system = sorted({name for text in texts.values() for name in INCLUDE.findall(text)})
    includes = "".join(f"#include <{name}>\n" for name in system)
    doubles = _doubles({f: texts[f] for f in sources})
    declared = (_section(h, GUARD.sub(r"\2", texts[h])) for h in headers)
    defined = (_section(f, _renamed(texts[f], f, doubles)) for f in sources)
    guard = "#ifndef LAGFMU_H\n#define LAGFMU_H\n\n"
    header = HEAD.format(file=HEADER, what="declarations of the runtime", version=version)
    header += f"{guard}{includes}{''.join(declared)}\n#endif\n"
    source = HEAD.format(file=SOURCE, what="the runtime", version=version)
    source += f'#include "{HEADER}"\n{"".join(defined)}'
    return {HEADER: header.encode(), SOURCE: source.encode()}


def with_one_header(text: bytes, headers: Iterable[str]) -> bytes:
    """A C file in which lagfmu.h stands for those of the runtime's `headers` that it includes."""
    known, found = {*headers}, OWN_INCLUDE.findall(text.decode())
    first = next((name for name in found if name in known), None)

    def one(m: re.Match[str]) -> str:
        return m[0] if m[1] not in known else f'#include "{HEADER}"\n' if m[1] == first else ""

    return OWN_INCLUDE.sub(one, text.decode()).encode()


def _bare(text: str) -> str:
    """Without comments, and no two empty lines in a row."""
    bare = TOKENS.sub(lambda m: "" if m[0].startswith("/*") else m[0], text)
    lines = [line.rstrip() for line in bare.split("\n")]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).strip("\n") + "\n"


def _in_layers(headers: Mapping[str, str]) -> list[str]:
    """Each behind those that it includes."""
    found: list[str] = []

    def take(name: str) -> None:
        if name in headers and name not in found:
            for other in OWN_INCLUDE.findall(headers[name]):
                take(other)
            found.append(name)

    for name in sorted(headers):
        take(name)
    return found


def _section(file: str, text: str) -> str:
    body = INCLUDE.sub("", OWN_INCLUDE.sub("", text)).strip("\n")
    return f"\n/* {file} */\n{body}\n"


def _local(text: str) -> set[str]:
    """The names that a file keeps for itself."""
    found = {*STATIC.findall(text), *TYPE.findall(text)}
    for listed in (*NUMBERS.findall(text), *CONSTANTS.findall(text)):
        found |= {part.split("=")[0].strip() for part in listed.split(",")}
    return found - {""}


def _doubles(sources: Mapping[str, str]) -> set[str]:
    """Names that one file keeps for itself and another one has too."""
    count = Counter(
        name for text in sources.values() for name in _local(text) | {*SHARED.findall(text)}
    )
    return {name for text in sources.values() for name in _local(text) if count[name] > 1}


def _renamed(text: str, file: str, doubles: set[str]) -> str:
    """With the file's name behind the names of its own that are not its alone; members keep theirs."""
    own = _local(text) & doubles
    if not own:
        return text
    word = re.compile(r"(?<![\w.>])(?:" + "|".join(sorted(own)) + r")(?!\w)")
    stem, parts, end = file[:-2], [], 0
    for m in TOKENS.finditer(text):
        parts += [word.sub(rf"\g<0>_{stem}", text[end : m.start()]), m[0]]
        end = m.end()
    return "".join(parts) + word.sub(rf"\g<0>_{stem}", text[end:])
