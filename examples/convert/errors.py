# SPDX-License-Identifier: MIT
"""The one exception of the converters, and the texts every reader shares."""

import os
import sys


class ConvertError(Exception):
    """Input that cannot be converted: which file, which field of it, and what is wrong."""

    def __init__(self, path, field, problem):
        super().__init__(f"{path}: {field}: {problem}" if field else f"{path}: {problem}")
        self.path, self.field, self.problem = str(path), field, problem


def warn(path, field, problem):
    print(f"convert: warning: {path}: {field}: {problem}", file=sys.stderr)


def read_file(path, limit=1 << 32):
    """The whole file as bytes; a clear error where it is missing, a folder or absurdly large."""
    try:
        size = os.path.getsize(path)
        if size > limit:
            raise ConvertError(path, "size", f"{size} bytes; at most {limit} are read")
        with open(path, "rb") as file:
            return file.read()
    except OSError as error:
        raise ConvertError(path, "", error.strerror or str(error)) from None
