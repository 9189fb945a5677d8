"""What is installed, and what of it works here."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import json
import sys
import tempfile
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from pathlib import Path
from typing import Any, NamedTuple

from cccd.extras import EXTRAS, how_to_install


class Finding(NamedTuple):
    """One thing looked at."""

    what: str
    works: bool
    detail: str  # a version, or what to do


def add_doctor(command: argparse.ArgumentParser) -> None:
    """Report what is installed and works: extras, GPU, off-screen drawing, CAD."""
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(run=_doctor)


def _doctor(given: argparse.Namespace) -> int:
    findings = examine()
    if given.json:
        print(json.dumps([finding._asdict() for finding in findings], indent=2))
    else:
        for what, works, detail in findings:
            print(f"{'yes' if works else 'no ':<4} {what:<18} {detail}")
    return 0


def examine() -> list[Finding]:
    """Look at Python, every extra, the GPU, off-screen drawing and OpenCASCADE; takes some seconds."""
    findings = [Finding("Python", sys.version_info >= (3, 11), sys.version.split()[0])]
    findings += [_extra(name, modules) for name, modules in EXTRAS.items()]
    checks: dict[str, Callable[[], Finding]] = {"gnn": _gpu, "cad": _cad}
    installed = {finding.what for finding in findings if finding.works}
    return [
        *findings,
        _opengl(),
        *(check() for name, check in checks.items() if f"extra {name}" in installed),
    ]


def _extra(name: str, modules: tuple[str, ...]) -> Finding:
    absent = [module for module in modules if importlib.util.find_spec(module) is None]
    what = f"extra {name}"
    if absent:
        return Finding(what, False, f"no {', '.join(absent)}; {how_to_install(name)}")
    return Finding(what, True, ", ".join(f"{module} {_version(module)}".strip() for module in modules))


def _version(module: str) -> str:
    for distribution in packages_distributions().get(module, [module]):
        try:
            return version(distribution)
        except PackageNotFoundError:
            continue
    return ""


def _gpu() -> Finding:
    torch: Any = importlib.import_module("torch")
    found = torch.cuda.is_available()
    name = torch.cuda.get_device_name(0) if found else "none: training and ordering run on the processor"
    return Finding("GPU", found, name)


def _opengl() -> Finding:
    """Draw a tetrahedron off screen, in a process of its own: without OpenGL VTK ends the process."""
    import numpy as np

    from cccd.geometry.mesh import Mesh
    from cccd.store import write_ply
    from cccd_workflow.report.render import VTK_PACKAGE, render_surface

    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    mesh = Mesh(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "tetrahedron.ply")
        write_ply(path, mesh, "tetrahedron")
        way = render_surface(path, path.with_suffix(".png"), 32)
    drawn = way == "vtk"
    return Finding("OpenGL", drawn, "off screen" if drawn else f"none: on Debian, apt install {VTK_PACKAGE}")


def _cad() -> Finding:
    try:
        importlib.import_module("OCP.STEPControl")
    except ImportError as error:
        return Finding("CAD", False, str(error))
    return Finding("CAD", True, "OpenCASCADE loads")
