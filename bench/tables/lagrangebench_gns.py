# SPDX-License-Identifier: MIT
"""GNS-5-64 by LagrangeBench's own code and by `ascc train`: as many steps on the same frames, the same test.

    lagrangebench_gns.py --build build --data ../shared/data/published/lagrangebench-3d-lj --steps 5000

Needs Python 3.9 or 3.10 with `lagrangebench` 0.0.1 of PyPI and what it ran with: jax and jaxlib 0.4.13, scipy < 1.12,
flax 0.7.0, chex 0.1.82, orbax-checkpoint 0.2.3, equinox < 0.11, jaxtyping < 0.2.24, lineax < 0.0.3, ott-jax 0.4.1,
jaxopt 0.7, vtk < 9.3. On the CPU.

The set is of three particles in a periodic box. libascc has no periodic boxes, so of each trajectory those frames are
taken in which the three see each other without them; put in a wide box they are the same motion, for both programs.
"""

import argparse
import json
import os
import subprocess
import sys
import time

import h5py
import numpy as np

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
sys.path[:0] = [os.path.join(ROOT, "examples", "convert"), os.path.join(ROOT, "examples", "python", "src")]
PAST, AHEAD, WIDE = 6, 20, 40.0  # positions seen, steps of a rollout, side of the box
NOISE = 3e-4
RATE = 5e-4


def together(path, length):
    """Pieces of so many frames in which nearest images agree, in the middle of a wide box."""
    with open(os.path.join(os.path.dirname(path), "metadata.json"), encoding="utf-8") as file:
        bounds = np.array(json.load(file)["bounds"])
    box = bounds[:, 1] - bounds[:, 0]
    with h5py.File(path) as file:
        x = file["00000/position"][:].astype(float)
    nearest = lambda r: r - box * np.round(r / box)  # noqa: E731
    one, two = nearest(x[:, 1] - x[:, 0]), nearest(x[:, 2] - x[:, 0])
    agree = np.abs(nearest(x[:, 2] - x[:, 1]) - (two - one)).max(1) < 1e-3
    ends = np.flatnonzero(np.diff(np.r_[0, agree, 0]))
    pieces = []
    for begin, end in zip(ends[::2], ends[1::2]):
        for k in range(begin, end - length + 1, length):
            part = slice(k, k + length)
            first = np.cumsum(np.r_[x[k : k + 1, 0] * 0, nearest(np.diff(x[part, 0], axis=0))], 0)
            pieces.append(np.stack([first, first + one[part], first + two[part]], 1) + WIDE / 2)
    return pieces


def prepare(data, folder, length=38):
    """train.h5 of the set's train and valid files, test.h5 of its test file; sequences of both."""
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(data, "metadata.json"), encoding="utf-8") as file:
        metadata = json.load(file)
    metadata["bounds"] = [[0.0, WIDE]] * 3
    pieces = {
        "train": sum((together(os.path.join(data, f"{name}.h5"), length) for name in ("train", "valid")), []),
        "test": together(os.path.join(data, "test.h5"), length),
    }
    step = np.concatenate([np.diff(p, axis=0).reshape(-1, 3) for p in pieces["train"]])
    change = np.concatenate([np.diff(p, 2, axis=0).reshape(-1, 3) for p in pieces["train"]])
    for name, values in (("vel", step), ("acc", change)):
        metadata[f"{name}_mean"], metadata[f"{name}_std"] = values.mean(0).tolist(), values.std(0).tolist()
    metadata["sequence_length_train"] = metadata["sequence_length_test"] = length
    with open(os.path.join(folder, "metadata.json"), "w", encoding="utf-8") as file:
        json.dump(metadata, file)
    for name, list_of in pieces.items():
        with h5py.File(os.path.join(folder, f"{name}.h5"), "w") as file:
            for k, piece in enumerate(list_of):
                file[f"{k:05}/position"] = piece.astype(np.float32)
                file[f"{k:05}/particle_type"] = np.zeros(3, np.int64)
    return metadata, pieces["test"]


def windows(pieces):
    for piece in pieces:
        for k in range(0, len(piece) - PAST - AHEAD + 1, 3):
            yield piece[k : k + PAST], piece[k + PAST : k + PAST + AHEAD]


def errors(pieces, rollout):
    """Mean errors after 1, 2 and 20 steps; None: of free flight."""
    found = []
    for past, future in windows(pieces):
        free = past[-1] + np.arange(1, AHEAD + 1)[:, None, None] * (past[-1] - past[-2])
        made = rollout(past) if rollout else free
        found.append(np.linalg.norm(made - future, axis=2).mean(1))
    mean = np.mean(found, 0)
    return {n: float(mean[n - 1]) for n in (1, 2, AHEAD)}


def theirs(folder, metadata, steps, seed):
    """A rollout by LagrangeBench's network after its own training, CPU seconds, and the folder of its weights."""
    import haiku
    import jax
    import jax.numpy as jnp
    from lagrangebench import H5Dataset, Trainer, case_builder, models
    from lagrangebench.utils import save_haiku

    data = {
        name: H5Dataset(name, dataset_path=folder, name="lj3d", input_seq_length=PAST, is_rollout=name != "train")
        for name in ("train", "test")
    }
    case = case_builder(box=np.array([WIDE] * 3), metadata=metadata, input_seq_length=PAST, noise_std=NOISE)
    model = haiku.without_apply_rng(haiku.transform_with_state(lambda x: models.GNS(
        particle_dimension=3, latent_size=64, num_mlp_layers=2, num_message_passing_steps=5,
        particle_type_embedding_size=16)(x)))  # fmt: skip
    begin = time.process_time()
    train = Trainer(model, case, data["train"], data["test"], lr_start=RATE, lr_final=1e-6, lr_decay_rate=0.1,
                    lr_decay_steps=steps, noise_std=NOISE, batch_size=1, seed=seed, n_rollout_steps=AHEAD,
                    log_steps=10**9, eval_steps=10**9)  # fmt: skip
    params, state, _ = train(step_max=steps)
    seconds = time.process_time() - begin
    saved = os.path.join(folder, "theirs")
    os.makedirs(os.path.join(saved, "best"), exist_ok=True)
    save_haiku(saved, params, state, None, {"step": steps, "loss": None})
    apply, kind, key = jax.jit(model.apply), jnp.zeros(3, int), jax.random.PRNGKey(0)

    def rollout(past):
        now, made = jnp.array(past.transpose(1, 0, 2), jnp.float32), []
        _, _, _, near = case.allocate(key, (jnp.concatenate([now, now[:, -1:]], 1), kind))
        for _ in range(AHEAD):
            features, near = case.preprocess_eval((now, kind), near)
            given, _ = apply(params, state, (features, kind))
            made.append(case.integrate(given, now))
            now = jnp.concatenate([now[:, 1:], made[-1][:, None]], 1)
        return np.array(made, float)

    return rollout, seconds, saved


def convert(*words):
    program = os.path.join(ROOT, "examples", "convert", "convert.py")
    subprocess.run([sys.executable, program, *words], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def ours(build, folder, metadata, steps, seed):
    """The same by ascc train."""
    import gns_network

    convert("data", "lagrangebench", os.path.join(folder, "train.h5"), "-o", os.path.join(folder, "sequences"))
    spacing = metadata["dx"]
    scale = np.sqrt(np.array(metadata["acc_std"]) ** 2 + NOISE**2).tolist()
    description = gns_network.network(
        3, spacing, metadata["dt"], metadata["default_connectivity_radius"], scale, name="lj", gravity=[0, 0, 0],
        features={"fluid": ["motion", "history"], "boundary": ["one"]}, steps=5, width=64)  # fmt: skip
    output = os.path.join(folder, "ours.safetensors")
    config = {
        "description": description, "data": {"train": [os.path.join(folder, "sequences", "*.safetensors")]},
        "stages": [{"iterations": steps, "unroll": 1, "learning_rate": RATE, "learning_rate_end": RATE / 10}],
        "batch": 1, "seed": seed, "jitter": NOISE / spacing, "rotate": False, "output": output}  # fmt: skip
    with open(os.path.join(folder, "ours.json"), "w", encoding="utf-8") as file:
        json.dump(config, file)
    for left in ("ours.checkpoint", "ours.csv"):
        if os.path.exists(os.path.join(folder, left)):
            os.unlink(os.path.join(folder, left))
    subprocess.run([os.path.join(build, "examples", "ascc"), "train", os.path.join(folder, "ours.json"), "--threads", "1"],
                   check=True, stdout=subprocess.DEVNULL)  # fmt: skip
    with open(os.path.join(folder, "ours.csv"), encoding="utf-8") as file:
        names, *_, last = file.read().splitlines()
    seconds = float(dict(zip(names.split(","), last.split(",")))["cpu_seconds"])
    return by_libascc(build, output, metadata["dt"]), seconds


def by_libascc(build, model, dt):
    """A rollout by a model file."""
    os.environ.setdefault("ASCC_LIBRARY", os.path.join(build, "lib", "libascc.so.0"))
    import ascc

    network = ascc.Model(model)

    def rollout(past):
        velocity = np.diff(past, axis=0)[::-1] / dt  # the last first
        atoms, step, made = ascc.Particles(network, mass=1), ascc.Step(network), []
        atoms.add_fluid(past[-1], velocity[0])
        for ago, earlier in enumerate(velocity[1:]):
            atoms.set(ascc.Kind.FLUID, ascc.EARLIER_VELOCITY + ago, earlier)
        for _ in range(AHEAD):
            step.run(atoms, 1, gravity=(0, 0, 0))
            made.append(np.array(atoms.position))
        return np.array(made)

    return rollout


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--build", default=os.path.join(ROOT, "build"))
    parser.add_argument("--data", default=os.path.join(ROOT, "..", "shared", "data", "published", "lagrangebench-3d-lj"))
    parser.add_argument("--steps", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", default="lagrangebench-gns", help="where what is made goes")
    parser.add_argument("--only", choices=("ours", "theirs"))
    options = parser.parse_args(); options.folder = os.path.abspath(options.folder)
    build = os.path.abspath(options.build)
    metadata, test = prepare(options.data, options.folder)
    print("free flight", errors(test, None), flush=True)
    if options.only != "theirs":
        rollout, seconds = ours(build, options.folder, metadata, options.steps, options.seed)
        print(f"ascc train, {options.steps} steps, {seconds:.0f} CPU s:", errors(test, rollout), flush=True)
    if options.only != "ours":
        rollout, seconds, saved = theirs(options.folder, metadata, options.steps, options.seed)
        print(f"LagrangeBench, {options.steps} steps, {seconds:.0f} CPU s:", errors(test, rollout), flush=True)
        model = saved + ".safetensors"
        convert("weights", "lagrangebench-gns", saved, "-o", model, "--metadata",
                os.path.join(options.folder, "metadata.json"), "--noise", str(NOISE))  # fmt: skip
        print("its weights, run by libascc:", errors(test, by_libascc(build, model, metadata["dt"])))


if __name__ == "__main__":
    main()
