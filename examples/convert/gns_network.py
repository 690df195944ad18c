# SPDX-License-Identifier: MIT
"""The description of a graph network simulator (GNS), as model files have it (docs/file-format.md).

Encoders of nodes and edges, message passing steps with residuals, a decoder; each perceptron has
`matrices` dense layers with ReLU between them and, but for the decoder, a layer normalisation. The
first matrix of an edge's perceptron is cut into three (sender, receiver, edge), that of a node's
into two: there are no concatenations.

    gns_network.py --dimension 2 --spacing 0.0125 --time-step 0.005 --steps 5 --width 64
"""

import argparse
import json


def dense(source, name, relu=False, bias=True):
    term = {"type": "dense", "source": source, "weight": f"{name}.weight"}
    if relu:
        term["relu"] = True
    if bias:
        term["bias"] = f"{name}.bias"
    return term


class Layers:
    def __init__(self, width, matrices):
        self.width, self.matrices, self.list = width, matrices, []

    def add(self, name, points, channels, *terms):
        self.list.append(
            {"name": name, "points": points, "channels": channels, "terms": list(terms)}
        )
        return name

    def perceptron(self, name, points, first, residual=None):
        """A perceptron whose first layer is made of these terms, normalised."""
        last = self.add(f"{name}.0", points, self.width, *first)
        for m in range(1, self.matrices):
            last = self.add(
                f"{name}.{m}", points, self.width, dense(last, f"{name}.{m}", relu=True)
            )
        norm = {"type": "normalize", "source": last}
        norm |= {"scale": f"{name}.scale", "offset": f"{name}.offset"}
        terms = [norm]
        if residual:
            terms.append({"type": "identity", "source": residual})
        return self.add(name, points, self.width, *terms)


def layers(dimension, steps, width, matrices=2):
    """All layers; nodes are fluid and walls, of which each has a matrix of its own in the encoder."""
    made = Layers(width, matrices)
    made.perceptron("n0", "all", [dense("fluid", "n0.fluid"), dense("boundary", "n0.boundary")])
    made.add("way", "edges", dimension + 1, {"type": "displacement", "source": "fluid"})
    made.perceptron("e0", "edges", [dense("way", "e0.0")])
    for k in range(1, steps + 1):
        node, edge = f"n{k - 1}", f"e{k - 1}"
        made.add(f"s{k}", "all", width, dense(node, f"m{k}.sender", bias=False))
        made.add(f"r{k}", "all", width, dense(node, f"m{k}.receiver"))
        ends = [
            {"type": "gather", "source": f"{end[0]}{k}", "end": end}
            for end in ("sender", "receiver")
        ]
        made.perceptron(f"m{k}", "edges", [dense(edge, f"m{k}.edge", bias=False), *ends])
        if k < steps:
            made.add(
                f"e{k}",
                "edges",
                width,
                {"type": "identity", "source": edge},
                {"type": "identity", "source": f"m{k}"},
            )
        made.add(f"a{k}", "all", width, {"type": "sum", "source": f"m{k}"})
        made.perceptron(
            f"n{k}",
            "all",
            [dense(node, f"n{k}.node"), dense(f"a{k}", f"n{k}.sum", bias=False)],
            residual=node,
        )
    last = f"n{steps}"
    for m in range(matrices - 1):
        last = made.add(f"d.{m}", "all", width, dense(last, f"d.{m}", relu=m > 0))
    made.add("correction", "all", dimension, dense(last, "d", relu=True))
    return made.list


def network(dimension, spacing, time_step, radius, scale, **given):
    """given: steps, width, and what stands in the description as it is."""
    made = {
        "name": given.pop("name", "gns"),
        "description": given.pop("description", "graph network simulator"),
        "dimension": dimension,
        "time_step": time_step,
        "gravity": given.pop("gravity", [0, -9.81, 0][:dimension]),
        "particle_spacing": spacing,
        "rest_density": given.pop("rest_density", 1000),
        "evaluate": "current",
        "history": given.pop("history", 4),
        "features": given.pop(
            "features",
            {"fluid": ["one", "motion", "history"], "boundary": ["one", "normal"]},
        ),
        "edges": {"points": "all", "radius": radius},
    }
    crop = given.pop("boundary_crop", None)
    if crop:
        made["boundary_crop"] = crop
    made["layers"] = layers(dimension, given.pop("steps"), given.pop("width"), **given)
    made["output"] = {"type": "plain", "source": "correction", "scale": scale}
    return made


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dimension", type=int, choices=(2, 3), required=True)
    parser.add_argument("--spacing", type=float, required=True, help="m")
    parser.add_argument("--time-step", type=float, required=True, help="s")
    parser.add_argument("--steps", type=int, default=5, help="of message passing")
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--radius", type=float, default=1.45, help="of edges, spacings")
    parser.add_argument("--name", default="gns")
    o = parser.parse_args()
    made = network(
        o.dimension,
        o.spacing,
        o.time_step,
        o.radius * o.spacing,
        0.02 * o.spacing,
        name=o.name,
        description=f"GNS-{o.steps}-{o.width}",
        boundary_crop=2 * o.steps * o.spacing,
        steps=o.steps,
        width=o.width,
    )
    lines = ",\n".join("      " + json.dumps(layer) for layer in made.pop("layers"))
    head = [f"    {json.dumps(key)}: {json.dumps(value)}" for key, value in made.items()]
    output = head.pop()
    print("{\n" + ",\n".join([*head, f'    "layers": [\n{lines}\n    ]', output]) + "\n  }")


if __name__ == "__main__":
    main()
