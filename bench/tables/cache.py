# SPDX-License-Identifier: MIT
"""What is measured once and kept: a result by what it is made from."""

import hashlib
import json
import os


class Cache:
    """Results as JSON in a folder, one file each; files that belong to one lie beside it."""

    def __init__(self, folder):
        self.folder = os.path.abspath(folder)
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
        try:
            with open(path + ".json", encoding="utf-8") as file:
                return json.load(file)
        except (OSError, ValueError):
            pass
        value = measure(path)
        with open(path + ".partial", "w", encoding="utf-8") as file:
            json.dump(value, file)
        os.replace(path + ".partial", path + ".json")
        return value


class File(str):
    """A path that stands for what the file holds."""


def content(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).digest()
