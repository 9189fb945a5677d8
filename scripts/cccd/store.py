"""What stages leave in files: HDF5, of which this alone in the core names a dataset's path, and binary PLY.

Every writer writes to a temporary name beside the target and renames, so that a killed job leaves no
half file under a final name. Times are not tracked, so that the same content gives the same bytes.
PLY's vertices are float64, so that nothing of a mesh's soundness is rounded away; trimesh's and VTK's
writers store float32.
"""

from __future__ import annotations

import contextlib
import errno
import glob
import io
import json
import os
import secrets
import tempfile
from collections.abc import Generator, Iterable, Mapping, Sequence
from dataclasses import is_dataclass, replace
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, TypeVar, cast, get_args, get_origin, get_type_hints

import h5py
import numpy as np
import numpy.typing as npt

from cccd.containers import Frame, Grid, Structure
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh

if TYPE_CHECKING:
    import pandas as pd

    from cccd.bands import Band
    from cccd.geometry.subdivision import ControlMesh

_T = TypeVar("_T")

#: How near in mm vertices are that were kept as single floats.
_SAME_VERTEX_MM = 1e-3


@contextlib.contextmanager
def atomic_path(path: str | Path) -> Generator[Path, None, None]:
    """Yield a temporary path in the same folder; rename it to ``path`` when the block succeeds.

    The temporary name keeps the suffix (writers choose their format by it) and is unique to the
    process, so that an orphan of a killed run cannot touch what a rerun writes.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    for stale in path.parent.glob(f".{glob.escape(path.stem)}.????????{path.suffix}"):
        stale.unlink(missing_ok=True)  # a killed job left it; an orphan that still writes it fails to rename
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:  # a signal may come as soon as it is there
        temporary.touch(exist_ok=False)
        try:
            yield temporary
        except OSError as error:
            error.filename = error.filename or str(path)  # a write that fails does not name its file
            raise
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(path: str | Path) -> None:
    """Refuse a file that `atomic_path` could not make: where its folder is, or is to be, one is tried.

    The rights do not tell: root has all of them, and yet makes no file in ``/proc``.

    Raises
    ------
    InputError
        It is a folder, or nothing can be written there.
    """
    if Path(path).is_dir():
        raise InputError(str(path), "that is a folder", "give the name of a file in it")
    folder = next(parent for parent in Path(path).absolute().parents if os.path.exists(parent))
    if not folder.is_dir():
        raise InputError(str(path), f"{folder} is not a folder", "give a folder that you can write to")
    try:
        with tempfile.NamedTemporaryFile(prefix=".", dir=folder):
            pass
    except OSError as error:
        if error.errno == errno.ENOSPC:
            raise
        raise InputError(
            str(path), f"the folder {folder} is not writable", "give a folder that you can write to"
        ) from None


@contextlib.contextmanager
def new_file(path: str | Path) -> Generator[h5py.File, None, None]:
    """Build the file in memory and write it at once: HDF5 crashes the process when the disk is full."""
    content = io.BytesIO()
    with h5py.File(content, "w", track_order=False) as file:
        yield file
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.getbuffer())


@contextlib.contextmanager
def open_file(path: str | Path) -> Generator[h5py.File, None, None]:
    """Open a file to read; one that is damaged, or of another layout, is one line to its user."""
    try:
        file = h5py.File(path, "r", locking=False)
    except OSError as error:
        raise InputError(
            str(path), f"not a readable HDF5 file ({error})", "delete it and run snakemake again"
        ) from None
    with file:
        try:
            yield file
        except (KeyError, OSError) as error:
            raise InputError(
                str(path), f"incomplete or older layout ({error})", "delete it and run snakemake again"
            ) from None


def _put(
    group: h5py.Group,
    name: str,
    array: npt.ArrayLike,
    dtype: npt.DTypeLike | None = None,
    chunks: tuple[int, ...] | None = None,
) -> None:
    array = np.ascontiguousarray(array, dtype)
    packed: dict[str, Any] = {}
    if array.size > 1024:
        packed = {"compression": "gzip", "compression_opts": 4, "shuffle": True, "chunks": chunks}
    group.create_dataset(name, data=array, track_times=False, **packed)


def _get(group: h5py.Group, name: str) -> npt.NDArray[Any]:
    """Read an array; its type is the writer's."""
    return group[name][:]


def _put_json(group: h5py.Group, name: str, value: object) -> None:
    group.attrs[name] = json.dumps(value, sort_keys=True)


def _get_json(group: h5py.Group, name: str) -> Any:
    return json.loads(group.attrs[name])


def _numbered(group: h5py.Group, name: str) -> list[h5py.Group]:
    """Return the groups 0, 1, 2 ... below the group ``name``."""
    parent: h5py.Group = group[name]
    return [parent[key] for key in sorted(parent, key=int)]


def write_fields(group: h5py.Group, value: object) -> None:
    """Write a dataclass by its fields' types: arrays, numbers, text, other dataclasses, lists and mappings.

    What is None is left out; what has parts of any type, or of text, is JSON; the frame is the file's.
    """
    for name, kind in get_type_hints(type(value)).items():
        write_value(group, name, getattr(value, name), kind)


def write_value(group: h5py.Group, name: str, value: Any, kind: Any) -> None:
    """Write one field: see `write_fields`."""
    if isinstance(value, Frame):
        _put_frame(cast(Any, group).file, value)
    elif isinstance(value, np.ndarray):
        _put(group, name, cast("npt.NDArray[Any]", value))
    elif _is_json(kind):
        _put_json(group, name, value)
    elif is_dataclass(value):
        write_fields(group.create_group(name), value)
    elif isinstance(value, (dict, list, tuple)):
        within = group.create_group(name)
        parts = cast(Any, value.items() if isinstance(value, dict) else enumerate(cast(Any, value)))
        for key, part in parts:
            write_value(within, str(key), part, None)
    elif value is not None:
        group.attrs[name] = value


def _is_json(kind: Any) -> bool:
    return get_origin(kind) in (dict, list) and get_args(kind)[-1] in (Any, str)


def read_fields(group: h5py.Group, kind: type[_T]) -> _T:
    """Read a dataclass that `write_fields` wrote."""
    hints = get_type_hints(kind)
    return kind(**{name: read_value(group, name, inner) for name, inner in hints.items()})


def read_value(group: h5py.Group, name: str, kind: Any) -> Any:
    """Read what `write_fields` wrote of one field."""
    if isinstance(kind, UnionType):  # with None
        return read_value(group, name, get_args(kind)[0]) if name in group else None
    if kind is Frame:
        return _get_frame(cast(Any, group).file)
    if np.ndarray in (kind, get_origin(kind)):
        return _get(group, name)
    if _is_json(kind):
        return _get_json(group, name)
    if is_dataclass(kind):
        return read_fields(group[name], cast(Any, kind))
    if (origin := get_origin(kind)) is dict:
        return {key: read_value(group[name], key, get_args(kind)[1]) for key in group[name]}
    if origin in (list, tuple):
        parts = (read_value(group[name], key, get_args(kind)[0]) for key in sorted(group[name], key=int))
        return cast(Any, origin)(parts)
    return kind(group.attrs[name])


def _put_frame(group: h5py.Group, frame: Frame) -> None:
    group.attrs["affine"] = np.asarray(frame.affine, float)
    group.attrs["slice_axis"] = int(frame.slice_axis)
    group.attrs["shape"] = np.asarray(frame.shape, np.int64)
    group.attrs["space"] = "RAS"
    group.attrs["unit"] = "mm"
    if frame.copied_to is not None:
        group.attrs["file_affine"] = np.asarray(frame.copied_to.affine, float)
        group.attrs["file_shape"] = np.asarray(frame.copied_to.shape, np.int64)


def _get_frame(group: h5py.Group) -> Frame:
    grid = _get_grid(group, "")
    assert grid is not None
    return Frame(grid.affine, int(group.attrs["slice_axis"]), grid.shape, _get_grid(group, "file_"))


def _get_grid(group: h5py.Group, prefix: str) -> Grid | None:
    if f"{prefix}affine" not in group.attrs:
        return None
    first, second, third = (int(n) for n in group.attrs[f"{prefix}shape"])
    return Grid(np.array(group.attrs[f"{prefix}affine"]), (first, second, third))


def read_report(path: str | Path) -> dict[str, Any]:
    """Read what a stage reported beside ``contours.h5``, ``curves.h5`` or ``surface.h5``: plain JSON."""
    with open_file(path) as file:
        return _get_json(file, "report")


def write_json(path: str | Path, value: Mapping[str, Any]) -> None:
    """Write ``value`` as sorted, indented JSON; NumPy scalars become numbers, NaN becomes null."""

    def plain(item: Any) -> Any:
        if isinstance(item, Mapping):
            return {str(key): plain(part) for key, part in cast(Mapping[Any, Any], item).items()}
        if isinstance(item, (list, tuple, np.ndarray)):
            return [plain(part) for part in cast(Iterable[Any], item)]
        if isinstance(item, np.generic):
            return plain(cast(Any, item).item())
        return None if isinstance(item, float) and not np.isfinite(item) else item

    with atomic_path(path) as temporary:
        text = json.dumps(plain(value), indent=2, sort_keys=True, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")


def read_json(path: str | Path) -> dict[str, Any]:
    """Read what `write_json` wrote."""
    return json.loads(Path(path).read_text(encoding="utf-8"))


def write_table(path: str | Path, table: pd.DataFrame) -> None:
    """Write a pandas DataFrame as CSV without its index."""
    with atomic_path(path) as temporary:
        table.to_csv(temporary, index=False, float_format="%.6g", lineterminator="\n")


def read_table(path: str | Path) -> pd.DataFrame | None:
    """Read a CSV file as a pandas DataFrame; None when the file is not there or holds no rows."""
    import pandas as pd

    try:
        frame = pd.read_csv(path)
    except (FileNotFoundError, pd.errors.EmptyDataError):  # a line break alone is a table without columns
        return None
    return None if frame.empty else frame


def write_structure(path: str | Path, structure: Structure) -> None:
    """Write ``structure.h5``."""
    with new_file(path) as file:
        write_fields(file, structure)


def read_structure(path: str | Path) -> Structure:
    """Read ``structure.h5``."""
    with open_file(path) as file:
        return read_fields(file, Structure)


def read_drawn(path: str | Path) -> Structure | None:
    """Read ``structure.h5`` where only some slices were drawn; None where all are known."""
    with open_file(path) as file:
        return read_fields(file, Structure) if "annotation" in file else None


def write_control_meshes(
    path: str | Path,
    bodies: Sequence[ControlMesh],
    frame: Frame,
    report: Mapping[str, Any],
    band: tuple[Band, npt.NDArray[np.float64]] | None = None,
) -> None:
    """Write ``surface.h5``: closed splines in mm RAS.

    Parameters
    ----------
    path : path
        Where.
    bodies : sequence of ControlMesh
        A cavity's turned inside out.
    frame : Frame
        The grid of the source volume.
    report : mapping
        Plain JSON about the lofting.
    band : (Band, (V, 3) float64), optional
        The error band, and the vertices that it is of.
    """
    with new_file(path) as file:
        _put_frame(file, frame)
        _put_json(file, "report", report)
        _put_bodies(file.create_group("bodies"), bodies)
        if band is not None:
            group, inner, outer = file.create_group("band"), band[0].inner, band[0].outer
            write_fields(group, replace(band[0], inner=np.float32(inner), outer=np.float32(outer)))
            _put(group, "vertices", band[1], np.float32)


def read_band(path: str | Path, vertices: npt.NDArray[np.float64]) -> Band | None:
    """Read the error band of ``surface.h5`` at the vertices (V, 3) of a mesh; None where there is none."""
    with open_file(path) as file:
        if "band" not in file:
            return None
        from cccd.bands import Band

        band, points = read_fields(file["band"], Band), _get(file, "band/vertices").astype(float)
    band = replace(band, inner=band.inner.astype(float), outer=band.outer.astype(float))
    same = points.shape == vertices.shape and np.allclose(points, vertices, atol=_SAME_VERTEX_MM)
    return band if same else band.moved_to(points, vertices)


def read_bodies(path: str | Path) -> list[ControlMesh]:
    """Read the closed splines of ``surface.h5``."""
    with open_file(path) as file:
        if "bodies" not in file:
            raise InputError(
                str(path), "it contains no closed splines: an older version wrote it", "loft it again"
            )
        return [_get_body(group) for group in _numbered(file, "bodies")]


def bodies_bytes(bodies: Sequence[ControlMesh]) -> int:
    """Bytes that closed splines take in ``surface.h5``, compressed: control points, quads and creases."""
    with h5py.File(io.BytesIO(), "w") as file:
        root = file.create_group("bodies")
        _put_bodies(root, bodies)
        groups = _numbered(file, "bodies")
        return sum(int(group[name].id.get_storage_size()) for group in groups for name in group)


def _put_bodies(root: h5py.Group, bodies: Sequence[ControlMesh]) -> None:
    for number, body in enumerate(bodies):
        group = root.create_group(str(number))
        group.attrs["sign"] = body.sign
        _put(group, "vertices", body.vertices, np.float64)
        # first corners of all quads, then second ones: a fifth less than quad by quad
        _put(group, "quads", body.quads, np.int32, chunks=(len(body.quads), 1))
        _put(group, "creases", body.creases, np.int32)
        _put(group, "crease_sharpness", body.sharpness, np.float32)


def _get_body(group: h5py.Group) -> ControlMesh:
    from cccd.geometry.subdivision import ControlMesh

    quads, creases = (_get(group, name).astype(np.int64) for name in ("quads", "creases"))
    return ControlMesh(_get(group, "vertices"), quads, creases, _get(group, "crease_sharpness").astype(float))


def read_surface_frame(path: str | Path) -> Frame:
    """Read the grid of the source volume that a surface was lofted in."""
    with open_file(path) as file:
        return _get_frame(file)


#: Written wherever a format has room for text; ``SPACE=RAS`` is what 3D Slicer looks for.
NOTE = "CCCD surface; unit mm; SPACE=RAS"

#: A triangle of the file.
_TRIANGLE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def write_ply(path: str | Path, mesh: Mesh, comment: str) -> None:
    """Write a mesh; ``comment`` is one line of the header."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"comment {comment}\n"
        f"element vertex {len(mesh.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    table = np.empty(len(mesh.faces), _TRIANGLE)
    table["count"], table["corners"] = 3, mesh.faces
    Path(path).write_bytes(header.encode() + mesh.vertices.astype("<f8").tobytes() + table.tobytes())


def read_ply(path: str | Path) -> Mesh:
    """Read back what `write_ply` wrote.

    Raises
    ------
    InputError
        When the file holds anything else, or less than its header says.
    """
    data = Path(path).read_bytes()
    head, mark, body = data.partition(b"end_header\n")
    counts = [
        int(line.split()[2]) for line in head.decode("ascii", "replace").splitlines() if "element" in line
    ]
    if not mark or len(counts) != 2 or len(body) != 24 * counts[0] + _TRIANGLE.itemsize * counts[1]:
        raise InputError(str(path), "not a mesh that the lofting wrote", "delete it and run snakemake again")
    vertices = np.frombuffer(body, "<f8", 3 * counts[0]).reshape(-1, 3)
    table = np.frombuffer(body, _TRIANGLE, counts[1], 24 * counts[0])
    return Mesh(vertices.copy(), table["corners"].astype(np.int64))
