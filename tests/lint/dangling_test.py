"""dangling.py finds the loops that read what is gone, and lets the others be."""
import unittest

from dangling import wrong


class Dangling(unittest.TestCase):
    def test_finds_a_part_of_what_a_call_returned(self):
        for over in ("f().value()", "store.devices(id(1)).value()", 'procedure()["anchors"]', "Json::parse(x).items()", "list(a, {b}).at(0)"):
            self.assertEqual([line for line, _ in wrong(f"\nfor (const auto& x : {over}) g(x);")], [2], over)

    def test_lets_what_lives_be(self):
        for over in (
            "f()",
            "f().rows",
            "found.value()",
            "found.value().rows",
            'document.at("paths").items()',
            "engine.state().anchors",
            "page.back()[column]",
            "Json(list()[0])",
            "(*rows)[0]",
            "{f().value(), g()}",
            "std::views::zip(a, b)",
        ):
            self.assertEqual(list(wrong(f"for (const auto& x : {over}) g(x);")), [], over)
        self.assertEqual(list(wrong("for (int i = 0; i < f().at(0); ++i) g(i);")), [])


if __name__ == "__main__":
    unittest.main()
