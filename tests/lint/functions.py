#!/usr/bin/env python3
"""Functions that are too long to be seen at once, or that take too many arguments to be told apart.

functions.py FOLDER...   names those of its .hpp and .cpp with more than 80 lines or more than 8 parameters and ends with 1.
What is long has steps, and each has a name; what needs nine values has a struct.
"""
import pathlib
import re
import sys

from comma import DIGITS, HEAD, LITERAL, SCOPE, quiet

MOST_LINES, MOST_PARAMETERS = 80, 8
CONTROL = re.compile(r"(?:^|[;}] ?)(?:(?:else )?if|else|for|while|switch|do|try|catch|case|default)\b[^;]*$")
TEMPLATE = re.compile(r"<[^<>]*>")


class Context:
    def __init__(self, kind, line):
        self.kind, self.text, self.line, self.inside = kind, "", line, ""


def functions(text):
    """(first line, last line, parameters, head) of every function body, lambdas included."""
    text = re.sub(r"^[ \t]*#(?:[^\n\\]|\\.|\\\n)*", "", text, flags=re.M)
    text = LITERAL.sub(quiet, DIGITS.sub("", text))
    line, stack = 1, [Context("block", 1)]
    for char in text:
        top = stack[-1]
        if char == "\n":
            line += 1
        if char.isspace():
            top.text += " " if top.text and not top.text.endswith(" ") else ""
            continue
        if not top.text:
            top.line = line
        if char in "([":
            stack.append(Context(char, line))
        elif char == "{":
            stack.append(Context("{", line))
        elif char in ")]}":
            if len(stack) == 1:
                continue
            closed, below = stack.pop(), stack[-1]
            if char == "}":
                head = below.text.strip()
                if HEAD.search(head) and not SCOPE.search(head) and not CONTROL.search(head) and "(" in head:
                    yield below.line, line, parameters(below.inside), head
                below.text = "" if below.kind in "{block" else below.text + "{}"
            else:
                if char == ")":
                    below.inside = closed.text
                below.text += {")": "()", "]": "[]"}[char]
        elif char == ";" and top.kind not in "([":
            top.text = ""
        else:
            top.text += char


def parameters(inside):
    while inside != (plain := TEMPLATE.sub("", inside)):
        inside = plain
    return inside.count(",") + 1 if inside.strip() else 0


def wrong(text):
    for first, last, n, head in functions(text):
        if last - first + 1 > MOST_LINES:
            yield first, f"{last - first + 1} lines, at most {MOST_LINES}: name its steps ({head[-60:]})"
        if n > MOST_PARAMETERS:
            yield first, f"{n} parameters, at most {MOST_PARAMETERS}: give it a struct ({head[-60:]})"


def main(folders):
    found = 0
    for file in sorted(file for folder in folders for file in pathlib.Path(folder).rglob("*.[hc]pp")):
        for line, what in wrong(file.read_text(encoding="utf-8")):
            print(f"{file}:{line}: a function of {what}")
            found += 1
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
