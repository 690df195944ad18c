# SPDX-License-Identifier: MIT
"""Fits what a process exchanges in a step to the surface of its part of the fluid: fit.py CSV

A process has n = N / P particles, a cube of n^(1/3) spacings: its surface is 6 n^(2/3), and of that all but what lies at
the edge of the whole borders on others, the share 1 - P^(-1/3). Ghosts and bytes are fitted to

    a n^(2/3) (1 - P^(-1/3))

by least squares of relative errors. One number is all that so few sizes can tell; how far runs lie from it, and how
well those of few processes foretell those of many, is printed with it.
"""

import csv
import sys

MANY = 8  # processes; runs of more are foretold from those of so many at most
ASKED = 1e9, 1024  # particles and processes to extrapolate to


def surface(particles, processes):
    return (particles / processes) ** (2 / 3) * (1 - processes ** (-1 / 3))


def fit(runs, column):
    """The a that makes the sum of (a surface / measured - 1)^2 least."""
    ratios = [surface(r["particles"], r["processes"]) / r[column] for r in runs]
    return sum(ratios) / sum(ratio * ratio for ratio in ratios)


def error(law, runs, column):
    """The largest relative error of any run, %."""
    return 100 * max(abs(law * surface(r["particles"], r["processes"]) / r[column] - 1) for r in runs)


def between(values, digits):
    return f"{min(values):.{digits}f} to {max(values):.{digits}f}"


def main():
    with open(sys.argv[1]) as file:
        runs = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    few = [r for r in runs if r["processes"] <= MANY]
    many = [r for r in runs if r["processes"] > MANY]
    for column in ["ghosts", "bytes"]:
        law = fit(runs, column)
        print(f"{column}: {law:.4g} n^(2/3) (1 - P^(-1/3)), off by at most {error(law, runs, column):.0f} %"
              f" in {len(runs)} runs")  # fmt: skip
        if few and many:
            law_of_few = fit(few, column)
            print(f"  from runs of at most {MANY} processes: {law_of_few:.4g}, off by at most"
                  f" {error(law_of_few, many, column):.0f} % in those of more")  # fmt: skip
        print(f"  extrapolated to {ASKED[0]:g} particles on {ASKED[1]} processes: {law * surface(*ASKED):.4g} a process")
    print(f"bytes of a ghost: {between([r['bytes'] / r['ghosts'] for r in runs], 0)}")
    for name in ["bytes", "messages", "ghosts", "own"]:
        print(f"most {name} of a process over the mean: {between([r[name + '_most'] / r[name] for r in runs], 2)}")
    print(f"messages a step for each other process: {between([r['messages'] / (r['processes'] - 1) for r in runs], 1)}")
    print(f"collective calls a step: {between([r['collectives'] for r in runs], 0)}")
    print(f"gnuplot: a = {fit(runs, 'bytes')!r}")


main()
