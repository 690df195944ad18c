"""Makes measures-golden.txt, which tests/test_measures.c compares with, by numpy and scipy alone.
SPDX-License-Identifier: MIT

    python3 make_measures_golden.py > measures-golden.txt

Checked with numpy 2.4.6 and scipy 1.17.1. Each entry: name, rows, columns, then the values.
"""
import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist, jensenshannon, pdist
from scipy.special import logsumexp


def put(name, values):
    values = np.atleast_2d(np.asarray(values, float))
    print(name, *values.shape)
    for row in values:
        print(*("%.17g" % v for v in row))


def emd(a, b):
    cost = cdist(a, b)
    rows, columns = linear_sum_assignment(cost)
    return cost[rows, columns].mean()


def entropic(a, b, epsilon):
    """Value of entropic transport, cost |x - y|, entropy relative to the product measure."""
    cost = cdist(a, b)
    f, g = np.zeros(len(a)), np.zeros(len(b))
    for _ in range(20000):
        f = -epsilon * (logsumexp((g - cost) / epsilon, axis=1) - np.log(len(b)))
        new = -epsilon * (logsumexp((f[:, None] - cost) / epsilon, axis=0) - np.log(len(a)))
        done, g = np.abs(new - g).max() < 1e-14, new
        if done:
            break
    return f.mean() + g.mean()


def histogram(v):
    speed = np.linalg.norm(v, axis=1)
    return np.histogram(np.minimum(speed, 10.05), bins=np.r_[np.arange(101) / 10, np.inf])[0]


def lattice(dimension):
    axes = np.meshgrid(*[np.arange(-3, 4)] * dimension)
    square = sum(x**2 for x in axes) / 4.0
    return (np.clip(1 - square, 0, None) ** 3).sum()


random = np.random.default_rng(5)
a, b, c = random.random((60, 3)), random.random((60, 3)) * 1.2, random.random((45, 3))
va, vb = random.normal(0, 2.5, (60, 3)), random.normal(0.5, 2.0, (60, 3))
mass = 0.1 + random.random(60)
p, q = random.random((50, 2)), random.random((50, 2)) + 0.3
gravity = np.array([1.0, -9.81, 0.5])
spacing, radius, epsilon = 0.2, 0.4, 0.05

for name, values in dict(a=a, b=b, c=c, va=va, vb=vb, mass=mass, p=p, q=q, gravity=gravity).items():
    put(name, values)
put("spacing", spacing)
put("epsilon", epsilon)
put("rmse_ab", np.sqrt(((a - b) ** 2).sum(1).mean()))
put("mean_distance_ab", np.linalg.norm(a - b, axis=1).mean())
put("nearest_a_to_c", cKDTree(c).query(a)[0])
put("chamfer_ac", [cKDTree(c).query(a)[0].mean(), cKDTree(a).query(c)[0].mean()])
put("chamfer_pq", [cKDTree(q).query(p)[0].mean(), cKDTree(p).query(q)[0].mean()])
put("emd_ab", emd(a, b))
put("emd_pq", emd(p, q))
for name, x, y in (("ab", a, b), ("ac", a, c), ("pq", p, q)):
    ot = entropic(x, y, epsilon)
    put("transport_" + name, ot)
    put("sinkhorn_" + name, ot - (entropic(x, x, epsilon) + entropic(y, y, epsilon)) / 2)
put("histogram_va", histogram(va))
put("jsd", jensenshannon(histogram(va), histogram(vb), base=2) ** 2)
density = lambda x, y: (np.clip(1 - (cdist(x, y) / radius) ** 2, 0, None) ** 3).sum(1)
put("density_a", density(a, a))
put("density_a_with_c", density(a, a) + density(a, c))
put("density_p", density(p, p))
put("rest", [lattice(2), lattice(3)])
da, db = density(a, a), density(b, b)
put("density_error", [abs(da.max() - db.max()) / lattice(3), abs(da.mean() - db.mean()) / lattice(3),
                      np.abs(da - db).mean() / lattice(3), abs(da.max() - db.max()) / db.max()])
for name, x in (("a", a), ("p", p)):
    d = pdist(x)
    put("pairs_" + name, [d.min(), (d < 2 * spacing).sum(), (d < spacing / 2).sum(),
                          (d < spacing / 5).sum()])
center = (mass[:, None] * a).sum(0) / mass.sum()
put("center", center)
put("momentum", (mass[:, None] * va).sum(0))
put("angular", (mass[:, None] * np.cross(a, va)).sum(0))
put("angular_about_center", (mass[:, None] * np.cross(a - center, va)).sum(0))
speed = np.linalg.norm(va, axis=1)
put("sums", [mass.sum(), (mass * speed).sum(), (mass * speed * np.linalg.norm(a - center, axis=1)).sum(),
             (mass * speed**2).sum() / 2, -(mass * (a @ gravity)).sum(), speed.max()])
