"""What the gallery's pages draw with: the program itself, while the site is built.

MkDocs loads this file as a hook; the pages' code then imports it as ``pictures``.
"""

from __future__ import annotations

import base64
import contextlib
import html
import io
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SCRIPTS = HERE.parent / "scripts"

#: Where the pages' commands are typed.
FOLDER = Path(tempfile.mkdtemp(prefix="cccd-gallery-"))


def on_startup(**_):
    """Let the pages' code import the library and this file."""
    sys.path[:0] = [str(HERE), str(SCRIPTS)]


def typed(command: str) -> str:
    """Run a ``cccd`` command, and return it with what it printed, as the page shows both."""
    from cccd.cli import main

    said = io.StringIO()
    with contextlib.chdir(FOLDER), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = main(command.split()[1:])
    if code:
        raise RuntimeError(f"{command}: {said.getvalue()}")
    return f"<pre><code>$ {html.escape(command)}\n{html.escape(said.getvalue())}</code></pre>"


def phantom(organ: str, spacing_mm: tuple[float, float, float], source: str = "phantom"):
    """Scan a phantom, whose true surface is known."""
    from cccd.inputs import Request, read_request
    from cccd.settings.imports import ImportSettings

    row = dict.fromkeys(("image", "mask", "boundary", "label"), "")
    row |= {"case": "gallery", "organ": organ, "source": source, "location": organ}
    settings = ImportSettings.model_validate({"phantom": {"spacing_mm": spacing_mm}})
    return read_request(Request.of_row(row, FOLDER), settings, seed=3)


def save_mask(structure, name: str) -> None:
    """Write a structure's mask as a NIfTI file where the commands are typed."""
    import numpy as np

    from cccd.inputs.nifti_export import write_nifti

    affine = structure.frame.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ structure.origin
    write_nifti(FOLDER / name, structure.mask.astype(np.uint8), affine)


def picture_of(*names: str) -> str:
    """Draw meshes (PLY files) from three sides, one below the other."""
    from cccd_workflow.report.render import render_surface

    drawn = []
    for name in names:
        path = FOLDER / f"{name}.png"
        render_surface(FOLDER / name, path, 300)
        drawn.append(_image(path.read_bytes(), f"{name} from the front, the left and above"))
    return "\n".join(drawn)


def heat_map(name: str, most_mm: float, pixels: int = 420) -> str:
    """Draw what ``cccd compare -o`` wrote as VTP: red lies outside the other surface, blue inside."""
    import pyvista

    plotter = pyvista.Plotter(off_screen=True, window_size=(pixels, pixels))
    shown = {"scalars": "distance", "cmap": "RdBu_r", "clim": (-most_mm, most_mm)}
    bar = {"title": "distance, mm", "color": "black"}
    plotter.add_mesh(pyvista.read(FOLDER / name), **shown, scalar_bar_args=bar)
    plotter.view_xz()
    plotter.camera.azimuth = 200
    return _screenshot(plotter, f"{name}, coloured by the distance to the other surface")


def group_map(name: str, pixels: int = 360) -> str:
    """Draw what ``cccd shapes`` wrote as VTP: the difference of the groups, and its p values."""
    import pyvista

    surface = pyvista.read(FOLDER / name)
    plotter = pyvista.Plotter(off_screen=True, shape=(1, 2), window_size=(2 * pixels, pixels))
    most = float(abs(surface["difference_outwards_mm"]).max())
    shown = {
        "difference_outwards_mm": ("difference, mm\n", "RdBu_r", (-most, most)),
        "p": ("p value\n", "YlOrRd_r", (0, 0.1)),
    }
    for column, (scalars, (title, colours, limits)) in enumerate(shown.items()):
        plotter.subplot(0, column)
        bar = {"title": title, "color": "black", "n_labels": 3, "position_y": 0.02}
        drawn = {"scalars": scalars, "cmap": colours, "clim": limits, "scalar_bar_args": bar}
        plotter.add_mesh(surface.copy(), **drawn, smooth_shading=True)
        plotter.view_xz()
        plotter.camera.zoom(0.65)
    return _screenshot(plotter, "difference of the groups in mm, and p values, on the mean surface")


def side_by_side(words: str, *names: str, pixels: int = 240) -> str:
    """Draw meshes (PLY files) in one size, from the front."""
    import pyvista

    plotter = pyvista.Plotter(
        off_screen=True, shape=(1, len(names)), window_size=(pixels * len(names), pixels)
    )
    for column, name in enumerate(names):
        plotter.subplot(0, column)
        plotter.add_mesh(pyvista.read(FOLDER / name), color="wheat", smooth_shading=True)
        plotter.view_xz()
    plotter.link_views()
    plotter.camera.zoom(0.9)
    return _screenshot(plotter, words)


def band(name: str, pixels: int = 620) -> str:
    """Draw what ``cccd surface -o`` wrote as VTP, coloured by the width of its error band."""
    import numpy as np
    import pyvista

    surface = pyvista.read(FOLDER / name)
    width = surface["inner_mm"] + surface["outer_mm"]
    surface["width"] = width
    plotter = pyvista.Plotter(off_screen=True, window_size=(pixels, 2 * pixels // 3))
    bar = {"title": "width, mm", "color": "black", "vertical": True, "position_x": 0.86, "position_y": 0.1}
    shown = {"scalars": "width", "cmap": "YlOrRd", "clim": (0, np.percentile(width, 98))}
    plotter.add_mesh(surface, **shown, smooth_shading=True, scalar_bar_args=bar)
    plotter.view_vector((0.4, -0.9, 0.15), (0, 0, 1))
    plotter.camera.zoom(1.3)
    return _screenshot(plotter, f"{name}, coloured by the width of its error band")


def bands_in_a_cut(name: str, reader_mm: float = 2.0, samples: int = 20) -> str:
    """Draw a cut across the slices of a mask: its surface, bands without and with another reader, samples."""
    import nibabel
    import numpy as np
    from matplotlib.figure import Figure

    import cccd

    figure = Figure(figsize=(7, 3.6))
    axes = figure.add_subplot()
    alone, other = (
        cccd.reconstruct(cccd.read(FOLDER / name), settings=cccd.Settings(surface={"reader_mm": mm}))
        for mm in (None, reader_mm)
    )
    middle = (alone.vertices.min(axis=0) + alone.vertices.max(axis=0))[1] / 2

    def draw(surface, **style):
        path = surface.mesh.section(plane_origin=(0, middle, 0), plane_normal=(0, 1, 0))
        for number, line in enumerate(path.discrete):
            label = style.pop("label", None) if number == 0 else None
            axes.plot(line[:, 0], line[:, 2], label=label, **style)

    for number, one in enumerate(alone.samples(samples)):
        draw(one, color="grey", lw=0.4, label=None if number else f"{samples} samples")
    for number, side in enumerate(other.sides.values()):
        draw(side, color="steelblue", lw=1, label=None if number else "band, with another reader")
    for number, side in enumerate(alone.sides.values()):
        draw(side, color="firebrick", lw=1, label=None if number else "error band")
    draw(alone, color="black", lw=1.4, label="surface")
    scan = nibabel.load(FOLDER / name)
    for height in scan.affine[2, 3] + scan.affine[2, 2] * np.arange(scan.shape[2]):
        axes.axhline(height, color="black", lw=0.4, ls=":", zorder=0)
    low, high = alone.vertices.min(axis=0), alone.vertices.max(axis=0)
    sides = {"xlim": (low[0] - 8, high[0] + 8), "ylim": (low[2] - 8, high[2] + 8)}
    axes.set(aspect="equal", xlabel="mm", ylabel="mm", **sides)
    axes.legend(fontsize=7, loc="best", framealpha=1)
    png = io.BytesIO()
    figure.savefig(png, dpi=130, bbox_inches="tight")
    return _image(png.getvalue(), "a cut across the slices with both bands and samples")


def tree(surface: str, lines: str, pixels: int = 520) -> str:
    """Draw what ``cccd centrelines -o`` wrote as VTP, coloured by the radius, in its surface."""
    import pyvista

    plotter = pyvista.Plotter(off_screen=True, window_size=(pixels, pixels))
    plotter.add_mesh(pyvista.read(FOLDER / surface), color="lightgrey", opacity=0.3)
    bar = {"title": "radius, mm", "color": "black", "vertical": True, "position_x": 0.82, "position_y": 0.1}
    plotter.add_mesh(
        pyvista.read(FOLDER / lines), scalars="radius", cmap="viridis", line_width=5, scalar_bar_args=bar
    )
    plotter.view_xz()
    return _screenshot(plotter, f"the centrelines in {lines}, coloured by the radius")


def groups(name: str, pixels: int = 520) -> str:
    """Draw what ``cccd lumen -o`` or ``cccd hollow -o`` wrote as VTP, each named group in a colour."""
    import pyvista

    data = pyvista.read(FOLDER / name)
    plotter = pyvista.Plotter(off_screen=True, window_size=(pixels, pixels))
    colours = ("lightgrey", "steelblue", "firebrick", "seagreen", "darkorange", "purple", "gold", "teal")
    for number, group in enumerate(data.field_data["group_names"]):
        part = data.extract_cells(data["group"] == number + 1)
        plotter.add_mesh(part, color=colours[number % len(colours)], label=str(group))
    plotter.add_legend(bcolor="white", face="circle", size=(0.22, 0.25), loc="lower right")
    plotter.view_vector((0.2, -0.8, 0.8))
    return _screenshot(plotter, f"the groups in {name}, each in a colour")


def cut_open(solid, pixels: int = 420) -> str:
    """Draw the half of a tetrahedral mesh that lies behind the middle, by the quality of its tetrahedra."""
    import pyvista

    rated = solid.cell_quality("shape")
    behind = rated.extract_cells(rated.cell_centers().points[:, 1] > rated.center[1])
    plotter = pyvista.Plotter(off_screen=True, window_size=(pixels, pixels))
    beside = {"title": "shape", "vertical": True, "position_x": 0.82, "position_y": 0.3}
    plotter.add_mesh(
        behind, scalars="shape", clim=(0, 1), show_edges=True, cmap="viridis", scalar_bar_args=beside
    )
    plotter.view_xz()
    return _screenshot(plotter, "half of the tetrahedra, by quality")


def _screenshot(plotter, words: str) -> str:
    path = FOLDER / "screenshot.png"
    plotter.screenshot(path)
    plotter.close()
    return _image(path.read_bytes(), words)


def panels(pictures: dict, overlay: dict | None = None) -> str:
    """Draw slices (I, J) side by side, with closed curves (n, 2) over those that have some."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(pictures), 3.4), layout="constrained")
    axes = figure.subplots(1, len(pictures), squeeze=False)[0]
    for panel, (title, picture) in zip(axes, pictures.items(), strict=True):
        panel.imshow(picture.T, cmap="gray_r", origin="lower", interpolation="nearest")
        for curve in (overlay or {}).get(title, []):
            panel.plot(*[[*axis, axis[0]] for axis in curve.T], color="tab:red", linewidth=1.4)
        panel.set_title(title, fontsize=9)
        panel.set_axis_off()
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=110)
    return _image(content.getvalue(), ", ".join(pictures))


def _image(content: bytes, words: str) -> str:
    data = base64.b64encode(content).decode()
    return f'<img alt="{html.escape(words)}" src="data:image/png;base64,{data}">'
