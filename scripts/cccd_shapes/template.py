"""A template: a control mesh, how its surface bends, and its smooth modes, each computed once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, eigsh, splu

from cccd.geometry.arrays import FloatArray
from cccd.geometry.libigl import igl
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.control_mesh import control_mesh
from cccd.surface.spline import Target, fit_spline

#: Smooth modes, three of which (one for each axis) move the surface as one.
MODES = 100
#: Shift of the eigenvalues, as a share of the first one on a sphere: the matrix itself is singular.
SHIFT = 1e-3
#: Triangles that the first control mesh is chosen among, by those that it keeps.
CHOSEN_AMONG = 16


def control_mesh_of(mesh: Mesh, points: int) -> ControlMesh:
    """Fit a closed spline, with about so many control points, to a closed mesh that is oriented outwards."""
    nowhere = (-np.inf, np.inf)  # no plane cuts a subject's surface here: rims are part of its shape
    triangles = max(points // 2, 20)  # two quads are made of each, about
    start, _ = control_mesh(mesh.simplified(CHOSEN_AMONG * triangles), triangles, nowhere)
    return fit_spline(start, Target.of(mesh)).spline


@dataclass(frozen=True, eq=False)
class Template:
    """A closed spline that is moved onto subjects."""

    spline: ControlMesh  # near its own centre; in mm

    @cached_property
    def area(self) -> float:
        """Area of the surface in mm^2."""
        return self.spline.tessellate(1).area

    @property
    def radius(self) -> float:
        """Radius in mm of the sphere of the same area."""
        return float(np.sqrt(self.area / (4 * np.pi)))

    @cached_property
    def edge(self) -> float:
        """Mean length in mm of a quad's edge."""
        return float(np.sqrt(self.area / len(self.spline.quads)))

    @cached_property
    def limits(self) -> csr_array:
        """Matrix (V, V) from control points to their limits on the surface."""
        return self.spline.sampler(0).matrix

    @cached_property
    def masses(self) -> FloatArray:
        """Area (V,) around each control point's limit, in mm^2."""
        return self.spline.tessellate(0).vertex_areas

    @cached_property
    def metric(self) -> csr_array:
        """Matrix (V, V): mean square over the surface of a displacement of control points."""
        return csr_array(self.limits.T @ diags_array(self.masses / self.masses.sum()) @ self.limits)

    @cached_property
    def _laplacian(self) -> csr_array:
        """Cotangent Laplacian (V, V) at the limits of the control points, of control points."""
        flat = self.spline.tessellate(0)
        return csr_array(csr_array(igl.cotmatrix(flat.vertices, flat.faces)) @ self.limits)

    @cached_property
    def bending(self) -> csr_array:
        """Matrix (V, V): mean square of the displacement's Laplacian over the surface, in 1/mm^4."""
        # the triangles' own areas may be tiny: none less than a tenth of the mean
        mass = np.maximum(self.masses, 0.1 * self.masses.mean())
        turned = diags_array(1 / mass) @ self._laplacian
        return csr_array(self._laplacian.T @ turned / self.masses.sum())

    @cached_property
    def modes(self) -> FloatArray:
        """Displacements (V, K) of control points along one axis, the smoothest first, of mean square 1."""
        count = min(MODES, len(self.masses) // 4)
        stiffness = csc_array(-self.limits.T @ self._laplacian / self.masses.sum())
        shift = -SHIFT / self.radius**2
        start = np.ones(len(self.masses))  # ARPACK's own is random
        found = cast(Any, eigsh)(stiffness, count, csc_array(self.metric), sigma=shift, v0=start)
        return np.asarray(found[1][:, np.argsort(found[0])], float)

    def solver(self, length: float) -> SuperLU:
        """Factorise a third of the mean square plus bending over so many mm (V, V)."""
        return splu(csc_array(self.metric / 3 + length**4 * self.bending), permc_spec="MMD_AT_PLUS_A")
