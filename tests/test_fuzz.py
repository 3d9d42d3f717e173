"""Files edited at random: each is read, or refused within seconds, within 500 MB, by a message that names the
file and the remedy; nothing in it is run, and nothing is lost.

A reader's edits run in one process of their own, which this file is too:

    python tests/test_fuzz.py COUNT FOLDER READER...
"""

from __future__ import annotations

import importlib.util
import io
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import traceback
import warnings
import zipfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from once import once

import lagfmu
from lagfmu.errors import LagfmuError

MODELS = Path(__file__).parent.parent / "models"
SHORT, LONG = 30, 1000  # edits a reader
SECONDS = 5  # of the processor, for one edit
MEMORY = 500 * 2**20  # bytes, beside what the program itself has
LONGEST = 21_000  # letters of a message
REMEDY = re.compile(
    r"expected|lacks|keep|correct|choose|give|remove|leave (?:[a-z ]+)?out|fill|build|write|put|save|"
    r"shorten|rename|copy|expand|another|did you mean|is there|make|exchange|take|use|again|anew"
)
XML = "modelDescription.xml"
BESIDE = "-metadata.json"
RECORD, PICTURE = "resources/lagfmu.json", "resources/picture.json"
NUMBERS = (
    *(b"", b"nan", b"inf", b"-inf", b"1e308", b"-1e-320", b"1e999", b"0", b"-1", b"1,5", b"0x10"),
    *(b"9" * 400, b"9" * 5000, b"0x" + b"f" * 5000, b"1" + b"0" * 100_000, b"1_0", b"--1", b"true"),
    *(b"2147483648", b"-9223372036854775809", b"1e-999", b"\xd9\xa1", b"null", b"[]", b'"1"', b"."),
)
WORDS = (
    *(
        b"\0",
        b"\xff\xfe",
        b"\xc3",
        b"\xe2\x80\xae",
        b"\xef\xbb\xbf",
        b"\x1b[31m",
        b"\r",
        b"\n\n",
        b"  ",
    ),
    *(
        b"<!--",
        b"]]>",
        b"<![CDATA[",
        b"&lol;",
        b"&#0;",
        b"&#x110000;",
        b"%s%n{}",
        b"../../etc/passwd",
    ),
    *(
        b"/dev/zero",
        b"__import__('os').system('x')",
        b"m^(9^9^9)",
        b"$x$",
        b'"',
        b"'",
        b"\\",
        b"\\u0000",
    ),
    *(
        b"time",
        b"name",
        b"nan",
        b"-",
        b"=",
        b",",
        b";",
        b":",
        b"{}",
        b"[",
        b"]",
        b"(",
        b")",
        b"<a>",
    ),
)
DEEP = (
    b"[",
    b"(",
    b"{",
    b'{"a":',
    b"<a>",
    b"a.",
    b"-",
    b'"',
    b"'",
    b"\n",
    b",",
    b" ",
    b"x",
    b"9",
    b"**",
)
NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
TOKEN = re.compile(rb"[\w.]+|[^\w\s]")


class TooLong(BaseException):
    """An edit that takes more than SECONDS."""


def edited(text: bytes, draw: random.Random) -> bytes:
    """One to three edits."""
    for _ in range(draw.choice((1, 1, 1, 2, 3))):
        text = draw.choice(EDITS)(text, draw)
    return text


def _span(text: bytes, draw: random.Random, longest: int = 200) -> tuple[int, int]:
    begin = draw.randrange(len(text) + 1)
    return begin, min(len(text), begin + draw.randrange(1, longest))


def _bytes(text: bytes, draw: random.Random) -> bytes:
    found = bytearray(text)
    for _ in range(draw.randrange(1, 9) if found else 0):
        found[draw.randrange(len(found))] = draw.randrange(256)
    return bytes(found)


def _bit(text: bytes, draw: random.Random) -> bytes:
    found = bytearray(text)
    if found:
        found[draw.randrange(len(found))] ^= 1 << draw.randrange(8)
    return bytes(found)


def _lost(text: bytes, draw: random.Random) -> bytes:
    begin, end = _span(text, draw)
    return text[:begin] + text[end:]


def _cut(text: bytes, draw: random.Random) -> bytes:
    return text[: draw.randrange(len(text) + 1)]


def _doubled(text: bytes, draw: random.Random) -> bytes:
    begin, end = _span(text, draw)
    return text[:end] + text[begin:end] * draw.choice((1, 1, 2, 300)) + text[end:]


def _token(
    text: bytes, draw: random.Random, pattern: re.Pattern[bytes], new: tuple[bytes, ...]
) -> bytes:
    spots = list(pattern.finditer(text))
    if not spots:
        return text
    one = draw.choice(spots)
    put = draw.choice(new) if new else draw.choice(spots)[0]
    return text[: one.start()] + put + text[one.end() :]


def _put(text: bytes, draw: random.Random) -> bytes:
    at = draw.randrange(len(text) + 1)
    return text[:at] + draw.choice(WORDS) + text[at:]


def _deep(text: bytes, draw: random.Random) -> bytes:
    at = draw.choice([m.start() for m in TOKEN.finditer(text)] or [0])
    return text[:at] + draw.choice(DEEP) * draw.choice((100, 3000, 50_000, 300_000)) + text[at:]


def _lines(text: bytes, draw: random.Random) -> bytes:
    lines = text.splitlines(keepends=True)
    if not lines:
        return text
    k, other = draw.randrange(len(lines)), draw.randrange(len(lines))
    match draw.randrange(3):
        case 0:
            lines[k], lines[other] = lines[other], lines[k]
        case 1:
            del lines[k]
        case _:
            lines.insert(other, lines[k])
    return b"".join(lines)


def _encoded(text: bytes, draw: random.Random) -> bytes:
    plain = text.decode("utf-8", "replace")
    name = draw.choice(("utf-16", "utf-32", "utf-16-be", "utf-8-sig", "latin-1", "cp500", "utf-7"))
    return ("\xe9\u03bb" * draw.randrange(2) + plain).encode(name, "replace")


EDITS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    *(_bytes, _bit, _lost, _cut, _doubled, _put, _deep, _lines, _encoded),
    *(partial(_token, pattern=NUMBER, new=NUMBERS), partial(_token, pattern=TOKEN, new=())),
    *(partial(_token, pattern=TOKEN, new=WORDS), partial(_token, pattern=NUMBER, new=NUMBERS)),
)


def forged(content: bytes, draw: random.Random) -> bytes:
    """A table of Parquet that is another one, or of which bytes are others, most of them of its end, which
    describes it."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    kind = draw.randrange(4)
    if kind == 0:
        return edited(content, draw)
    if kind == 1:
        at = max(0, len(content) - 3000)
        return content[:at] + edited(content[at:], draw)
    table = pq.read_table(io.BytesIO(content))
    for _ in range(draw.randrange(1, 4)):
        table = _another(pa, table, draw)
    made = io.BytesIO()
    pq.write_table(table, made)
    return made.getvalue()


def _another(pa: Any, table: Any, draw: random.Random) -> Any:
    rows, k = table.num_rows, draw.randrange(table.num_columns) if table.num_columns else 0
    old = table.schema.field(k) if table.num_columns else pa.field("x", pa.int64())
    facts = table.schema.metadata or {}
    columns = {
        "texts": pa.array([str(draw.choice(WORDS)) for _ in range(rows)]),
        "bytes": pa.array([draw.choice(WORDS) for _ in range(rows)], pa.binary()),
        "lists": pa.array([[1.0, None]] * rows),
        "records": pa.array([{"a": 1}] * rows),
        "truth": pa.array([True] * rows),
        "nothing": pa.nulls(rows),
        "gaps": pa.array([None, 1.0][:rows] * rows, pa.float64())[:rows],
        "numbers": pa.array([draw.choice((np.nan, np.inf, 1e308, -0.0)) for _ in range(rows)]),
        "same": pa.array(["ok"] * rows).dictionary_encode(),
        "times": pa.array([0] * rows, pa.timestamp("ns")),
        "spans": pa.array([2**62] * rows, pa.duration("s")),
        "dates": pa.array([2**30] * rows, pa.date32()),
        "large": pa.array([2**63] * rows, pa.uint64()),
    }
    kind = draw.choice(
        [*columns, "gone", "renamed", "twice", "facts", "no facts", "unit", "empty", "none"]
    )
    if kind in columns and table.num_columns:
        return table.set_column(k, old.with_type(columns[kind].type), columns[kind])
    if kind == "gone" and table.num_columns:
        return table.remove_column(k)
    if kind in ("renamed", "twice"):
        names = table.column_names
        put = draw.choice(WORDS).decode("utf-8", "replace") if kind == "renamed" else names[-1:]
        return table.rename_columns([*names[:k], "".join(put), *names[k + 1 :]][: len(names)])
    if kind == "facts":
        return table.replace_schema_metadata({n: edited(v, draw) for n, v in facts.items()})
    if kind == "no facts":
        return table.replace_schema_metadata(None)
    if kind == "unit" and table.num_columns:
        said = draw.choice(({}, {b"unit": draw.choice(WORDS)}, {b"unit": b"x" * 100_000}))
        return table.set_column(k, old.with_metadata(said), table.column(k))
    if kind == "none":
        return table.select([])
    return table.slice(0, draw.randrange(2)) if kind == "empty" else table


# ---------- readers: files that are good, and what reads


def _description(folder: Path, text: bytes) -> None:
    from lagfmu.testing import described_rules, file_stem, read_description

    place = _as(folder, XML, text)
    found = read_description(place.parent)
    described_rules(found)
    file_stem(found)


def _fmu(folder: Path, content: bytes) -> None:
    from lagfmu.testing import archive, read_description

    place = _as(folder, "edited.fmu", content)
    read_description(place)
    shutil.rmtree(archive.unpack(place))


def _described(folder: Path, text: bytes) -> None:
    """The FMU with another description, run."""
    lagfmu.simulate(_with(folder, XML, text), stop_time=0.02)


def _with(folder: Path, name: str, text: bytes) -> Path:
    place = folder / "work" / "edited.fmu"
    with zipfile.ZipFile(folder / "good.fmu") as ours, zipfile.ZipFile(place, "w") as theirs:
        for entry in ours.infolist():
            theirs.writestr(entry, text if entry.filename == name else ours.read(entry))
    return place


def _record(folder: Path, text: bytes) -> None:
    from lagfmu.testing import closed_forms_in, laws_in, left_out_in, read_description

    fmu = folder / "work" / "edited.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.write(folder / "mechanism.xml", XML)
        archive.writestr(RECORD, text)
    closed_forms_in(fmu)
    left_out_in(fmu)
    laws_in(fmu, read_description(fmu))


def _picture(folder: Path, text: bytes) -> None:
    from lagfmu.testing import read_picture

    read_picture(text)


def _preset(folder: Path, text: bytes) -> None:
    from lagfmu.testing import read_preset

    read_preset(text)


def _measured(folder: Path, text: bytes) -> None:
    lagfmu.fit(folder / "good.fmu", _as(folder, "edited.csv", text), {"L": (0.5, 2.0)}, ["theta"])


def _inputs(folder: Path, text: bytes) -> None:
    lagfmu.simulate(folder / "driven.fmu", inputs=_as(folder, "edited.csv", text), stop_time=0.02)


def _reference(folder: Path, text: bytes) -> None:
    from lagfmu.testing import read_table

    read_table(_as(folder, "edited.csv", text))


def _table(folder: Path, text: bytes) -> None:
    lagfmu.Spline.read("road", _as(folder, "edited.csv", text), "m", "m")


def _statements(folder: Path, text: bytes) -> None:
    from lagfmu.testing import read_description, read_statements

    read_statements(_as(folder, "edited.toml", text), read_description(folder / "good.fmu"))


def _runs(folder: Path, content: bytes, ending: str = ".parquet") -> None:
    from lagfmu.testing import read_rows

    if ending == ".csv":
        shutil.copy(folder / f"runs.csv{BESIDE}", folder / "work" / f"edited.csv{BESIDE}")
    read_rows(_as(folder, f"edited{ending}", content))


def _study(folder: Path, content: bytes) -> None:
    from lagfmu.testing import study_in

    study_in(_as(folder, "edited.parquet", content))


def _facts(folder: Path, text: bytes) -> None:
    from lagfmu.testing import read_rows

    _as(folder, "edited.csv-metadata.json", text)
    read_rows(_as(folder, "edited.csv", (folder / "runs.csv").read_bytes()))


def _rows(folder: Path, content: bytes, ending: str) -> None:
    from lagfmu.testing import rows_from

    rows_from(_as(folder, f"edited{ending}", content))


def _parts(folder: Path, content: bytes, name: str) -> None:
    """A chunk that cannot be used is done again; a record that is none is refused."""
    from lagfmu.testing import Parts

    place = folder / "work" / "parts"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(folder / "parts", place)
    (place / name).write_bytes(content)
    known = json.loads((folder / "parts" / "sweep.json").read_text())
    Parts(place, known, True).check({0: {"run": np.arange(1)}}, (51, 1))


def _urdf(folder: Path, text: bytes) -> None:
    from lagfmu.bodies import from_urdf

    from_urdf(_as(folder, "edited.urdf", text))


def _mjcf(folder: Path, text: bytes) -> None:
    from lagfmu.bodies import from_mjcf

    from_mjcf(_as(folder, "edited.xml", text))


READERS: dict[str, tuple[str, Callable[[Path, bytes], None]]] = {
    "description": (XML, _description),
    "description3": ("three.xml", _description),
    "fmu": ("small.fmu", _fmu),
    "described": (XML, _described),
    "record": (RECORD, _record),
    "picture": (PICTURE, _picture),
    "preset": ("preset.json", _preset),
    "measured": ("measured.csv", _measured),
    "inputs": ("inputs.csv", _inputs),
    "reference": ("reference.csv", _reference),
    "table": ("road.csv", _table),
    "statements": ("claims.toml", _statements),
    "runs": ("runs.parquet", _runs),
    "study": ("runs.parquet", _study),
    "runs in text": ("runs.csv", partial(_runs, ending=".csv")),
    "facts": ("runs.csv-metadata.json", _facts),
    "rows": ("rows.csv", partial(_rows, ending=".csv")),
    "rows of numbers": ("rows.parquet", partial(_rows, ending=".parquet")),
    "parts": ("parts/part_00000000.parquet", partial(_parts, name="part_00000000.parquet")),
    "motions": ("parts/part_00000000.npz", partial(_parts, name="part_00000000.npz")),
    "progress": ("parts/sweep.json", partial(_parts, name="sweep.json")),
    "urdf": ("arm.urdf", _urdf),
    "mjcf": ("arm.xml", _mjcf),
}
FORGED = ("runs", "study", "rows of numbers", "parts")
SLOW = ("study", "described", "measured", "inputs", "record")  # what is read is run, or drawn


def _as(folder: Path, name: str, content: bytes) -> Path:
    place = folder / "work" / name
    place.write_bytes(content)
    return place


def good(folder: Path, pendulum: Path, driven: Path, mechanism: Path, third: Path) -> None:
    """A file of each kind that is right."""
    shutil.copy(pendulum, folder / "good.fmu")
    shutil.copy(driven, folder / "driven.fmu")
    (folder / "resources").mkdir()
    for fmu, name, to in (
        (pendulum, XML, XML),
        (mechanism, XML, "mechanism.xml"),
        (third, XML, "three.xml"),
        (mechanism, RECORD, RECORD),
        (mechanism, PICTURE, PICTURE),
    ):
        with zipfile.ZipFile(fmu) as archive:
            (folder / to).write_bytes(archive.read(name))
    with zipfile.ZipFile(folder / "small.fmu", "w") as archive:
        for name, held in (
            ("mechanism.xml", XML),
            (RECORD, RECORD),
            ("three.xml", "sources/model.c"),
        ):
            archive.write(folder / name, held, zipfile.ZIP_DEFLATED)
    (folder / "preset.json").write_text(
        '{"sliders": ["m"], "curves": ["theta"], "ranges": {"m": [0.5, 2.0]}}'
    )
    run = lagfmu.simulate(pendulum, stop_time=0.4, step_size=0.1)
    lines = [f"{t:.17g},{x:.17g}" for t, x in zip(run["time"], run["theta"], strict=True)]
    (folder / "measured.csv").write_text("\n".join(["time [s],theta [rad]", *lines, ""]))
    (folder / "reference.csv").write_text("\n".join(["time,theta", *lines, ""]))
    (folder / "inputs.csv").write_text("time,F\n0,0\n0.01,1.5e0\n0.02,-2\n")
    (folder / "road.csv").write_text("x,y\n0,0\n1,0.5\n2,0.25\n3,1e-3\n")
    (folder / "claims.toml").write_text(CLAIMS)
    (folder / "rows.csv").write_text("theta,m\n0.1,1\n0.2,2\n0.3,1.5\n")
    _studies(folder, pendulum)
    shutil.copy(MODELS / "arm.urdf", folder)
    (folder / "arm.xml").write_text(ARM)


def _studies(folder: Path, pendulum: Path) -> None:
    import pandas as pd

    pd.read_csv(folder / "rows.csv").to_parquet(folder / "rows.parquet")
    angles = {"theta": [0.1, 0.2, 0.3]}
    for ending in ("csv", "parquet"):
        lagfmu.sweep(
            pendulum, angles, keep=["lambda.rod:max"], out=folder / f"runs.{ending}", stop_time=0.1
        )
    told = {"keep": ["theta:trajectory"], "workers": 1, "stop_time": 0.1, "step_size": 0.05}

    def stop(*_: int) -> None:
        if list(folder.glob("motions.nc.parts/part_*.parquet")):
            raise KeyboardInterrupt

    with pytest.raises((KeyboardInterrupt, LagfmuError)):
        lagfmu.sweep(pendulum, angles, out=folder / "motions.nc", progress=stop, **told)
    shutil.move(folder / "motions.nc.parts", folder / "parts")


CLAIMS = """within = 1e-6

[[bounds]]
name = "the rod pulls"
of = "lambda.rod - m*g"
at_least = 0
at_most = "initial(theta) + 2.5e1"

[[conserved]]
of = "energy.total"
scale = 9.81

[[event]]
becomes = "theta"
at = 0.5
occurrence = 1

[[monotone]]
of = "theta"
direction = "rising"
when = "time < 0.1"

[[reference]]
file = "reference.csv"
within = 1e-5
"""
ARM = """<mujoco model="arm">
  <option gravity="0 0 -9.81"><flag contact="disable"/></option>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" type="hinge" axis="0 1 0" range="-90 90" limited="true" damping="0.1"/>
      <geom type="capsule" size="0.04" fromto="0 0 0 0 0 -0.4" mass="2"/>
      <body name="lower" pos="0 0 -0.4">
        <joint name="elbow" type="slide" axis="0 0 1"/>
        <geom type="box" size="0.1 0.2 0.3" mass="1.5" euler="10 20 30"/>
        <site name="tip" pos="0 0 -0.3"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="shoulder" gear="2"/></actuator>
  <keyframe><key name="home" qpos="0.1 0.02"/></keyframe>
</mujoco>
"""

# ---------- the process of edits

FORBIDDEN = (
    "os.system",
    "os.exec",
    "os.posix_spawn",
    "subprocess.Popen",
    "socket.connect",
    "os.fork",
    "exec",
)
CHANGES = ("os.remove", "os.rename", "os.rmdir", "os.truncate", "os.mkdir", "shutil.rmtree")


class Watch:
    """What an edit does besides reading; hooks cannot be taken away, so this one is told when to look."""

    def __init__(self, folder: Path) -> None:
        self.places = (str(folder / "work"), "/tmp/lagfmu_", "/dev/null")
        self.on, self.seen = False, []
        self.compiled = re.compile(r"<|.*\.py")
        sys.addaudithook(self)

    def __call__(self, event: str, args: tuple[Any, ...]) -> None:
        if not self.on:
            return
        written = event == "open" and (args[2] or 0) & (os.O_WRONLY | os.O_RDWR | os.O_TRUNC)
        if written or event in CHANGES:
            inside = (
                event != "open" and len(args) > 1 and args[-1] != -1
            )  # of a folder that is open
            if not inside and not str(args[0]).startswith(self.places):
                self.seen.append(f"{event} {args[0]!r}")
        elif event in FORBIDDEN and event != "exec":
            self.seen.append(event)


def told_wrongly(error: LagfmuError, name: str) -> str:
    """What a message lacks."""
    text = str(error)
    if len(text) > LONGEST:
        return f"{len(text)} letters"
    if "more memory than" in text or "alloc" in text:
        return "no memory was left"
    return "" if REMEDY.search(text) else "no remedy"


def _attempt(
    read: Callable[[Path, bytes], None], folder: Path, content: bytes, watch: Watch
) -> str:
    """What is wrong with how an edit is taken; empty if nothing is."""
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    watch.seen.clear()
    watch.on = True
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(folder, content)
    except LagfmuError as error:
        watch.on = False
        if wrong := told_wrongly(error, ""):
            return f"{wrong}: {str(error)[:300]}"
    except TooLong:
        return "takes too long: " + "".join(traceback.format_stack(limit=3))
    except BaseException as error:
        return "".join(traceback.format_exception(error, limit=-5))[-1500:]
    finally:
        watch.on = False
        signal.setitimer(signal.ITIMER_PROF, 0)
    return f"does {', '.join(watch.seen)}" if watch.seen else ""


def edits(readers: list[str], count: int, folder: Path) -> None:
    """In the process of its own: a line of JSON for each edit that is taken wrongly."""
    import resource

    def ring(*_: Any) -> None:
        raise TooLong

    (folder / "work").mkdir(exist_ok=True)
    shutil.copy(folder / "reference.csv", folder / "work")
    signal.signal(signal.SIGPROF, ring)
    for name, read in map(READERS.__getitem__, readers):
        read(folder, (folder / name).read_bytes())  # what is imported, is
    watch = Watch(folder)
    own = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (own + MEMORY, own + MEMORY))
    for reader in readers:
        name, read = READERS[reader]
        content = (folder / name).read_bytes()
        for k in range(count // 6 if reader in SLOW and count == SHORT else count):
            draw = random.Random(f"{reader} {k}")
            text = forged(content, draw) if reader in FORGED else edited(content, draw)
            print(json.dumps({"begins": k}), flush=True)
            if wrong := _attempt(read, folder, text, watch):
                print(json.dumps({"wrong": f"{reader} {k}: {wrong}"}), flush=True)
    print(json.dumps({"done": count}), flush=True)


def run(readers: Sequence[str], count: int, files: Path, own: Path) -> list[str]:
    """What is wrong with how each edit is taken."""
    shutil.copytree(files, own, dirs_exist_ok=True)
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, __file__, str(count), str(own), *readers]
    ended = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=600)
    said = [json.loads(line) for line in ended.stdout.splitlines() if line.startswith("{")]
    wrong = [one["wrong"] for one in said if "wrong" in one]
    if not said or said[-1] != {"done": count}:
        wrong.append(f"ended {ended.returncode} at {said[-1:]}: {ended.stderr[-2000:]}")
    return wrong


@pytest.fixture(scope="module")
def files(native_fmu, fmi3_fmu, shared_folder) -> Path:
    """The files that are right, once for all processes."""

    def make(place: Path) -> None:
        fmus = map(native_fmu, ("PendulumAngle", "CartPendulum", "SliderCrankBodies"))
        good(place, *fmus, fmi3_fmu("PendulumAngle"))

    return once(shared_folder / "fuzz", make)


def test_edited_files_are_read_or_refused(files, tmp_path):
    """Of 30 seeded edits of each kind of file, and 5 of those that are run, each is read, or refused with
    the remedy."""
    readers = [r for r in READERS if r != "mjcf" or importlib.util.find_spec("mujoco")]
    assert run(readers, SHORT, files, tmp_path) == []


@pytest.mark.thorough
@pytest.mark.parametrize("reader", READERS)
def test_a_thousand_edited_files_are_read_or_refused(reader, files, tmp_path):
    """Of 1,000 seeded edits each is read, or refused with the remedy."""
    if reader == "mjcf":
        pytest.importorskip("mujoco")
    assert run([reader], LONG, files, tmp_path) == []


if __name__ == "__main__":
    edits(sys.argv[3:], int(sys.argv[1]), Path(sys.argv[2]))
