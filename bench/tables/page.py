# SPDX-License-Identifier: MIT
"""docs/tables.md: each number beside the paper's, and what differs in words."""

import os
import statistics


def number(value, digits=3):
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.{digits}g}"


def spread(values):
    """Mean and, of several, the standard deviation."""
    values = [v for v in values if v is not None]
    if not values:
        return "-"
    return number(statistics.fmean(values)) + (f" ± {number(statistics.stdev(values), 2)}" if len(values) > 1 else "")


def of(figures, name):
    return [f.get(name) for f in figures]


def stopped(figures):
    """Where a rollout ended that did not reach its end."""
    ends = [f"{f['last_frame']:.0f}" for f in figures if f["last_frame"] + 1 < f["frames"]]
    return f" (stopped at frame {', '.join(ends)})" if ends else ""


def last(momentum):
    """The error after the last step, "0" only if it is."""
    if not momentum or not momentum[0]:
        return "-"
    worst, steps = max(momentum[0]), len(momentum[0])
    return ("**0**" if worst == 0 else f"{worst:.2g}") + (f" (stopped after {steps} steps)" if momentum[2] else "")


def table1(rows, paper, size):
    yield (
        "| method | model | training, CPU s | RMSE after 20 steps, mm | EMD at the end, mm | JSD, bit | escaped | momentum error | "
        "paper: RMSE, EMD, JSD |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for row in rows:
        p = paper["table1"][row["row"]]
        said = f"{p['rmse']:.3g}, {p['emd']}, {p['jsd']}"
        if not row["path"]:
            yield f"| {row['row']} | `{row['model']}` | no model file | | | | | | {said} |"
            continue
        f = row["figures"]
        rmse = [1000 * v for v in of(f, "rmse_20") if v is not None]
        emd = [1000 * v for v in of(f, "emd_final") if v is not None]
        escaped = [v for v in of(f, "escaped_max") if v is not None]
        seconds = f"{row['seconds']:.0f}" if row["seconds"] else "[card](models/" + row["model"] + ".md)"
        yield (
            f"| {row['row']} | `{row['model']}` | {seconds} | {spread(rmse)} | {spread(emd)}{stopped(f)} | {spread(of(f, 'jsd_mean'))} | "
            f"{sum(escaped):.0f} | {last(row['momentum'])} | {said} |"
        )


def mean_of(row, name):
    """Of the sequences; None if a rollout did not get there."""
    values = of(row["figures"], name)
    return None if None in values or not values else statistics.fmean(values)


def score(row, full):
    """Harmonic mean of the scores of RMSE, EMD and momentum, each 1 for the full network; None: it has none."""
    parts = [1 / (1 + max(row["momentum"][0]))] if row["momentum"][0] else []
    for name in ("rmse_20", "emd_final"):
        own, best = mean_of(row, name), mean_of(full, name)
        parts += [best / own] if own and best else []
    return len(parts) / sum(1 / part for part in parts) if len(parts) == 3 else None


def orders(own, said):
    """Names from best to worst, here and in the paper, of what both have."""
    here = sorted((name for name in own if own[name] is not None), key=own.get)
    there = sorted((name for name in said if name in here), key=said.get)
    agree = "as in the paper" if here == there else "in the paper " + ", ".join(there)
    return f"{', '.join(here)}; {agree}" if here else "nothing was measured"


def table2(found, paper):
    yield (
        "| row | what it adds | training, CPU s | RMSE after 20 steps, mm | EMD after 30 steps, mm | momentum error | "
        "steps until it fails | score | paper |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    full = found[-1]
    for row in found:
        said = paper["table2"][row["row"]]
        if not row.get("figures") or not row.get("momentum"):
            yield f"| {row['row']} | {row['text']} | not measured | | | | | | {said} |"
            continue
        rmse, emd = ([1000 * v for v in of(row["figures"], n) if v is not None] for n in ("rmse_20", "emd_final"))
        ends = [f"{f['last_frame']:.0f}" if f["last_frame"] + 1 < f["frames"] else "none" for f in row["whole"]]
        overall = score(row, full) if full.get("figures") and full.get("momentum") else None
        overall = "-" if overall is None else f"{overall:.2f}"
        yield (
            f"| {row['row']} | {row['text']} | {row['seconds']:.0f} | {spread(rmse)} | "
            f"{spread(emd)}{stopped(row['figures'])} | {last(row['momentum'])} | {', '.join(ends)} | {overall} | {said} |"
        )


def score_order(found, paper):
    measured = [r for r in found if r.get("figures") and r.get("momentum")]
    scores = {r["row"]: score(r, found[-1]) for r in measured if found[-1] in measured}
    own = {name: None if value is None else -round(value, 2) for name, value in scores.items()}
    return orders(own, {name: -value for name, value in paper["table2"].items()})


def speed(costs, sph, paper, size):
    counts = [f"{n:,}" for n in (size.particles, size.more)]
    yield f"| network | ms a frame at {counts[0]} | MiB | ms a frame at {counts[1]} | MiB | reference SPH / network |"
    yield "|---|---|---|---|---|---|"
    for row in costs:
        cells = []
        for cost in row["cost"]:
            cells += [number(cost["ms"]), number(cost["mib"])] if cost else ["-", "-"]
        ratio = "-"
        three = "3D" in row["label"]
        if sph and row["cost"][0] and three:
            each = sph["ms"] / sph["particles"]
            ratio = f"{each / (row['cost'][0]['ms'] / size.particles):.3g}"
        name = f"`{row['model']}`" + (", no model file" if row["missing"] else "")
        yield f"| {row['label']} ({name}) | " + " | ".join(cells) + f" | {ratio} |"
    p = paper["speed"]
    yield f"| the paper, one RTX 3090 | {p['50000']} at 50,000 | < 8 GB | {p['1000000']} at 1,000,000 | < 8 GB | {p['ratio']} |"


INTRO = """# The paper's tables and figures

    sh bench/tables/run.sh             # hours; stopped, it goes on where it was: results are kept in build/tables
    sh bench/tables/run.sh --quick     # all of it from smaller runs, in minutes

{scope}

Measures are those of [measures.md](measures.md). A method is a line of `bench/tables/methods.csv`; its model file is looked for in `examples/models`, then in
`examples/train/runs`, where `ascc train examples/train/NAME.json` leaves it. What fails is said at the end, nothing is left out.
"""

QUICK = """**This page is of a quick run.** It shows that everything runs, not how good anything is. """

SCOPE = """This run: {sequences} test sequence(s) of at most {frames} frames of 0.005 s (the whole has 5 of 501), {steps} steps of momentum (500), networks of Table 2 trained for {iterations} % of their
iterations, {first:,} and {second:,} particles (50,000 and 1,000,000)."""

TABLE1 = """## Table 1: methods

{table}

From the smallest RMSE to the largest: {order}. ± is the standard deviation over the sequences; the paper gives none. What differs from the paper: the test sequences are of about 1,300 particles in a unit square (two of DualSPHysics where
`../shared` is there, the others of `ascc generate wbc2d --solver sph`), not the 10,000 of a set whose generator is not public, so no error here is to be compared with a number there, only the order of methods. RMSE is of
positions after 20 steps of 0.005 s; the paper does not say after how many. EMD is the mean distance of the best assignment after the last frame; the paper's has no unit. Baselines are small networks of the
recipes in `examples/train`, trained for CPU minutes where the published ones took days: PointNet++ and CConv of those sizes are not the authors' weights, and a row says nothing about what their method can reach. Rollouts are not clipped: escapes are counted.
The momentum error is that of two drops which collide without walls or gravity, both drifting at 0.56 m/s so that P(0) is not 0: |P(t) - P(0)| / (|P(0)| + 1e-10), its greatest over {steps} steps: bold 0 is no rounding but equal whole numbers.
"""

FIGURE4 = """## Figure 4: momentum over time

![momentum error over time](figures/tables-momentum.png)

Exactly 0 is drawn at the foot of the logarithmic axis, which has no 0. The paper draws about 1e-13 for ASCC "in float32": that is rounding, which whole numbers do not have.
"""

FIGURE5 = """## Figure 5: free fall and drops

![the same moment of every method](figures/tables-scenes.png)

Grey: the start, and the ways of some particles; blue: all of them at the same moment, {time:g} s. Truth is DFSPH. With gravity and without walls the truth of the drops is that without gravity, falling. Every method is run to the
end, clumped, scattered or not; particles outside the window of the truth are counted in red.
"""

TABLE2 = """## Table 2: what each part is worth

{table}

From the highest score to the lowest: {order}. `examples/train/ablation2d.json`, changed row by row, equally many iterations, one seed, on the 2D training sequences; errors on the test sequences. "Steps until it fails": of a rollout of each from its beginning until a particle moves more than a step allows; none, if it reaches the end. The paper's overall score is the harmonic mean of normalised RMSE, EMD and momentum scores, the full
network 1. How it normalises is not said; here an error's score is that of the full network over the row's own, and momentum's 1 / (1 + error), so that 0 gives 1 and an error as large as the momentum 1/2; a row whose rollout did not reach the end has no EMD and no score. What differs: two-dimensional, networks of 8 to 24 channels, short training. 
"""

SPEED = """## Section 5.4: speed

{table}

One thread, CPU time of one step of `bench step --scene block` (no walls); a frame is the model's time step, {frame}. MiB is the scratch of a step. The last column is CPU time of the
reference SPH of `examples/reference` for a frame of 0.02 s in steps of 1e-4 s ({sph}) over that of the network, per particle, same machine. DualSPHysics 5.4 itself took 203 us a particle and frame at that step in 2D (10,000 particles, measured beside these),
{dual}. The paper compares a graphics card with one CPU thread; these are one CPU thread both. Time does not depend on how long a network was trained: that of PointNet++ in 3D was not, to speak of. Farthest points cost the square of the particles: a million would take PointNet++ hours, and it is not asked for them.
"""


def write(path, size, paper, rows, sequences, ablations, costs, sph, errors):
    numbers = {"sequences": sequences, "frames": size.frames, "steps": size.steps,
               "first": size.particles, "second": size.more, "iterations": size.iterations}  # fmt: skip
    table = lambda lines: "\n".join(lines)  # noqa: E731
    parts = [INTRO.format(scope=(QUICK if size.quick else "") + SCOPE.format(**numbers))]
    own = {r["row"]: mean_of(r, "rmse_20") for r in rows}
    order = orders(own, {name: p["rmse"] for name, p in paper["table1"].items()})
    parts.append(TABLE1.format(table=table(table1(rows, paper, size)), order=order, **numbers))
    parts += [FIGURE4, FIGURE5.format(time=size.fall * 0.005)]
    if ablations:
        parts.append(TABLE2.format(table=table(table2(ablations, paper)), order=score_order(ablations, paper)))
    else:
        parts.append("## Table 2: what each part is worth\n\nNot measured: the training sequences of `../shared/data/wbc2d` are not there.\n")
    said = f"{sph['ms'] / sph['particles'] * 1000:.3g} us a particle at {sph['particles']:,}" if sph else "not measured"
    ours = next((c["cost"][0] for c in costs if c["model"] == "water3d" and c["cost"][0]), None)
    dual = f"{203 / (ours['ms'] * 1000 / size.particles):.3g} times what `water3d` takes in 3D" if ours else "for scale"
    parts.append(SPEED.format(table=table(speed(costs, sph, paper, size)), sph=said, dual=dual,
                              frame="0.02 s of the 3D networks and 0.005 s of the 2D one"))  # fmt: skip
    missing = [r["model"] for r in rows if not r["path"]] + [c["model"] for c in costs if c["missing"]]
    lines = [f"- no model file: `{name}`" for name in dict.fromkeys(missing)] + [f"- {e}" for e in errors]
    lines += [f"- `{r['model']}` in the momentum run: {r['momentum'][2]}" for r in rows if r["momentum"] and r["momentum"][2]]
    parts.append("## What is missing or failed\n\n" + ("\n".join(lines) if lines else "Nothing.") + "\n")
    with open(path + ".partial", "w", encoding="utf-8") as file:
        file.write("\n".join(parts))
    os.replace(path + ".partial", path)
