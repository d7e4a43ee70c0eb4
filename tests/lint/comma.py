#!/usr/bin/env python3
"""Statements with the comma operator: `a = 1, b = 2;`, `return fail(), 0;`. Two things are two statements.

comma.py FOLDER...   names them in its .hpp and .cpp and ends with 1. Declarations, arguments, templates and heads of for loops may have commas.
"""
import pathlib
import re
import sys

LITERAL = re.compile(r'R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\'|//[^\n]*|/\*.*?\*/', re.S)
DIGITS = re.compile(r"(?<=[0-9a-fA-F])'(?=[0-9a-fA-F])")
# An expression and no type stands before the first comma: a name, a member, an element, a dereference, with what is done
# with it.
EXPRESSION = re.compile(
    r"(?:\+\+|--|\*)*(?:this->)?[A-Za-z_][\w:]*(?:(?:\.|->)[A-Za-z_]\w*|\[\]|\(\))*(?:\+\+|--)?"
    r" ?(?:$|(?:[-+*/|&^%]|<<|>>)?=(?!=))"  # not <<: `matrix << 1, 2` is Eigen's
)
PREFIX = re.compile(r"(?:(?:else )?if (?:constexpr )?\(\)|else|for \(\)|while \(\)|do|case (?:[^:]|::)*:(?!:)|default:) ?")
DECLARATION = re.compile(r"(?:public|private|protected|template|using|typedef|enum|static_assert|friend)\b")
HEAD = re.compile(r"(?:\)|\b(?:const|noexcept|override|final|mutable|else|do|try)|-> ?[\w:<>&* ,]+)$")
SCOPE = re.compile(r"(?:^|[ >])(?:namespace|class|struct|union|extern)\b")


def quiet(match):
    """Literals and comments keep their lines and say nothing."""
    text = match.group(0)
    return ("" if text.startswith("/") else '""') + "\n" * text.count("\n")


class Context:
    def __init__(self, kind, line):
        self.kind, self.text, self.line = kind, "", line


def statements(text):
    """(line, statement), each with `()`, `[]`, `{}` in place of what is in its brackets."""
    line, stack = 1, [Context("block", 1)]
    for char in text:
        top = stack[-1]
        if char == "\n":
            line += 1
        if char.isspace():
            if top.text and not top.text.endswith(" "):
                top.text += " "
            continue
        if not top.text:
            top.line = line
        if char in "([":
            stack.append(Context(char, line))
        elif char == "{":
            said = top.text.strip()
            if re.match(r"enum\b", said):
                kind = "list"
            elif not said or HEAD.search(said) or SCOPE.search(said):
                kind = "block"
            elif re.match(r"[\w:~]+ ?\(\).*\) ?$", said):
                kind = "block"
            else:
                kind = "list"
            if said.endswith("[]"):  # a lambda without arguments
                kind = "block"
            stack.append(Context(kind, line))
        elif char in ")]}":
            if len(stack) == 1:
                continue  # of a macro's other half
            closed = stack.pop()
            below = stack[-1]
            below.text += {")": "()", "]": "[]", "}": "{}"}[char]
            if closed.kind == "block" and below.kind == "block":
                said = below.text.strip()
                # The end of a function or of a branch; a lambda's statement goes on.
                if not re.search(r"\[\]", said) or SCOPE.search(said):
                    yield below.line, said[:-2]
                    below.text = ""
        elif char == ";" and top.kind == "block":
            yield top.line, top.text.strip()
            top.text = ""
        else:
            top.text += char


def wrong(text):
    text = re.sub(r"^[ \t]*#(?:[^\n\\]|\\.|\\\n)*", "", text, flags=re.M)
    text = LITERAL.sub(quiet, DIGITS.sub("", text))
    for line, statement in statements(text):
        if "," not in statement or DECLARATION.match(statement):
            continue
        while PREFIX.match(statement):
            statement = PREFIX.sub("", statement, count=1)
        plain = re.sub(r"(?<=\w)<[\w:, ]*>", "", statement)  # arguments of templates
        while plain != (inner := re.sub(r"(?<=\w)<[\w:, ]*>", "", plain)):
            plain = inner
        if "," not in plain:
            continue
        if re.match(r"(?:co_)?return\b", plain) or EXPRESSION.match(plain.split(",")[0].strip()):
            yield line, statement


def main(folders):
    found = 0
    for file in sorted(file for folder in folders for file in pathlib.Path(folder).rglob("*.[hc]pp")):
        for line, statement in wrong(file.read_text(encoding="utf-8")):
            print(f"{file}:{line}: two statements in one, by a comma: {statement[:100]}")
            found += 1
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
