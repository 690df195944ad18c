# SPDX-License-Identifier: MIT
"""What is measured once and kept: a result by what it is made from."""

import fcntl
import functools
import hashlib
import json
import os
import time


class Failed(Exception):
    """A measurement that there is not: a line of the page."""


class Cache:
    """Results as JSON in a folder, one file each; files that belong to one lie beside it."""

    def __init__(self, folder, seconds=None):
        """seconds: after that long nothing new is begun."""
        self.folder = os.path.abspath(folder)
        self.end = None if seconds is None else time.monotonic() + seconds
        self.left = False  # whether something was not begun
        os.makedirs(self.folder, exist_ok=True)

    def path(self, kind, *made_from):
        """Where the result of this kind, made from these texts and files, lies (without an ending)."""
        key = hashlib.sha256()
        for part in made_from:
            key.update(content(part) if isinstance(part, File) else repr(part).encode())
            key.update(b"\0")
        return os.path.join(self.folder, f"{kind}-{key.hexdigest()[:16]}")

    def result(self, kind, made_from, measure):
        """The kept result, or that of measure(path), kept."""
        path = self.path(kind, *made_from)
        found = kept(path)
        if found is not None:
            return found
        if self.end is not None and time.monotonic() >= self.end:
            self.left = True
            raise Failed("not measured yet, the time was over")
        with open(path + ".lock", "w", encoding="utf-8") as lock:  # of those that run beside this one
            fcntl.flock(lock, fcntl.LOCK_EX)
            value = kept(path)
            if value is None:
                value = measure(path)
                with open(path + ".partial", "w", encoding="utf-8") as file:
                    json.dump(value, file)
                os.replace(path + ".partial", path + ".json")
        return value


def kept(path):
    try:
        with open(path + ".json", encoding="utf-8") as file:
            return json.load(file)
    except (OSError, ValueError):
        return None


class File(str):
    """A path that stands for what the file holds."""


def content(path):
    status = os.stat(path)
    return digest(path, status.st_mtime_ns, status.st_size)


@functools.cache
def digest(path, *_):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).digest()
