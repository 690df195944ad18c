# SPDX-License-Identifier: MIT
"""Figures 4 and 5, from what was measured."""

import matplotlib.pyplot as plt
import numpy as np

ZERO = 1e-20  # where exactly 0 is drawn: below all that is not


def momentum(curves, path):
    """curves: (label, error after each step, paper's row or not)."""
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    for label, error in curves:
        if error and any(error):
            values = np.where(np.array(error) == 0, ZERO, error)
            axes.plot(np.arange(1, len(error) + 1), values, label=label, linewidth=1.3)
    exact = [(label, len(error)) for label, error in curves if error and not any(error)]
    if exact:
        steps = max(count for _, count in exact)
        names = "; ".join(label for label, _ in exact)
        axes.plot(np.arange(1, steps + 1), np.full(steps, ZERO), label=f"{names}: exactly 0", linewidth=2.5)
    axes.axhline(1e-13, color="gray", linestyle=":", linewidth=1)
    axes.annotate("the paper's bound for ASCC, 1e-13", (1, 1.3e-13), fontsize=7, color="gray")
    axes.set(yscale="log", ylim=(ZERO / 10, None), xlabel="step", ylabel="|P(t) - P(0)| / |P(0)|")
    ticks = [ZERO] + [10.0**e for e in range(-18, 7, 3)]
    top = axes.get_ylim()[1]
    ticks = [t for t in ticks if t <= top]
    axes.set_yticks(ticks, ["0"] + [f"$10^{{{round(np.log10(t))}}}$" for t in ticks[1:]])
    axes.minorticks_off()
    axes.legend(fontsize=8, loc="center right")
    save(figure, path)


def scenes(rows, path):
    """rows: (what, [(label, frames [T, n, 2] or None, note)]); the same moments of a row in the same window."""
    columns = len(rows[0][1])
    figure, axes = plt.subplots(len(rows), columns, figsize=(2.6 * columns, 2.6 * len(rows)), layout="constrained",
                                squeeze=False)  # fmt: skip
    for line, (what, panels) in zip(axes, rows):
        truth = panels[0][1]
        low, high = truth.reshape(-1, 2).min(0), truth.reshape(-1, 2).max(0)
        edge = 0.55 * max(high - low)
        middle = (low + high) / 2
        for panel, (label, frames, note) in zip(line, panels):
            panel.set(xlim=(middle[0] - edge, middle[0] + edge), ylim=(middle[1] - edge, middle[1] + edge))
            panel.set(aspect="equal", xticks=[], yticks=[])
            panel.set_title(f"{label}\n{what}", fontsize=7)
            if frames is None:
                panel.text(0.5, 0.5, "no network", ha="center", fontsize=8, transform=panel.transAxes)
                continue
            trace = frames[:, :: max(1, frames.shape[1] // 24)]
            panel.plot(trace[:, :, 0], trace[:, :, 1], color="0.75", linewidth=0.5, zorder=1)
            panel.scatter(*frames[0].T, s=0.4, color="0.6", zorder=2)
            panel.scatter(*frames[-1].T, s=0.8, color="tab:blue", zorder=3)
            outside = (np.abs(frames[-1] - middle) > edge).any(1) | ~np.isfinite(frames[-1]).all(1)
            text = note or (f"{outside.sum()} of {len(outside)} outside" if outside.any() else "")
            panel.text(0.02, 0.02, text, fontsize=6, color="tab:red", transform=panel.transAxes)
    save(figure, path)


def save(figure, path):
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)
