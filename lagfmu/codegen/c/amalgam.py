"""The runtime's files -> lagfmu.h and lagfmu.c, as an FMU carries them below sources/.

One file instead of a hundred packs to half the bytes.  Comments stay behind, in lagfmu/runtime/ of the
package, and so do declarations of functions that stand before all that call them; statements stay as they
are, but for names: what is static in one file and bears a name that another file uses too gets the file's
name behind its own.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping

HEADER, SOURCE = "lagfmu.h", "lagfmu.c"
OF_MODELS = (
    "interval.h"  # model.c calls some of its functions, one model's these and another's those
)
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
INDENT = re.compile(r"^ +", re.MULTILINE)
WORD, CALL = re.compile(r"[A-Za-z_]\w*"), re.compile(r"(\w+)\(")
TYPE = re.compile(r"^\} (\w+);", re.MULTILINE)
DECLARED = re.compile(
    r"^(?!typedef|static|extern|FMI2_EXPORT|return)[A-Za-z][\w \*]*?\b(\w+)\((?:[^(){};]|\([^()]*\))*\);\n",
    re.MULTILINE,
)
SHARED = re.compile(
    r"^(?!static|typedef|enum|return)\w[\w \*]*?\b(\w+)(?:\[\w*\])*(?: =|\()", re.MULTILINE
)


def amalgamate(
    runtime: Mapping[str, bytes], generated: Mapping[str, bytes], version: str
) -> dict[str, bytes]:
    """lagfmu.h and lagfmu.c of the runtime's files (name -> text), which lie in layers, for the files
    `generated` beside them."""
    texts = {file: _bare(text.decode()) for file, text in runtime.items()}
    headers = _in_layers({f: OWN_INCLUDE.findall(t) for f, t in texts.items() if f.endswith(".h")})
    sources = _in_layers(_callees({f: t for f, t in texts.items() if f.endswith(".c")}))
    system = sorted({name for text in texts.values() for name in INCLUDE.findall(text)})
    includes = "".join(f"#include <{name}>\n" for name in system)
    doubles = _doubles({f: texts[f] for f in sources})
    declared = "".join(_section(h, GUARD.sub(r"\2", texts[h])) for h in headers)
    defined = "".join(_section(f, _renamed(texts[f], f, doubles)) for f in sources)
    outside = "".join((*(text.decode() for text in generated.values()), texts[OF_MODELS]))
    guard = "#ifndef LAGFMU_H\n#define LAGFMU_H\n\n"
    header = HEAD.format(file=HEADER, what="declarations of the runtime", version=version)
    header += f"{guard}{includes}{_needed(declared, defined, outside)}\n#endif\n"
    source = HEAD.format(file=SOURCE, what="the runtime", version=version)
    source += f'#include "{HEADER}"\n{defined}'
    return {HEADER: header.encode(), SOURCE: source.encode()}


def with_one_header(text: bytes, headers: Iterable[str]) -> bytes:
    """A C file in which lagfmu.h stands for those of the runtime's `headers` that it includes."""
    known, found = {*headers}, OWN_INCLUDE.findall(text.decode())
    first = next((name for name in found if name in known), None)

    def one(m: re.Match[str]) -> str:
        return m[0] if m[1] not in known else f'#include "{HEADER}"\n' if m[1] == first else ""

    return OWN_INCLUDE.sub(one, text.decode()).encode()


def _bare(text: str) -> str:
    """Without comments, no two empty lines in a row, a tab for up to four spaces."""
    bare = TOKENS.sub(lambda m: "" if m[0].startswith("/*") else m[0], text)
    bare = INDENT.sub(lambda m: "\t" * -(-len(m[0]) // 4), bare)
    lines = [line.rstrip() for line in bare.split("\n")]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).strip("\n") + "\n"


def _in_layers(needs: Mapping[str, Iterable[str]]) -> list[str]:
    """Each behind those that it needs, as far as they do not need each other."""
    found: list[str] = []
    begun: set[str] = set()

    def take(name: str) -> None:
        if name in needs and name not in begun:
            begun.add(name)
            for other in needs[name]:
                take(other)
            found.append(name)

    for name in sorted(needs):
        take(name)
    return found


def _callees(sources: Mapping[str, str]) -> dict[str, list[str]]:
    """Each file with those that define what it calls."""
    owner = {m[1]: file for file, text in sources.items() for m in SHARED.finditer(text)}
    return {
        file: sorted({owner[w] for w in WORD.findall(text) if w in owner} - {file})
        for file, text in sources.items()
    }


def _section(file: str, text: str) -> str:
    body = INCLUDE.sub("", OWN_INCLUDE.sub("", text)).strip("\n")
    return f"\n/* {file} */\n{body}\n"


def _needed(declared: str, defined: str, outside: str) -> str:
    """`declared` without the functions that `defined` defines before it calls them, if nothing else does."""
    bare = TOKENS.sub(lambda m: " " * len(m[0]), defined)
    first = {m[0]: m.start() for m in reversed([*WORD.finditer(bare)])}
    starts = {m[1]: m.start(1) for m in SHARED.finditer(bare)}
    called = Counter(CALL.findall(declared))
    others = {*WORD.findall(outside)}

    def one(m: re.Match[str]) -> str:
        name = m[1]
        spare = called[name] == 1 and name not in others and starts.get(name) == first.get(name)
        return "" if spare else m[0]

    return re.sub(r"\n{3,}", "\n\n", DECLARED.sub(one, declared))


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
