# SPDX-License-Identifier: MIT
"""A user's own particles: CSV, PLY, VTK, HDF5 and NPZ, one file a frame or all frames in one.

Columns and arrays are found by name, whatever the case: position (or x y z, points, pos), velocity
(vx vy vz, vel, v), id, time, normal (nx ny nz). What a file calls otherwise, options name.
"""

import csv
import os
import re
import xml.etree.ElementTree
from dataclasses import dataclass, field

import numpy as np

import hdf5
import positions
import sequence
from errors import ConvertError, read_file, warn

# The name of a quantity, then those of its components; the first that is there is taken.
NAMES = {
    "position": (("position", "positions", "points", "pos", "x"), (("x", "y", "z"),)),
    "velocity": (
        ("velocity", "velocities", "vel", "v"),
        (("vx", "vy", "vz"), ("u", "v", "w"), ("vel_x", "vel_y", "vel_z")),
    ),
    "normal": (("normal", "normals"), (("nx", "ny", "nz"),)),
    "id": (("id", "ids", "particle_id", "idp"), ()),
    "time": (("time", "t", "timevalue", "seconds"), ()),
    "frame": (("frame", "step", "timestep"), ()),
}


@dataclass
class Table:
    """Columns of one file by their names in small letters: [rows] or [rows][components], or with
    frames in front; rows are what the first position says."""

    path: str
    columns: dict
    given: dict = field(
        default_factory=dict
    )  # from the name of a quantity to the file's, by options

    def get(self, quantity, wanted=False):
        """The numbers of a quantity; None where the file has none."""
        asked = self.given.get(quantity)
        names, groups = NAMES.get(quantity, ((quantity,), ()))
        if asked:
            parts = [name.strip().lower() for name in asked.split(",")]
            names, groups = (parts, ()) if len(parts) == 1 else ((), (tuple(parts),))
            wanted = True
        for group in groups:
            found = [self.columns[name] for name in group if name in self.columns]
            if len(found) >= 2 and all(name in self.columns for name in group[: len(found)]):
                return np.stack(found, -1).astype(np.float64)
        for name in names:
            parts = [f"{name}{mark}{c}" for mark in (":", "_") for c in range(3)]
            found = [self.columns[part] for part in parts if part in self.columns]
            if len(found) >= 2:  # as ParaView writes vectors into CSV
                return np.stack(found[:3], -1).astype(np.float64)
            if name in self.columns:
                return self.columns[name]
        if wanted:
            there = ", ".join(sorted(self.columns)) or "nothing"
            raise ConvertError(self.path, asked or quantity, f"not there; the file has {there}")
        return None


# ---- Files ----


def read_csv(path):
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            sample = file.readline()
            marks = max(",;\t", key=sample.count)
            marks = marks if sample.count(marks) else " "
            names = [
                n.strip().lower() for n in next(csv.reader([sample.lstrip("# ")], delimiter=marks))
            ]
            names = [name for name in names if name] if marks == " " else names
            rest = [line for line in file if line.strip()]
            if not rest:
                raise ValueError("one line, or none")
            numbers = np.loadtxt(
                rest, delimiter=None if marks == " " else marks, dtype=np.float64, ndmin=2
            )
    except OSError as error:
        raise ConvertError(path, "", error.strerror or str(error)) from None
    except (ValueError, csv.Error, StopIteration) as error:
        raise ConvertError(path, "", f"not a table of numbers: {error}") from None
    if all(re.fullmatch(r"[-+0-9.eE]+", name) for name in names):
        raise ConvertError(path, "", "the first line is wanted to name the columns: x,y,z,...")
    if numbers.size == 0 or numbers.shape[1] != len(names):
        raise ConvertError(path, "", f"{len(names)} names over rows of {numbers.shape[1]} numbers")
    return dict(zip(names, numbers.T))


def read_npz(path):
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name.lower(): file[name] for name in file.files}
    except OSError as error:
        raise ConvertError(path, "", error.strerror or str(error)) from None
    except Exception as error:  # zipfile, zlib and numpy each have their own
        raise ConvertError(path, "", f"not an archive of arrays: {error}") from None


def read_hdf5(path):
    """All datasets of numbers, by their names and by their paths."""
    import h5py

    found = {}

    def visit(name, item):
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu":
            found[name.lower()] = found.setdefault(name.rsplit("/", 1)[-1].lower(), item[()])

    with hdf5.opened(path) as file, hdf5.reading(path, "HDF5"):
        file.visititems(visit)
    return found


def read_mesh(path):
    """PLY and VTK by meshio; what that cannot read by VTK itself, where it is installed."""
    import contextlib
    import io

    data = read_file(path)
    if path.lower().endswith(".ply") and b"end_header" not in data[: 1 << 20]:
        raise ConvertError(
            path, "", "no PLY file: its header does not end"
        )  # meshio waits for it for ever
    reason = "meshio does not read this format"
    if not path.lower().endswith(".vtp"):
        import meshio

        said = io.StringIO()
        try:
            with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
                mesh = meshio.read(path)
            told = re.search(rb"^element vertex (\d+)\s*$", data[: 1 << 20], re.M)
            if path.lower().endswith(".ply") and told and int(told.group(1)) != len(mesh.points):
                raise ValueError(
                    f"{int(told.group(1))} points are told, {len(mesh.points)} are there"
                )
            columns = {name.lower(): np.asarray(values) for name, values in mesh.point_data.items()}
            return {"points": np.asarray(mesh.points), **columns}
        except (Exception, SystemExit) as error:  # meshio ends the program on some files
            reason = f"meshio: {str(error) or type(error).__name__}"
    if path.lower().endswith((".vtp", ".vtk", ".vtu")):
        try:
            return read_with_vtk(path)
        except ModuleNotFoundError:
            reason += "; the module vtk, which may, is not installed"
    raise ConvertError(path, "", f"not readable ({reason})")


def read_with_vtk(path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOLegacy import vtkDataSetReader
    from vtkmodules.vtkIOXML import vtkXMLGenericDataObjectReader

    reader = (
        vtkDataSetReader() if path.lower().endswith(".vtk") else vtkXMLGenericDataObjectReader()
    )
    if hasattr(reader, "ReadAllVectorsOn"):
        reader.ReadAllVectorsOn()
        reader.ReadAllScalarsOn()
        reader.ReadAllNormalsOn()
        reader.ReadAllFieldsOn()
    reader.GlobalWarningDisplayOff()
    reader.SetFileName(path)
    reader.Update()
    data = reader.GetOutput()
    if data is None or not hasattr(data, "GetPoints") or data.GetPoints() is None:
        raise ConvertError(path, "", "not readable: VTK finds no points in it")
    columns = {"points": vtk_to_numpy(data.GetPoints().GetData())}
    arrays = data.GetPointData()
    for i in range(arrays.GetNumberOfArrays()):
        if arrays.GetArray(i) is not None:
            columns[arrays.GetArrayName(i).lower()] = vtk_to_numpy(arrays.GetArray(i))
    return columns


READERS = {
    ".csv": read_csv,
    ".txt": read_csv,
    ".npz": read_npz,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".ply": read_mesh,
    ".vtk": read_mesh,
    ".vtu": read_mesh,
    ".vtp": read_mesh,
}


def table(path, given):
    reader = READERS.get(os.path.splitext(path)[1].lower())
    if reader is None:
        raise ConvertError(path, "", f"the end of its name is none of {' '.join(READERS)} .pvd")
    return Table(path, reader(path), given)


# ---- Frames ----


def natural(path):
    """frame_2 before frame_10."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path)]


def listed(path):
    """(files, times) of a .pvd."""
    try:
        sets = xml.etree.ElementTree.parse(path).getroot().findall("Collection/DataSet")
        entries = [(float(item.get("timestep")), item.get("file")) for item in sets]
        if not entries or not all(name for _, name in entries):
            raise ValueError("no DataSet with a file")
    except OSError as error:
        raise ConvertError(path, "", error.strerror or str(error)) from None
    except (xml.etree.ElementTree.ParseError, ValueError, TypeError) as error:
        raise ConvertError(path, "", f"no collection of VTK files: {error}") from None
    folder = os.path.dirname(path)
    return [os.path.join(folder, name) for _, name in entries], [time for time, _ in entries]


@dataclass
class Frame:
    origin: str
    position: np.ndarray  # [N][dim]
    velocity: np.ndarray  # or None
    id: np.ndarray  # or None
    time: float  # or None


def chosen(rows, selection, quantity, frame_count=None):
    """Rows of a table where NAME is one of the values, of "NAME=V,V"; all where nothing is selected."""
    if selection is None:
        return slice(None)
    name, _, values = selection.partition("=")
    try:
        wanted = [float(v) for v in values.split(",")]
    except ValueError:
        raise ConvertError(rows.path, quantity, f"{selection!r} is not NAME=NUMBER,...") from None
    column = Table(rows.path, rows.columns, {name: name}).get(name)
    return np.isin(np.asarray(column).reshape(len(column), -1)[:, 0], wanted)


def vectors(origin, name, values, count):
    values = np.asarray(values, np.float64)
    if values.ndim != 2 or len(values) != count or values.shape[1] not in (2, 3):
        raise ConvertError(origin, name, f"shape {list(values.shape)}, [{count}, 2 or 3] is wanted")
    return values


def frames_of(rows, selection):
    """The frames of one file: of arrays [T][N][dim], of a column that numbers frames or times, or one."""
    x = np.asarray(rows.get("position", wanted=True))
    v, ids, time, number = (rows.get(q) for q in ("velocity", "id", "time", "frame"))
    if x.ndim == 3:
        for t in range(len(x)):
            yield Frame(
                rows.path,
                vectors(rows.path, "position", x[t], x.shape[1]),
                None if v is None else vectors(rows.path, "velocity", v[t], x.shape[1]),
                None if ids is None else np.asarray(ids[t] if np.ndim(ids) == 2 else ids),
                (
                    None
                    if time is None or np.ndim(time) != 1 or len(time) != len(x)
                    else float(time[t])
                ),
            )
        return
    keep = chosen(rows, selection, "--fluid")
    x = vectors(rows.path, "position", x, len(x))[keep]
    v = None if v is None else vectors(rows.path, "velocity", v, len(v))[keep]
    ids = None if ids is None else np.asarray(ids).reshape(-1)[keep]
    each = time if time is not None and np.size(time) > 1 else number
    if each is None or np.size(each) <= 1:
        yield Frame(rows.path, x, v, ids, None if time is None else float(np.ravel(time)[0]))
        return
    each = np.asarray(each).reshape(-1)[keep]
    for value in np.unique(each):
        here = each == value
        yield Frame(
            f"{rows.path} at {value:g}",
            x[here],
            None if v is None else v[here],
            None if ids is None else ids[here],
            float(value) if each is not number and time is not None else None,
        )


def in_order(frames):
    """Rows of all frames in the order of ids, or as they are; the same particles throughout."""
    first = frames[0]
    with_ids = all(f.id is not None for f in frames)
    for f in frames:
        if f.position.shape != first.position.shape:
            raise ConvertError(
                f.origin,
                "position",
                f"{len(f.position)} particles in {f.position.shape[1]}D, {len(first.position)} in "
                f"{first.position.shape[1]}D in {first.origin}; a sequence keeps its particles",
            )
    if not with_ids:
        return frames
    known = np.sort(first.id)
    if len(np.unique(known)) != len(known):
        raise ConvertError(first.origin, "id", "given twice")
    for f in frames:
        order = np.argsort(f.id, kind="stable")
        if not np.array_equal(f.id[order], known):
            raise ConvertError(f.origin, "id", f"other ids than in {first.origin}")
        f.position = f.position[order]
        f.velocity = None if f.velocity is None else f.velocity[order]
    return frames


def time_between(frames, times, given):
    """s between frames: as given, else from times that are evenly spaced."""
    if given is not None:
        return given
    if times is None and all(f.time is not None for f in frames):
        times = [f.time for f in frames]
    if times is None or len(times) < 2:
        raise ConvertError(frames[0].origin, "time", "not told; give --dt")
    steps = np.diff(times)
    mean = float(f"{(times[-1] - times[0]) / (len(times) - 1):.9g}")
    if not mean > 0 or np.abs(steps - mean).max() > 0.01 * mean:
        raise ConvertError(
            frames[0].origin,
            "time",
            f"from {steps.min():g} to {steps.max():g} s apart; evenly is wanted, or --dt",
        )
    return mean


# ---- Walls ----


def walls(options, first_table, fluid, spacing, dim):
    """(position, normal, extra metadata)."""
    position, normal, extra = np.empty((0, dim)), None, {}
    if options.boundary:
        keep = chosen(first_table, options.boundary, "--boundary")
        position = vectors(
            first_table.path, "position", first_table.get("position", True), len(keep)
        )[keep]
        normal = first_table.get("normal")
        normal = None if normal is None else np.asarray(normal)[keep]
    elif options.walls:
        given = table(options.walls, {})
        position = given.get("position", wanted=True)
        position = vectors(options.walls, "position", position, len(position))
        normal = given.get("normal")
    elif options.box:
        if len(options.box) != 2 * dim:
            raise ConvertError(
                "--box", "", f"{len(options.box)} numbers; {2 * dim} are wanted in {dim}D"
            )
        low, high = np.array(options.box[:dim]), np.array(options.box[dim:])
        if not (high > low).all():
            raise ConvertError("--box", "", "the high corner is not above the low one")
        position, normal = sequence.walls_around(
            low, high, [False] * dim, spacing, options.wall_layers
        )
        extra = {"walls": "made around a box"}
        return position, normal, extra
    position = position[:, :dim] * options.scale
    if normal is None and len(position):
        normal = sequence.estimated_normals(position, fluid, spacing)
        extra = {"normals_estimated": "all"}
    elif len(position):
        normal = np.asarray(normal, np.float64)[:, :dim]
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        if not (length > 0).all():
            raise ConvertError(options.walls or first_table.path, "normal", "of length 0")
        normal = normal / length
    return position, np.empty((0, dim)) if normal is None else normal, extra


# ---- All of it ----


def read(paths, options):
    """The Sequence of the files given, in natural order."""
    times = None
    if len(paths) == 1 and paths[0].lower().endswith(".pvd"):
        paths, times = listed(paths[0])
    else:
        paths = sorted(paths, key=natural)
    given = {"position": options.position, "velocity": options.velocity_name, "id": options.id}
    given = {name: value for name, value in given.items() if value}
    tables = [table(path, given) for path in paths]
    frames = in_order([f for rows in tables for f in frames_of(rows, options.fluid)])
    if times is not None and len(times) != len(frames):
        times = None
    origin, dim = frames[0].origin, frames[0].position.shape[1]
    flat = dim == 3 and all(np.ptp(f.position[:, 2]) == 0.0 for f in frames if len(f.position))
    dim = options.dim or (2 if flat else dim)
    position = np.stack([f.position[:, :dim] for f in frames]) * options.scale
    dt = time_between(frames, times, options.dt)
    stored = all(f.velocity is not None for f in frames)
    if stored:
        velocity = np.stack([f.velocity[:, :dim] for f in frames]) * options.scale
    else:
        if any(f.velocity is not None for f in frames):
            warn(origin, "velocity", "not in all frames: differences are taken instead")
        position, velocity = positions.with_first_velocity(origin, position, dt)
    sequence.check_finite(origin, "position", position)
    spacing, spacing_from = sequence.choose_spacing(origin, position[0], options.spacing)
    boundary, normal, extra = walls(options, tables[0], position[0], spacing, dim)
    gravity = options.gravity or (0.0, -9.81) + (0.0,) * (dim - 2)
    density = options.rest_density or 1000.0
    name, end = os.path.splitext(os.path.basename(options.output))
    if end != ".safetensors":
        raise ConvertError(options.output, "", "the output's name ends in .safetensors")
    return sequence.Sequence(
        origin=origin,
        name=name,
        position=position.astype(np.float32),
        velocity=velocity.astype(np.float32),
        boundary=boundary.astype(np.float32),
        normal=normal.astype(np.float32),
        dt=dt,
        gravity=gravity,
        spacing=spacing,
        spacing_from=spacing_from,
        rest_density=density,
        particle_mass=sequence.lattice_mass(density, spacing, dim),
        source=options.source or f"imported from {os.path.basename(paths[0])}",
        extra=extra,
    )
