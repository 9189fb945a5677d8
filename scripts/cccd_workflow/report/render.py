"""Pictures of a surface from three sides, on any machine.

VTK draws off screen with EGL or OSMesa. Where neither library is installed it does not raise: it ends
the process with a segmentation fault. So it runs in a process of its own, and when that dies the
picture is drawn by matplotlib instead, flat-shaded and painter-sorted. The PNG says in its text chunk
``renderer`` how it was drawn.

Run as a script, this file is that other process: ``python -P render.py SURFACE.ply OUT.png PIXELS``.
"""

from __future__ import annotations

import base64
import io
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

    from cccd.geometry.mesh import Mesh

Renderer = Literal["vtk", "matplotlib"]

#: The one Debian package that lets VTK draw without a display (Mesa's software rasteriser).
VTK_PACKAGE = "libosmesa6"

#: Seconds after which a hanging VTK is given up.
TIME_LIMIT_S = 120

_COLOUR = (0.80, 0.67, 0.56)
_FALLBACK_TRIANGLES = 60_000
#: Pixels of VTK's picture, to a side, that become one: smooth edges for less than its own antialiasing.
_OVERSAMPLED = 2


class Camera(NamedTuple):
    """A side from which a surface is looked at: ``towards`` points from the body to the eye (RAS)."""

    name: str
    towards: tuple[float, float, float]
    up: tuple[float, float, float]


#: The three sides of every picture, left to right, patient upright (RAS: x right, y anterior, z superior).
VIEWS = (
    Camera("anterior", (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    Camera("left", (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    Camera("superior", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
)


def render_surface(ply_path: str | Path, png_path: str | Path, pixels: int = 420) -> Renderer:
    """Draw a mesh from three sides into one transparent PNG of ``3 pixels x pixels``.

    Parameters
    ----------
    ply_path : path
        A triangle mesh in world mm (RAS).
    png_path : path
        Where the picture goes; written under a temporary name first.
    pixels : int
        Edge length of each of the three views.

    Returns
    -------
    {"vtk", "matplotlib"}
        What drew it.
    """
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    from cccd.store import atomic_path, read_ply

    stamp = PngInfo()
    with atomic_path(png_path) as temporary:
        renderer: Renderer = "vtk" if _render_with_vtk(Path(ply_path), temporary, pixels) else "matplotlib"
        if renderer == "vtk":
            size = len(VIEWS) * _OVERSAMPLED * pixels, _OVERSAMPLED * pixels
            upside_down = Image.frombytes("RGBA", size, temporary.read_bytes())
            picture = upside_down.transpose(Image.Transpose.FLIP_TOP_BOTTOM).reduce(_OVERSAMPLED)
        else:
            picture = Image.fromarray(_draw_with_matplotlib(read_ply(ply_path), pixels))
        stamp.add_text("renderer", renderer)
        picture.save(temporary, pnginfo=stamp)
    return renderer


def picture_renderer(png_path: str | Path) -> Renderer | None:
    """Return what drew a picture made by `render_surface`; None when the file does not say."""
    from PIL import Image

    with Image.open(png_path) as picture:
        stamp = getattr(picture, "text", {}).get("renderer")
    return stamp if stamp in ("vtk", "matplotlib") else None


def webp(picture: Picture, quality: int) -> str:
    """Encode a picture for a page as base64 WebP, which has a tenth of PNG's size."""
    from PIL import WebPImagePlugin  # noqa: F401  or Pillow loads all its formats

    buffer = io.BytesIO()
    picture.save(buffer, "WEBP", quality=quality, method=4)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def _render_with_vtk(ply_path: Path, png_path: Path, pixels: int) -> bool:
    """Whether the other process drew the picture; False when it crashed, failed or hung."""
    command = [sys.executable, "-P", __file__, str(ply_path), str(png_path), str(_OVERSAMPLED * pixels)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=TIME_LIMIT_S, check=False)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0 and png_path.stat().st_size > 0


def _draw_with_vtk(ply_path: str, raw_path: str, pixels: int) -> None:
    """Draw three turned copies of the mesh in one scene, as red, green, blue and alpha from below."""
    from vtkmodules import vtkRenderingCore, vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.vtkCommonTransforms import vtkTransform
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
    from vtkmodules.vtkIOPLY import vtkPLYReader

    vtk = vtkRenderingCore
    mapper, renderer = vtk.vtkPolyDataMapper(), vtk.vtkRenderer(background_alpha=0)
    reader = vtkPLYReader(file_name=ply_path)
    normals = vtkPolyDataNormals(splitting=False, input_connection=reader.output_port)
    mapper.SetInputConnection(normals.output_port)
    mapper.Update()
    assert mapper.GetInput().GetNumberOfPoints(), f"no mesh in {ply_path}"
    bounds = np.reshape(mapper.GetBounds(), (3, 2))
    half = 0.57 * np.ptp(bounds, axis=1).max()
    for column, view in enumerate(VIEWS):
        placed, turned = np.eye(4), vtkTransform()
        placed[:3, :3] = np.cross(view.up, view.towards), view.up, view.towards
        placed[:3, 3] = [2 * half * (column - 1), 0, 0] - placed[:3, :3] @ bounds.mean(axis=1)
        turned.SetMatrix(placed.ravel().tolist())
        shade = vtk.vtkProperty(color=_COLOUR, specular=0.25, specular_power=12, backface_culling=True)
        renderer.AddActor(vtk.vtkActor(mapper=mapper, user_transform=turned, property=shade))
    renderer.active_camera.parallel_projection = True
    renderer.ResetCamera()
    renderer.active_camera.parallel_scale = half
    vtk.vtkLightKit().AddLightsToRenderer(renderer)
    window = vtk.vtkRenderWindow(off_screen_rendering=True, alpha_bit_planes=1, multi_samples=0)
    window.size = len(VIEWS) * pixels, pixels
    window.AddRenderer(renderer)
    picture = vtk.vtkWindowToImageFilter(input=window, read_front_buffer=False, input_buffer_type=4)  # RGBA
    picture.Update()
    Path(raw_path).write_bytes(picture.output.point_data.scalars)


def frame_view(axes, points: np.ndarray) -> np.ndarray:
    """Make a square, axis-free window that holds ``points`` (N, 3) from every side; return its centre."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = 0.57 * (high - low).max()
    axes.set_axis_off()
    axes.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    return (low + high) / 2


def paint_mesh(axes, vertices: np.ndarray, faces: np.ndarray, centre: np.ndarray, view: Camera, **options):
    """Paint the triangles that face the eye from back to front, flat-shaded, in parallel projection.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Prepared by `frame_view`, which gave ``centre``.
    vertices, faces : (V, 3) and (F, 3) arrays
        World mm (RAS), normals outwards.
    centre : (3,) array
    view : Camera
    **options
        Passed on to the `PolyCollection`.
    """
    from matplotlib.collections import PolyCollection

    a, b, c = (vertices[corner] for corner in faces.T)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    towards, up = np.array(view.towards), np.array(view.up)
    right = np.cross(up, towards)
    front = normals @ towards > 0
    corners = (vertices - centre)[faces[front]]
    order = np.argsort((corners @ towards).mean(axis=1))
    corners = corners[order]
    light = towards + 0.5 * up - 0.4 * right
    shade = np.clip(normals[front][order] @ (light / np.linalg.norm(light)), 0, 1)
    colours = np.clip(np.outer(0.35 + 0.75 * shade, _COLOUR), 0, 1)
    flat = list(np.stack([corners @ right, corners @ up], axis=2))
    axes.add_collection(
        PolyCollection(
            flat, facecolors=colours, edgecolors=colours, linewidths=0.15, antialiaseds=False, **options
        )
    )


def _draw_with_matplotlib(mesh: Mesh, pixels: int) -> np.ndarray:
    """Flat-shaded orthographic views as RGBA (pixels, 3 pixels, 4) uint8, painted from back to front."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    small = mesh.simplified(_FALLBACK_TRIANGLES)
    figure = Figure(figsize=(len(VIEWS), 1), dpi=pixels)
    canvas = FigureCanvasAgg(figure)
    figure.patch.set_alpha(0)
    for column, view in enumerate(VIEWS):
        axes = figure.add_axes((column / len(VIEWS), 0, 1 / len(VIEWS), 1))
        paint_mesh(axes, small.vertices, small.faces, frame_view(axes, small.vertices), view)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba()).copy()


if __name__ == "__main__":
    _draw_with_vtk(sys.argv[1], sys.argv[2], int(sys.argv[3]))
