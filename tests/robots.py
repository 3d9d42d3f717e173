"""Small URDF files."""

from __future__ import annotations

from pathlib import Path

INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
MASS = f'<inertial><mass value="1"/>{INERTIA}</inertial>'


def link(name: str, inertial: str = MASS) -> str:
    return f'<link name="{name}">{inertial}</link>'


def joint(name: str, parent: str, child: str, kind: str = "continuous", more: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<axis xyz="0 0 1"/>{more}</joint>'


BASE = link("base", "")
HINGE = joint("j", "base", "a")


def text(*parts: str) -> str:
    return f'<robot name="R">{"".join(parts)}</robot>'


def robot(tmp_path: Path, *parts: str) -> Path:
    path = tmp_path / "r.urdf"
    path.write_text(text(*parts))
    return path
