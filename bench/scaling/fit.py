# SPDX-License-Identifier: MIT
"""Fits what a process exchanges in a step to the surface of its part of the fluid: fit.py CSV

A process has n = N / P particles: a cube of n^(1/3) spacings, of whose surface all but what lies at the edge of the whole
borders on others: the share 1 - P^(-1/3). A halo around it is

    (n^(1/3) + 2 w)^3 - n = 6 w n^(2/3) + 12 w^2 n^(1/3) + 8 w^3

so bytes and ghosts are fitted, by least squares of relative errors, to (a n^(2/3) + b n^(1/3) + c) (1 - P^(-1/3)).
"""

import csv
import sys


def solve(rows, values):
    """The least squares of rows x = values, by the normal equations and Gauss's elimination."""
    count = len(rows[0])
    matrix = [[sum(r[i] * r[j] for r in rows) for j in range(count)] + [sum(r[i] * v for r, v in zip(rows, values))]
              for i in range(count)]  # fmt: skip
    for i in range(count):
        pivot = max(range(i, count), key=lambda r: abs(matrix[r][i]))
        matrix[i], matrix[pivot] = matrix[pivot], matrix[i]
        for r in range(count):
            if r != i:
                factor = matrix[r][i] / matrix[i][i]
                matrix[r] = [a - factor * b for a, b in zip(matrix[r], matrix[i])]
    return [matrix[i][count] / matrix[i][i] for i in range(count)]


def terms(particles, processes):
    n, share = particles / processes, 1 - processes ** (-1 / 3)
    return [share * n ** (2 / 3), share * n ** (1 / 3), share]


def fit(runs, column):
    """Coefficients, and the largest relative error of any run."""
    rows = [[t / r[column] for t in terms(r["particles"], r["processes"])] for r in runs]
    law = solve(rows, [1.0] * len(rows))
    return law, max(abs(sum(a * b for a, b in zip(law, row)) - 1) for row in rows)


def main():
    with open(sys.argv[1]) as file:
        runs = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    for column in ["ghosts", "bytes"]:
        law, error = fit(runs, column)
        print(f"{column}: ({law[0]:.4g} n^(2/3) + {law[1]:.4g} n^(1/3) + {law[2]:.4g}) (1 - P^(-1/3)),"
              f" off by at most {100 * error:.0f} % of {len(runs)} runs")  # fmt: skip
        for particles, processes in [(1e9, 1024)]:
            value = sum(a * b for a, b in zip(law, terms(particles, processes)))
            print(f"  extrapolated to {particles:g} particles on {processes} processes: {value:.4g} a process and step")
    print("gnuplot: " + "; ".join(f"{name} = {value!r}" for name, value in zip("abc", law)))
    for name in ["bytes", "messages", "ghosts", "own"]:
        worst = max(r[name + "_most"] / r[name] for r in runs)
        print(f"most {name} of a process over the mean: at most {worst:.2f}")
    pairs = [r["messages"] / (r["processes"] - 1) for r in runs]
    print(f"messages a step for each other process: {min(pairs):.1f} to {max(pairs):.1f}")
    print(f"collective calls a step: {min(r['collectives'] for r in runs):.0f} to {max(r['collectives'] for r in runs):.0f}")


main()
