# SPDX-License-Identifier: MIT
"""docs/tables.md: each number beside the paper's, and what differs in words."""

import os
import statistics

REMARKS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "remarks.md")


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
    """How many rollouts ended early, and where the first."""
    ends = [f["last_frame"] for f in figures if f["last_frame"] + 1 < f["frames"]]
    return f" ({len(ends)} of {len(figures)} stopped, the first at frame {min(ends):.0f})" if ends else ""


def over_runs(row, name, scale=1):
    """A figure of Table 1: of several networks the mean over the sequences of each, else that of each sequence."""
    each = [[scale * v for v in of(run["figures"], name) if v is not None] for run in row["runs"]]
    means = [statistics.fmean(values) for values in each if values]
    return spread(means if len(row["runs"]) > 1 else each[0])


def escapes(row):
    """Share of the particles that were outside at the worst moment, of all rollouts."""
    figures = [f for run in row["runs"] for f in run["figures"]]
    fluid = sum(f["fluid"] for f in figures)
    return f"{number(100 * sum(f['escaped_max'] for f in figures) / fluid, 2)} %" if fluid else "-"


def momentum_of(row):
    """The greatest error of each network; bold 0 only where it is exactly that."""
    found = [run["momentum"] for run in row["runs"] if run["momentum"] and run["momentum"][0]]
    ended = [m for m in found if m[2]]
    said = spread([max(m[0]) for m in found])
    early = f" ({len(ended)} of {len(found)} stopped)" if ended else ""
    return ("**0**" if found and not any(any(m[0]) for m in found) else said) + early


def trained(row):
    """CPU seconds of the training of each network, or where they are told."""
    if row["row"].endswith("published"):
        return "its authors'"
    seconds = [run["seconds"] for run in row["runs"] if run["seconds"]]
    return f"{len(seconds)} x {statistics.fmean(seconds):.0f}" if seconds else f"[card](models/{row['model']}.md)"


def networks(rows, paper):
    """What was trained and for how long, beside what is published."""
    yield "| method | network | weights | rate | noise, spacings | iterations | published |"
    yield "|---|---|---|---|---|---|---|"
    for row in rows:
        for run in row["runs"][:1] if "rate" in row else []:
            config = f"[`{row['model']}`](../examples/train/{row['model']}.json)"
            count = statistics.fmean(r["iterations"] for r in row["runs"])
            yield (
                f"| {row['row']} | {config} | {run['weights']:,} | {row['rate']:g} | {run['jitter']:g} | {number(count)} | "
                f"{paper['published'][row['row'].split(',')[0]]} |"
            )


def table1(rows, paper):
    yield (
        "| method | network | training, CPU s | one step, mm | RMSE after 20 steps, mm | EMD at the end, mm | JSD, bit | escaped | "
        "momentum error | paper: RMSE, EMD, JSD |"
    )
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for row in rows:
        p = paper["table1"][row["row"].split(",")[0]]
        said = f"{p['rmse']:.3g}, {p['emd']}, {p['jsd']}"
        if not row["runs"]:
            yield f"| {row['row']} | `{row['model']}` | none | | | | | | | {said} |"
            continue
        f = [f for run in row["runs"] for f in run["figures"]]
        yield (
            f"| {row['row']} | `{row['model']}` | {trained(row)} | {over_runs(row, 'err_n1_difference', 1000)} | "
            f"{over_runs(row, 'rmse_20', 1000)} | {over_runs(row, 'emd_final', 1000)}{stopped(f)} | "
            f"{over_runs(row, 'jsd_mean')} | {escapes(row)} | {momentum_of(row)} | {said} |"
        )


def mean_of(run, name):
    """Of the sequences; None if a rollout did not get there."""
    values = of(run["figures"], name)
    return None if None in values or not values else statistics.fmean(values)


def score(run, full):
    """Harmonic mean of the scores of RMSE, EMD and momentum, each 1 for the full network; None: it has none.

    full: its mean RMSE and EMD."""
    parts = [1 / (1 + max(run["momentum"][0]))] if run["momentum"] and run["momentum"][0] else []
    for name, best in full.items():
        own = mean_of(run, name)
        parts += [best / own] if own and best else []
    return len(parts) / sum(1 / part for part in parts) if len(parts) == 3 else None


def scores(row, found):
    """Of each network of a row that has one."""
    full = {}
    for name in ("rmse_20", "emd_final"):
        values = [mean_of(run, name) for run in found[-1]["runs"]]
        full[name] = statistics.fmean(values) if values and None not in values else None
    return [value for run in row["runs"] if (value := score(run, full)) is not None]


def orders(own, said):
    """Names from best to worst, here and in the paper, of what both have."""
    here = sorted((name for name in own if own[name] is not None), key=own.get)
    there = sorted((name for name in said if name in here), key=said.get)
    agree = "as in the paper" if here == there else "in the paper " + ", ".join(there)
    return f"{', '.join(here)}; {agree}" if here else "nothing was measured"


def table1_order(rows, paper):
    """By the mean RMSE of the rows that were trained alike."""
    own = {}
    for row in rows:
        values = [v for run in row["runs"] for v in of(run["figures"], "rmse_20")]
        if row["row"] in paper["table1"]:
            own[row["row"]] = statistics.fmean(values) if values and None not in values else None
    return orders(own, {name: p["rmse"] for name, p in paper["table1"].items()})


COLUMNS = [  # of Table 1, by the name of a figure and the words for it
    ("err_n1_difference", "one step"), ("rmse_20", "RMSE"), ("emd_final", "EMD"), ("jsd_mean", "JSD"),
    ("escaped_max", "escapes"), ("momentum", "momentum"),
]  # fmt: skip


def of_networks(row, name):
    """One number of each network of a row; of rollouts that did not get there none."""
    if name == "momentum":
        return [max(run["momentum"][0]) for run in row["runs"] if run["momentum"] and run["momentum"][0]]
    return [value for run in row["runs"] if (value := mean_of(run, name)) is not None]


def joined(words):
    words = list(words)
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def seen(rows, free, paper):
    """What Table 1 says, in sentences: who leads each column, what is told apart, who fails."""
    alike = [row for row in rows if row["row"] in paper["table1"] and row["runs"]]
    if len(alike) < 2:
        return ""
    led = {}
    for name, words in COLUMNS:
        means = {row["row"]: statistics.fmean(v) for row in alike if (v := of_networks(row, name))}
        best = [row for row in means if means[row] == min(means.values())]
        if means and len(best) < len(means):
            led.setdefault(joined(best), []).append(words)
    text = [f"Least in {joined(words)}: {best}." for best, words in led.items()]
    if len(led) == 1 and len(next(iter(led.values()))) == len(COLUMNS):
        text = [f"{next(iter(led))} leads every column."]
    if free:
        of_free = [
            f"{row['row']} {100 * (1 - 1000 * statistics.fmean(v) / free):.0f} %"
            for row in alike
            if (v := of_networks(row, "err_n1_difference"))
        ]
        text.append(f"After one step, less error than free flight has: {joined(of_free)}.")
    text += [s for name, words in COLUMNS[:2] if (s := close(alike, name, words))]
    text += [s for row in alike if (s := failing(row))]
    return " ".join(text)


def close(rows, name, words):
    """Neighbours in the order of a column that differ by less than both standard deviations together."""
    found = {row["row"]: values for row in rows if len(values := of_networks(row, name)) > 1}
    order = sorted(found, key=lambda row: statistics.fmean(found[row]))
    pairs = [
        f"{a} and {b}"
        for a, b in zip(order, order[1:])
        if statistics.fmean(found[b]) - statistics.fmean(found[a]) < statistics.stdev(found[a]) + statistics.stdev(found[b])
    ]
    return f"Within their ± in {words}: {', '.join(pairs)}." if pairs else ""


def failing(row):
    """How many rollouts a tenth of the particles left, or that ended early."""
    figures = [f for run in row["runs"] for f in run["figures"]]
    left = [f for f in figures if f["escaped_max"] > 0.1 * f["fluid"]]
    ended = [f for f in figures if f["last_frame"] + 1 < f["frames"]]
    said = [f"{len(some)} of {len(figures)} rollouts {what}" for some, what in
            ((left, "lose a tenth of the particles or more"), (ended, "end early")) if some]  # fmt: skip
    return f"{row['row']}: {joined(said)}." if said else ""


def remarks(path):
    """Paragraphs of remarks.md by their headings: what somebody saw in a whole run, in its numbers and pictures."""
    found, heading = {}, None
    with open(path, encoding="utf-8") as file:
        for line in file:
            if line.startswith("## "):
                heading = line[3:].strip()
            elif heading:
                found[heading] = found.get(heading, "") + line
    return {heading: text.strip() for heading, text in found.items()}


def table2(found, paper):
    yield (
        "| row | what it adds | training, CPU s | RMSE after 20 steps, mm | EMD after 30 steps, mm | momentum error | "
        "steps until it fails | score | paper |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for row in found:
        said = paper["table2"][row["row"]]
        if not row["runs"]:
            yield f"| {row['row']} | {row['text']} | not measured | | | | | | {said} |"
            continue
        whole = [f for run in row["runs"] for f in run["whole"]]
        ends = [f["last_frame"] for f in whole if f["last_frame"] + 1 < f["frames"]]
        lasted = (f"{number(statistics.fmean(ends))}" if ends else "-") + f" ({len(ends)} of {len(whole)} fail)"
        early = stopped([f for run in row["runs"] for f in run["figures"]])
        own = scores(row, found)
        yield (
            f"| {row['row']} | {row['text']} | {trained(row)} | {over_runs(row, 'rmse_20', 1000)} | "
            f"{over_runs(row, 'emd_final', 1000)}{early} | {momentum_of(row)} | {lasted} | "
            f"{spread(own)} | {said} |"
        )


def score_order(found, paper):
    own = {row["row"]: scores(row, found) for row in found}
    means = {name: -statistics.fmean(values) if values else None for name, values in own.items()}
    return orders(means, {name: -value for name, value in paper["table2"].items()})


def speed(costs, sph, paper, size):
    counts = [f"{n:,}" for n in (size.particles, size.more)]
    yield f"| network | ms a frame at {counts[0]} | MiB | ms a frame at {counts[1]} | MiB | reference SPH / network |"
    yield "|---|---|---|---|---|---|"
    for row in costs:
        cells = []
        for cost in row["cost"]:
            cells += [cost, ""] if isinstance(cost, str) else [number(cost["ms"]), number(cost["mib"])]
        ratio = "-"
        if sph and not isinstance(row["cost"][0], str) and "3D" in row["label"]:
            ratio = f"{sph['ms'] / sph['particles'] / (row['cost'][0]['ms'] / size.particles):.3g}"
        name = f"`{row['model']}`" + (", no model file" if row["missing"] else "")
        yield f"| {row['label']} ({name}) | " + " | ".join(cells) + f" | {ratio} |"
    p = paper["speed"]
    yield f"| the paper, one RTX 3090 | {p['50000']} at 50,000 | < 8 GB | {p['1000000']} at 1,000,000 | < 8 GB | {p['ratio']} |"


INTRO = """# The paper's tables and figures

    sh bench/tables/run.sh                  # hours; stopped, it goes on where it was: results are kept in build/tables
    sh bench/tables/run.sh --minutes 8      # so much of it
    sh bench/tables/run.sh --quick          # all of it from smaller runs, in minutes

{scope}

Measures are those of [measures.md](measures.md). A method is a line of `bench/tables/methods.csv`, its network a config of `examples/train`; this command makes the sequences, trains, chooses, measures and
draws. What fails is said at the end, nothing is left out. `--keep DIR` copies the baselines of the first seed, of which [models/baselines.md](models/baselines.md) tells. What is said to be seen is computed;
`bench/tables/remarks.md` has what somebody saw beyond it.
"""

QUICK = """**This page is of a quick run.** It shows that everything runs, not how good anything is. """

SCOPE = """This run: networks of Table 1 trained for {seconds} CPU s on one thread (the whole: 90; in 3D {seconds_3d}, 120) with {seeds} seed(s) (3; in 3D one), learning rate and noise chosen among {tries} by networks of {tuning} CPU s (5 of 30),
{sequences} test sequence(s) of at most {frames} frames of 0.005 s (5 of 501), {steps} steps of momentum (500), networks of Table 2 trained for {iterations} % of their iterations, {first:,} and {second:,} particles (50,000 and 1,000,000)."""

TABLE1 = """## Table 1: methods

{table}

From the smallest RMSE to the largest, of those trained alike: {order}. ± is the standard deviation over the seeds; of the shipped network, which is one, over the sequences; the paper gives none. "One step" starts from true states
(of a graph network with the five velocities before; free flight has {free} mm). RMSE is of positions after 20 steps of 0.005 s from the first frame; the paper does not say after how many. EMD is the mean
distance of the best assignment after the last frame, of rollouts that got there; the paper's has no unit. "Escaped" is the share of particles outside the walls at the worst moment: rollouts are not clipped.

What is seen: {seen}
{remark}
**These are small networks, trained for a minute and a half.** What was trained, and what the authors of each method trained:

{networks}

All learn from the same sequences by one protocol: 70 % of the CPU seconds single steps, the rest rollouts of two steps behind up to eight (GNS: two) without gradient, the rate falling to a third and then a fiftieth of where it began.
Rates of 0.001, 0.0025 and 0.006 were tried, then the config's noise three times and none; the least RMSE after 20 steps on five sequences that nobody learns from decides. CPU seconds are equal as far as iterations
measured in advance make them. Gravity is added by libascc before any network sees the state, so what they all learn is the rest: with gravity of its own direction in every sequence a network that is not told of it cannot know it.

What else differs from the paper: the test sequences are of about 1,300 particles in a unit square (two of DualSPHysics where `../shared` is there, the others of `ascc generate wbc2d --solver sph`), not the 10,000 of a set whose
generator is not public. So no error here is to be compared with a number there, only the order of methods, and a row says what a method is worth after so little, not what it can reach.

The momentum error is that of two drops which collide without walls or gravity, both drifting at 0.56 m/s so that P(0) is not 0: |P(t) - P(0)| / (|P(0)| + 1e-10), its greatest over {steps} steps (mean over the seeds): bold 0 is no rounding but equal whole numbers.
"""

TABLE1_3D = """### The same in 3D

{table}

From the smallest RMSE to the largest, of those trained alike: {order}. One seed each, with the rate and noise that were chosen in 2D for the row of that name; ± is over the two test sequences of Liquid3d (`../shared`), steps of 0.02 s; free flight has {free} mm
after one step. "No gravity given": learnt and tested on the same sequences with gravity taken out of what the network and the integration are told, so that it must learn it, which GNS does in the papers.
Its momentum in a scene without gravity cannot be asked. "CConv, published" has weights as they were published, after 50,000 iterations. The paper's figures are of its 2D set.

What is seen: {seen}
{remark}
{networks}
"""

FIGURE4 = """## Figure 4: momentum over time

![momentum error over time](figures/tables-momentum.png)

Networks of the first seed. Exactly 0 is drawn at the foot of the logarithmic axis, which has no 0. The paper draws about 1e-13 for ASCC "in float32": that is rounding, which whole numbers do not have.
"""

FIGURE5 = """## Figure 5: free fall and drops

![the same moment of every method](figures/tables-scenes.png)

Grey: the start, and the ways of some particles; blue: all of them at the same moment, {time:g} s, or the last one that the method reached. Truth is DFSPH. With gravity and without walls the truth of the drops is that without
gravity, falling. Networks of the first seed; particles outside the window of the truth are counted in red.

### How methods fail

![the first test sequence after so many steps of every method](figures/tables-failures.png)

The first test sequence, in the window of the truth: every method runs until it fails, and stays as it was then. A rollout stops when a particle would move more than a step allows (`max_displacement`) or is not finite.
{remark}"""

TABLE2 = """## Table 2: what each part is worth

{table}

From the highest score to the lowest: {order}. `examples/train/ablation2d.json`, changed row by row, equally many iterations, on the sequences of Table 1; errors on the two given test sequences; ± over the seeds. "Steps until it fails": mean of the rollouts that do, to the end of those
sequences. The paper's overall score is the harmonic mean of normalised RMSE, EMD and momentum scores, the full network 1. How it normalises is not said; here an error's score is the mean error of the full networks over the network's own, and momentum's 1 / (1 + error), so
that 0 gives 1 and an error as large as the momentum 1/2; a network whose rollout did not reach the end has no EMD and no score. What differs: two-dimensional, networks of 8 to 24 channels, without limit or contact, trained for less than a minute.
{remark}"""

SPEED = """## Section 5.4: speed

{table}

One thread, CPU time of one step of `bench step --scene block` (no walls); a frame is the model's time step, {frame}. MiB is the scratch of a step. The last column is CPU time of the
reference SPH of `examples/reference` for a frame of 0.02 s in steps of 1e-4 s ({sph}) over that of the network, per particle, same machine. DualSPHysics 5.4 itself took 203 us a particle and frame at that step in 2D (10,000 particles),
{dual}. The paper compares a graphics card with one CPU thread; these are one CPU thread both. Time does not depend on how long a network was trained. Farthest points cost the square of the particles: a step of a million would take PointNet++ minutes, and it is not asked for one.
{remark}"""


def write(path, size, paper, rows, floors, ablations, costs, sph, errors):
    """floors: of each dimension the figures of free flight on the test sequences."""
    flat, solid = ([row for row in rows if row["dimension"] == d] for d in "23")
    numbers = {"first": size.particles, "second": size.more,
               "tries": size.rates + size.noises, **vars(size), "sequences": len(floors["2"])}  # fmt: skip

    def remark(heading):
        """Nobody looked at a quick run."""
        return "" if size.quick or heading not in said_of else f"\n{said_of[heading]}\n"

    said_of = remarks(REMARKS)

    def part(text, dimension, of_it):
        free = [v for v in of(floors[dimension], "err_n1_difference") if v is not None]
        free = 1000 * statistics.fmean(free) if free else None
        return text.format(**numbers, seen=seen(of_it, free, paper), remark=remark(f"Table 1, {dimension}D"), table="\n".join(table1(of_it, paper)), order=table1_order(of_it, paper),
                           networks="\n".join(networks(of_it, paper)),
                           free=number(free) if free else "-")  # fmt: skip

    parts = [INTRO.format(scope=(QUICK if size.quick else "") + SCOPE.format(**numbers)), part(TABLE1, "2", flat)]
    if any(run["figures"] for row in solid for run in row["runs"]):
        parts.append(part(TABLE1_3D, "3", solid))
    parts += [FIGURE4, FIGURE5.format(time=size.fall * 0.005, remark=remark("Figures"))]
    parts.append(TABLE2.format(table="\n".join(table2(ablations, paper)), order=score_order(ablations, paper),
                               remark=remark("Table 2")))  # fmt: skip
    said = f"{sph['ms'] / sph['particles'] * 1000:.3g} us a particle at {sph['particles']:,}" if sph else "not measured"
    ours = next((c["cost"][0] for c in costs if c["model"] == "water3d" and not isinstance(c["cost"][0], str)), None)
    dual = f"{203 / (ours['ms'] * 1000 / size.particles):.3g} times what `water3d` takes in 3D" if ours else "for scale"
    parts.append(SPEED.format(table="\n".join(speed(costs, sph, paper, size)), sph=said, dual=dual,
                              remark=remark("Speed"), frame="0.02 s of the 3D networks and 0.005 s of the 2D ones"))  # fmt: skip
    parts.append("## What is missing or failed\n\n" + "\n".join(missing(rows, costs, errors) or ["Nothing."]) + "\n")
    with open(path + ".partial", "w", encoding="utf-8") as file:
        file.write("\n".join(parts))
    os.replace(path + ".partial", path)


def missing(rows, costs, errors):
    names = [r["model"] for r in rows if not r["runs"]] + [c["model"] for c in costs if c["missing"]]
    lines = [f"- no network: `{name}`" for name in dict.fromkeys(names)] + [f"- {e}" for e in errors]
    return lines + [
        f"- {row['row']}, network {k + 1}, in the momentum run: {run['momentum'][2]}"
        for row in rows
        for k, run in enumerate(row["runs"])
        if run["momentum"] and run["momentum"][2]
    ]
