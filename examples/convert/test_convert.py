# SPDX-License-Identifier: MIT
"""Tests of the converters: python3 -m unittest examples/convert/test_convert.py, or as a program for
TAP output. Published samples are looked for in $ASCC_SHARED, or ../shared beside the repository;
the original checkpoints in $ASCC_CHECKPOINTS. Tests that need what is not there say so and skip."""

import contextlib
import importlib.util
import io
import json
import os
import pickle
import struct
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, "..", "..", "tests", "support")]

import numpy as np  # noqa: E402

import convert  # noqa: E402
import crc32c  # noqa: E402
import positions  # noqa: E402
import read_bundle  # noqa: E402
import sequence  # noqa: E402
import tap  # noqa: E402
import tensorfile  # noqa: E402
import testfiles  # noqa: E402
import weights  # noqa: E402

SHARED = os.environ.get("ASCC_SHARED", os.path.join(HERE, "..", "..", "..", "shared"))
PUBLISHED = os.path.join(SHARED, "data", "published")
WEIGHTS = os.path.join(SHARED, "data", "weights")
CHECKPOINTS = os.environ.get("ASCC_CHECKPOINTS", os.path.join(PUBLISHED, "checkpoints"))


def needs(folder, name):
    variable = "ASCC_CHECKPOINTS" if folder == CHECKPOINTS else "ASCC_SHARED"
    found = os.path.exists(os.path.join(folder, name))
    return unittest.skipUnless(found, f"{name} is not here; see {variable} in README.md")


class Case(unittest.TestCase):
    """A folder of its own, and the program run in this process."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.out = os.path.join(self.folder, "out")

    def path(self, name):
        return os.path.join(self.folder, name)

    def run_convert(self, *argv):
        """(exit code, standard error)."""
        err = io.StringIO()
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(err):
            code = convert.main([str(arg) for arg in argv])
        return code, err.getvalue()

    def data(self, kind, *argv):
        return self.run_convert("data", kind, *argv, "-o", self.out)

    def converted(self, kind, *argv):
        """{name: (tensors, metadata)} of a run that must succeed."""
        code, err = self.data(kind, *argv)
        self.assertEqual(code, 0, err)
        return {
            name.removesuffix(".safetensors"): tensorfile.read(os.path.join(self.out, name))
            for name in sorted(os.listdir(self.out))
        }

    def refused(self, kind, *argv, says):
        """The run fails with exit code 2, says all of `says`, and leaves nothing behind."""
        code, err = self.data(kind, *argv)
        self.assertEqual(code, 2, err)
        for part in says:
            self.assertIn(part, err)
        self.assertEqual(os.listdir(self.out) if os.path.isdir(self.out) else [], [])

    def survives_damage(self, path, run, rounds=60, checksums=False):
        """Cut short, the file is refused; with a byte changed, it is refused or, without checksums,
        may pass as another file; in no case is a file left half or the error another one."""
        with open(path, "rb") as file:
            whole = file.read()
        rng = np.random.default_rng(7)
        for i in range(rounds):
            data, at = bytearray(whole), int(rng.integers(len(whole)))
            if i % 2:
                del data[at:]
            else:
                data[at] ^= int(rng.integers(1, 256))
            with open(path, "wb") as file:
                file.write(data)
            code, err = run()
            self.assertIn(code, (0, 2), err)
            if i % 2 or code == 2 or checksums:
                self.assertEqual(code, 2, f"byte {at} of {len(whole)}: still converted")
                self.assertIn(os.path.basename(path).split(".")[0], err)
            for _, _, names in os.walk(self.folder):
                self.assertFalse([name for name in names if name.endswith(".partial")])


class Crc(unittest.TestCase):
    def test_known_values(self):  # RFC 3720, B.4
        for data, crc in (
            (b"", 0),
            (b"123456789", 0xE3069283),
            (bytes(32), 0x8A9136AA),
            (b"\xff" * 32, 0x62A8AB43),
            (bytes(range(32)), 0x46DD794E),
        ):
            self.assertEqual(crc32c.crc32c(data), crc)

    def test_lanes_equal_the_bytewise_loop(self):
        data = np.random.default_rng(1).bytes(3 * crc32c.LANE + 5)
        register = 0xFFFFFFFF
        for size, byte in enumerate(data):
            if size in (crc32c.LANE, 2 * crc32c.LANE + 1, 3 * crc32c.LANE):
                self.assertEqual(crc32c.crc32c(data[:size]), register ^ 0xFFFFFFFF)
            register ^= byte
            for _ in range(8):
                register = register >> 1 ^ (crc32c.POLYNOMIAL if register & 1 else 0)
        self.assertEqual(crc32c.crc32c(data), register ^ 0xFFFFFFFF)


class Files(Case):
    TENSORS = {"b": np.float32([[1, 2], [3, 4]]), "a": np.zeros((0, 3), np.float32)}

    def test_header_is_padded_and_tensors_come_back(self):
        tensorfile.write(self.path("x"), self.TENSORS, {"format": "test", "text": 'a "b" \u00b5'})
        with open(self.path("x"), "rb") as file:
            data = file.read()
        size = struct.unpack("<Q", data[:8])[0]
        self.assertEqual(size % 8, 0)
        self.assertEqual(len(data), 8 + size + 16)
        self.assertEqual(json.loads(data[8 : 8 + size])["b"]["data_offsets"], [0, 16])
        tensors, metadata = tensorfile.read(self.path("x"))
        self.assertEqual(metadata["text"], 'a "b" \u00b5')
        self.assertTrue(np.array_equal(tensors["b"], self.TENSORS["b"]))
        self.assertEqual(tensors["a"].shape, (0, 3))

    def test_a_failed_write_leaves_the_old_file_and_no_partial_one(self):
        tensorfile.write(self.path("x"), self.TENSORS, {"n": "1"})
        for function in ("replace", "fsync"):
            with mock.patch.object(os, function, side_effect=OSError(28, "No space left")):
                with self.assertRaisesRegex(tensorfile.ConvertError, "No space left"):
                    tensorfile.write(self.path("x"), self.TENSORS, {"n": "2"})
        self.assertEqual(os.listdir(self.folder), ["x"])
        self.assertEqual(tensorfile.read(self.path("x"))[1], {"n": "1"})

    def test_numbers_are_written_at_their_own_precision(self):
        self.assertEqual(sequence.number(np.float32(0.1)), "0.1")
        self.assertEqual(sequence.number(0.1), "0.1")
        self.assertEqual(sequence.numbers((0.0, -9.81, 1e-7)), "0 -9.81 0.0000001")


class Geometry(unittest.TestCase):
    def test_walls_surround_the_box_and_point_into_it(self):
        points, normals = sequence.walls_around([0, 0], [1, 0.5], [False, False], 0.1, 2)
        self.assertEqual(len(points), 14 * 9 - 10 * 5)
        self.assertTrue(np.allclose(np.linalg.norm(normals, axis=1), 1))
        inside = points + normals * 0.3
        self.assertTrue(((inside > 0) & (inside < [1, 0.5])).all())
        nearest = np.abs(points - np.clip(points, 0, [1, 0.5])).max(1).min()
        self.assertAlmostEqual(nearest, 0.05)

    def test_periodic_axes_have_no_walls(self):
        points, normals = sequence.walls_around([0] * 3, [1] * 3, [True, False, True], 0.25, 1)
        self.assertEqual(len(points), 2 * 16)
        self.assertTrue((np.abs(normals[:, 1]) == 1).all())

    def test_normals_of_a_line_are_across_it_on_the_fluids_side(self):
        rng = np.random.default_rng(3)
        along = np.sort(rng.uniform(0, 1, 60))
        line = np.stack([along, 0.5 * along], 1)
        normals = sequence.estimated_normals(line, np.array([[0.5, 2.0]]), 0.02)
        self.assertGreater((normals @ [-0.4472136, 0.8944272]).min(), 0.999)

    def test_normals_of_a_block_point_out_of_it(self):
        x, y = np.meshgrid(np.arange(10), np.arange(10))
        block = np.stack([x.ravel(), y.ravel()], 1) * 0.1
        normals = sequence.estimated_normals(block, np.array([[0.45, 5.0]]), 0.1)
        bottom = (block[:, 1] == 0) & (block[:, 0] > 0.15) & (block[:, 0] < 0.75)
        self.assertGreater((normals[bottom] @ [0, -1]).min(), 0.95)

    def test_a_lone_boundary_point_faces_the_fluid(self):
        normals = sequence.estimated_normals(np.zeros((1, 2)), np.array([[3.0, 0]]), 0.1)
        self.assertEqual(normals.tolist(), [[1, 0]])

    def test_paths_through_periodic_axes_are_continuous(self):
        true = np.linspace(0.1, 2.7, 27)[:, None, None] * np.float64([[1, -1]])
        wrapped = np.float32(true % 1)
        path = positions.unwrap(wrapped, np.array([1.0, 1.0]), [True, True])
        self.assertLess(np.abs(np.diff(path, axis=0) - np.diff(true, axis=0)).max(), 1e-6)
        self.assertTrue(np.array_equal(path[0], wrapped[0]))
        still = positions.unwrap(wrapped, np.array([1.0, 1.0]), [False, False])
        self.assertTrue(np.array_equal(still, wrapped))


class Dlf(Case):
    def shard(self, name="sim_0001_00.msgpack.zst", frames=None, change=None, **options):
        frames = frames or testfiles.scene_frames(**options)
        if change:
            change(frames)
        testfiles.write_shard(self.path(name), frames)
        return self.path(name)

    def test_shards_of_a_scene_become_one_sequence(self):
        for i in range(12):
            self.shard(f"sim_0001_{i}.msgpack.zst", first=4 * i)
        self.shard("sim_0002_0.msgpack.zst", frames=testfiles.scene_frames("sim_0002"))
        files = self.converted("dlf", self.folder)
        self.assertEqual(list(files), ["sim_0001", "sim_0002"])
        tensors, metadata = files["sim_0001"]
        frames = testfiles.scene_frames(count=48)
        self.assertTrue(np.array_equal(tensors["fluid.position"], [f["pos"] for f in frames]))
        self.assertTrue(np.array_equal(tensors["fluid.velocity"], [f["vel"] for f in frames]))
        self.assertTrue(np.array_equal(tensors["boundary.position"], frames[0]["box"]))
        expected = {
            "format": "ascc.sequence",
            "version": "1",
            "dim": "3",
            "dt": "0.02",
            "gravity": "0 -9.81 0",
            "particle_radius": "0.025",
            "particle_mass": "0.125",
            "rest_density": "1000",
            "frame_ids": "0 to 47",
            "scene": "sim_0001",
        }
        self.assertEqual({key: metadata[key] for key in expected}, expected)

    def test_flat_scenes_are_2d_with_their_own_gravity(self):
        def change(frames):
            for frame in frames:
                frame["grav"] = np.float32([6.76015713, -7.10889412, 0])

        files = self.converted("dlf", self.shard(change=change, dim=2))
        tensors, metadata = files["sim_0001"]
        self.assertEqual(tensors["fluid.position"].shape, (4, 8, 2))
        self.assertEqual(tensors["boundary.normal"].shape, (3, 2))
        self.assertEqual(metadata["gravity"], "6.760157 -7.1088943")
        self.assertEqual((metadata["dim"], metadata["dt"]), ("2", "0.0025"))
        self.assertEqual(metadata["particle_radius"], "0.0025")
        self.assertEqual(metadata["spacing_from"], "measured in the first frame")

    def test_shards_without_mass_walls_or_velocity_scale_are_read(self):
        def change(frames):
            for frame in frames:
                for key in ("m", "viscosity", "box", "box_normals"):
                    frame.pop(key, None)
                frame["vel"] = 0 * frame["vel"]

        tensors, metadata = self.converted("dlf", self.shard(change=change))["sim_0001"]
        self.assertEqual(tensors["boundary.position"].shape, (0, 3))
        self.assertEqual(metadata["particle_mass"], "0.125")

    def test_density_follows_from_mass_and_a_mixture_keeps_its_range(self):
        def change(frames):
            for frame in frames:
                frame["m"] = np.float32([0.25] * 4 + [0.125] * 4)

        _, metadata = self.converted("dlf", self.shard(change=change))["sim_0001"]
        self.assertEqual(metadata["rest_density"], "1500")
        self.assertEqual(metadata["particle_mass_range"], "0.125 0.25")

    def test_zero_normals_are_estimated(self):
        def change(frames):
            frames[0]["box_normals"] = np.zeros((3, 3), np.float32)

        tensors, metadata = self.converted("dlf", self.shard(change=change))["sim_0001"]
        self.assertEqual(metadata["normals_estimated"], "3")
        length = np.linalg.norm(tensors["boundary.normal"], axis=1)
        self.assertTrue(np.allclose(length, 1, atol=1e-6))

    def test_a_wrong_frame_time_or_spacing_is_warned_of(self):
        code, err = self.data("dlf", self.shard(), "--dt", "0.01", "--spacing", "0.05")
        self.assertEqual(code, 0)
        self.assertIn("dt: 0.01 s, but positions and velocities suggest 0.02 s", err)

        def change(frames):
            for frame in frames:
                frame["pos"] = frame["pos"] * 4

        code, err = self.data("dlf", self.shard(change=change))
        self.assertIn("median distance to the nearest particle in the first frame is 0.2 m", err)

    def test_same_input_gives_the_same_bytes(self):
        path = self.shard()
        self.assertEqual(self.data("dlf", path)[0], 0)
        with open(os.path.join(self.out, "sim_0001.safetensors"), "rb") as file:
            first = file.read()
        self.assertEqual(self.data("dlf", path)[0], 0)
        with open(os.path.join(self.out, "sim_0001.safetensors"), "rb") as file:
            self.assertEqual(file.read(), first)

    def test_what_is_wrong_with_a_frame_is_named(self):
        def put(index, key, value):
            def change(frames):
                frames[index][key] = value

            return change

        nan = np.zeros((8, 3), np.float32)
        nan[5, 1] = np.nan
        normals = np.float32([[0, 1, 0], [0, 2, 0], [0, 1, 0]])
        pickled = {
            b"nd": True,
            b"type": "|O",
            b"kind": b"O",
            b"shape": [1],
            b"data": b"cos\nsystem\n",
        }
        short = {**testfiles.encoded(np.zeros((8, 3), np.float32)), b"data": b"1234"}
        cases = [
            (put(1, "pos", nan), ["[1]: pos: not finite: nan at [5, 1]"]),
            (put(2, "vel", np.zeros((8, 2), np.float32)), ["vel: shape [8, 2], expected [8, 3]"]),
            (put(1, "pos", np.zeros((7, 3), np.float32)), ["[1]: vel: shape [8, 3], expected [7"]),
            (put(0, "box_normals", np.zeros((2, 3), np.float32)), ["box_normals", "[2, 3]"]),
            (put(0, "box_normals", normals), ["boundary normal: row 1 has length 2"]),
            (put(3, "m", pickled), ["[3].m: array of type '|O'"]),
            (put(3, "vel", short), ["[3].vel: 4 bytes for shape [8, 3]"]),
            (put(0, "num_rigid_bodies", 2), ["num_rigid_bodies: moving rigid bodies"]),
            (put(1, "grav", np.zeros(3)), ["grav: only some frames have it"]),
            (put(1, "grav", np.zeros(2)), ["grav: shape [2], expected [any, 3]"]),
            (put(0, "box", np.zeros(7, np.float32)), ["box: shape [7], expected [any, 3]"]),
            (put(0, "frame_id", np.float64(np.inf)), ["[0].frame_id: expected a whole number"]),
            (put(2, "frame_id", np.int64(7)), ["frame_id: 3 follows 1", "shard is missing"]),
            (put(2, "frame_id", np.float64(1.5)), ["[2].frame_id: expected a whole number"]),
            (lambda frames: frames[2].pop("vel"), ["[2].vel: missing"]),
            (lambda frames: [f.update(scene_id="../x") for f in frames], ["name", "'../x'"]),
        ]
        for change, says in cases:
            path = self.shard(change=change)
            with self.subTest(says=says):
                self.refused("dlf", path, says=["sim_0001_00.msgpack.zst", *says])

    def test_changing_gravity_and_walls_are_refused(self):
        def change(frames):
            for i, frame in enumerate(frames):
                frame["grav"] = np.float32([0, -i, 0])

        self.refused("dlf", self.shard(change=change), says=["grav: changes within the scene"])
        self.shard("sim_0001_00.msgpack.zst")

        def moved(frames):
            frames[0]["box"] = frames[0]["box"] + 1

        self.shard("sim_0001_01.msgpack.zst", first=4, change=moved)
        self.refused("dlf", self.folder, says=["sim_0001_01.msgpack.zst", "box: differs"])

    def test_a_missing_or_repeated_shard_is_refused(self):
        self.shard("sim_0001_00.msgpack.zst")
        self.shard("sim_0001_02.msgpack.zst", first=8)
        self.refused("dlf", self.folder, says=["sim_0001_02", "frame_id: 8 follows 3"])
        self.shard("sim_0001_02.msgpack.zst", first=2)
        self.refused("dlf", self.folder, says=["frame_id", "given twice"])

    def test_a_scene_that_comes_again_is_refused_and_the_others_are_whole(self):
        self.shard("a.msgpack.zst")
        self.shard("b.msgpack.zst", frames=testfiles.scene_frames("other"))
        self.shard("c.msgpack.zst")
        code, err = self.data("dlf", self.folder)
        self.assertEqual(code, 2)
        self.assertIn("c.msgpack.zst: [0].scene_id: sim_0001 was already complete", err)
        self.assertEqual(
            sorted(os.listdir(self.out)), ["other.safetensors", "sim_0001.safetensors"]
        )

    def test_damaged_shards_are_refused(self):
        path = self.shard()
        self.survives_damage(path, lambda: self.data("dlf", path))

    def test_bytes_after_the_frame_and_other_files_are_refused(self):
        path = self.shard()
        with open(path, "ab") as file:
            file.write(b"x")
        self.refused("dlf", path, says=["zstd: bytes after the end"])
        os.truncate(path, os.path.getsize(path) - 2)
        self.refused("dlf", path, says=["zstd: truncated: the frame does not end"])
        with open(path, "wb") as file:
            file.write(b"PK\3\4 no zstd at all")
        self.refused("dlf", path, says=["zstd"])
        os.unlink(path)
        self.refused("dlf", path, says=["No such file"])
        self.refused("dlf", self.folder, says=["no .msgpack.zst files"])

    @needs(PUBLISHED, "liquid3d-canyon.msgpack.zst")
    def test_the_published_canyon_scene_converts(self):
        import msgpack
        import zstandard

        path = os.path.join(PUBLISHED, "liquid3d-canyon.msgpack.zst")
        ((name, (tensors, metadata)),) = self.converted("dlf", path).items()
        self.assertEqual(name, "sim_canyon")
        self.assertEqual(tensors["fluid.position"].shape, (13, 1280, 3))
        self.assertEqual(tensors["fluid.velocity"].shape, (13, 1280, 3))
        self.assertEqual(tensors["boundary.position"].shape, (185447, 3))
        expected = {
            "dt": "0.02",
            "particle_radius": "0.025",
            "particle_mass": "0.125",
            "rest_density": "1000",
            "gravity": "0 -9.81 0",
        }
        self.assertEqual({key: metadata[key] for key in expected}, expected)
        with open(path, "rb") as file:  # bit for bit, past our own reader
            frames = msgpack.unpackb(zstandard.ZstdDecompressor().decompress(file.read()))
        for i, frame in enumerate(frames):
            self.assertEqual(tensors["fluid.position"][i].tobytes(), frame["pos"][b"data"])
        self.assertEqual(tensors["boundary.normal"].tobytes(), frames[0]["box_normals"][b"data"])
        spacing = sequence.measured_spacing(tensors["fluid.position"][0])
        self.assertAlmostEqual(spacing, 0.05, places=4)


class Gns(Case):
    METADATA = {
        "bounds": [[0.1, 0.9], [0.1, 0.9]],
        "sequence_length": 5,
        "dim": 2,
        "dt": 0.0025,
        "default_connectivity_radius": 0.015,
    }

    def scene(self, seed=1):
        """(kinds, position): a falling block of water over a sloping ramp."""
        x, y = np.meshgrid(np.arange(6), np.arange(5))
        water = np.stack([x.ravel(), y.ravel()], 1) * 0.01 + [0.4, 0.6]
        ramp = np.stack([np.linspace(0.2, 0.8, 60), np.linspace(0.3, 0.2, 60)], 1)
        fall = np.float64([0.01 * seed, -1]) * 0.0025
        position = np.stack([np.concatenate([ramp, water + i * fall]) for i in range(6)])
        return [3] * 60 + [5] * 30, np.float32(position)

    def file(self, records=None, **metadata):
        metadata = {**self.METADATA, **metadata}
        testfiles.write_json(
            self.path("metadata.json"),
            {key: value for key, value in metadata.items() if value is not None},
        )
        records = records or [testfiles.sequence_example(i, *self.scene(i + 1)) for i in range(2)]
        testfiles.write_tfrecord(self.path("valid.tfrecord"), records)
        return self.path("valid.tfrecord")

    def test_records_become_sequences_with_walls_and_normals(self):
        files = self.converted("gns", self.file())
        self.assertEqual(list(files), ["valid_00000", "valid_00001"])
        tensors, metadata = files["valid_00001"]
        kinds, position = self.scene(2)
        self.assertTrue(np.array_equal(tensors["fluid.position"], position[1:, 60:]))
        first = (position[1, 60:].astype(np.float64) - position[0, 60:]) / 0.0025
        self.assertTrue(np.array_equal(tensors["fluid.velocity"][0], np.float32(first)))
        boundary, normal = tensors["boundary.position"], tensors["boundary.normal"]
        self.assertTrue(np.array_equal(boundary[:60], position[0, :60]))
        self.assertGreater((normal[:60] @ np.float32([0.164399, 0.986394])).min(), 0.99)
        walls = boundary[60:]
        self.assertEqual(len(walls), 86 * 86 - 80 * 80)  # spacing 0.01, three layers
        self.assertTrue(((walls < 0.1) | (walls > 0.9)).any(1).all())
        expected = {
            "dim": "2",
            "dt": "0.0025",
            "gravity": "0 -9.81",
            "particle_radius": "0.005",
            "particle_mass": "0.1",
            "box_min": "0.1 0.1",
            "velocity_frames": "first",
        }
        self.assertEqual({key: metadata[key] for key in expected}, expected)

    @unittest.skipUnless(importlib.util.find_spec("tfrecord"), "the package tfrecord is not here")
    def test_files_of_another_writer_are_read(self):
        import tfrecord  # protocol buffers and CRC are not ours; the shapes are those of Water-Ramps

        self.file(sequence_length=600)
        random = np.random.default_rng(3)
        ramp = np.stack([np.linspace(0.2, 0.8, 400), np.linspace(0.3, 0.2, 400)], 1)
        lattice = np.stack(np.meshgrid(np.arange(46), np.arange(46)), -1).reshape(-1, 2)
        kinds, scenes = np.repeat([3, 5], [400, 2116]), []
        writer = tfrecord.TFRecordWriter(self.path("test.tfrecord"))
        for key in range(2):
            water = lattice * 0.005 + [0.4, 0.5] + random.uniform(-0.001, 0.001, (601, 2116, 2))
            frames = [np.float32(np.concatenate([ramp, w])) for w in water]
            scenes.append(np.stack(frames))
            writer.write(
                {"key": (key, "int"), "particle_type": (kinds.astype("<i8").tobytes(), "byte")},
                {"position": ([frame.tobytes() for frame in frames], "byte")},
            )
        writer.close()
        files = self.converted("gns", self.path("test.tfrecord"), "--spacing", 0.005)
        self.assertEqual(list(files), ["test_00000", "test_00001"])
        for (tensors, _), scene in zip(files.values(), scenes):
            self.assertTrue(np.array_equal(tensors["fluid.position"], scene[1:, 400:]))
            self.assertTrue(np.array_equal(tensors["boundary.position"][:400], scene[0, :400]))

    def test_count_wall_layers_and_fluid_types_are_options(self):
        kinds, position = self.scene()
        record = testfiles.sequence_example(0, [3] * 60 + [7] * 10 + [5] * 20, position)
        path = self.file([record, record])
        self.refused("gns", path, says=["record 0: particle_type: 7 (goop)", "--fluid-type"])
        files = self.converted(
            "gns", path, "--count", 1, "--wall-layers", 0, "--fluid-type", 5, "--fluid-type", 7
        )
        ((tensors, _),) = files.values()
        self.assertEqual(tensors["boundary.position"].shape, (60, 2))
        self.assertEqual(tensors["fluid.position"].shape, (5, 30, 2))

    def test_an_example_instead_of_a_sequence_example_is_read(self):
        kinds, position = self.scene()
        record = testfiles.field(
            1,
            testfiles.map_entry(
                "particle_type", testfiles.bytes_feature([np.asarray(kinds, "<i8").tobytes()])
            )
            + testfiles.map_entry(
                "position", testfiles.bytes_feature([frame.tobytes() for frame in position])
            ),
        )
        ((tensors, _),) = self.converted("gns", self.file([record])).values()
        self.assertTrue(np.array_equal(tensors["fluid.position"], position[1:, 60:]))

    def test_what_is_wrong_with_a_record_is_named(self):
        kinds, position = self.scene()
        nan, moving = position.copy(), position.copy()
        nan[3, 7, 1] = np.inf
        moving[4, 2, 0] += 0.01
        example = testfiles.sequence_example
        cases = [
            (example(0, kinds, nan), "position: not finite: inf at [3, 7, 1]"),
            (example(0, kinds, moving), "position: boundary particles move"),
            (example(0, kinds, position[:4]), "position: 4 frames, metadata.json says 6"),
            (example(0, kinds[1:], position), "position[0]: 720 bytes, expected 712"),
            (example(0, [3] * 90, position), "particle_type: no fluid particles"),
            (example(0, [4] * 90, position), "particle_type: 4 (unknown)"),
            (example(0, [], position), "particle_type: missing"),
            (testfiles.field(2, testfiles.map_entry("position", b"")), "particle_type: missing"),
            (b"\x0a\xff\x01", "SequenceExample"),
            (b"\x0f", "SequenceExample: field 1 has type 7"),
        ]
        for record, says in cases:
            with self.subTest(says=says):
                self.refused("gns", self.file([record]), says=["valid.tfrecord: record 0", says])

    def test_wrong_metadata_is_named(self):
        cases = [
            ({"dt": None}, "dt: missing"),
            ({"dim": 4}, "dim: 4"),
            ({"dt": "x"}, "dt: expected"),
            ({"sequence_length": 5.5}, "sequence_length"),
            ({"bounds": [[1, 0], [0, 1]]}, "bounds"),
            ({"bounds": "no"}, "bounds"),
            ({"context_mean": [0, 0]}, "context_mean"),
        ]
        for change, says in cases:
            with self.subTest(says=says):
                self.refused("gns", self.file(**change), says=["metadata.json", says])
        path = self.file()
        with open(self.path("metadata.json"), "w") as file:
            file.write("{")
        self.refused("gns", path, says=["metadata.json: not JSON"])
        os.unlink(self.path("metadata.json"))
        self.refused("gns", path, says=["metadata.json: No such file"])

    def test_checksums_lengths_and_compression_are_checked(self):
        path = self.file()
        with open(path, "rb") as file:
            whole = file.read()

        def damaged(at, says, size=None):
            data = bytearray(whole[:size])
            data[at] ^= 1
            with open(path, "wb") as file:
                file.write(data)
            self.refused("gns", path, says=["record 0", says])

        damaged(0, "checksum of the length does not match")
        damaged(500, "checksum of the data does not match")
        damaged(-1, "truncated", size=1000)
        with open(path, "wb") as file:
            file.write(b"\x1f\x8b" + whole)
        self.refused("gns", path, says=["gzip-compressed"])
        with open(path, "wb"):
            pass
        self.refused("gns", path, says=["empty: no records"])

    def test_damaged_files_are_refused(self):
        path = self.file([testfiles.sequence_example(0, *self.scene())])
        self.survives_damage(
            path, lambda: self.data("gns", path, "--wall-layers", 1), checksums=True
        )


class LagrangeBench(Case):
    def box(self):
        """(position, kind): fluid that moves right by 0.07 a frame in [0, 1), and a wall."""
        x, y = np.meshgrid(np.arange(4), np.arange(4))
        fluid = np.stack([x.ravel(), y.ravel()], 1) * 0.1 + 0.55
        wall = np.stack([np.arange(10) * 0.1, np.full(10, 0.05)], 1)
        position = np.stack([np.concatenate([(fluid + [0.07 * i, 0]) % 1, wall]) for i in range(5)])
        return np.float32(position), np.int32([0] * 16 + [1] * 10)

    def file(self, change=None, trajectories=None, **metadata):
        if not trajectories:
            position, kind = self.box()
            if change:
                position, kind = change(position, kind) or (position, kind)
            trajectories = [(position, kind)]
        return testfiles.write_lagrangebench(self.folder, "test", trajectories, **metadata)

    def test_trajectories_become_sequences(self):
        files = self.converted("lagrangebench", self.file(trajectories=[self.box()] * 2))
        self.assertEqual(list(files), ["test_00000", "test_00001"])
        tensors, metadata = files["test_00000"]
        self.assertEqual(tensors["fluid.position"].shape, (4, 16, 2))
        self.assertEqual(tensors["boundary.position"].shape, (10, 2))
        self.assertTrue(np.allclose(tensors["boundary.normal"][2:8], [0, 1], atol=1e-3))
        expected = {"dt": "0.01", "particle_radius": "0.05", "gravity": "0 0", "periodic": "0 0"}
        self.assertEqual({key: metadata[key] for key in expected}, expected)

    def test_periodic_paths_are_continuous_and_say_so(self):
        files = self.converted(
            "lagrangebench", self.file(periodic_boundary_conditions=[True, False, False])
        )
        tensors, metadata = files["test_00000"]
        step = np.diff(tensors["fluid.position"], axis=0)
        self.assertTrue(np.allclose(step, [0.07, 0], atol=1e-6))
        self.assertTrue(np.allclose(tensors["fluid.velocity"], [7, 0], atol=1e-4))
        self.assertEqual((metadata["periodic"], metadata["box_max"]), ("1 0", "1 1"))

    def test_gravity_is_known_only_where_the_data_says_it(self):
        path = self.file(case="DB", g_ext_magnitude=1.0)
        _, metadata = self.converted("lagrangebench", path)["test_00000"]
        self.assertEqual(metadata["gravity"], "0 -1")
        os.unlink(os.path.join(self.out, "test_00000.safetensors"))
        path = self.file(case="RPF", g_ext_magnitude=1.0)
        self.refused("lagrangebench", path, says=["g_ext_magnitude: 1 in case 'RPF'", "--gravity"])
        _, metadata = self.converted("lagrangebench", path, "--gravity", "1 0")["test_00000"]
        self.assertEqual(metadata["gravity"], "1 0")

    def test_moving_walls_need_a_decision(self):
        def change(position, kind):
            kind[-3:] = 2
            position[2:, -3:, 0] += 0.5

        path = self.file(change)
        self.refused("lagrangebench", path, says=["particle_type: 3 particles of a moving wall"])
        ((tensors, _),) = self.converted("lagrangebench", path, "--moving-walls-at-rest").values()
        self.assertEqual(tensors["boundary.position"].shape, (10, 2))

    def test_what_is_wrong_is_named(self):
        def nan(position, kind):
            position[2, 3, 1] = np.nan

        def moving(position, kind):
            position[2, -1, 1] += 0.1

        def rigid(position, kind):
            kind[0] = 3

        def no_fluid(position, kind):
            kind[:16] = 1
            position[:] = position[0]

        cases = [
            (nan, {}, "position: not finite: nan at [2, 3, 1]"),
            (moving, {}, "position: boundary particles move"),
            (rigid, {}, "particle_type: [3]"),
            (no_fluid, {}, "no fluid particles"),
            (lambda p, k: (p, k[1:]), {}, "particle_type: shape [25], expected [26]"),
            (lambda p, k: (p[0], k), {}, "position: shape [26, 2]"),
            (lambda p, k: (p[:1], k), {}, "position: 1 frames"),
            (lambda p, k: (p, k.astype("S3")), {}, "particle_type: type |S3"),
            (None, {"dx": None}, "dx: missing"),
            (None, {"dim": 3}, "position: shape [5, 26, 2]"),
            (None, {"write_every": 0.5}, "write_every"),
            (None, {"periodic_boundary_conditions": [1]}, "periodic_boundary_conditions"),
        ]
        for change, metadata, says in cases:
            with self.subTest(says=says):
                self.refused("lagrangebench", self.file(change, **metadata), says=[says])

    def test_missing_data_sets_and_other_files_are_refused(self):
        import h5py

        path = self.file()
        with h5py.File(path, "a") as file:
            del file["00000/particle_type"]
        self.refused("lagrangebench", path, says=["test.h5: 00000: particle_type: missing"])
        with h5py.File(path, "w"):
            pass
        self.refused("lagrangebench", path, says=["no trajectories"])
        with open(path, "wb") as file:
            file.write(b"no HDF5")
        self.refused("lagrangebench", path, says=["test.h5: HDF5: not readable"])

    def test_damaged_files_are_refused(self):
        path = self.file()
        # Damage in HDF5's numbers themselves has no checksum: it may pass as other numbers.
        self.survives_damage(path, lambda: self.data("lagrangebench", path))

    @needs(PUBLISHED, "lagrangebench-3d-lj")
    def test_the_published_lennard_jones_set_converts(self):
        import h5py

        folder = os.path.join(PUBLISHED, "lagrangebench-3d-lj")
        files = self.converted("lagrangebench", folder)
        shapes = {name: tensors["fluid.position"].shape for name, (tensors, _) in files.items()}
        self.assertEqual(
            shapes,
            {"train_00000": (1213, 3, 3), "valid_00000": (404, 3, 3), "test_00000": (404, 3, 3)},
        )
        for name, (tensors, metadata) in files.items():
            self.assertEqual((metadata["dt"], metadata["particle_radius"]), ("0.005", "0.7"))
            path = tensors["fluid.position"].astype(np.float64)
            self.assertLess(np.abs(np.diff(path, axis=0)).max(), 0.5)  # no jumps of the box's 5
            with h5py.File(os.path.join(folder, name.split("_")[0] + ".h5")) as file:
                stored = file["00000/position"][1:]
            cells = (path - stored) / 5
            self.assertLess(np.abs(cells - np.round(cells)).max(), 1e-5)


def network_tensors(name, seed=5):
    """Tensors of the right names and shapes, with other numbers."""
    rng = np.random.default_rng(seed)
    return {
        key: rng.normal(size=shape).astype(np.float32)
        for key, shape in weights.network(name)["tensors"].items()
    }


def dmcf_paths():
    """{tensor: attribute path}, by the order in which DMCF's constructors make the layers."""
    paths = {"sym0.kernel_half": "model/sym_convs/0/kernel"}
    for kind in ("kernel", "bias"):
        for name, path in (("fluid", "fluid"), ("obstacle", "obs")):
            paths[f"conv_{name}.{kind}"] = f"model/{path}_convs/{kind}"
            paths[f"dense_{name}.{kind}"] = f"model/{path}_dense/{kind}"
        branches = [1, 3, 3, 1]  # of the inputs of l1, l2, l3, and of the last output
        for layer in range(3):
            for target in range(branches[layer + 1]):
                for source in range(branches[layer]):
                    tail = f"{layer}/{target}/0/{source}/{kind}"
                    paths[f"l{layer + 1}.conv_{source}_{target}.{kind}"] = f"model/convs/{tail}"
                    if source == target:
                        paths[f"l{layer + 1}.dense_{source}.{kind}"] = f"model/denses/{tail}"
    return paths


def dmcf_variables(tensors):
    """A checkpoint's variables; optimizer and counter too, which are not converted."""
    paths = dmcf_paths()
    variables = {paths[name]: tensor for name, tensor in tensors.items()}
    variables["optimizer/iter"] = np.int64(150000)
    variables["save_counter"] = np.int64(50)
    return variables


def torch_state(tensors):
    state = {"gravity": np.float32([0, -9.81, 0])}
    for name, tensor in tensors.items():
        if name.startswith("dense"):
            state[name.replace(".kernel", ".weight")] = np.ascontiguousarray(tensor.T)
        else:
            state[name] = tensor
            state[name.split(".")[0] + ".offset"] = np.zeros(3, np.float32)
    return state


def keras_layers(tensors):
    layers = {}
    for name, tensor in tensors.items():
        layer, kind = name.split(".")
        layers.setdefault(layer, {})[kind] = tensor
    return layers


class Weights(Case):
    def convert(self, kind, path):
        return self.run_convert("weights", kind, path, "-o", self.path("model.safetensors"))

    def accepted(self, kind, path, tensors):
        code, err = self.convert(kind, path)
        self.assertEqual(code, 0, err)
        read, metadata = tensorfile.read(self.path("model.safetensors"))
        self.assertEqual(list(read), list(tensors))
        for name, tensor in tensors.items():
            self.assertEqual(read[name].tobytes(), tensor.tobytes(), name)
        os.unlink(self.path("model.safetensors"))
        return metadata

    def refused_weights(self, kind, path, *says):
        code, err = self.convert(kind, path)
        self.assertEqual(code, 2, err)
        for part in says:
            self.assertIn(part, err)
        self.assertFalse(os.path.exists(self.path("model.safetensors")))

    def bundle(self, variables, **options):
        testfiles.write_bundle(self.path("ckpt"), variables, **options)
        return self.path("ckpt.index")

    def test_bundles_are_read_compressed_sharded_and_under_any_key(self):
        tensors = network_tensors("dmcf-liquid3d")
        for options in (
            {},
            {"compress": True},
            {"shards": 3},
            {"key_of": lambda path: f"v{crc32c.crc32c(path.encode()):08x}"},
        ):
            with self.subTest(options=options):
                metadata = self.accepted(
                    "dmcf", self.bundle(dmcf_variables(tensors), **options), tensors
                )
        self.assertEqual(metadata["source"], "converted from ckpt.index")
        self.assertNotIn("trained_with", metadata)

    def test_the_prefix_of_a_bundle_names_it_too(self):
        tensors = network_tensors("dmcf-liquid3d")
        self.accepted("dmcf", self.bundle(dmcf_variables(tensors)).removesuffix(".index"), tensors)

    def test_keras_and_torch_files_are_read(self):
        tensors = network_tensors("cconv-liquid3d")
        testfiles.write_keras(self.path("w.h5"), keras_layers(tensors))
        self.accepted("cconv-h5", self.path("w.h5"), tensors)
        testfiles.write_torch(self.path("w.pt"), torch_state(tensors))
        self.accepted("cconv-pt", self.path("w.pt"), tensors)
        testfiles.write_torch(self.path("w.pt"), {"model": torch_state(tensors), "step": 7})
        self.accepted("cconv-pt", self.path("w.pt"), tensors)

    def test_what_is_wrong_with_a_bundle_is_named(self):
        tensors = network_tensors("dmcf-liquid3d")

        def changed(name, tensor):
            return dmcf_variables({**tensors, name: tensor})

        missing = dmcf_variables(tensors)
        del missing["model/convs/1/2/0/1/kernel"]
        nan = tensors["sym0.kernel_half"].copy()
        nan[1, 2, 3, 4, 0] = np.nan
        deeper = {**dmcf_variables(tensors), "model/convs/3/0/0/0/kernel": np.zeros(1, np.float32)}
        cases = [
            (missing, {}, ["model/convs/1/2/0/1/kernel: no object 'kernel'"]),
            (
                changed("l1.dense_0.kernel", np.zeros((16, 24), np.float32)),
                {},
                ["l1.dense_0.kernel: shape [16, 24], expected [24, 16]"],
            ),
            (changed("l1.dense_0.bias", np.zeros(16)), {}, ["l1.dense_0.bias: type float64"]),
            (changed("sym0.kernel_half", nan), {}, ["sym0.kernel_half: not finite: nan"]),
            (deeper, {}, ["model/convs: 4 trunk layers"]),
            (dmcf_variables(tensors), {"version": 2}, ["header: unknown version: producer 2"]),
        ]
        for variables, options, says in cases:
            with self.subTest(says=says):
                self.refused_weights("dmcf", self.bundle(variables, **options), "ckpt", *says)

    def test_a_damaged_bundle_is_refused(self):
        path = self.bundle(dmcf_variables(network_tensors("dmcf-liquid3d")))
        data = self.path("ckpt.data-00000-of-00001")
        with open(data, "rb") as file:
            whole = file.read()
        with open(data, "wb") as file:
            file.write(whole[:5000] + bytes([whole[5000] ^ 4]) + whole[5001:])
        self.refused_weights("dmcf", path, "ckpt.data-00000-of-00001", "checksum does not match")
        with open(data, "wb") as file:
            file.write(whole[:-100])
        self.refused_weights("dmcf", path, "_CHECKPOINTABLE_OBJECT_GRAPH: truncated")
        os.unlink(data)
        self.refused_weights("dmcf", path, "ckpt.data-00000-of-00001: No such file")
        with open(data, "wb") as file:
            file.write(whole)
        with open(path, "rb") as file:
            index = bytearray(file.read())
        index[1000] ^= 8
        with open(path, "wb") as file:
            file.write(index)
        self.refused_weights("dmcf", path, "ckpt.index: block 0: checksum does not match")
        index[-1] ^= 8
        with open(path, "wb") as file:
            file.write(index)
        self.refused_weights("dmcf", path, "ckpt.index: footer: no tensor-bundle index")
        self.bundle(dmcf_variables(network_tensors("dmcf-liquid3d")))
        self.survives_damage(path, lambda: self.convert("dmcf", path))

    def test_snappy_reads_what_snappy_writes(self):
        rng = np.random.default_rng(9)
        far = rng.bytes(40000)
        for data in (
            b"",
            b"a",
            b"abcd" * 30,
            rng.bytes(70),
            rng.bytes(1000),
            far + far[:200],
            bytes(rng.integers(0, 3, 5000, np.uint8)),
        ):
            self.assertEqual(read_bundle.snappy(testfiles.snappy_compress(data)), data)
        for bad in (b"\x05\x00a", b"\x04\x01\x00", b"\x02\x04", b"\x03\xf4\x01", b""):
            with self.assertRaises(read_bundle.wire.WireError):
                read_bundle.snappy(bad)

    def test_what_is_wrong_with_keras_weights_is_named(self):
        import h5py

        tensors, path = network_tensors("cconv-liquid3d"), self.path("w.h5")
        layers = keras_layers(tensors)
        cases = [
            ({k: v for k, v in layers.items() if k != "conv2"}, "conv2.bias: missing"),
            ({**layers, "conv4": layers["conv1"]}, "conv4.bias: not part of the network"),
            (
                {**layers, "conv3": {**layers["conv3"], "bias": np.zeros(4, np.float32)}},
                "conv3.bias: shape [4], expected [3]",
            ),
            (
                {**layers, "conv3": {**layers["conv3"], "bias": np.full(3, np.nan, np.float32)}},
                "conv3.bias: not finite",
            ),
        ]
        for changed, says in cases:
            with self.subTest(says=says):
                testfiles.write_keras(path, changed)
                self.refused_weights("cconv-h5", path, "w.h5", says)
        with h5py.File(path, "w"):
            pass
        self.refused_weights("cconv-h5", path, "layer_names: missing: no Keras weights")
        with open(path, "wb") as file:
            file.write(b"\x89HDF\r\n\x1a\n")
        self.refused_weights("cconv-h5", path, "w.h5: HDF5")

    def test_what_is_wrong_with_torch_weights_is_named(self):
        state, path = torch_state(network_tensors("cconv-liquid3d")), self.path("w.pt")
        cases = [
            ({k: v for k, v in state.items() if k != "dense1.weight"}, "dense1.weight: missing"),
            (
                {**state, "dense1.weight": state["dense1.weight"].T.copy()},
                "dense1.kernel: shape [64, 96], expected [96, 64]",
            ),
            ({**state, "gravity": np.float32([0, 0, -9.81])}, "gravity: [0.0, 0.0, -9.8"),
            ({**state, "conv1.offset": np.float32([0, 0.5, 0])}, "conv1.offset: [0.0, 0.5"),
            ({**state, "conv9.kernel": np.zeros(3, np.float32)}, "conv9.kernel: not part"),
            ([1, 2], "data.pkl: expected a state dictionary"),
        ]
        for changed, says in cases:
            with self.subTest(says=says):
                testfiles.write_torch(path, changed)
                self.refused_weights("cconv-pt", path, "w.pt", says)
        with open(path, "wb") as file:
            file.write(pickle.dumps({"a": 1}))
        self.refused_weights("cconv-pt", path, "w.pt: zip", "before 1.6")

    def test_a_pickle_cannot_run_code(self):
        class Bomb:
            def __reduce__(self):
                return os.mkdir, (bomb,)

        bomb = self.path("exploded")
        calls = [
            pickle.dumps(Bomb(), 2),
            pickle.dumps({"model": Bomb()}, 4),
            b"\x80\x02cbuiltins\neval\n.",
            b"\x80\x02cnumpy\nload\n.",
            b"\x80\x02ccollections\nOrderedDict.popitem\n.",
            b"\x80\x02X\x01\x00\x00\x00aQ.",
            b"\x80\x02(i",
            b"not a pickle",
        ]
        for pickled in calls:
            with self.subTest(pickled=pickled):
                testfiles.write_torch(self.path("w.pt"), {}, pickled)
                self.refused_weights("cconv-pt", self.path("w.pt"), "w.pt", "data.pkl")
        self.assertFalse(os.path.exists(bomb))

    def test_a_tensor_cannot_reach_outside_its_storage(self):
        import read_torch

        storage = np.arange(12, dtype=np.float32)
        view = read_torch.rebuild_tensor(storage, 2, (2, 3), (1, 2), False, {})
        self.assertEqual(view.tolist(), [[2, 4, 6], [3, 5, 7]])
        for offset, size, stride in (
            (0, (13,), (1,)),
            (10, (3,), (1,)),
            (-1, (2,), (1,)),
            (0, (2, 2), (11, 1)),
            (0, (1 << 40,), (0,)),
            (0, (2,), ()),
        ):
            with self.assertRaises(read_torch.Refused):
                read_torch.rebuild_tensor(storage, offset, size, stride)

    def test_damaged_torch_and_keras_files_are_refused_or_read(self):
        tensors = network_tensors("cconv-liquid3d")
        testfiles.write_torch(self.path("w.pt"), torch_state(tensors))
        self.survives_damage(
            self.path("w.pt"), lambda: self.convert("cconv-pt", self.path("w.pt")), 20
        )
        testfiles.write_keras(self.path("w.h5"), keras_layers(tensors))
        self.survives_damage(
            self.path("w.h5"), lambda: self.convert("cconv-h5", self.path("w.h5")), 20
        )

    def published(self, name):
        """(file bytes, tensors) of a reference conversion."""
        path = os.path.join(WEIGHTS, name + ".safetensors")
        with open(path, "rb") as file:
            return file.read(), tensorfile.read(path)[0]

    def equals_published(self, kind, path, name):
        code, err = self.convert(kind, path)
        self.assertEqual(code, 0, err)
        with open(self.path("model.safetensors"), "rb") as file:
            self.assertTrue(
                file.read() == self.published(name)[0], "not byte for byte the reference"
            )

    @needs(WEIGHTS, "dmcf-liquid3d.safetensors")
    def test_the_published_dmcf_network_comes_back_byte_for_byte(self):
        _, tensors = self.published("dmcf-liquid3d")
        self.equals_published("dmcf", self.bundle(dmcf_variables(tensors)), "dmcf-liquid3d")

    @needs(WEIGHTS, "cconv-liquid3d.safetensors")
    def test_the_published_cconv_network_comes_back_byte_for_byte(self):
        _, tensors = self.published("cconv-liquid3d")
        testfiles.write_torch(self.path("w.pt"), torch_state(tensors))
        self.equals_published("cconv-pt", self.path("w.pt"), "cconv-liquid3d")
        testfiles.write_keras(self.path("w.h5"), keras_layers(tensors))
        self.equals_published("cconv-h5", self.path("w.h5"), "cconv-liquid3d")

    @needs(CHECKPOINTS, "ckpt.index")
    def test_the_original_dmcf_checkpoint_gives_the_reference(self):
        self.equals_published("dmcf", os.path.join(CHECKPOINTS, "ckpt.index"), "dmcf-liquid3d")

    @needs(CHECKPOINTS, "pretrained_model_weights.pt")
    def test_the_original_cconv_files_give_the_reference(self):
        for kind in ("pt", "h5"):
            path = os.path.join(CHECKPOINTS, "pretrained_model_weights." + kind)
            self.equals_published("cconv-" + kind, path, "cconv-liquid3d")


class Program(Case):
    def program(self, *argv):
        return subprocess.run(
            [sys.executable, os.path.join(HERE, "convert.py"), *argv],
            capture_output=True,
            text=True,
            check=False,
        )

    def test_exit_codes_and_streams(self):
        testfiles.write_shard(self.path("a.msgpack.zst"), testfiles.scene_frames())
        done = self.program("data", "dlf", self.path("a.msgpack.zst"), "-o", self.out)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        self.assertIn(
            "sim_0001.safetensors: 3D, 4 frames of 0.02 s, 8 fluid and 3 boundary particles, "
            "spacing 0.05 m",
            done.stdout,
        )
        failed = self.program("data", "dlf", self.path("b.msgpack.zst"), "-o", self.out)
        self.assertEqual((failed.returncode, failed.stdout), (2, ""))
        self.assertEqual(failed.stderr.count("\n"), 1)
        for argv in (
            (),
            ("data", "vtk", "x", "-o", "y"),
            ("data", "dlf", "x", "-o", "y", "--dt", "-1"),
            ("data", "dlf", "x", "-o", "y", "--gravity", "1"),
        ):
            self.assertEqual(self.program(*argv).returncode, 2)

    def test_an_unusable_output_folder_is_an_error(self):
        testfiles.write_shard(self.path("a.msgpack.zst"), testfiles.scene_frames())
        with open(self.out, "w"):
            pass
        code, err = self.data("dlf", self.path("a.msgpack.zst"))
        self.assertEqual(code, 2)
        self.assertIn("out", err)


if __name__ == "__main__":
    sys.exit(tap.main(sys.modules[__name__]))
