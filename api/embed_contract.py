#!/usr/bin/env python3
"""Writes a C++ file with the YAML contract documents as compact JSON.

usage: embed_contract.py OPENAPI_YAML ASYNCAPI_YAML OUT_CPP
"""
import json
import sys

import yaml


class Loader(yaml.SafeLoader):
    """YAML 1.2 core schema as far as we need it: dates stay text, as they are in the examples."""


Loader.yaml_implicit_resolvers = {
    first: [(tag, regexp) for tag, regexp in resolvers if tag != "tag:yaml.org,2002:timestamp"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def literal(text):
    # A string literal may have 64 KiB; adjacent ones are joined by the compiler but limited as well, so: bytes.
    data = text.encode("utf-8")
    rows = [",".join(str(byte) for byte in data[i:i + 32]) for i in range(0, len(data), 32)]
    return ",\n".join(rows)


def main():
    out = ["#include \"api/kit/contract.hpp\"\n\nnamespace anchord::api {\nnamespace {\n"]
    for name, path in (("openapi", sys.argv[1]), ("asyncapi", sys.argv[2])):
        with open(path, encoding="utf-8") as file:
            text = json.dumps(yaml.load(file, Loader), ensure_ascii=False, separators=(",", ":"))
        out.append(f"constexpr unsigned char k_{name}[] = {{\n{literal(text)}}};\n")
    out.append("}  // namespace\n\n")
    for name in ("openapi", "asyncapi"):
        out.append(f"std::string_view {name}_json() {{\n"
                   f"  return {{reinterpret_cast<const char*>(k_{name}), sizeof k_{name}}};\n}}\n")
    out.append("\n}  // namespace anchord::api\n")
    with open(sys.argv[3], "w", encoding="utf-8") as file:
        file.write("".join(out))


if __name__ == "__main__":
    main()
