"""A bar of two organs end to end, with a ball in one of them, that the scan cuts at both ends."""

import shutil
import subprocess

import numpy as np
import pytest
import trimesh

from cccd.containers import Frame
from cccd.settings.surface import TetrahedraSettings
from support.solids import mesh_of, sphere

#: Of the bar's section, and of each organ's length, in mm.
WIDTH, HALF = 10.0, 20.0
FRAME = Frame(
    np.array([[1, 0, 0, -20.0], [0, 1, 0, -20], [0, 0, 1, 0.5 - HALF], [0, 0, 0, 1]]), 2, (40, 40, 40)
)
SETTINGS = TetrahedraSettings(edge_mm=6, tolerance_mm=0.1)


def two_halves():
    box = trimesh.creation.box((WIDTH, WIDTH, HALF)).subdivide().subdivide()
    return {
        "left": mesh_of(box, (0, 0, -HALF / 2)),
        "right": mesh_of(box, (0, 0, HALF / 2)),
        "tumour": sphere(3.0, (0, 0, -HALF / 2), subdivisions=3),
    }


needs_calculix = pytest.mark.skipif(
    shutil.which("ccx") is None, reason="CalculiX (Debian's calculix-ccx) is not installed"
)
MODEL = """*INCLUDE, INPUT={file}
{material}*BOUNDARY
{held}
*STEP
*STATIC
*DSLOAD
{loaded}, P, {pressure}
*NODE PRINT, NSET=N_{loaded}
U
*END STEP
"""


def elastic(modulus, poisson):
    """One material for all elements."""
    tissue = f"*MATERIAL, NAME=TISSUE\n*ELASTIC\n{modulus}, {poisson}\n"
    return f"{tissue}*SOLID SECTION, ELSET=EALL, MATERIAL=TISSUE\n"


def calculix(folder, file, held, loaded, pressure, material=""):
    """Press on a boundary and solve with CalculiX: rows of node, x, y and z of its displacements."""
    given = {"file": file, "held": held, "loaded": loaded, "pressure": pressure, "material": material}
    (folder / "model.inp").write_text(MODEL.format(**given))
    done = subprocess.run(["ccx", "model"], cwd=folder, capture_output=True, text=True, timeout=120)
    assert "Job finished" in done.stdout, done.stdout[-2000:]
    rows = [line.split() for line in (folder / "model.dat").read_text().splitlines()]
    return np.array([[float(x) for x in row] for row in rows if len(row) == 4 and row[0].isdigit()])
