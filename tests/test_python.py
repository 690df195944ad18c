# SPDX-License-Identifier: MIT
"""Tests of examples/python against the library that ASCC_LIBRARY names; run by tests/python_test.sh."""

import ctypes
import gc
import mmap
import os
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(HERE, "support"))

import ascc  # noqa: E402
import tap  # noqa: E402
from ascc import _library  # noqa: E402

MODELS = os.path.join(HERE, "..", "examples", "models")
POSITION, VELOCITY, MASS, NORMAL = ascc.POSITION, ascc.VELOCITY, ascc.MASS, ascc.NORMAL
FLUID, BOUNDARY = ascc.FLUID, ascc.BOUNDARY


def model(name="pbf2d"):
    return ascc.Model(os.path.join(MODELS, name + ".safetensors"))


def walled(shape, dtype=np.float32):
    """An array that ends where a page begins that nobody may read: what reads on dies."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    room = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
    pages = mmap.mmap(-1, room + mmap.PAGESIZE)
    array = np.frombuffer(pages, np.uint8)[room - size : room].view(dtype).reshape(shape)
    libc = ctypes.CDLL(None, use_errno=True)
    address = array.ctypes.data + size
    if libc.mprotect(ctypes.c_void_p(address), ctypes.c_size_t(mmap.PAGESIZE), 0) != 0:
        raise OSError(ctypes.get_errno(), "mprotect")
    return array


class Case(unittest.TestCase):
    def setUp(self):
        self.model = model()
        self.set = ascc.Particles(self.model)

    def fails(self, status, call, *arguments, says="", **named):
        before = self.set.hash()
        with self.assertRaises(ascc.Error) as caught:
            call(*arguments, **named)
        self.assertEqual(caught.exception.status, status)
        self.assertIn(says, str(caught.exception))
        self.assertEqual(self.set.hash(), before)


class Header(unittest.TestCase):
    def test_structs_lie_as_the_header_has_them(self):
        names = {
            "ContextOptions": "ascc_context_options",
            "ModelInfo": "ascc_model_info",
            "ParticlesOptions": "ascc_particles_options",
            "Measures": "ascc_measures",
            "StepOptions": "ascc_step_options",
            "Forces": "ascc_forces",
            "StageTime": "ascc_stage_time",
            "Compression": "ascc_compression",
            "StepStatistics": "ascc_step_statistics",
            "LadderOptions": "ascc_ladder_options",
            "LadderStatistics": "ascc_ladder_statistics",
            "Array": "ascc_array",
            "Shape": "ascc_shape",
            "Pose": "ascc_pose",
            "BodyInfo": "ascc_body_info",
            "Tap": "ascc_tap",
            "Drain": "ascc_drain",
        }
        lines, wanted = [], []
        for python, c in names.items():
            struct = getattr(_library, python)
            lines.append(f'printf("{c} %zu\\n", sizeof({c}));')
            wanted.append(f"{c} {ctypes.sizeof(struct)}")
            for field, _ in struct._fields_:
                at = getattr(struct, field)
                lines.append(
                    f'printf("{c}.{field} %zu %zu\\n", offsetof({c}, {field}), sizeof((({c} *)0)->{field}));'
                )
                wanted.append(f"{c}.{field} {at.offset} {at.size}")
        for enum, prefix in (
            (_library.Status, "ASCC_ERROR_"),
            (_library.Kind, "ASCC_"),
            (_library.Field, "ASCC_"),
            (ascc.ShapeKind, "ASCC_SHAPE_"),
            (ascc.Water, "ASCC_WATER_"),
            (ascc.DrainKind, "ASCC_DRAIN_"),
            (ascc.LadderReason, "ASCC_LADDER_"),
        ):
            for item in enum:
                name = "ASCC_OK" if item.name == "OK" else prefix + item.name
                lines.append(f'printf("{name} %d\\n", {name});')
                wanted.append(f"{name} {item.value}")
        with tempfile.TemporaryDirectory() as folder:
            source, program = os.path.join(folder, "p.c"), os.path.join(folder, "p")
            with open(source, "w") as file:
                file.write(
                    "#include <stdio.h>\n#include <ascc/ascc.h>\nint main(void) {\n"
                    + "\n".join(lines)
                    + "\n}\n"
                )
            subprocess.run(
                ["cc", "-I", os.path.join(HERE, "..", "include"), source, "-o", program], check=True
            )
            told = subprocess.run([program], capture_output=True, text=True, check=True).stdout
        self.assertEqual(told.split("\n")[:-1], wanted)

    def test_every_function_of_the_library_is_there(self):
        with open(os.path.join(HERE, "exports.txt")) as file:
            exported = {line.strip().removeprefix("ascc_") for line in file if line.strip()}
        functions = set(_library._FUNCTIONS)
        self.assertLessEqual(exported, functions)
        self.assertEqual(functions - exported, set())


class Arrays(Case):
    def test_numbers_go_in_and_out_without_copies(self):
        for dtype in (np.float32, np.float64):
            vertices = np.zeros(50, [("position", dtype, 2), ("colour", np.uint8), ("mass", dtype)])
            whole = np.arange(100, dtype=dtype).reshape(50, 2)
            vertices["position"], vertices["mass"] = whole, 1 + np.arange(50)
            layouts = {
                "rows": whole,
                "columns": np.asfortranarray(whole),
                "a struct's member": vertices["position"],
                "backwards": whole[::-1],
                "every other": np.repeat(whole, 2, 0)[::2],
                "components backwards": whole[:, ::-1],
                "transposed": np.ascontiguousarray(whole.T).T,
            }
            for name, array in layouts.items():
                with self.subTest(name, dtype=dtype):
                    self.assertIs(ascc._arrays.rows_of("x", array, 2), array)  # no copy
                    self.set.clear(FLUID)
                    self.set.add_fluid(array, velocity=array, mass=vertices["mass"])
                    np.testing.assert_array_equal(self.set.position, array)
                    self.assertTrue(np.allclose(self.set.velocity, array, atol=1e-6))
                    np.testing.assert_array_equal(self.set.mass, 1 + np.arange(50))
                    room = np.zeros(50, [("a", dtype, 2), ("b", np.int16)])
                    for out in (np.empty_like(array), room["a"], np.empty((2, 50), dtype).T):
                        self.assertIs(self.set.get(FLUID, POSITION, out=out), out)
                        np.testing.assert_array_equal(out, array)
                    self.assertFalse(room["b"].any())

    def test_arrays_are_read_to_their_end_and_not_beyond(self):
        for dtype in (np.float32, np.float64):
            for rows in (1, 2, 511, 512):
                array = walled((rows, 2), dtype)
                array[:] = np.arange(2 * rows).reshape(rows, 2) % 100
                for given in (array, array[::-1], array[:, ::-1], array[:1], array[-1:]):
                    self.set.clear(FLUID)
                    self.set.add_fluid(given, given, np.abs(given[:, 0]) + 1)
                    np.testing.assert_array_equal(self.set.position, given)
                    self.set.get(FLUID, POSITION, out=given)

    def test_what_is_repeated_is_read_once_and_no_further(self):
        one = walled((1, 2))
        one[:] = 3, 4
        n = 4096  # rows packed behind `one` would lie on the forbidden page
        lattice = ascc.block((0, 0), (64, 64), 0.02)
        for row in (
            np.broadcast_to(one, (n, 2)),
            np.lib.stride_tricks.as_strided(one, (n, 2), (0, 4)),
        ):
            self.set.clear(FLUID)
            self.set.add_fluid(lattice, velocity=row)
            self.assertTrue(np.allclose(self.set.velocity, (3, 4), atol=1e-6))
            self.set.set(FLUID, POSITION, row)
            np.testing.assert_array_equal(self.set.position, row)
        column = walled((n, 1))
        column[:, 0] = np.arange(n)
        self.set.set(
            FLUID, POSITION, np.broadcast_to(column, (n, 2))
        )  # a component that stands for both
        np.testing.assert_array_equal(self.set.position[:, 1], np.arange(n))
        mass = walled((1,))
        mass[:] = 2
        self.set.mass = np.broadcast_to(mass, (n,))
        np.testing.assert_array_equal(self.set.mass, 2)
        ascc.Step(self.model).run(self.set, acceleration=np.broadcast_to(one, (n, 2)))

    def test_one_number_or_row_stands_for_all_where_it_may(self):
        x = ascc.block((0, 0), (3, 4), 0.01)
        self.set.add_fluid(x, velocity=(1, 2), mass=0.25)
        np.testing.assert_array_equal(self.set.mass, 0.25)
        self.assertTrue(np.allclose(self.set.velocity, (1, 2), atol=1e-6))
        self.set.velocity = 0
        self.assertFalse(self.set.velocity.any())
        self.set.add_boundary(x, (0, 1))
        np.testing.assert_array_equal(self.set.get(BOUNDARY, NORMAL), np.tile((0, 1), (12, 1)))
        for wrong in (
            (1, 2, 3),
            np.zeros((3, 2)),
            np.zeros((1, 2)),
            np.zeros((12, 3)),
            np.zeros((12, 2, 1)),
        ):
            with self.assertRaises(ValueError):
                self.set.add_fluid(x, velocity=wrong)
        for wrong in ((0, 0), np.zeros((12, 3)), 0.0, np.zeros((2, 12))):
            with self.assertRaises(ValueError):
                self.set.add_fluid(wrong)
        self.assertEqual(len(self.set), 12)

    def test_earlier_velocities_are_set_and_read_one_by_one(self):
        self.set.add_fluid(ascc.block((0, 0), (3, 4), 0.01), velocity=(1, 2))
        values = np.arange(24.0).reshape(12, 2)
        self.set.set(FLUID, ascc.EARLIER_VELOCITY + 1, values)
        np.testing.assert_array_equal(self.set.get(FLUID, ascc.EARLIER_VELOCITY + 3), values)
        np.testing.assert_array_equal(self.set.get(FLUID, ascc.EARLIER_VELOCITY), self.set.velocity)

    def test_other_numbers_are_copied_and_what_is_none_refused(self):
        self.set.add_fluid([[0, 1], [2, 3]])
        self.set.add_fluid(np.arange(4, dtype=np.int8).reshape(2, 2))
        self.set.add_fluid(np.arange(4, dtype=">f4").reshape(2, 2))
        self.set.add_fluid(np.arange(4, dtype=np.float16).reshape(2, 2))
        np.testing.assert_array_equal(self.set.position, np.tile([[0, 1], [2, 3]], (4, 1)))
        for wrong in ([[1j, 2]], [["a", "b"]], [[None, 1]], [[True, False]]):
            with self.assertRaises(TypeError):
                self.set.add_fluid(wrong)
        self.fails(ascc.Status.NOT_FINITE, self.set.add_fluid, [[np.nan, 0]], says="position")
        self.assertEqual(self.set.add_fluid(np.empty((0, 2))).shape, (0,))
        self.assertEqual(len(self.set), 8)

    def test_nothing_is_written_where_it_must_not(self):
        self.set.add_fluid(ascc.block((0, 0), (4, 1), 0.01))
        frozen = np.empty((4, 2), np.float32)
        frozen.flags.writeable = False
        for wrong in (
            frozen,
            np.broadcast_to(np.float32(0), (4, 2)),
            np.lib.stride_tricks.as_strided(np.zeros(2, np.float32), (4, 2), (0, 4)),
            np.empty((5, 2), np.float32),
            np.empty((4, 3), np.float32),
            np.empty(8, np.float32),
        ):
            with self.assertRaises(ValueError):
                self.set.get(FLUID, POSITION, out=wrong)
        for wrong in (
            np.empty((4, 2), np.float16),
            np.empty((4, 2), int),
            [[0.0, 0.0]] * 4,
            np.empty((4, 2), ">f4"),
        ):
            with self.assertRaises(TypeError):
                self.set.get(FLUID, POSITION, out=wrong)
        with self.assertRaises(ValueError):
            self.set.get(FLUID, POSITION, first=-1)
        self.assertEqual(self.set.get(FLUID, POSITION, 1, 2, dtype=np.float64).dtype, np.float64)
        self.assertEqual(self.set.get(FLUID, POSITION, 4).shape, (0, 2))


class Sets(Case):
    def test_bodies_are_carried_and_taps_and_drains_count(self):
        h = self.set.spacing
        ball = ascc.Shape(ascc.ShapeKind.SPHERE, radius=3 * h)
        body = self.set.add_body(ball, ascc.Pose((0, 9), velocity=(0.5, 0), spin=(2.0,)))
        square = [[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5]]
        mesh = self.set.add_body(
            ascc.Shape(ascc.ShapeKind.MESH, position=square, faces=[[0, 1], [1, 2], [2, 3], [3, 0]])
        )
        self.assertEqual(self.set.body_numbers, (body, mesh))
        step = ascc.Step(self.model)
        step.run(self.set, 3)
        now = self.set.body(body)
        self.assertAlmostEqual(now.pose.position[0], 1.5 * self.model.info.time_step, 12)
        self.assertAlmostEqual(now.pose.angle, 6 * self.model.info.time_step, 12)
        self.assertGreater(now.count, 5)
        self.assertEqual([i.impulse for i in self.set.body_impulses([body, mesh])], [(0, 0, 0)] * 2)
        self.set.move_body(body, now.pose)
        with self.assertRaisesRegex(ascc.Error, "jump"):
            self.set.move_body(body, ascc.Pose((99, 0)))
        with self.assertRaisesRegex(ascc.Error, "none has the number 77"):
            self.set.body(77)
        with self.assertRaises(ValueError):
            self.set.add_body(ascc.Shape(ascc.ShapeKind.BOX, (h, h), open=["up"]))
        self.set.remove_body(body)
        self.assertEqual(self.set.body_numbers, (mesh,))
        before = len(self.set.ids())
        tap = ascc.Tap((5, 5), velocity=(0, -1), radius=2 * h)
        came = self.set.run_tap(tap, 0.1)
        self.assertEqual((len(came), tap.emitted), (5, 5))
        self.assertEqual(len(self.set.run_tap(tap, 0.1)), 0)
        gone = self.set.run_drain(ascc.Drain(ascc.DrainKind.SPHERE, (5, 5), radius=2.5 * h))
        self.assertEqual(list(gone), list(came))
        self.assertEqual(len(self.set.ids()), before)

    def test_particles_come_go_and_are_found(self):
        ids = self.set.add_fluid(ascc.block((0, 0), (4, 2), 0.01))
        walls = self.set.add_boundary([[0, 0], [1, 0]], (0, 1), body=7)
        self.set.remove(ids[[1, 3]])
        self.assertEqual((len(self.set), self.set.count(BOUNDARY)), (6, 2))
        self.assertEqual(self.set.find(int(ids[4])), (FLUID, 2))
        self.assertEqual(self.set.find(walls[1]), (BOUNDARY, 1))
        for gone in (ids[1], 2**64 - 1, -1, 2**70):
            with self.assertRaises(KeyError):
                self.set.find(int(gone))
        self.fails(ascc.Status.ARGUMENT, self.set.remove, [ids[1]])
        for wrong, error in (([0.5], TypeError), ([-1], ValueError), ([[1]], ValueError)):
            with self.assertRaises(error):
                self.set.remove(wrong)
        self.assertEqual(self.set.bodies().tolist(), [7, 7])
        self.assertEqual(self.set.ids(BOUNDARY).tolist(), walls.tolist())
        self.set.resize_fluid(3)
        self.set.reserve(100, 10)
        self.assertGreaterEqual(self.set.capacity(), 100)
        self.assertEqual(len(self.set), 3)
        for call in (self.set.resize_fluid, self.set.reserve):
            with self.assertRaises(ValueError):
                call(-1)
            with self.assertRaises((ValueError, OverflowError)):
                call(2**64)
        self.fails(ascc.Status.ARGUMENT, self.set.set, BOUNDARY, MASS, [1])

    def test_a_snapshot_is_the_state(self):
        self.set.add_fluid(ascc.block((0, 0), (8, 8), self.set.spacing), (1, 0))
        step = ascc.Step(self.model)
        snapshot = self.set.snapshot()
        step.run(self.set, 5)
        after = self.set.hash()
        self.set.restore(snapshot)
        step.run(self.set, 5)
        self.assertEqual(self.set.hash(), after)
        self.fails(ascc.Status.FORMAT, self.set.restore, snapshot[:-1])

    def test_momentum_is_kept_to_the_bit(self):
        self.set.add_fluid(ascc.block((0, 0), (8, 8), self.set.spacing * 0.7), (1, -2))
        before = self.set.total_momentum()
        step = ascc.Step(self.model, context=ascc.Context(threads=2))
        step.run(self.set, gravity=(0, 0))
        first = step.statistics
        self.assertGreater(first.compression_before.largest, first.compression_after.mean)
        step.run(self.set, 20, gravity=(0, 0))
        self.assertEqual(self.set.total_momentum(), before)
        self.assertEqual(self.set.momentum().sum(0).tolist(), list(before[:2]))
        s = step.statistics
        self.assertEqual((s.steps, s.momentum_before, s.momentum_after), (20, before, before))
        self.assertIn("relaxation", s.stages)
        self.assertGreater(self.set.measure().kinetic_energy, 0)

    def test_walls_receive_what_the_fluid_loses(self):
        self.set.add_fluid(ascc.block((0, 0), (8, 8), self.set.spacing))
        self.set.add_boundary(*ascc.box((0, 0), (0.1, 0.2), self.set.spacing, open=["+y"]), body=3)
        step = ascc.Step(self.model)
        step.run(self.set, 30)
        got, s = self.set.body_impulse(3, (0, 0)), step.statistics
        self.assertEqual(got.impulse, s.wall_impulse)
        self.assertLess(got.impulse[1], 0)
        self.assertEqual(
            [b + e - w for b, e, w in zip(s.momentum_before, s.external_impulse, s.wall_impulse)],
            list(s.momentum_after),
        )

    def test_bits_are_those_of_any_number_of_threads(self):
        hashes = set()
        for threads in (1, 2, 5):
            water = ascc.Particles(self.model)
            water.add_fluid(ascc.block((0, 0), (16, 16), water.spacing))
            water.add_boundary(*ascc.box((0, 0), (0.3, 0.3), water.spacing))
            ascc.Step(self.model, context=ascc.Context(threads)).run(water, 10)
            hashes.add(water.hash())
        self.assertEqual(len(hashes), 1)


    def test_a_step_tells_how_far_it_is_from_training(self):
        self.set.add_fluid(ascc.block((0, 0), (8, 8), self.set.spacing))
        for measure in (False, True):
            step = ascc.Step(self.model, measure_distance=measure)
            step.run(self.set)
            told = step.statistics
            knows = measure and self.model.info.tells_distance
            self.assertEqual(told.distance_count, 64 if knows else 0)
            self.assertEqual(told.distance_mean > 0, knows)


class Ladders(Case):
    def test_choices_run_again_give_the_same_bits(self):
        models = [self.model, self.model]
        d, h = self.set.dimension, self.set.spacing
        self.set.add_fluid(ascc.block((0.0,) * d, (4,) * d, h))
        ladder = ascc.Ladder(models, budget=1e-9)
        start = self.set.snapshot()
        ladder.run(self.set, 3)
        told = ladder.statistics
        self.assertEqual((told.steps, told.late, sum(told.steps_on)), (3, 3, 3))
        self.assertEqual(told.reason, ascc.LadderReason.TOO_SLOW)
        self.assertTrue(all(seconds > 0 for seconds in told.predicted))
        hash_ = self.set.hash()
        other = ascc.Ladder(models)
        self.set.restore(start)
        other.replay(self.set, ladder.choices)
        self.assertEqual(self.set.hash(), hash_)
        self.assertEqual(other.statistics.reason, ascc.LadderReason.GIVEN)
        third = ascc.Ladder(models)
        third.restore(ladder.snapshot())
        self.assertEqual(third.choices, ladder.choices)
        third.set_budget(100.0)
        third.measure(self.set)
        third.run(self.set, gravity=[0.0] * self.set.dimension)
        self.fails(ascc.Status.ARGUMENT, third.replay, self.set, [7], says="rungs[0]")

    def test_detail_is_counted_by_rung(self):
        d, h = self.set.dimension, self.set.spacing
        self.set.add_fluid(ascc.block((0.0,) * d, (4,) * d, h))
        count = 4**d
        self.set.set(FLUID, ascc.DETAIL, np.ones(count))
        np.testing.assert_array_equal(self.set.get(FLUID, ascc.DETAIL), np.ones(count))
        ladder = ascc.Ladder([self.model, self.model])
        ladder.replay(self.set, [0])
        self.assertEqual(ladder.statistics.particles_on, (0, count))


class Life(Case):
    def test_errors_name_what_is_wrong(self):
        with self.assertRaises(ascc.Error) as caught:
            ascc.Model("/nonexistent/model")
        self.assertEqual(caught.exception.status, ascc.Status.FILE)
        self.assertIn("/nonexistent/model", str(caught.exception))
        with self.assertRaises(ascc.Error):
            ascc.Model.from_bytes(b"no model")
        with self.assertRaises(ascc.Error):
            ascc.Context(threads=-1)
        with self.assertRaises(ValueError):
            ascc.Context(threads=2**40)
        with self.assertRaises(ascc.Error):
            ascc.Particles()
        with self.assertRaises(ascc.Error) as caught:
            ascc.Step(self.model, time_step=-1.0)
        self.assertEqual(caught.exception.status, ascc.Status.ARGUMENT)
        with self.assertRaises(ascc.Error) as caught:
            ascc.Step(self.model, time_step=1.0, substeps=3).run(self.set)
        self.assertEqual(caught.exception.status, ascc.Status.RANGE)
        self.set.add_fluid([[0, 0]])
        step = ascc.Step(self.model)
        self.fails(ascc.Status.ARGUMENT, step.run, self.set, -1)
        with self.assertRaises(ValueError):
            step.run(self.set, 2**32 + 1)
        with self.assertRaises(ValueError):
            step.run(self.set, gravity=(0, 0, 0))
        other = ascc.Particles(model("pbf3d"))
        with self.assertRaises(ascc.Error) as caught:
            step.run(other)
        self.assertEqual(caught.exception.status, ascc.Status.MISMATCH)

    def test_a_closed_handle_is_an_error_and_what_uses_it_lives_on(self):
        step = ascc.Step(self.model)
        with ascc.Particles(self.model) as other:
            other.add_fluid([[0, 0]])
            self.model.context.close()
            self.model.close()
            step.run(other)
        for call in (
            lambda: len(other),
            lambda: step.run(other),
            lambda: self.model.info,
            other.snapshot,
        ):
            with self.assertRaisesRegex(ValueError, "closed"):
                call()
        other.close()

    def test_a_model_is_its_file(self):
        path = os.path.join(MODELS, "pbf2d.safetensors")
        with open(path, "rb") as file:
            data = file.read()
        self.assertEqual(bytes(self.model), data)
        with tempfile.TemporaryDirectory() as folder:
            copy = os.path.join(folder, "modèle 水")
            self.model.save(copy)
            self.assertEqual(bytes(ascc.Model(copy)), data)
        info = ascc.Model.from_bytes(data).info
        self.assertEqual((info.name, info.dimension, len(info.gravity)), ("pbf2d", 2, 2))
        self.assertTrue(info.conserves_momentum)

    def test_a_model_is_found_by_name(self):
        os.environ["ASCC_MODEL_PATH"] = MODELS
        self.addCleanup(os.environ.pop, "ASCC_MODEL_PATH")
        self.assertEqual(bytes(ascc.Model("pbf2d")), bytes(self.model))
        with self.assertRaisesRegex(ascc.Error, "no-such-model"):
            ascc.Model("no-such-model")

    def test_lines_of_the_log_arrive_and_what_it_raises_goes_no_further(self):
        lines, raised = [], []

        def log(line):
            lines.append(line)
            raise RuntimeError("from the log")

        hook, sys.unraisablehook = sys.unraisablehook, lambda told: raised.append(told.exc_value)
        try:
            context = ascc.Context(log=log)
            with self.assertRaises(ascc.Error):
                ascc.Model("/nonexistent/model", context)
        finally:
            sys.unraisablehook = hook
        self.assertIn("/nonexistent/model", lines[0])
        self.assertEqual(str(raised[0]), "from the log")

    def test_a_callback_that_comes_back_to_its_handle_is_told(self):
        told = []

        def log(line):
            try:
                len(water)
            except RuntimeError as error:
                told.append(str(error))

        water = ascc.Particles(self.model, context=ascc.Context(log=log))
        with self.assertRaises(ascc.Error):
            water.add_fluid([[np.nan, 0]])
        self.assertIn("in use", told[0])

    def test_threads_take_turns(self):
        self.set.add_fluid(ascc.block((0, 0), (12, 12), self.set.spacing))
        step, errors = ascc.Step(self.model), []

        def work(call):
            try:
                for _ in range(20):
                    call()
            except Exception as error:  # noqa: BLE001
                errors.append(error)

        calls = [
            lambda: step.run(self.set, 2),
            lambda: self.set.position,
            lambda: self.set.add_fluid([[1.0 + len(self.set), 5]]),
            lambda: step.statistics,
        ]
        threads = [threading.Thread(target=work, args=(call,)) for call in calls]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual((errors, len(self.set)), ([], 164))

    def test_handles_are_freed(self):
        def resident():
            with open("/proc/self/statm") as file:
                return int(file.read().split()[1]) * mmap.PAGESIZE

        x = ascc.block((0, 0), (100, 100), 0.01)
        for i in range(60):
            if i == 10:
                gc.collect()
                before = resident()
            water = ascc.Particles(self.model)
            water.add_fluid(x)  # half a megabyte and more
        del water
        gc.collect()
        self.assertLess(resident() - before, 10e6)


class Scenes(unittest.TestCase):
    def test_a_box_surrounds_its_block(self):
        for low, high, count in (((0, 0), (1, 0.5), 3), ((-1, 0, 2), (0, 0.5, 3), 5)):
            position, normal = ascc.box(low, high, 0.05, open=["+y"])
            self.assertEqual(position.dtype, np.float32)
            self.assertEqual(len({tuple(n) for n in normal.tolist()}), count)
            middle = (np.array(low) + high) / 2
            self.assertTrue((((middle - position) * normal).sum(1) > 0).all())
            self.assertFalse((position[:, 1] == high[1]).any())
            distance = np.sort(np.linalg.norm(position[:, None] - position[None], axis=2), 1)[:, 1]
            self.assertLessEqual(distance.max(), 0.64 * 0.05 + 1e-6)
        for wrong in (((0, 0), (0, 1)), ((0,), (1,)), ((0, 0), (1, 1, 1))):
            with self.assertRaises(ValueError):
                ascc.box(*wrong, 0.05)
        with self.assertRaises(ValueError):
            ascc.box((0, 0), (1, 1), 0.05, open=["+z"])

    def test_a_mesh_is_covered_and_its_points_lie_on_it(self):
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]])
        position, normal = ascc.surface(corners, [[0, 1, 2], [1, 3, 2], [0, 0, 1]], 0.1)
        np.testing.assert_array_equal(normal, np.tile(np.float32([0, 0, 1]), (len(position), 1)))
        self.assertTrue(
            (position[:, 2] == 0).all() and (position >= 0).all() and (position <= 1).all()
        )
        probe = np.stack(np.meshgrid(*[np.linspace(0, 1, 41)] * 2, [0]), -1).reshape(-1, 3)
        gap = np.linalg.norm(probe[:, None] - position[None], axis=2).min(1).max()
        self.assertLess(gap, 0.064)
        distance = np.sort(np.linalg.norm(position[:, None] - position[None], axis=2), 1)[:, 1]
        self.assertLessEqual(distance.max(), 0.064 + 1e-6)
        self.assertEqual(ascc.surface(corners, np.empty((0, 3), int), 0.1)[0].shape, (0, 3))


if __name__ == "__main__":
    sys.exit(tap.main(sys.modules[__name__]))
