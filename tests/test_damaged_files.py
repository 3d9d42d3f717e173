"""URDF and MJCF files that are damaged, or made to do harm: each is refused by name, with the remedy."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from robots import BASE, HINGE, MASS, joint, link, text

from lagfmu.bodies import from_mjcf, from_urdf, mechanism
from lagfmu.errors import ModelError

BOMB = "".join(f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(12))
BOMB = f'<!DOCTYPE r [<!ENTITY e0 "lol">{BOMB}]>'
XXE = '<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/passwd">]>'
DOCTYPE = "has a DOCTYPE, whose entities are not read: write what they stand for in place"
LIMIT = '<limit lower="{}" upper="{}"/>'


def with_hinge(*parts: str, more: str = "", old: str = "", new: str = "") -> str:
    """A file that is right but for what is said."""
    hinge = joint("j", "base", "a", "revolute", more).replace(old, new)
    return text(BASE, link("a"), hinge, *parts)


URDF: dict[str, tuple[str, str]] = {
    "empty": ("", "'m.urdf' is empty: export it again"),
    "half": (
        '<robot name="R"><link name="base"/><link name="a"',
        "'m.urdf' is no XML: .*line 1: correct it there",
    ),
    "tags that cross": ("<robot><link></robot></link>", "is no XML: .*link.*line 1"),
    "what others hide": (f"{XXE}<robot name='R'><link name='&e;'/></robot>", DOCTYPE),
    "billion laughs": (f'{BOMB}<robot name="&e9;"><link name="a"/></robot>', DOCTYPE),
    "laughs in UTF-16": (
        f'{BOMB}<robot name="&e9;"><link name="a"/></robot>'.encode("utf-16").decode("latin-1"),
        DOCTYPE,
    ),
    "laughs in UTF-7": (
        '<?xml version="1.0" encoding="UTF-7"?>+ADwAIQ-DOCTYPE r>'
        "<robot name='R'><link name='a'/></robot>",
        f"{DOCTYPE}|is no XML",
    ),
    "a DTD of the net": (
        '<!DOCTYPE robot SYSTEM "http://127.0.0.1:9/r.dtd"><robot name="R"/>',
        DOCTYPE,
    ),
    "deep": (text("<a>" * 230 + "</a>" * 230), "elements deeper than 200: hang them on fewer"),
    "many": (text("<a/>" * 200_001), "expected at most 200000: leave out what is no mechanism"),
    "another root": ("<sdf/>", "the root of 'm.urdf' is <sdf>, expected <robot>: name a URDF file"),
    "no link": (text(), "<robot> in line 1 lacks <link>: give it one"),
    "no name": (text("<link/>"), "<link> in line 1 lacks name=: give it one"),
    "xacro": (
        '<robot name="R"><a:b xmlns:a="http://ros.org/wiki/xacro"/></robot>',
        "<b> in line 1 is a macro: expand the file first, by xacro",
    ),
    "a formula": (text(link("${arm}")), "<link> in line 1 is a macro: expand the file first"),
    "a substitution": (
        with_hinge(more='<origin xyz="$(optenv X 0 0 0)"/>'),
        "<origin> in line 1 is a macro: expand the file first",
    ),
    "NaN": (
        text(BASE, link("a", MASS.replace('mass value="1"', 'mass value="nan"')), HINGE),
        "link 'a': <mass value> is 'nan', expected a finite number, none below 0: correct it",
    ),
    "negative mass": (
        text(BASE, link("a", MASS.replace('mass value="1"', 'mass value="-1"')), HINGE),
        "link 'a': <mass value> is '-1', expected a finite number, none below 0: correct it",
    ),
    "four numbers": (
        with_hinge(more='<origin rpy="0 1 2 3"/>'),
        "joint 'j': <origin rpy> is '0 1 2 3', expected 3 finite numbers: correct it",
    ),
    "commas": (
        with_hinge(more='<origin xyz="0, 1, 2"/>'),
        "joint 'j': <origin xyz> is '0, 1, 2', expected 3 finite numbers: correct it",
    ),
    "a number of Python's": (
        with_hinge(more='<origin xyz="0 0 1_0"/>'),
        "joint 'j': <origin xyz> is '0 0 1_0', expected 3 finite numbers",
    ),
    "no axis": (
        with_hinge(old="0 0 1", new="0 0 0"),
        r"joint 'j' has the axis \[0.0, 0.0, 0.0\], expected a direction: correct it",
    ),
    "limits exchanged": (
        with_hinge(more=LIMIT.format(1, -1)),
        "joint 'j' has the limits 1.0, -1.0, expected the smaller first: exchange them",
    ),
    "negative friction": (
        with_hinge(more='<dynamics friction="-0.1"/>'),
        "joint 'j': <dynamics friction> is '-0.1', expected a finite number, none below 0",
    ),
    "no inertia": (
        text(BASE, link("a", '<inertial><mass value="1"/></inertial>'), HINGE),
        "link 'a': <inertial> in line 1 lacks <inertia>: give it one",
    ),
    "no mass": (
        text(BASE, link("a", ""), HINGE),
        "link 'a' moves and has no mass, nor does it carry one: give it an <inertial> with mass",
    ),
    "an impossible inertia": (
        text(BASE, link("a", MASS.replace('izz="1"', 'izz="9"')), HINGE),
        "body 'a' has the principal moments of inertia 1, 1, 9 .*none is above the sum",
    ),
    "a negative inertia": (
        text(BASE, link("a", MASS.replace('ixx="1"', 'ixx="-1"')), HINGE),
        "body 'a' has the inertia xx -1.0, expected a positive number in kg.m.2, or 0 where",
    ),
    "no mass on its branch": (
        text(
            BASE,
            link("a"),
            link("b", ""),
            link("c", ""),
            HINGE,
            joint("k", "a", "b"),
            joint("l", "b", "c"),
        ),
        "link 'b' moves and has no mass, nor does it carry one.*link 'c' moves",
    ),
    "another kind": (
        with_hinge(old="revolute", new="screw"),
        "joint 'j' is of the type 'screw', expected one of revolute, .*: build it from bodies",
    ),
    "unknown link": (
        text(BASE, joint("j", "base", "c")),
        "joint 'j': its child 'c' is no link of the file: correct it",
    ),
    "its own ancestor": (
        text(BASE, link("a"), link("b"), joint("i", "a", "b"), joint("j", "b", "a")),
        "the joints of the links 'a', 'b' form a cycle: URDF has trees only; leave out one",
    ),
    "its own child": (
        text(BASE, link("a"), joint("j", "a", "a")),
        "the joints of the links 'a' form a cycle",
    ),
    "two parents": (
        text(
            BASE,
            *map(link, "ab"),
            *(joint(*j.split()) for j in ("i base a", "j base b", "k a b")),
        ),
        "link 'b' is the child of 'j' and 'k', expected one joint: .*close a loop by a joint",
    ),
    "two roots": (
        text(BASE, link("a"), link("b"), HINGE),
        "the root links 'base', 'b', expected one: tie them together by fixed joints",
    ),
    "two links of a name": (
        text(BASE, link("a"), link("a"), HINGE),
        "two links are called 'a': rename one",
    ),
    "two names of a word": (
        text(BASE, link("a.b"), link("a-b"), joint("i", "base", "a.b"), joint("j", "base", "a-b")),
        "the link 'a.b' and the link 'a-b' would both be called 'a_b': rename one",
    ),
    "mimics none": (
        with_hinge(more='<mimic joint="k"/>'),
        "joint 'j' mimics 'k', expected a hinge or a slide that follows another.*: correct the name",
    ),
    "mimics itself": (
        with_hinge(more='<mimic joint="j"/>'),
        "joint 'j' mimics itself: leave out the <mimic> of one joint",
    ),
}

BALL = '<geom type="sphere" size="0.1" mass="2" pos="0 0 -0.5" contype="0" conaffinity="0"/>'
GOOD = f'<body name="a"><joint name="j"/>{BALL}</body>'


def good(old: str = "", new: str = "", more: str = "") -> str:
    """A file that is right but for one change."""
    return (
        f"<mujoco><worldbody>{GOOD.replace(old, new) if old else GOOD}</worldbody>{more}</mujoco>"
    )


OUTSIDE = ", which is not in the folder of the file: copy it there, and name it by a relative path"
MJCF: dict[str, tuple[str, str]] = {
    "empty": ("", "'m.xml' is empty: export it again"),
    "half": ("<mujoco>", "'m.xml' is no XML: .*line 1: correct it there"),
    "another root": (
        "<robot/>",
        "the root of 'm.xml' is <robot>, expected <mujoco>: name an MJCF file",
    ),
    "what others hide": (f"{XXE}<mujoco model='&e;'/>", DOCTYPE),
    "billion laughs": (f"{BOMB}<mujoco>&e9;</mujoco>", DOCTYPE),
    "DOCTYPE of a file": ('<!DOCTYPE a SYSTEM "/etc/passwd"><mujoco/>', DOCTYPE),
    "outside": ('<mujoco><include file="../x.xml"/></mujoco>', f"'../x.xml'{OUTSIDE}"),
    "absolute": ('<mujoco><include file="/etc/passwd"/></mujoco>', f"'/etc/passwd'{OUTSIDE}"),
    "meshes outside": ('<mujoco><compiler meshdir="../m"/></mujoco>', f"'../m'{OUTSIDE}"),
    "mesh outside": (
        '<mujoco><asset><mesh name="a" file="../../a.stl"/></asset></mujoco>',
        f"'../../a.stl'{OUTSIDE}",
    ),
    "texture outside": (
        '<mujoco><asset><texture type="2d" fileup="../a.png"/></asset></mujoco>',
        f"'../a.png'{OUTSIDE}",
    ),
    "by a link": ('<mujoco><include file="way/x.xml"/></mujoco>', f"'way/x.xml'{OUTSIDE}"),
    "outside of a part": (
        '<mujoco><asset><model name="b" file="part.xml"/></asset></mujoco>',
        f"'part.xml': <include> in line 1 names '../x.xml'{OUTSIDE}",
    ),
    "itself": (
        '<mujoco><include file="m.xml"/></mujoco>',
        "includes 'm.xml', which includes it: leave out one of the two",
    ),
    "missing include": (
        '<mujoco><include file="none.xml"/></mujoco>',
        "none.xml' cannot be read .*: correct the path",
    ),
    "a folder": ('<mujoco><include file="parts"/></mujoco>', "parts' is no file: name one"),
    "plugin": (
        '<mujoco><extension><plugin plugin="mujoco.pid"/></extension></mujoco>',
        "<plugin> in line 1 runs code of a plugin, which nothing here does: leave it out",
    ),
    "deep": ("<mujoco>" + "<a>" * 230 + "</a>" * 230 + "</mujoco>", "elements deeper than 200"),
    "many": ("<mujoco>" + "<a/>" * 200_001 + "</mujoco>", "expected at most 200000: leave out"),
    "unknown element": ("<mujoco><wheel/></mujoco>", "does not take it: .*'wheel'.*correct that"),
    "unknown joint": (
        '<mujoco><worldbody><body><joint type="screw"/></body></worldbody></mujoco>',
        "'screw' Element 'joint', line 1",
    ),
    "no number": (good("-0.5", "x"), "attribute 'pos' Element 'geom', line 1"),
    "NaN": (good("-0.5", "nan"), "<geom> in line 1 has pos='0 0 nan', expected finite numbers"),
    "no mass": (
        '<mujoco><worldbody><body name="a"><joint/></body></worldbody></mujoco>',
        "mass and inertia of moving bodies must be larger.*'a'",
    ),
    "negative mass": (good('mass="2', 'mass="-2'), "negative in geom"),
    "impossible inertia": (
        '<mujoco><worldbody><body><joint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 9"/>'
        "</body></worldbody></mujoco>",
        "inertia must satisfy A . B >= C",
    ),
    "zero axis": (good("<joint", '<joint axis="0 0 0"'), "axis too small in joint"),
    "two names": (
        f"<mujoco><worldbody>{GOOD}{GOOD}</worldbody></mujoco>",
        "repeated name 'a' in body",
    ),
    "unknown body": (
        '<mujoco><equality><connect body1="a" anchor="0 0 0"/></equality></mujoco>',
        "unknown element 'a' in equality",
    ),
    "unknown joint of a motor": (
        '<mujoco><actuator><motor joint="a"/></actuator></mujoco>',
        "unknown transmission target 'a'",
    ),
}


def built(path: Path) -> None:
    parts = from_urdf(path) if path.suffix == ".urdf" else from_mjcf(path)
    mechanism(parts.name, bodies=parts.bodies, joints=parts.joints)


def refusal(path: Path) -> str:
    """Of a file; nothing is written beside it."""
    beside = {*path.parent.iterdir()}
    with pytest.raises(ModelError) as caught:
        built(path)
    assert {*path.parent.iterdir()} == beside
    return " ".join(str(caught.value).split())


def told_of(path: Path, content: str, expected: str) -> None:
    path.write_bytes(content.encode("latin-1"))
    assert re.search(expected, refusal(path)), refusal(path)


@pytest.mark.parametrize("name", URDF)
def test_a_damaged_urdf_file_is_refused_by_name(name: str, tmp_path: Path) -> None:
    """No entity is expanded, nothing beside the file opened."""
    told_of(tmp_path / "m.urdf", *URDF[name])


@pytest.mark.parametrize("name", MJCF)
def test_a_damaged_mjcf_file_is_refused_by_name(name: str, tmp_path: Path) -> None:
    """Nothing outside its folder is opened, though a link or a part of it names that; nothing is run."""
    pytest.importorskip("mujoco")
    folder = tmp_path / "own"
    (folder / "parts").mkdir(parents=True)
    (folder / "way").symlink_to(tmp_path)
    (tmp_path / "x.xml").write_text("<mujoco/>")
    (folder / "part.xml").write_text('<mujoco><include file="../x.xml"/></mujoco>')
    told_of(folder / "m.xml", *MJCF[name])


@pytest.mark.parametrize("ending", ["urdf", "xml"])
def test_what_is_no_file_or_too_large_is_not_read(ending: str, tmp_path: Path) -> None:
    """A pipe is not waited for; of 40 MB not a byte is read."""
    pytest.importorskip("mujoco")
    path = tmp_path / f"m.{ending}"
    assert "No such file" in refusal(path)
    os.mkfifo(path)
    assert "is no file: name one" in refusal(path)
    path.unlink()
    with path.open("wb") as file:
        file.truncate(40_000_000)
    told = "'m.{}' has 40000000 bytes, expected at most 33554432: leave out what is no mechanism"
    assert told.format(ending) in refusal(path)


def test_a_long_file_is_judged_in_proportion(tmp_path: Path) -> None:
    """20,000 links and as many joints, the last of which has no mass."""
    links = [link(f"l{k}") for k in range(20_000)]
    joints = [joint(f"j{k}", f"l{k - 1}", f"l{k}", "fixed") for k in range(1, 20_000)]
    end = joint("end", "l19999", "tip")
    path = tmp_path / "m.urdf"
    path.write_text(text(*links, link("tip", ""), *joints, end))
    assert "link 'tip' moves and has no mass" in refusal(path)


def test_what_readers_of_robots_let_pass_is_taken(tmp_path: Path) -> None:
    """A version that there is not, a line before the declaration, a prefix that nothing declares, zeros
    behind the end; what a mechanism does not need is not looked at."""
    path = tmp_path / "m.urdf"
    limit = '<limit lower="-1" upper="1" effort="much" velocity="inf" drake:acceleration="1"/>'
    cup = '<visual><geometry><cup/></geometry><material><color rgba="red"/></material></visual>'
    extra = f"<drake:filter/><sensor/>{cup}"
    robots = with_hinge(link("b", f"{MASS}{extra}"), joint("i", "a", "b"), more=limit)
    path.write_text(f'\n<?xml version="0.0"?>{robots}\0\n')
    parts = from_urdf(path)
    assert [b.name for b in parts.bodies] == ["a", "b"]
    assert parts.joints[0].limits == (-1, 1)
    assert "other shapes (1) are left out" in parts.description
