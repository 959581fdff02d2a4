"""The tree-sitter grammar as editors use it: compiled, over every shipped file, its corpus and its queries.

check_grammar.py WORK FOLDER...: WORK is for the compiled parser; all `.mech` files below the folders are parsed.
"""

import ctypes
import hashlib
import re
import subprocess
import sys
import warnings
from pathlib import Path

from tree_sitter import Language, Parser, Query

HERE = Path(__file__).resolve().parents[2] / "editors" / "tree-sitter-flexura"


def compiled(work):
    library = Path(work) / "flexura.so"
    sources = [str(HERE / "src" / name) for name in ("parser.c", "scanner.c")]
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", "-Wno-unused", "-I", str(HERE / "src"), "-o", str(library), *sources],
        check=True,
    )
    function = ctypes.CDLL(str(library)).tree_sitter_flexura
    function.restype = ctypes.c_void_p
    with warnings.catch_warnings():
        # The address as a number is what a compiled parser gives without a package of its own.
        warnings.simplefilter("ignore", DeprecationWarning)
        return Language(function())


def shape(node):
    """A tree as the corpus writes it: named nodes, without the names of fields."""
    if node.type == "ERROR" or node.is_missing:
        return f"({node.type}!)"
    inner = [shape(child) for child in node.children if child.is_named or child.type == "ERROR" or child.is_missing]
    return "(" + " ".join([node.type, *inner]) + ")"


def captures(query, root):
    try:
        from tree_sitter import QueryCursor

        return QueryCursor(query).captures(root)
    except ImportError:
        return query.captures(root)


def main(work, folders):
    digest = hashlib.sha256((HERE / "grammar.js").read_bytes()).hexdigest()
    made_of = (HERE / "src" / "made-of.sha256").read_text().split()[0]
    assert digest == made_of, "src/ is not made of this grammar.js: run generate.sh"

    language = compiled(work)
    parser = Parser(language)

    samples = re.findall(r"^=+\n([^\n]+)\n=+\n(.*?)^---\n(.*?)(?=^===|\Z)", (HERE / "test/corpus/statements.txt").read_text(), re.M | re.S)
    assert len(samples) >= 5, samples
    for name, text, wanted in samples:
        got = shape(parser.parse(text.encode()).root_node)
        wanted = re.sub(r"\s+", " ", re.sub(r"\w+: ", "", wanted)).replace("( ", "(").replace(" )", ")").strip()
        assert got == wanted, f"{name}:\n{got}\n{wanted}"

    queries = {path.name: Query(language, path.read_text()) for path in sorted((HERE / "queries").glob("*.scm"))}
    assert {"highlights.scm", "folds.scm", "indents.scm", "locals.scm"} <= queries.keys(), queries

    files = sorted(file for folder in folders for file in Path(folder).rglob("*.mech"))
    assert len(files) > 40, files
    nodes = 0
    for file in files:
        text = file.read_bytes()
        root = parser.parse(text).root_node
        assert not root.has_error, f"{file}: {root}"
        nodes += root.descendant_count
        found = captures(queries["highlights.scm"], root)
        # Every number and every first word of a line has its colour.
        digits = {n.start_byte for n in found.get("number", [])}
        # Neither in comments and texts nor in the exponents of units.
        code = re.sub(rb"//[^\n]*|\"[^\"\n]*\"|[a-zA-Z]\^-?\d(?=[ */\n,)])", lambda m: b" " * len(m.group()), text)
        for match in re.finditer(rb"(?<![\w.])(?<!e[-+])\d", code):
            if code[match.start() : match.start() + 3] != b"3mf":
                assert match.start() in digits, f"{file}: no colour at {text[match.start() - 30 : match.start() + 9]}"
        words = {n.start_byte for n in found.get("keyword", [])}
        for match in re.finditer(rb"^    ([a-z]+) +\w+ *(=|:|\{)", code, re.M):
            assert match.start(1) in words, f"{file}: no keyword in {match.group()}"
        folds = captures(queries["folds.scm"], root).get("fold", [])
        assert folds, f"{file}: nothing folds"
        # As in an editor: a letter typed and taken back gives the same tree.
        tree = parser.parse(text)
        at = text.rfind(b"\n", 0, len(text) // 2) + 1
        row, point = text[:at].count(b"\n"), (text[:at].count(b"\n"), 0)
        tree.edit(at, at, at + 1, point, point, (row, 1))
        typed = parser.parse(text[:at] + b"(" + text[at:], tree)
        typed.edit(at, at + 1, at, point, (row, 1), point)
        assert shape(parser.parse(text, typed).root_node) == shape(root), file
    print(f"{len(samples)} samples, {len(files)} files, {nodes} nodes, no error; {', '.join(queries)}")


main(sys.argv[1], sys.argv[2:])
