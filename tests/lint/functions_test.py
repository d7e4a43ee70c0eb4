#!/usr/bin/env python3
"""functions.py finds what is too long or takes too much, and nothing else."""
import unittest

import functions

BODY = "  x = 1;\n" * 79


def found(text):
    return [what.split(":")[0] for _, what in functions.wrong(text)]


class Functions(unittest.TestCase):
    def test_finds_long_ones_and_their_line(self):
        text = "namespace a {\nint b;\nvoid f(int a) {\n" + BODY + "}\n}\n"
        self.assertEqual([line for line, _ in functions.wrong(text)], [3])
        self.assertEqual(found(text), ["81 lines, at most 80"])
        self.assertEqual(found("struct S {\n  int f() const noexcept {\n" + BODY + "  }\n};\n"), ["81 lines, at most 80"])
        self.assertEqual(found("void f() {\n  g([](int a) {\n" + BODY + "  });\n}\n"), ["81 lines, at most 80", "83 lines, at most 80"])

    def test_counts_parameters_and_not_arguments_of_templates(self):
        nine = ", ".join(f"int a{i}" for i in range(9))
        self.assertEqual(found("void f(" + nine + ") {}"), ["9 parameters, at most 8"])
        self.assertEqual(found("void f(" + nine + ") const { g(); }"), ["9 parameters, at most 8"])
        self.assertEqual(found("void f(std::map<int, std::pair<int, int>> a, int b) { if (g(" + nine + ")) { h(); } }"), [])

    def test_lets_others_be(self):
        self.assertEqual(found("void f() {\n" + BODY[:-9] + "}\n"), [])
        self.assertEqual(found("namespace a {\nclass B {\n" + "  int x;\n" * 100 + "};\n}\n"), [])
        self.assertEqual(found("constexpr Row k_rows[] = {\n" + "  {1, 2},\n" * 100 + "};\n"), [])
        self.assertEqual(found("enum class E {\n" + "  a,\n" * 100 + "};\n"), [])


if __name__ == "__main__":
    unittest.main()
