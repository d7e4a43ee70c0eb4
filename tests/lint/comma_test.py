#!/usr/bin/env python3
"""comma.py finds what it is there for, and lets be what only has commas."""
import unittest

import comma


def found(text):
    return [line for line, _ in comma.wrong(text)]


class Comma(unittest.TestCase):
    def test_finds_statements_and_bodies(self):
        for text in (
            "void f() { aim_m_ = aim, aim_s_ = rig_.now; }",
            "void f() {\n  ++n, ++m;\n}",
            "int f() { return fail(\"a, b\"), 0; }",
            "void f() { if (x) a = 1, b = 2; }",
            "void f() { for (int i = 0; i < 3; ++i) sum += i, n += 1; }",
            "void f() { switch (k) { case K::one: a = 1, b = 2; break; } }",
            "void f() { each(all, [&](auto& one) { one.a = 1, one.b = 2; }); }",
            "void f() { out[i] = x, out[j] = y; }",
            "struct S { void add(double v) { sum += v, ++n; } };",
            "void f() { open(), close(); }",
            "void f() { else_ = 1;\n#define X a = 1, b = 2\n  p->q = 1, r = 2; }",
        ):
            self.assertEqual(len(found(text)), 1, text)

    def test_lets_other_commas_be(self):
        for text in (
            "int a = 1, b = 2;",
            "void f() { double x = 0, y = g(1, 2); const auto [p, q] = pair; }",
            "void f() { for (int i = 0, n = 3; i < n; ++i, --n) g(i, n); }",
            "void f() { m << 1, 2, 3, 4; }",
            "void f() { fit.c = all.bottomRightCorner<k, k>(); std::map<int, std::string> m; }",
            "enum class E { a, b = 2, c };",
            "void f() { T t{1, 2}; v = {1, 2}; return {3, 4}; }",
            "template <class A, class B> A g(B b, int c) { return h<A, B>(b, c); }",
            "S::S(int a, int b) : a_(a), b_{b} {}",
            "using T = std::pair<int, int>; friend bool operator==(S, S);",
            "void f() { x = \"a = 1, b = 2;\"; /* a = 1, b = 2; */ c = ','; } // a = 1, b = 2;",
            "auto f = [a, &b](int c, int d) { return c + d; };",
            "constexpr std::array k{1, 2}, l{3, 4};",
        ):
            self.assertEqual(found(text), [], text)

    def test_names_the_line(self):
        self.assertEqual(found('void f() {\n  g("x\\"y", 1);\n\n  a = 1, b = 2;\n}\n'), [4])


if __name__ == "__main__":
    unittest.main()
