# SPDX-License-Identifier: MIT
"""What Figure 5 and the pictures of failures show: truth and methods side by side."""

import numpy as np

from measure import attempt, tensorfile

EVERY = 10  # steps between kept frames of those that run until they fail


def figure5(tools, size, rows, errors):
    """Truth and methods in free fall and in a collision, without and with gravity."""
    every = size.fall // 20
    fall = tools.generated("free-fall", size.fall + 1, 900, 0.005, "--dimension", "2")
    drops = tools.generated("droplets", size.fall + 1, 900, 0.005, "--dimension", "2")

    def truth(path, gravity):
        x = tensorfile.read(path)[0]["fluid.position"][::every].astype(float)
        t = np.arange(len(x)) * every * 0.005
        return x + 0.5 * np.array(gravity)[None, None] * (t**2)[:, None, None]

    lines = []
    for what, path, gravity, added in (
        ("free fall", fall, (0, -9.81), (0, 0)),
        ("two drops, no gravity", drops, (0, 0), (0, 0)),
        ("two drops, gravity", drops, (0, -9.81), (0, -9.81)),
    ):
        panels = [("truth", truth(path, added), "")]
        for row in rows:
            run = row["runs"] and attempt(
                errors, f"{row['row']}: {what}",
                lambda r=row, p=path, g=gravity: tools.rollout(r["runs"][0]["path"], p, size.fall, every, g))  # fmt: skip
            panels.append((row["row"], run[1] if run else None, run[2] if run else ""))
        lines.append((what, panels))
    return lines


def failures(tools, rows, world, frames, errors):
    """Truth and methods on the first test sequence after so many steps each: a line of panels for each moment."""
    sequence = world.test[0]
    tensors, metadata = tensorfile.read(sequence)
    true = tensors["fluid.position"].astype(float)
    frames = [f for f in frames if f < len(true)]
    gravity = [float(g) for g in metadata["gravity"].split()][:2]
    runs = [
        (row["row"], attempt(errors, f"{row['row']} until it fails",
                             lambda r=row: tools.rollout(r["runs"][0]["path"], sequence, frames[-1], EVERY, gravity)))
        for row in rows if row["runs"]
    ]  # fmt: skip
    return [
        (f"step {f}", [("truth", true[[0, f]], "")] + [(label, at(run, f), said(run, f)) for label, run in runs])
        for f in frames
    ]


def at(run, frame):
    """First frame and this one, or the last that there is."""
    return run and run[1][[0, min(frame // EVERY, len(run[1]) - 1)]]


def said(run, frame):
    return run[2].split(":")[0] if run and run[2] and frame // EVERY >= len(run[1]) - 1 else ""
