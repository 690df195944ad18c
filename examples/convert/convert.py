#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Published data sets and networks, and users' particles, as libascc's own files; see README.md beside this file.

    convert.py data FORMAT INPUT... -o DIR       one sequence file per scene
    convert.py import INPUT... -o FILE           one's own particles: CSV, PLY, VTK, HDF5, NPZ
    convert.py usd SEQUENCE -o FILE              a sequence as a USD stage
    convert.py weights FORMAT INPUT -o FILE      one network, for `ascc convert`

Exit codes: 0 done, 2 wrong input or arguments; what was written before an error is whole.
"""

import argparse
import importlib
import itertools
import math
import os
import sys

from errors import ConvertError

DATA = {
    "dlf": ("read_dlf", "Liquid3d, WBC-SPH: msgpack + zstd shards (.msgpack.zst)"),
    "gns": ("read_gns", "Water-Ramps: .tfrecord beside metadata.json"),
    "lagrangebench": ("read_lagrangebench", "LagrangeBench: .h5 beside metadata.json"),
}
WEIGHTS = {
    "dmcf": "TensorFlow checkpoint of the DMCF Liquid3d network (its .index file)",
    "cconv-h5": "Keras .h5 of the CConv Liquid3d network",
    "cconv-pt": "PyTorch .pt of the CConv Liquid3d network",
    "lagrangebench-gns": "folder of a GNS that LagrangeBench trained (params_tree.pkl,\n"
    "    params_array.npy) beside the data's metadata.json; makes a model file at once",
}


def positive(text):
    value = float(text)
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def count(text):
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return value


def corners(text):
    values = tuple(float(part) for part in text.replace(",", " ").split())
    if len(values) not in (4, 6) or not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(f"{text!r} is not four or six numbers")
    return values


def vector(text):
    values = tuple(float(part) for part in text.replace(",", " ").split())
    if len(values) not in (2, 3) or not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(f"{text!r} is not two or three numbers")
    return values


def arguments(argv):
    parser = argparse.ArgumentParser(prog="convert.py", description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)

    data = commands.add_parser(
        "data", help="sequences", formatter_class=argparse.RawTextHelpFormatter
    )
    data.add_argument(
        "format",
        choices=DATA,
        help="\n".join(f"{name}: {about}" for name, (_, about) in DATA.items()),
    )
    data.add_argument("input", nargs="+", help="files, or folders of them")
    data.add_argument("-o", "--output", required=True, metavar="DIR")
    data.add_argument("--count", type=count, help="only the first COUNT sequences")
    data.add_argument("--spacing", type=positive, help="particle spacing, m")
    data.add_argument("--dt", type=positive, help="time between frames, s")
    data.add_argument("--gravity", type=vector, metavar='"X Y [Z]"', help="m/s^2")
    data.add_argument("--rest-density", type=positive, help="kg/m^3")
    data.add_argument(
        "--dim", type=int, choices=(2, 3), help="dlf: 2 drops z (as found by default)"
    )
    data.add_argument("--metadata", help="gns, lagrangebench: where metadata.json is")
    data.add_argument(
        "--fluid-type",
        type=count,
        action="append",
        help="gns: particle type read as fluid (5, water); may be repeated",
    )
    data.add_argument(
        "--wall-layers",
        type=count,
        default=3,
        help="gns: layers of wall particles around the box (3; 0 = none)",
    )
    data.add_argument(
        "--moving-walls-at-rest",
        action="store_true",
        help="lagrangebench: convert moving walls as if they stood still",
    )
    data.add_argument("--source", help="text for the files' metadata")

    own = commands.add_parser("import", help="one's own particles: CSV, PLY, VTK, HDF5, NPZ")
    own.add_argument("input", nargs="+", help="a file a frame, or one with all; a .pvd; folders")
    own.add_argument("-o", "--output", required=True, metavar="FILE", help="name.safetensors")
    own.add_argument("--dt", type=positive, help="time between frames, s (times in the files)")
    own.add_argument("--spacing", type=positive, help="particle spacing, m (measured)")
    own.add_argument("--gravity", type=vector, metavar='"X Y [Z]"', help="m/s^2 (9.81 along -y)")
    own.add_argument("--rest-density", type=positive, help="kg/m^3 (1000)")
    own.add_argument(
        "--scale", type=positive, default=1.0, help="metres in a unit of the files (1)"
    )
    own.add_argument("--dim", type=int, choices=(2, 3), help="2 drops z (where z never changes)")
    own.add_argument("--position", metavar="NAME", help="array or columns X,Y,Z of positions")
    own.add_argument("--velocity", dest="velocity_name", metavar="NAME", help="of velocities")
    own.add_argument("--id", metavar="NAME", help="of ids: rows are put in their order")
    own.add_argument("--fluid", metavar="NAME=V,...", help="only rows where NAME is one of V")
    own.add_argument(
        "--boundary", metavar="NAME=V,...", help="rows of the first frame that are walls"
    )
    own.add_argument("--walls", metavar="FILE", help="wall points, with normals or without")
    own.add_argument("--box", type=corners, metavar='"LOW HIGH"', help="walls around a box")
    own.add_argument("--wall-layers", type=count, default=1, help="of --box (1)")
    own.add_argument("--source", help="text for the file's metadata")

    usd = commands.add_parser("usd", help="a sequence as a USD stage of points")
    usd.add_argument("input")
    usd.add_argument("-o", "--output", required=True, metavar="FILE", help="name.usdc or .usda")
    usd.add_argument("--every", type=count, default=1, help="each EVERY-th frame (1)")

    weights = commands.add_parser(
        "weights", help="networks", formatter_class=argparse.RawTextHelpFormatter
    )
    weights.add_argument(
        "format",
        choices=WEIGHTS,
        help="\n".join(f"{name}: {about}" for name, about in WEIGHTS.items()),
    )
    weights.add_argument("input")
    weights.add_argument("-o", "--output", required=True, metavar="FILE")
    weights.add_argument("--metadata", help="of lagrangebench-gns: metadata.json, if it is elsewhere")
    weights.add_argument(
        "--noise",
        type=float,
        default=3e-4,
        help="of lagrangebench-gns: standard deviation of the noise that it was trained with (3e-4)",
    )
    return parser.parse_args(argv)


def files(inputs, suffix):
    """The named files, and those with the suffix (one or a tuple) in the named folders."""
    found = []
    for path in inputs:
        if os.path.isdir(path):
            names = sorted(name for name in os.listdir(path) if name.endswith(suffix))
            if not names:
                ends = suffix if isinstance(suffix, str) else " ".join(suffix)
                raise ConvertError(path, "", f"no {ends} files in this folder")
            found += [os.path.join(path, name) for name in names]
        else:
            found.append(path)
    return found


def convert_data(options):
    reader = importlib.import_module(DATA[options.format][0])
    sequence = importlib.import_module("sequence")
    os.makedirs(options.output, exist_ok=True)
    written = set()
    sequences = reader.read(files(options.input, reader.SUFFIX), options)
    for item in itertools.islice(sequences, options.count):
        if item.name in written:
            raise ConvertError(
                item.origin,
                "name",
                f"{item.name} was already written from another input; "
                "convert them into different folders",
            )
        sequence.write(item, options.output)
        written.add(item.name)


def import_own(options):
    reader = importlib.import_module("read_points")
    found = files(options.input, tuple(reader.READERS))
    folder = os.path.dirname(options.output)
    if folder:
        os.makedirs(folder, exist_ok=True)
    importlib.import_module("sequence").write(reader.read(found, options), folder)


def main(argv=None):
    options = arguments(argv)
    try:
        if options.command == "data":
            convert_data(options)
        elif options.command == "import":
            import_own(options)
        elif options.command == "usd":
            importlib.import_module("write_usd").write(
                options.input, options.output, max(options.every, 1)
            )
        elif options.format == "lagrangebench-gns":
            importlib.import_module("read_lagrangebench_gns").convert(
                options.input, options.output, options
            )
        else:
            importlib.import_module("weights").convert(
                options.format, options.input, options.output
            )
    except ConvertError as error:
        print(f"convert: error: {error}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        print(
            f"convert: error: Python module {error.name} is missing; see requirements.txt",
            file=sys.stderr,
        )
        return 2
    except OSError as error:
        print(f"convert: error: {error.filename or ''}: {error.strerror or error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
