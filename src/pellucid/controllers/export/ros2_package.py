"""Write a supervised law as a package with a controller of ros2_control, around the exported C folder."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ...study.exporter import write_files
from .c_folder import c_content, c_files, render
from .controller_values import ControllerValues

C_FOLDER = "controller"
"""Folder of the exported C in the package."""

PACKAGE_TEMPLATES: Mapping[str, str] = {
    "package.xml": "package.xml",
    "CMakeLists.txt": "CMakeLists.txt",
    "README.md": "README.md",
    "plugin.xml": "{package}.xml",
    "parameters.yaml": "src/{package}_parameters.yaml",
    "controller.cpp": "src/controller.cpp",
    "controller.hpp": "include/{package}/controller.hpp",
    "controllers.yaml": "config/controllers.yaml",
    "mock.urdf": "description/mock.urdf",
    "mock.launch.py": "launch/mock.launch.py",
}
"""Templates of the package, each with the path of its file."""

LABEL = "Compiled against stand-in headers; not yet run under ROS 2."
"""Tests of exported packages."""


def package_name(controller: str) -> str:
    """Return the name of the package of a controller, as ROS 2 accepts names."""
    return "pellucid_" + re.sub(r"[^a-z0-9]+", "_", controller.lower()).strip("_")


def package_paths(package: str) -> dict[str, str]:
    """Return the path in the package of the file of each template."""
    return {template: path.format(package=package) for template, path in PACKAGE_TEMPLATES.items()}


def write_ros2_package(study: str, values: ControllerValues, out: Path, *, controller: str, joint: str) -> Path:
    """Write the package of a law into the folder `out`; files of an earlier export are replaced."""
    content = c_content(study, values)
    package = package_name(controller)
    shown = {
        **content,
        "package": package,
        "joint": re.sub(r"[^A-Za-z0-9_]+", "_", joint),
        "numbers": [*content["law"].fields, *content["supervisor"]],
        "values_of": {**values.numbers, **content["supervision"]},
        "rate": round(1.0 / values.numbers["period"]),
    }
    files = {path: render(template, "ros2_control", **shown) for template, path in package_paths(package).items()}
    write_files(c_files(content, out), out / C_FOLDER)
    return write_files(files, out)


def describe_package(folder: Path) -> str:
    """Return a sentence about an exported package."""
    return f"{folder}: package for ros2_control. {LABEL} Read README.md there."
