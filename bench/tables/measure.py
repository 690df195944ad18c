# SPDX-License-Identifier: MIT
"""Runs the program, the benchmark and the library, and reads what they say."""

import csv
import os
import resource
import subprocess
import sys

import numpy as np

from cache import Failed, File

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
sys.path.insert(0, os.path.join(ROOT, "examples", "convert"))
sys.path.insert(0, os.path.join(ROOT, "examples", "python", "src"))

import tensorfile  # noqa: E402

MANY = 200000  # particles of which a step is repeated less often
FRAME = 0.02  # s: of a frame in section 5.4
SPH_STEP = 1e-4  # s: of the paper's reference


def say(text):
    print(text, file=sys.stderr, flush=True)


def attempt(errors, what, measure):
    """A measurement, or None and why not: one that fails is a line of the page, not the end of it."""
    say(what)
    try:
        return measure()
    except Failed as error:
        errors.append(f"{what}: {error}")
        say(f"  {error}")
        return None


class Tools:
    """The programs of a build, their cache, how much is wanted, and where the data that is given lies."""

    def __init__(self, build, cache, quick, shared):
        self.build, self.cache, self.quick, self.shared = os.path.abspath(build), cache, quick, shared
        os.environ.setdefault("ASCC_LIBRARY", os.path.join(self.build, "lib", "libascc.so.0"))

    def program(self, name, *arguments):
        """Standard output, and CPU seconds."""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        words = [os.path.join(self.build, name), *map(str, arguments)]
        try:
            run = subprocess.run(words, capture_output=True, text=True, cwd=ROOT)
        except OSError as error:
            raise Failed(f"{words[0]}: {error.strerror}") from None
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        if run.returncode:
            raise Failed((run.stderr.strip().splitlines() or [f"{name} failed"])[-1])
        return run.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    def ascc(self, *arguments):
        return self.program("examples/ascc", *arguments)

    # ---- Truth ----

    def generated(self, kind, frames, seed, interval, *more):
        """A sequence of the reference solver; the path."""
        folder = self.cache.path("scenes", kind, frames, seed, interval, more)
        path = os.path.join(folder, f"{kind}_{seed}_0000.safetensors")
        if not os.path.exists(path):
            self.ascc("generate", kind, "-o", folder, "--seed", seed, "--count", 1, "--frames", frames,
                      "--interval", interval, *more)  # fmt: skip
        return path

    def cut(self, path, frames, every):
        """The first frames of a sequence, every so many; the path."""
        out = self.cache.path("cut", File(path), frames, every) + ".safetensors"
        if not os.path.exists(out):
            tensors, metadata = tensorfile.read(path)
            for name in ("fluid.position", "fluid.velocity"):
                if len(tensors.get(name, [])) > 1:
                    tensors[name] = tensors[name][::every][:frames]
            metadata["dt"] = repr(float(metadata["dt"]) * every)
            tensorfile.write(out, tensors, metadata)
        return out

    def drifting(self, path, velocity):
        """The first frame of a sequence with a velocity more; the path."""
        out = self.cache.path("drifting", File(path), velocity) + ".safetensors"
        if not os.path.exists(out):
            tensors, metadata = tensorfile.read(path)
            tensors["fluid.position"] = tensors["fluid.position"][:1]
            tensors["fluid.velocity"] = tensors["fluid.velocity"][:1] + np.array(velocity, np.float32)
            tensorfile.write(out, tensors, metadata)
        return out

    def floating(self, path):
        """A sequence of which nobody is told that there is gravity; the path."""
        out = self.cache.path("floating", File(path)) + ".safetensors"
        if not os.path.exists(out):
            tensors, metadata = tensorfile.read(path)
            metadata["gravity"] = " ".join(["0"] * int(metadata["dim"]))
            tensorfile.write(out, tensors, metadata)
        return out

    # ---- Networks ----

    def published(self, name):
        """A network that its authors trained and that was given, as a model file; the path, or None."""
        given = os.path.join(self.shared, "data", "weights", name + ".safetensors")
        if not os.path.exists(given):
            return None
        out = self.cache.path("published", File(given)) + ".safetensors"
        if not os.path.exists(out):
            self.ascc("convert", given, "-o", out)
        return out

    # ---- Measures ----

    def evaluate(self, model, sequence):
        """Figures of docs/measures.md, by name."""

        def measure(path):
            self.ascc("eval", model, sequence, "--emd", "--quiet", "--velocity", "difference",
                      "--csv", path + ".csv")  # fmt: skip
            with open(path + ".csv", encoding="utf-8", newline="") as file:
                rows = list(csv.DictReader(file))
            os.unlink(path + ".csv")
            return {row["figure"]: float(row["value"]) if row["value"] else None for row in rows}

        return self.cache.result("eval", ["2", File(model) if os.path.exists(model) else model, File(sequence)], measure)

    def rollout(self, model, start, steps, every, gravity):
        """Momentum error after each step, and frames of positions: {"momentum": [], "file": path}."""

        def measure(path):
            return run_model(model, start, steps, every, gravity, path + ".npy")

        made_from = ["3", File(model), File(start), steps, every, list(gravity)]
        value = self.cache.result("rollout", made_from, measure)
        return value["momentum"], np.load(self.cache.path("rollout", *made_from) + ".npy"), value["note"]

    def step_cost(self, model, particles):
        """ms a frame on one thread and bytes of scratch; the model's time step is its frame."""

        def measure(_):
            out, _ = self.program("bench/bench", "step", "--scene", "block", "--model", model, "--particles",
                                  particles, "--threads", 1, "--output", "none", "--figures", "none",
                                  "--shared", self.shared, "--repeats", 3 if self.quick or particles > MANY else 7)  # fmt: skip
            rows = list(csv.DictReader(line for line in out.splitlines() if not line.startswith("#")))
            if not rows:
                raise Failed("bench step printed no row")
            ns, scratch = (float(rows[-1][key]) for key in ("ns_per_particle", "scratch_bytes_per_particle"))
            return {"ms": ns * particles * 1e-6, "mib": scratch * particles / 2**20}

        made_from = ["3", File(model) if os.path.exists(model) else model, particles, self.quick]
        return self.cache.result("step", made_from, measure)

    def sph_cost(self, particles):
        """ms of the reference SPH for a frame of 0.02 s in steps of 1e-4 s, one thread, by CPU time."""

        def measure(path):
            side = round(particles ** (1 / 3))
            scene = path + ".safetensors"
            block(scene, side, 3)
            sound = 20.0
            # dt = courant * h / (c + |v|), h = 1.5 spacings
            courant = SPH_STEP * sound / (SMOOTHING * SPACING)
            cost = []
            for method in ("ballistic", f"sph:cs={sound},contact=-1,courant={courant!r}"):
                cost.append(self.ascc("eval", method, scene, "--no-rollout", "--velocity", "stored", "--frames",
                                      "0:1:1", "--quiet")[1])  # fmt: skip
            os.unlink(scene)
            return {"ms": 1000 * (cost[1] - cost[0]) / 2, "particles": side**3}

        return self.cache.result("sph", ["4", particles], measure)


SPACING, SMOOTHING = 0.05, 1.5


def block(path, side, frames):
    """A block at rest, without walls or gravity, as a sequence of some frames."""
    x = (np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), -1).reshape(-1, 3) + 0.5) * SPACING
    x += np.random.default_rng(1).uniform(-0.1, 0.1, x.shape) * SPACING
    still = np.repeat(x[None], frames, 0)
    tensors = {
        "fluid.position": still, "fluid.velocity": np.zeros_like(still),
        "boundary.position": np.zeros((0, 3)), "boundary.normal": np.zeros((0, 3)),
    }  # fmt: skip
    tensorfile.write(path, tensors, {
        "format": "ascc.sequence", "version": "1", "dim": "3", "dt": repr(FRAME), "gravity": "0 0 0",
        "particle_radius": repr(SPACING / 2), "particle_mass": repr(1000 * SPACING**3), "rest_density": "1000",
        "source": "a block at rest, made for a measurement"})  # fmt: skip


def run_model(model, start, steps, every, gravity, out):
    """|P(t) - P(0) - t m g| / (|P(0)| + 1e-10) in whole quanta, and positions: the last ones, too, if it ends early."""
    import ascc

    tensors, metadata = tensorfile.read(start)
    x, v = tensors["fluid.position"][0], tensors["fluid.velocity"][0]
    try:
        network = ascc.Model(model)
    except ascc.Error as error:
        raise Failed(str(error)) from None
    water = ascc.Particles(network, mass=float(metadata["particle_mass"]))
    water.add_fluid(x, v)
    if len(tensors["boundary.position"]):
        water.add_boundary(tensors["boundary.position"], tensors["boundary.normal"])
    step = ascc.Step(network)
    first = np.array(water.total_momentum(), float) * water.momentum_quantum
    own, momentum, frames, note = np.array(water.total_momentum(), object), [], [np.array(water.position)], ""
    given = np.zeros(3, object)
    for t in range(1, steps + 1):
        try:
            step.run(water, 1, gravity=gravity)
        except ascc.Error as error:
            note = f"stopped at step {t}: {error}"
            frames.append(np.array(water.position))
            break
        given = given + np.array(step.statistics.external_impulse, object)
        lost = np.array(water.total_momentum(), object) - own - given
        size = np.sqrt(sum(float(c) ** 2 for c in lost)) * water.momentum_quantum
        momentum.append(size / (np.linalg.norm(first) + 1e-10))
        if t % every == 0:
            frames.append(np.array(water.position))
    np.save(out, np.array(frames))
    return {"momentum": momentum, "note": note}
