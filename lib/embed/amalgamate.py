#!/usr/bin/env python3
"""Makes one source file of libascc, with its header: ascc.c and ascc.h.

    python3 lib/embed/amalgamate.py FOLDER
    cc -std=c11 -O3 -c ascc.c        # gcc or clang; link with -lm and threads

Same bits as the library, kernels for AVX2, AVX-512, NEON and WebAssembly's SIMD included: each is compiled for
its own instruction set by pragmas, and chosen when the program runs. -DASCC_NO_SIMD leaves them out.
SPDX-License-Identifier: MIT

The files stand behind each other as the compiler would read them, headers once. In one file the names that
are private to several of them would clash: these get the name of their file as an ending. The text of the
kernels, which every instruction set has once, gets the ending for all its names.
"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
LIB = ROOT / "lib"

# Instruction set: where there is one, and what its functions are compiled for (None: nothing to say).
VARIANTS = {
    "avx2": ("defined(__x86_64__)", "avx2,fma,bmi2,popcnt"),
    "avx512": ("defined(__x86_64__)", "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi2,popcnt"),
    "neon": ("defined(__aarch64__)", None),
    "simd128": ("defined(__wasm_simd128__)", None),
}
VARIANTS = {name: value for name, value in VARIANTS.items() if (LIB / "kernels" / f"{name}.c").exists()}

TOP = """/* libascc %s in one file, made by lib/embed/amalgamate.py. SPDX-License-Identifier: MIT
 *
 *   cc -std=c11 -O3 -c ascc.c     gcc or clang; link with -lm and threads (-pthread)
 */
#if !defined(__GNUC__)
#error "libascc needs gcc or clang"
#endif
/* Same bits from every build: no contraction, whatever the command line says. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#else
#pragma GCC optimize("fp-contract=off", "no-math-errno", "no-trapping-math")
#endif
#if !defined(_POSIX_C_SOURCE) && !defined(_WIN32)
#define _POSIX_C_SOURCE 200809L
#endif
#if defined(_WIN32)
#define __USE_MINGW_ANSI_STDIO 1
#endif
#define ASCC_BUILD
#if !defined(ASCC_NO_SIMD)
%s#endif
#if defined(__x86_64__)
#include <immintrin.h>
#endif
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
"""

TOKEN = re.compile(
    r"""(?P<comment>/\*.*?\*/|//[^\n]*)
      | (?P<directive>^[ \t]*\#(?:\\\n|[^\n])*)
      | (?P<text>"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')
      | (?P<number>\.?\d(?:[eEpP][+-]|[\w.])*)
      | (?P<name>[A-Za-z_]\w*)
      | (?P<arrow>->)
      | (?P<space>\s+)
      | (?P<other>.)""",
    re.VERBOSE | re.MULTILINE | re.DOTALL,
)
KEYWORDS = set(
    """auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    bool true false NULL _Alignas _Atomic _Static_assert""".split()
)


def tokens(text):
    return [(m.lastgroup, m.group()) for m in TOKEN.finditer(text)]


def sources():
    """The files that Meson compiles for the run-time, read from its own lists, without the variants."""
    text = (LIB / "meson.build").read_text()
    found = []
    for name in ("core_sources", "hot_sources"):
        block = re.search(name + r" = files\(([^)]*)\)", text).group(1)
        found += re.findall(r"'([^']+\.c)'", block)
    operations = re.findall(r"^OPERATION\((\w+)\)", (LIB / "network/operations.list").read_text(), re.M)
    found += [f"network/op_{name}.c" for name in operations]
    found.remove("kernels/portable.c")
    return found


# ---- Names ----


def statements(code):
    """Lists of tokens, one for each declaration or definition at file scope, without blanks and comments."""
    depth, current = 0, []
    for kind, text in code:
        if kind in ("space", "comment", "directive"):
            continue
        current.append((kind, text))
        if text in "{([" and kind == "other":
            depth += 1
        elif text in "})]" and kind == "other":
            depth -= 1
            whole_function = text == "}" and any(t == ")" for _, t in current) and "=" not in [t for _, t in outer(current)]
            macro = text == ")" and len(current) > 1 and current[1][1] == "(" and current[0][1].isupper()
            if depth == 0 and (macro or (whole_function and outer(current)[0][1] != "typedef")):
                yield current
                current = []
        elif text == ";" and depth == 0:
            yield current
            current = []


def outer(statement):
    """The tokens of a statement that no bracket holds; brackets themselves stay."""
    depth, found = 0, []
    for kind, text in statement:
        if kind == "other" and text in "})]":
            depth -= 1
        if depth == 0:
            found.append((kind, text))
        if kind == "other" and text in "{([":
            depth += 1
    return found


def declared(statement):
    """What a statement at file scope gives a name to."""
    names = set()
    texts = [text for _, text in statement]
    for i, text in enumerate(texts[:-2]):
        if text in ("struct", "union", "enum") and texts[i + 2] == "{":
            names.add(texts[i + 1])
    if "enum" in texts and "{" in texts:
        body = texts[texts.index("{") + 1 : texts.index("}")]
        names |= {t for i, t in enumerate(body) if re.match(r"[A-Za-z_]\w*$", t) and (i == 0 or body[i - 1] == ",")}
    bare = outer(statement)
    for i, (kind, text) in enumerate(bare):
        following = bare[i + 1][1] if i + 1 < len(bare) else ""
        if kind == "name" and text not in KEYWORDS and following in ("(", "[", "=", ";", ","):
            names.add(text if not (text.isupper() and i == 0) else texts[2])
            if following == "(":
                break
    pointer = re.search(r"\( \* (\w+) \) \(", " ".join(texts))
    if texts[0] == "typedef" and pointer:
        names.add(pointer.group(1))
    return {n for n in names - KEYWORDS if not n.lower().startswith("ascc_") and not n.startswith("__")}


def private_names(text):
    names = set()
    for statement in statements(tokens(text)):
        names |= declared(statement)
    return names


def rename(text, names, ending):
    """Gives names the ending, but for members: those behind a point or an arrow, and where structs declare them."""
    code = tokens(text)
    solid = [i for i, (kind, _) in enumerate(code) if kind not in ("space", "comment")]
    place = {i: n for n, i in enumerate(solid)}
    result, in_struct, brackets = [], 0, []
    for i, (kind, t) in enumerate(code):
        if kind == "directive" and not t.lstrip().startswith("#include"):
            t = re.sub(r"(?<![\w.>])[A-Za-z_]\w*", lambda m: m.group() + ending if m.group() in names else m.group(), t)
        elif kind == "other" and t == "{":
            back = [code[j][1] for j in solid[max(0, place[i] - 2) : place[i]]]
            brackets.append(bool(back) and ("struct" in back or "union" in back))
        elif kind == "other" and t == "}" and brackets:
            brackets.pop()
        elif kind == "name" and t in names:
            before = code[solid[place[i] - 1]][1] if place[i] else ""
            after = code[solid[place[i] + 1]][1] if place[i] + 1 < len(solid) else ""
            member = before in (".", "->") or (bool(brackets) and brackets[-1] and after in (";", ",", "[", ":", ")"))
            if not member or before == "struct":
                t += ending
        result.append(t)
    return "".join(result)


def own_macros(text):
    return sorted(set(re.findall(r"^[ \t]*#[ \t]*define[ \t]+(\w+)", text, re.M)))


# ---- Files ----


class Amalgamation:
    def __init__(self):
        self.seen, self.out = set(), []
        self.sources = sources()
        count = {}
        for name in self.sources:
            for n in private_names((LIB / name).read_text()):
                count[n] = count.get(n, 0) + 1
        for header in LIB.rglob("*.h"):
            if header.name not in ("body.h", "vector.h") and header.parent.name != "mpi":
                for n in private_names(header.read_text()):
                    count[n] = count.get(n, 0) + 2
        self.shared = {n for n, times in count.items() if times > 1}

    def find(self, name, folder):
        for place in (folder / name, LIB / name):
            if place.exists():
                return place.resolve()
        sys.exit(f"amalgamate: {folder}: no {name}")

    def expand(self, path, text, inline=()):
        """Puts the project's headers in the place of their #include, each once; lists always."""
        lines = []
        for line in text.splitlines(keepends=True):
            quoted = re.match(r'[ \t]*#[ \t]*include[ \t]*"([^"]+)"', line)
            if re.match(r"[ \t]*#[ \t]*include[ \t]*<ascc/(ascc|version)\.h>", line):
                lines.append('#include "ascc.h"\n')
            elif quoted:
                header = self.find(quoted.group(1), path.parent)
                if header.suffix == ".list" or header.name in inline:
                    lines.append(self.expand(header, header.read_text(), inline))
                elif header not in self.seen:
                    self.seen.add(header)
                    lines.append(self.expand(header, header.read_text(), inline))
            elif re.match(r"[ \t]*#[ \t]*include[ \t]*<windows\.h>", line):
                lines.append(line + "#undef near\n#undef far\n#undef small\n")
            else:
                lines.append(line)
        return "".join(lines)

    def add(self, name):
        path = LIB / name
        text = path.read_text()
        names = private_names(text) & self.shared
        text = rename(text, names, "_" + path.stem)
        whole = self.expand(path, text)
        self.out.append(f"\n/* ==== {name} ==== */\n{whole}")
        self.out += [f"#undef {m}\n" for m in own_macros(text)]

    def add_variant(self, name):
        """A file of kernels: its text with that of body.h and vector.h, all names its own."""
        path = LIB / "kernels" / f"{name}.c"
        parts = [path.read_text(), (LIB / "kernels/body.h").read_text(), (LIB / "kernels/vector.h").read_text()]
        names = set().union(*(private_names(p) for p in parts))
        text = "".join(self.headers_of(p) for p in parts)
        inner = self.expand(path, re.sub(r'(#include ")(kernels|fused)(\.h")', r"", path.read_text()), ("body.h", "vector.h"))
        inner = rename(inner, names, "_" + name)
        where, target = VARIANTS.get(name, (None, None))
        begin, end = "", ""
        if where:
            begin, end = f"#if {where} && !defined(ASCC_NO_SIMD)\n", "#endif\n"
        if target:
            begin += f"""#if defined(__clang__)
#pragma clang attribute push(__attribute__((target("{target}"))), apply_to = function)
#else
#pragma GCC push_options
#pragma GCC target("{target}")
#endif
"""
            end = "#if defined(__clang__)\n#pragma clang attribute pop\n#else\n#pragma GCC pop_options\n#endif\n" + end
        undefined = "".join(f"#undef {m}\n" for m in own_macros(inner))
        self.out.append(f"\n/* ==== kernels/{name}.c ==== */\n{text}{begin}{inner}{undefined}{end}")

    def headers_of(self, text):
        """Headers that a variant needs and has in common with the rest."""
        found = []
        for name in re.findall(r'#include "(kernels|fused)\.h"', text):
            header = LIB / "kernels" / f"{name}.h"
            if header not in self.seen:
                self.seen.add(header)
                found.append(self.expand(header, header.read_text()))
        return "".join(found)

    def write(self, folder):
        for name in self.sources:
            self.add(name)
        for name in ("portable", *VARIANTS):
            self.add_variant(name)
        version = (ROOT / "include/ascc/version.h").read_text()
        numbers = ".".join(re.search(rf"ASCC_VERSION_{p} (\d+)", version).group(1) for p in ("MAJOR", "MINOR", "PATCH"))
        have = "".join(f"#if {w}\n#define ASCC_HAVE_{n.upper()}\n#endif\n" for n, (w, _) in VARIANTS.items())
        header = (ROOT / "include/ascc/ascc.h").read_text().replace('#include "version.h"\n', version)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "ascc.h").write_text(header)
        (folder / "ascc.c").write_text(TOP % (numbers, have) + "".join(self.out))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: amalgamate.py FOLDER")
    Amalgamation().write(pathlib.Path(sys.argv[1]))
