"""lagfmu report, and verify --html: what an FMU does, as one file to hand on."""

from __future__ import annotations

import re
import shutil
import zipfile
import zlib

import numpy as np
import pytest
from browser import program
from conftest import MODELS
from lxml import html
from typer.testing import CliRunner

import lagfmu
from lagfmu.errors import BuildError, SimulationError, UsageError
from lagfmu.testing import app, obtained, report_pdf

CODE = b"&lt;script&gt;alert(1)&lt;/script&gt;"  # as it stands in XML


def run(*words, code: int = 0) -> str:
    done = CliRunner().invoke(app, [str(w) for w in words])
    assert done.exit_code == code, done.output
    return " ".join(done.output.split())


def table(page, label: str) -> list[list[str]]:
    """The cells of the table that reads itself aloud by this name."""
    rows = page.xpath(f"//div[@aria-label='{label}']//tbody/tr")
    return [[" ".join(c.text_content().split()) for c in row] for row in rows]


@pytest.fixture(scope="module")
def hemisphere(tmp_path_factory):
    """The report of the model file."""
    out = tmp_path_factory.mktemp("report") / "hemisphere.html"
    run("report", MODELS / "hemisphere.py", "--out", out, "--stop-time", 2)
    return out


@pytest.fixture(scope="module")
def page(hemisphere):
    return html.parse(str(hemisphere)).getroot()


def test_the_figures_are_those_of_the_run(page, native_fmu):
    """The particle presses most with lambda = m g cos(theta_0) at the start and leaves when lambda is 0; the
    time of that is the FMU's."""
    (row,) = table(page, "Extremes of the forces")
    assert row[0] == "lambda.surface"
    assert float(row[1]) == pytest.approx(0.0, abs=1e-9)
    assert float(row[3]) == pytest.approx(9.81 * np.cos(0.01), rel=1e-5)
    assert row[5] == "N"
    left = lagfmu.simulate(native_fmu("Hemisphere"), stop_time=2)["departure.surface.time"][-1]
    (event,) = table(page, "Events")
    assert event[:2] == ["leaves surface", "1"]
    assert float(event[2]) == pytest.approx(left, rel=1e-8)


def test_extremes_without_a_watch_on_peaks_are_those_of_the_table(python_fmu, tmp_path):
    """An FMU without the outputs peak.*: the smallest value stands before the largest, each with its own
    time; lambda = -m (g cos theta + L theta'^2)/(2 L) of a pendulum at rest at theta_0 is nearest to 0 where
    it turns and largest in magnitude, m g (3 - 2 cos theta_0)/(2 L), at the bottom."""
    fmu = python_fmu("PendulumAngle")
    out = tmp_path / "pendulum.html"
    run("report", fmu, "--out", out, "--stop-time", 3)
    told = lagfmu.simulate(fmu, stop_time=3)
    assert not [n for n in told.dtype.names if n.startswith("peak")]
    row = table(html.parse(str(out)).getroot(), "Extremes of the forces")[0]
    force, time = told["lambda.rod"], told["time"]
    expected = [force.min(), time[force.argmin()], force.max(), time[force.argmax()]]
    assert row[0] == "lambda.rod"
    assert [float(cell) for cell in row[1:5]] == pytest.approx(expected, rel=1e-4)
    angle = told["theta"]
    assert abs(angle[force.argmin()]) < 0.1 < abs(angle[force.argmax()])


def test_what_it_says_of_accuracy_is_the_distance_to_a_closer_run(page, native_fmu):
    """lambda along a run at the tolerance and at a hundredth of it; none is farther off than a closed form
    allows."""
    fmu = native_fmu("Hemisphere")
    plain, close = (lagfmu.simulate(fmu, stop_time=2, tolerance=t) for t in (1e-8, 1e-10))
    off = np.abs(plain["lambda.surface"] - close["lambda.surface"]).max()
    told = dict(table(page, "Accuracy"))
    assert float(told["lambda.surface"]) == pytest.approx(
        off / np.abs(close["lambda.surface"]).max(), rel=0.1
    )


def test_an_impact_that_comes_a_little_later_is_an_error_of_its_time_alone():
    """A ball that has fallen for 0.5 s, e = 1/2, in two runs whose impacts are 1e-9 s apart, seen at the very
    instant: there one has v = -g/2 and the other g/4, and beside it they are 1e-9 apart.  A run in which it
    falls on is wrong by all of v."""

    def ball(impact: float, bounces: bool = True) -> np.ndarray:
        kinds = [("time", float), ("velocity.y", float), ("closing.floor.count", int)]
        found = np.zeros(10, [*kinds, ("contact.floor", bool)])
        found["time"] = np.linspace(0, 0.9, 10)
        past = (found["time"] >= impact) & bounces
        found["closing.floor.count"] = past
        found["velocity.y"] = -9.81 * found["time"] + past * 1.5 * 9.81 * impact
        return found

    off = obtained(ball(0.5 + 1e-9), ball(0.5))
    assert off["velocity.y"] == pytest.approx(1.5 * 9.81 * 1e-9 / (9.81 * 0.4), rel=1e-6)
    assert obtained(ball(0.5, bounces=False), ball(0.5))["velocity.y"] > 1


def test_what_the_caller_has_set_is_marked(native_fmu, tmp_path):
    """A run with m = 2.5 kg: m stands there as set, and nothing else does."""
    out = tmp_path / "heavy.html"
    fmu = native_fmu("PendulumAngle")
    run("report", fmu, "--out", out, "--stop-time", 1, "--set", "m=2.5")
    rows = table(html.parse(str(out)).getroot(), "Parameters and start values")
    assert [row[:2] for row in rows if "(set)" in row[1]] == [["m", "2.5 (set)"]]
    assert ["L", "1"] in [row[:2] for row in rows]


def test_it_holds_what_a_colleague_asks_for(page, hemisphere):
    """The mechanism, curves with the event, equations as MathML, constraints with units, parameters, every
    statement, hashes and versions; and nothing that it would have to fetch or run."""
    titles = [" ".join(h.text_content().split()) for h in page.xpath("//h2")]
    assert titles == [
        "Forces and motion",
        "Verification",
        "Accuracy",
        "Equations of motion",
        "Parameters and start values",
        "Versions and hashes",
    ]
    assert [f.get("aria-label") for f in page.xpath("//figure")] == [
        "The mechanism at its start",
        "Forces of constraint",
        "Motion",
    ]
    assert page.xpath("//*[local-name()='math']")
    assert ["m", "1", "kg", "mass of the particle"] in table(page, "Parameters and start values")
    assert table(page, "Multipliers")[0][:2] == ["lambda.surface", "N"]
    verdicts = [row[4] for row in table(page, "Statements")]
    assert len(verdicts) > 8
    assert set(verdicts) == {"pass"}
    text = hemisphere.read_text(encoding="utf-8")
    assert re.search(r"\b[0-9a-f]{64}\b", text)
    assert "<script" not in text
    assert "default-src 'none'" in text
    assert not re.search(r"""(?:src|href)=["'](?!#)""", text)


def test_no_two_figures_share_an_identifier(page):
    """Clip paths and glyphs of one figure are not those of another."""
    known = page.xpath("//@id")
    assert len(known) == len(set(known))
    used = re.findall(r"url\(#([^)]+)\)", html.tostring(page, encoding="unicode"))
    assert used
    assert set(used) <= set(known)


def test_what_fails_is_drawn(native_fmu, tmp_path):
    """A bound that the particle breaks, in the report and on the page of verify, with its exit code."""
    (tmp_path / "claims.toml").write_text('[[bounds]]\nof = "theta"\nat_most = 0.5\n')
    fmu, claims = native_fmu("Hemisphere"), tmp_path / "claims.toml"
    run("report", fmu, "-o", tmp_path / "r.html", "--statements", claims)
    run("verify", fmu, "--statements", claims, "--html", tmp_path / "v.html", code=1)
    for name in ("r.html", "v.html"):
        page = html.parse(str(tmp_path / name)).getroot()
        (row,) = [r for r in table(page, "Statements") if r[0] == "theta <= 0.5"]
        assert row[4].startswith("FAIL, first missed at t =")
        assert [h.text for h in page.xpath("//h3") if h.text.startswith("Missed")] == [
            "Missed: theta <= 0.5"
        ]


def test_a_page_of_several_files_says_which_could_not_be_run(native_fmu, tmp_path):
    """One that is not there stands in the page beside one that holds."""
    out = tmp_path / "v.html"
    run("verify", native_fmu("Hemisphere"), tmp_path / "none.fmu", "--html", out, code=3)
    titles = [h.text_content() for h in html.parse(str(out)).getroot().xpath("//h2")]
    assert titles[0] == "Hemisphere: pass"
    assert titles[1].endswith("none.fmu: not run")


def test_an_fmu_of_another_tool_gets_a_report_too(native_fmu, tmp_path):
    """Without closed forms and equations, and with markup in its texts: what it says of itself is text."""
    path = tmp_path / "Other.fmu"
    with zipfile.ZipFile(native_fmu("Hemisphere")) as ours, zipfile.ZipFile(path, "w") as theirs:
        for entry in ours.infolist():
            content = ours.read(entry)
            if entry.filename.startswith(("documentation/", "resources/")):
                continue
            if entry.filename == "modelDescription.xml":
                content = content.replace(
                    b"mass of the particle", b"&lt;script&gt;alert(1)&lt;/script&gt;"
                )
            theirs.writestr(entry, content)
    run("report", path, "-o", tmp_path / "o.html")
    text = (tmp_path / "o.html").read_text(encoding="utf-8")
    assert "Nothing was held against this FMU" in text
    assert "<script" not in text
    assert "&lt;script&gt;alert(1)" in text


def test_a_study_stands_in_the_report_or_alone(native_fmu, tmp_path):
    """The table of a sweep, from Parquet and from CSV: the same numbers."""
    pytest.importorskip("pyarrow")
    fmu, tables = native_fmu("Hemisphere"), []
    for ending in ("parquet", "csv"):
        rows = tmp_path / f"runs.{ending}"
        keep = ["lambda.surface:max", "departure.surface.time:last"]
        lagfmu.sweep(fmu, {"theta": np.linspace(0.1, 1, 7)}, keep=keep, out=rows, workers=1)
        out = tmp_path / f"{ending}.html"
        run("report", rows, "-o", out)
        tables.append(table(html.parse(str(out)).getroot(), "What varied and what was kept"))
    assert tables[0] == tables[1]
    assert tables[0][0] == ["theta", "0.1", "0.55", "1", "rad"]
    run("report", fmu, "-o", tmp_path / "both.html", "--study", tmp_path / "runs.parquet")
    page = html.parse(str(tmp_path / "both.html")).getroot()
    assert table(page, "What varied and what was kept") == tables[0]


def test_what_cannot_be_reported_is_refused(native_fmu, tmp_path, monkeypatch):
    """Another ending, a table that no sweep wrote, a PDF without a browser: nothing is written."""
    fmu = native_fmu("Hemisphere")
    with pytest.raises(UsageError, match=r"expected a file \.html or \.pdf"):
        lagfmu.report(fmu, tmp_path / "report.docx")
    (tmp_path / "runs.csv").write_text("a,b\n1,2\n")
    with pytest.raises(SimulationError, match="no table that lagfmu sweep wrote"):
        lagfmu.report(tmp_path / "runs.csv", tmp_path / "report.html")
    monkeypatch.delenv("CHROMIUM", raising=False)
    monkeypatch.setattr(report_pdf.shutil, "which", lambda _: None)
    with pytest.raises(BuildError, match=r"write a \.html file, and print it"):
        lagfmu.report(fmu, tmp_path / "report.pdf")
    assert not list(tmp_path.glob("report.*"))


@pytest.mark.skipif(program() is None, reason="no Chromium on this machine")
def test_a_pdf_is_printed_where_there_is_a_browser(native_fmu, tmp_path, monkeypatch):
    """A file of several A4 pages."""
    monkeypatch.setenv("CHROMIUM", str(program()))
    run("report", native_fmu("Hemisphere"), "-o", tmp_path / "h.pdf")
    content = (tmp_path / "h.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    assert re.search(rb"/Count [2-9]", content)


@pytest.mark.thorough
@pytest.mark.skipif(not shutil.which("firefox"), reason="no Firefox on this machine")
def test_a_pdf_is_printed_by_firefox_where_there_is_no_chromium(native_fmu, tmp_path, monkeypatch):
    """Through the protocol that it listens to: A4 pages of the whole report, and no process is left."""
    monkeypatch.delenv("CHROMIUM", raising=False)
    monkeypatch.setattr(report_pdf, "CHROMIUM", ())
    run("report", native_fmu("Hemisphere"), "-o", tmp_path / "h.pdf")
    content = (tmp_path / "h.pdf").read_bytes()
    assert content.startswith(b"%PDF")
    packed = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", content, re.DOTALL)
    opened = [zlib.decompress(part) for part in packed if part[:1] == b"x"]
    assert re.search(rb"/Count [2-9]", b"".join(opened))
    monkeypatch.setattr(report_pdf, "FIREFOX", ("false",))
    with pytest.raises(BuildError, match=r"cannot print the report: it ended with 1"):
        report_pdf.printed("<p>nothing", "h.pdf")


def test_the_page_fits_a_telephone(hemisphere, opened):
    """At 390 and 1280 pixels nothing but tables and formulas is wider than the window, and axe-core finds
    no fault."""
    for width in (390, 1280):
        page = opened(hemisphere, viewport={"width": width, "height": 800})
        assert page.tab.evaluate("document.documentElement.scrollWidth") <= width
        assert page.violations() == []


def test_a_model_gives_the_same_bytes_twice(tmp_path):
    """Nothing in it depends on the day or on an address in memory."""
    copies = []
    for k in range(2):
        shutil.copy(MODELS / "pendulum.py", tmp_path / "pendulum.py")
        run("report", tmp_path / "pendulum.py", "-o", tmp_path / f"{k}.html", "--stop-time", 1)
        copies.append((tmp_path / f"{k}.html").read_bytes())
    assert copies[0] == copies[1]
