#!/usr/bin/env python3
"""Loops over a part of what a call returned: `for (auto& x : f().value())`, `for (auto& x : f()["a"])`. What f() returned is gone before the first round.

dangling.py FOLDER...   names them in its .hpp and .cpp and ends with 1. A data member of it (`f().rows`) lives as long as the loop; name the rest first.
"""
import pathlib
import re
import sys

from comma import DIGITS, LITERAL, quiet

FOR = re.compile(r"\bfor \(")
# Calls that return a reference into what they are called on.
INTO = {"at", "back", "front", "value", "get", "state", "lock"}
PART = re.compile(r"(\w+)(\(\))(?:\.(?:value|items|at)\(\)|\[\])")


def head(text, start):
    """What stands between the bracket at `start` and its mate."""
    depth = 0
    for i in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[i], 0)
        if depth == 0:
            return text[start + 1 : i]
    return ""


def flat(expression):
    """Without what is in its brackets."""
    said = r"(?:[^()\[\]{}]|\(\)|\[\]|\{\})+"
    return re.sub(rf"\({said}\)|\[{said}\]|\{{{said}\}}", lambda m: m.group(0)[0] + m.group(0)[-1], expression)


def wrong(text):
    text = LITERAL.sub(quiet, DIGITS.sub("", text))
    for match in FOR.finditer(text):
        said = head(text, match.end() - 1)
        if ";" in said or not re.search(r"(?<!:):(?!:)", said):
            continue
        over = re.split(r"(?<!:):(?!:)", said, maxsplit=1)[1]
        while flat(over) != over:
            over = flat(over)
        part = PART.search(over)
        if part and part.group(1) not in INTO and not over[: part.start()].endswith("*"):
            yield text.count("\n", 0, match.start()) + 1, " ".join(over.split())


def main():
    found = 0
    for folder in sys.argv[1:]:
        for path in sorted(pathlib.Path(folder).rglob("*.[ch]pp")):
            for line, over in wrong(path.read_text()):
                print(f"{path}:{line}: what the call returned is gone in the loop, name it first: {over}")
                found += 1
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
