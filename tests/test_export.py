# SPDX-License-Identifier: MIT
"""Files for other programs, read by those programs' own libraries, and theirs read here: PLY, VTK, USD,
surfaces; CSV, NPZ, HDF5. Run by tests/export_test.sh; ASCC names the program."""

import contextlib
import importlib
import importlib.util
import io
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(HERE, "support"), os.path.join(HERE, "..", "examples", "convert")]

import convert  # noqa: E402
import tap  # noqa: E402
import tensorfile  # noqa: E402

ASCC = os.environ["ASCC"]


def needs(module):
    return unittest.skipUnless(importlib.util.find_spec(module), f"no Python module {module}")


def ascc(*words, status=0):
    done = subprocess.run([ASCC, *map(str, words)], capture_output=True, text=True)
    if done.returncode != status:
        raise AssertionError(f"ascc {words}: {done.returncode}\n{done.stderr}")
    return done.stdout + done.stderr


class Case(unittest.TestCase):
    """A run in 3D and one in 2D, of four frames, with all they write."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.root = folder.name
        cls.truth = {}
        for dim in (2, 3):
            words = ["sim", "demo", f"dam-break-{dim}d", "--size", 8, "-n", 9, "--every", 3]
            ascc(
                *words,
                "-o",
                cls.at(f"s{dim}.safetensors"),
                "--ply",
                cls.at(f"ply{dim}"),
                "--vtk",
                cls.at(f"vtk{dim}"),
            )
            tensors, metadata = tensorfile.read(cls.at(f"s{dim}.safetensors"))
            cls.truth[dim] = (
                three(tensors["fluid.position"]),
                three(tensors["fluid.velocity"]),
                float(metadata["dt"]),
                tensors,
            )

    @classmethod
    def at(cls, *names):
        return os.path.join(cls.root, *names)

    def frames(self, dim, folder, end):
        names = [f"frame_{3 * f:05d}.{end}" for f in range(4)]
        self.assertEqual(
            sorted(n for n in os.listdir(self.at(folder)) if n.startswith("frame_")), names
        )
        for f, name in enumerate(names):
            yield self.at(folder, name), *(values[f] for values in self.truth[dim][:2])


def three(vectors):
    out = np.zeros((*vectors.shape[:-1], 3), np.float32)
    out[..., : vectors.shape[-1]] = vectors
    return out


def appended(path):
    """Arrays of a VTK XML file with raw blocks behind its text, by name: another reader where VTK is not."""
    with open(path, "rb") as file:
        text, _, blocks = file.read().partition(b'<AppendedData encoding="raw">\n_')
    root = xml.etree.ElementTree.fromstring(text + b"</VTKFile>")
    assert root.get("header_type") == "UInt64" and root.get("byte_order") == "LittleEndian"
    types = {"Float32": "<f4", "Int64": "<i8", "Int32": "<i4"}
    arrays = {}
    for item in root.iter("DataArray"):
        if item.get("format") != "appended":
            continue
        at = int(item.get("offset"))
        size = int(np.frombuffer(blocks[at : at + 8], "<u8")[0])
        values = np.frombuffer(blocks[at + 8 : at + 8 + size], types[item.get("type")])
        width = int(item.get("NumberOfComponents"))
        arrays[item.get("Name")] = values.reshape(-1, width) if width > 1 else values
    return root, arrays


class Ply(Case):
    @needs("meshio")
    def test_meshio_reads_positions_velocities_and_ids(self):
        import meshio

        for dim in (2, 3):
            for path, x, v in self.frames(dim, f"ply{dim}", "ply"):
                mesh = meshio.read(path)
                np.testing.assert_array_equal(mesh.points, x)
                for c, name in enumerate(("vx", "vy", "vz")):
                    np.testing.assert_array_equal(mesh.point_data[name], v[:, c])
                np.testing.assert_array_equal(mesh.point_data["id"], 1 + np.arange(len(x)))

    @needs("vtkmodules")
    def test_vtk_reads_velocities(self):
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkIOPLY import vtkPLYReader

        for dim in (2, 3):
            for path, x, v in self.frames(dim, f"ply{dim}", "ply"):
                reader = vtkPLYReader()
                reader.SetFileName(path)
                reader.Update()
                out = reader.GetOutput()
                np.testing.assert_array_equal(vtk_to_numpy(out.GetPoints().GetData()), x)
                np.testing.assert_array_equal(vtk_to_numpy(out.GetPointData().GetNormals()), v)


class Vtk(Case):
    def test_the_collection_tells_times_and_files(self):
        for dim in (2, 3):
            root = xml.etree.ElementTree.parse(self.at(f"vtk{dim}", "frames.pvd")).getroot()
            entries = [(float(e.get("timestep")), e.get("file")) for e in root.iter("DataSet")]
            dt = self.truth[dim][2]
            self.assertEqual(
                [name for _, name in entries], [f"frame_{3 * f:05d}.vtp" for f in range(4)]
            )
            np.testing.assert_allclose([t for t, _ in entries], dt * np.arange(4), rtol=1e-7)
            self.assertTrue(all(os.path.isfile(self.at(f"vtk{dim}", name)) for _, name in entries))

    def test_arrays_are_where_the_text_says(self):
        for dim in (2, 3):
            for path, x, v in self.frames(dim, f"vtk{dim}", "vtp"):
                root, arrays = appended(path)
                np.testing.assert_array_equal(arrays["Points"], x)
                np.testing.assert_array_equal(arrays["velocity"], v)
                np.testing.assert_allclose(arrays["speed"], np.linalg.norm(v, axis=1), rtol=1e-6)
                np.testing.assert_array_equal(arrays["id"], 1 + np.arange(len(x)))
                np.testing.assert_array_equal(arrays["connectivity"], np.arange(len(x)))
                np.testing.assert_array_equal(arrays["offsets"], np.arange(len(x)) + 1)
                self.assertEqual(root.find("PolyData/Piece").get("NumberOfVerts"), str(len(x)))
            _, walls = appended(self.at(f"vtk{dim}", "walls.vtp"))
            np.testing.assert_array_equal(
                walls["Points"], three(self.truth[dim][3]["boundary.position"])
            )
            np.testing.assert_array_equal(
                walls["Normals"], three(self.truth[dim][3]["boundary.normal"])
            )

    @needs("vtkmodules")
    def test_vtk_reads_all_of_it(self):
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

        for dim in (2, 3):
            for f, (path, x, v) in enumerate(self.frames(dim, f"vtk{dim}", "vtp")):
                reader = vtkXMLPolyDataReader()
                reader.SetFileName(path)
                reader.Update()
                out = reader.GetOutput()
                data = out.GetPointData()
                np.testing.assert_array_equal(vtk_to_numpy(out.GetPoints().GetData()), x)
                np.testing.assert_array_equal(vtk_to_numpy(data.GetVectors()), v)
                self.assertEqual(
                    (data.GetVectors().GetName(), data.GetScalars().GetName()),
                    ("velocity", "speed"),
                )
                np.testing.assert_array_equal(
                    vtk_to_numpy(data.GetArray("id")), 1 + np.arange(len(x))
                )
                self.assertEqual(out.GetNumberOfVerts(), len(x))
                seconds = out.GetFieldData().GetArray("TimeValue").GetValue(0)
                self.assertAlmostEqual(seconds, f * self.truth[dim][2], places=9)
            reader = vtkXMLPolyDataReader()
            reader.SetFileName(self.at(f"vtk{dim}", "walls.vtp"))
            reader.Update()
            normals = vtk_to_numpy(reader.GetOutput().GetPointData().GetNormals())
            np.testing.assert_array_equal(normals, three(self.truth[dim][3]["boundary.normal"]))

    def test_an_interrupted_run_lists_the_frames_it_has(self):
        folder = self.at("interrupted")
        with subprocess.Popen(
            [ASCC, "sim", "demo", "dam-break-2d", "-n", "100000000", "--every", "5", "--vtk", folder],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        ) as run:  # fmt: skip
            for _ in range(200):
                if os.path.exists(os.path.join(folder, "frame_00010.vtp")):
                    break
                time.sleep(0.05)
            run.send_signal(signal.SIGINT)
        root = xml.etree.ElementTree.parse(os.path.join(folder, "frames.pvd")).getroot()
        listed = {e.get("file") for e in root.iter("DataSet")}
        self.assertEqual(listed, {n for n in os.listdir(folder) if n.startswith("frame_")})
        self.assertGreaterEqual(len(listed), 3)


class Convert(Case):
    def test_a_sequence_becomes_the_files_that_the_run_wrote(self):
        for dim in (2, 3):
            told = ascc(
                "convert",
                self.at(f"s{dim}.safetensors"),
                "--ply",
                self.at("p"),
                "--vtk",
                self.at("v"),
            )
            self.assertIn("4 frames", told)
            for f, (path, _, _) in enumerate(self.frames(dim, f"ply{dim}", "ply")):
                with open(path, "rb") as a, open(self.at("p", f"frame_{f:05d}.ply"), "rb") as b:
                    self.assertEqual(a.read(), b.read())
            for f, (path, _, _) in enumerate(self.frames(dim, f"vtk{dim}", "vtp")):
                ours, theirs = appended(path)[1], appended(self.at("v", f"frame_{f:05d}.vtp"))[1]
                for name, values in theirs.items():
                    np.testing.assert_array_equal(values, ours[name])
            told = ascc(
                "convert", self.at(f"s{dim}.safetensors"), "--vtk", self.at("every"), "--every", 3
            )
            self.assertIn("2 frames", told)

    def test_what_cannot_be_converted_is_told(self):
        s = self.at("s2.safetensors")
        for words, status, says in (
            ((s, "--vtk", self.at("x"), "-o", self.at("y")), 2, "and no -o"),
            (("--vtk", self.at("x")), 2, "one SEQUENCE is wanted"),
            ((s, "--vtk", self.at("x"), "--every", "0"), 2, "--every 0: no value"),
            ((s, "--vtk"), 2, "value is missing behind: --vtk"),
            ((s, "--ply", s), 1, "Not a directory"),
            (("none", "--ply", self.at("x")), 1, "none: No such file"),
        ):
            told = ascc("convert", *words, status=status)
            self.assertIn(says, told)
            self.assertEqual(told.count("\n"), 1)


class Tool(Case):
    def run_tool(self, *words):
        """(status, standard error, standard output) of convert.py, which leaves nothing half written."""
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = convert.main([str(word) for word in words])
        left = [n for _, _, names in os.walk(self.root) for n in names if "partial" in n]
        self.assertEqual(left, [])
        return status, err.getvalue(), out.getvalue()


@needs("pxr")
class Usd(Tool):
    def test_usd_reads_points_velocities_and_ids_through_time(self):
        from pxr import Usd, UsdGeom

        for dim in (2, 3):
            for end in ("usdc", "usda"):
                path = self.at(f"s{dim}.{end}")
                status, err, _ = self.run_tool("usd", self.at(f"s{dim}.safetensors"), "-o", path)
                self.assertEqual((status, err), (0, ""))
                stage = Usd.Stage.Open(path)
                x, v, dt, tensors = self.truth[dim]
                points = UsdGeom.Points(stage.GetPrimAtPath("/ascc/fluid"))
                self.assertAlmostEqual(stage.GetTimeCodesPerSecond() * dt, 1.0)
                self.assertEqual((stage.GetStartTimeCode(), stage.GetEndTimeCode()), (0, 3))
                self.assertEqual(UsdGeom.GetStageUpAxis(stage), "Y")
                self.assertEqual(UsdGeom.GetStageMetersPerUnit(stage), 1.0)
                for f in range(4):
                    np.testing.assert_array_equal(points.GetPointsAttr().Get(f), x[f])
                    np.testing.assert_array_equal(points.GetVelocitiesAttr().Get(f), v[f])
                np.testing.assert_array_equal(points.GetIdsAttr().Get(), 1 + np.arange(x.shape[1]))
                walls = UsdGeom.Points(stage.GetPrimAtPath("/ascc/walls"))
                np.testing.assert_array_equal(
                    walls.GetPointsAttr().Get(), three(tensors["boundary.position"])
                )
                widths = list(points.GetWidthsAttr().Get()) * x.shape[1]
                extent = UsdGeom.Points.ComputeExtent(points.GetPointsAttr().Get(2), widths)
                np.testing.assert_allclose(points.GetExtentAttr().Get(2), extent, atol=1e-6)

    def test_what_is_no_sequence_is_refused(self):
        with open(self.at("text"), "w") as file:
            file.write("no sequence")
        for path, output, says in (
            (self.at("text"), self.at("t.usda"), "text"),
            (self.at("s2.safetensors"), self.at("t.obj"), "ends in .usdc"),
            (self.at("none"), self.at("t.usda"), "No such file"),
        ):
            status, err, _ = self.run_tool("usd", path, "-o", output)
            self.assertEqual((status, err.count("\n")), (2, 1))
            self.assertIn(says, err)
            self.assertFalse(os.path.exists(output))


@needs("pysplashsurf")
class Surface(Case):
    def test_the_recipe_makes_a_closed_surface_around_the_water(self):
        ascc("sim", "demo", "still-column-3d", "--size", 10, "-n", 1, "--ply", self.at("still"))
        with open(os.path.join(HERE, "..", "docs", "exporting.md")) as file:
            recipe = re.search(r"pysplashsurf reconstruct (.*)", file.read()).group(1)
        words = recipe.replace("frames/", self.at("still") + "/").replace("{}", "00001").split()
        words[words.index("-o") + 1] = self.at("surface.obj")
        words = [word.strip('"') for word in words]
        program = "from pysplashsurf import run_pysplashsurf; run_pysplashsurf()"
        subprocess.run(
            [sys.executable, "-c", program, "reconstruct", *words], check=True, capture_output=True
        )
        vertices, faces = [], []
        with open(self.at("surface.obj")) as file:
            for line in file:
                if line.startswith("v "):
                    vertices.append([float(c) for c in line.split()[1:4]])
                elif line.startswith("f "):
                    faces.append([int(c.split("/")[0]) - 1 for c in line.split()[1:4]])
        a, b, c = np.moveaxis(np.array(vertices)[np.array(faces)], 1, 0)
        volume = (np.cross(a, b) * c).sum() / 6
        with open(self.at("still", "frame_00001.ply"), "rb") as file:
            count = int(re.search(rb"element vertex (\d+)", file.read(200)).group(1))
        self.assertGreater(volume / (count * 0.05**3), 0.85)
        self.assertLess(volume / (count * 0.05**3), 1.05)
        edges = np.sort(np.concatenate([np.array(faces)[:, [i, (i + 1) % 3]] for i in range(3)]), 1)
        _, times = np.unique(edges, axis=0, return_counts=True)
        self.assertTrue((times == 2).all())  # closed


class Import(Tool):
    def imported(self, *words, dim=3, warns=""):
        """Tensors and metadata of an import that must succeed, and that the program takes."""
        path = self.at("imported.safetensors")
        status, err, _ = self.run_tool("import", *words, "-o", path)
        self.assertEqual(status, 0, err)
        self.assertEqual(err == "", warns == "", err)
        self.assertIn(warns, err)
        self.assertIn(f"dimension         {dim}", ascc("info", path))
        return tensorfile.read(path)

    def refused(self, *words, says):
        path = self.at("refused.safetensors")
        status, err, out = self.run_tool("import", *words, "-o", path)
        self.assertEqual((status, out), (2, ""), err)
        self.assertEqual(err.count("\n"), 1, err)
        self.assertIn(says, err)
        self.assertFalse(os.path.exists(path))

    def equals(self, tensors, dim, atol=0.0):
        x, v, _, _ = self.truth[dim]
        np.testing.assert_allclose(tensors["fluid.position"], x[..., :dim], rtol=0, atol=atol)
        np.testing.assert_allclose(tensors["fluid.velocity"], v[..., :dim], rtol=0, atol=atol)

    @needs("meshio")
    def test_what_was_exported_comes_back(self):
        for dim in (2, 3):
            tensors, metadata = self.imported(
                self.at(f"ply{dim}"), "--dt", 0.01, "--spacing", 0.05, dim=dim
            )
            self.equals(tensors, dim)
            self.assertEqual((metadata["dt"], metadata["particle_radius"]), ("0.01", "0.025"))
        # And runs: what was imported is a scene.
        ascc("sim", "demo", self.at("imported.safetensors"), "-n", 2)

    @needs("vtkmodules")
    def test_a_collection_of_vtk_files_comes_back_with_its_times(self):
        tensors, metadata = self.imported(
            self.at("vtk3", "frames.pvd"), "--walls", self.at("vtk3", "walls.vtp")
        )
        self.equals(tensors, 3)
        self.assertAlmostEqual(float(metadata["dt"]), self.truth[3][2], places=9)
        np.testing.assert_array_equal(
            tensors["boundary.position"], self.truth[3][3]["boundary.position"]
        )
        np.testing.assert_array_equal(
            tensors["boundary.normal"], self.truth[3][3]["boundary.normal"]
        )

    @needs("meshio")
    def test_frames_that_meshio_wrote(self):
        import meshio

        x, v, _, _ = self.truth[3]
        rng = np.random.default_rng(3)
        for end in ("vtu", "vtk", "ply"):
            folder = self.at("meshio-" + end)
            os.makedirs(folder)
            for f in range(4):
                order = rng.permutation(x.shape[1])  # ids put rows back
                data = {"id": order.astype(np.int32)}
                if end == "ply":
                    data.update({name: v[f][order, c] for c, name in enumerate(("vx", "vy", "vz"))})
                else:
                    data["Velocity"] = v[f][order]
                cells = [("vertex", np.arange(x.shape[1])[:, None])] if end != "ply" else []
                meshio.Mesh(x[f][order], cells, point_data=data).write(
                    os.path.join(folder, f"f{3 * f + 8}.{end}")
                )
            self.equals(self.imported(folder, "--dt", 0.02)[0], 3)

    def test_arrays_of_all_frames(self):
        import h5py

        x, v, _, _ = self.truth[3]
        np.savez(self.at("a.npz"), Position=x, Velocity=v, time=0.5 + 0.02 * np.arange(4))
        tensors, metadata = self.imported(self.at("a.npz"))
        self.equals(tensors, 3)
        self.assertEqual(metadata["dt"], "0.02")
        with h5py.File(self.at("a.h5"), "w") as file:
            file["run/fluid/pos"], file["run/fluid/speed3"] = x, v
        self.equals(
            self.imported(self.at("a.h5"), "--dt", 0.1, "--velocity", "run/fluid/speed3")[0], 3
        )
        for f in range(4):
            np.savez(self.at(f"one-{8 + f}.npz"), x=x[f] * 100, v=v[f] * 100)
        paths = [self.at(f"one-{f}.npz") for f in (10, 9, 8, 11)]
        self.equals(self.imported(*paths, "--dt", 0.1, "--scale", 0.01)[0], 3, atol=1e-6)

    def test_tables(self):
        for dim in (2, 3):
            x, v, dt, _ = self.truth[dim]
            rng = np.random.default_rng(5)
            rows = [
                (f * dt, i, *x[f, i, :dim], *v[f, i, :dim])
                for f in range(4)
                for i in rng.permutation(x.shape[1])
            ]
            names = ["Time", "ID", *"xyz"[:dim], *("vx", "vy", "vz")[:dim]]
            for mark in ",;\t ":
                with open(self.at("t.csv"), "w") as file:
                    file.write(mark.join(names) + "\n")
                    file.writelines(mark.join(repr(float(n)) for n in row) + "\n" for row in rows)
                tensors, metadata = self.imported(self.at("t.csv"), dim=dim)
                self.equals(tensors, dim)
                self.assertAlmostEqual(float(metadata["dt"]), dt, places=7)
        # As ParaView writes them: a file a frame, vectors by component.
        x, v, _, _ = self.truth[3]
        for f in range(4):
            table = np.concatenate([v[f], x[f]], 1)
            head = '"velocity:0","velocity:1","velocity:2","Points:0","Points:1","Points:2"'
            np.savetxt(self.at(f"p{f}.csv"), table, "%.9g", ",", header=head, comments="")
        self.equals(self.imported(*[self.at(f"p{f}.csv") for f in range(4)], "--dt", 0.01)[0], 3)

    def test_without_velocities_the_first_frame_makes_them(self):
        x, _, _, _ = self.truth[3]
        np.savez(self.at("x.npz"), position=x)
        tensors, metadata = self.imported(self.at("x.npz"), "--dt", 0.02)
        np.testing.assert_array_equal(tensors["fluid.position"], x[1:])
        np.testing.assert_allclose(
            tensors["fluid.velocity"][0], (x[1] - x[0].astype(float)) / 0.02, rtol=1e-5
        )
        self.assertEqual(metadata["velocity_frames"], "first")

    def test_walls_come_from_rows_files_and_boxes(self):
        x, v, _, _ = self.truth[3]
        lattice = (
            np.stack(np.meshgrid(np.arange(6), [-0.5], np.arange(6)), -1).reshape(-1, 3) * 0.05
        )
        both = np.concatenate([x[0], lattice])
        kind = np.repeat([1, 0], [len(x[0]), len(lattice)])
        table = np.column_stack([both, np.zeros_like(both), kind])
        np.savetxt(self.at("k.csv"), table, "%.9g", ",", header="x,y,z,vx,vy,vz,type", comments="")
        words = (self.at("k.csv"), "--dt", 0.01, "--fluid", "type=1", "--boundary", "type=0")
        tensors, metadata = self.imported(*words)
        np.testing.assert_allclose(tensors["fluid.position"][0], x[0], atol=1e-7)
        np.testing.assert_allclose(tensors["boundary.position"], lattice, atol=1e-7)
        np.testing.assert_allclose(
            tensors["boundary.normal"], np.tile([0, 1, 0], (36, 1)), atol=1e-6
        )
        self.assertEqual(metadata["normals_estimated"], "all")
        np.savez(self.at("w.npz"), position=lattice, normal=np.tile([0, 3.0, 0], (36, 1)))
        np.savez(self.at("x.npz"), position=x, velocity=v)
        tensors, _ = self.imported(self.at("x.npz"), "--dt", 0.01, "--walls", self.at("w.npz"))
        np.testing.assert_array_equal(
            tensors["boundary.normal"], np.float32(np.tile([0, 1, 0], (36, 1)))
        )
        tensors, _ = self.imported(
            self.at("x.npz"), "--dt", 0.01, "--spacing", 0.05, "--box", "0 0 0 1 0.6 0.2"
        )
        inside = tensors["boundary.position"] + 0.03 * tensors["boundary.normal"]
        self.assertTrue(((inside > -0.01) & (inside < np.array([1, 0.6, 0.2]) + 0.01)).all())

    def test_what_cannot_be_is_refused_by_name(self):
        x, v, _, _ = self.truth[3]

        def save(name, **arrays):
            np.savez(self.at(name), **arrays)
            return self.at(name)

        a = save("a.npz", position=x[0], velocity=v[0], id=np.arange(len(x[0])))
        fewer = save("b.npz", position=x[1][:-1], velocity=v[1][:-1], id=np.arange(len(x[0]) - 1))
        others = save("b2.npz", position=x[1], velocity=v[1], id=np.arange(len(x[0])) + 1)
        self.refused(a, fewer, "--dt", 0.1, says="127 particles in 3D, 128 in 3D")
        self.refused(a, others, "--dt", 0.1, says="b2.npz: id: other ids")
        self.refused(save("c.npz", position=x, velocity=v), says="time: not told; give --dt")
        self.refused(
            save("d.npz", position=x, velocity=v, time=[0, 1, 2, 9]), says="evenly is wanted"
        )
        self.refused(
            save("e.npz", position=np.where(x == x[2, 3, 1], np.nan, x)),
            "--dt",
            1,
            says="not finite",
        )
        self.refused(
            save("f.npz", place=x), "--dt", 1, says="f.npz: position: not there; the file has place"
        )
        self.refused(a, "--velocity", "speeds", "--dt", 1, says="speeds: not there")
        self.refused(save("g.npz", position=x[..., 0]), "--dt", 1, says="shape")
        self.refused(save("h.npz", position=x, velocity=v[:, :5]), "--dt", 1, says="velocity")
        self.refused(a, "--dt", 1, "--fluid", "id", says="NAME=NUMBER")
        self.refused(a, "--dt", 1, "--fluid", "kind=1", says="kind: not there")
        self.refused(a, "--dt", 1, "--box", "0 0 0 1 1 -1", says="high corner")
        self.refused(a, "--dt", 1, "--box", "0 0 1 1", says="6 are wanted")
        self.refused(self.at("none.npz"), "--dt", 1, says="none.npz")
        with open(self.at("n.xyz"), "w") as file:
            file.write("1 2 3\n")
        self.refused(self.at("n.xyz"), "--dt", 1, says="none of .csv")
        for text, says in (
            ("1,2,3\n4,5,6\n", "name the columns"),
            ("x,y\n1,2,3\n", "2 names over rows of 3"),
            ("x,y\n1,two\n", "not a table"),
            ("", "t.csv"),
        ):
            with open(self.at("t.csv"), "w") as file:
                file.write(text)
            self.refused(self.at("t.csv"), "--dt", 1, says=says)
        with open(self.at("l.pvd"), "w") as file:
            file.write("<VTKFile><Collection></Collection></VTKFile>")
        self.refused(self.at("l.pvd"), says="no DataSet")

    def test_no_file_runs_code_or_ends_or_stops_the_program(self):
        signal.signal(signal.SIGALRM, lambda *_: self.fail("it waits for ever"))
        signal.alarm(60)
        self.addCleanup(signal.alarm, 0)
        np.savez(self.at("o.npz"), position=np.array([{"a": 1}], dtype=object))
        self.refused(self.at("o.npz"), "--dt", 1, says="o.npz")
        rng = np.random.default_rng(1)
        for end in ("csv", "npz", "h5", "ply", "vtk", "vtu", "vtp", "pvd"):
            path = self.at("noise." + end)
            for data in (
                b"",
                bytes(rng.integers(0, 256, 500, np.uint8)),
                b"ply\n",
                b"# vtk DataFile Version 3.0\n",
            ):
                with open(path, "wb") as file:
                    file.write(data)
                self.refused(path, "--dt", 1, says="noise." + end)
        with open(self.at("ply3", "frame_00003.ply"), "rb") as file:
            whole = file.read()
        for size in rng.integers(1, len(whole), 40):  # cut short
            with open(self.at("noise.ply"), "wb") as file:
                file.write(whole[:size])
            self.refused(self.at("noise.ply"), "--dt", 1, says="noise.ply")


class OwnData(Tool):
    def test_the_way_of_the_page_leads_to_a_network(self):
        """docs/own-data.md, with tables made of generated water, and six iterations."""
        folder = os.path.join(self.at("own"), "data")
        os.makedirs(folder)
        words = ["generate", "still-column", "--dimension", 2, "--spacing", 0.0125, "--seed", 3]
        ascc(*words, "--frames", 60, "--count", 2, "--all-velocities", "-o", self.at("generated"))
        for run in (1, 2):
            tensors, _ = tensorfile.read(
                self.at("generated", f"still-column_3_{run - 1:04d}.safetensors")
            )
            frames, count, _ = tensors["fluid.position"][::2].shape
            time = np.repeat(0.005 * np.arange(frames), count)
            rows = [
                tensors[name][::2].reshape(-1, 2) for name in ("fluid.position", "fluid.velocity")
            ]
            table = np.column_stack([time, np.tile(np.arange(count), frames), *rows])
            np.savetxt(
                self.at("own", "run.csv"),
                table,
                "%.9g",
                ",",
                header="time,id,x,y,vx,vy",
                comments="",
            )
            wall = np.column_stack([tensors["boundary.position"], tensors["boundary.normal"]])
            np.savetxt(
                self.at("own", "tank.csv"), wall, "%.9g", ",", header="x,y,nx,ny", comments=""
            )
            out = os.path.join(folder, f"run{run}.safetensors")
            words = [
                "import",
                self.at("own", "run.csv"),
                "--spacing",
                0.0125,
                "--walls",
                self.at("own", "tank.csv"),
            ]
            status, err, _ = self.run_tool(*words, "-o", out)
            self.assertEqual((status, err), (0, ""))
            told = ascc("lint", out)
            self.assertRegex(told, r"(?m)^pass .*run\d\.safetensors")
        with open(os.path.join(HERE, "..", "docs", "own-data.md")) as file:
            config = re.search(r"```json\n(.*?)```", file.read(), re.S).group(1)
        with open(self.at("own", "mine.json"), "w") as file:
            file.write(config)
        ascc("train", self.at("own", "mine.json"), "--iterations", 6, "--threads", 1)
        mine, relaxed = self.at("own", "mine-latest.safetensors"), self.at(
            "own", "relaxed.safetensors"
        )
        ascc(
            "relax",
            mine if os.path.exists(mine) else self.at("own", "mine.safetensors"),
            "-o",
            relaxed,
        )
        for method in ("ballistic", "pbf:iterations=4,substeps=4", relaxed):
            self.assertIn(
                "err_n1",
                ascc("eval", method, os.path.join(folder, "run2.safetensors"), "--no-rollout"),
            )
        told = ascc(
            "sim",
            relaxed,
            os.path.join(folder, "run2.safetensors"),
            "-n",
            3,
            "--vtk",
            self.at("own", "frames"),
        )
        self.assertRegex(told, r"(?m)^momentum error *0 ")


if __name__ == "__main__":
    sys.exit(tap.main(sys.modules[__name__]))
