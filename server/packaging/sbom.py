#!/usr/bin/env python3
"""SPDX 2.3 of what the executable needs and contains, and the licence texts of what it contains.

Needed: the libraries it names (readelf -d), by the Debian package that has each (dpkg -S).
Contained: development packages of .ci/packages of which it names no library (headers, archives), and the npm packages
of the dashboard (web/package-lock.json, those that are not for development).
"""

import argparse
import datetime
import json
import pathlib
import re
import subprocess
import sys

FOR_TESTS = {"libgtest-dev", "libgmock-dev"}


def output(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def needed_libraries(binary):
    names = re.findall(r"\(NEEDED\).*\[(.+)\]", output("readelf", "-d", binary))
    if "AArch64" in output("readelf", "-h", binary):
        return {name: of_this_machine(name) for name in names}
    places = dict(re.findall(r"^\s*(\S+) => (\S+)", output("ldd", binary), re.M))
    # The loader names itself by its path.
    for path in re.findall(r"^\s*(/\S+) \(0x", output("ldd", binary), re.M):
        places[pathlib.Path(path).name] = path
    return {name: places[name] for name in names}


def of_this_machine(name):
    """For another architecture: this machine's library of that name, which the same release of Debian has in the same package."""
    if name.startswith("ld-linux"):
        name = "libc.so.6"
    found = re.search(rf"^\s*{re.escape(name)} \(.*\) => (\S+)", output("/sbin/ldconfig", "-p"), re.M)
    return found.group(1) if found else sys.exit(f"sbom: this machine has no {name}")


def owner(path):
    """The Debian package of a file; Debian 12 has /lib in /usr/lib, and files under either name."""
    real = str(pathlib.Path(path).resolve())
    for candidate in (real, real.removeprefix("/usr"), "/usr" + real, path):
        found = subprocess.run(["dpkg", "-S", candidate], capture_output=True, text=True)
        if found.returncode == 0:
            return found.stdout.split(":")[0].split(",")[0]
    sys.exit(f"sbom: no Debian package has {path}")


def unpacked(source, package):
    """A development package that ./dev unpacked below build, where another one that is installed conflicts with it."""
    for deb in sorted((source / "build").glob(f"*/deb/{package}_*.deb")):
        return deb
    sys.exit(f"sbom: {package} of .ci/packages is not installed")


def installed(package):
    return subprocess.run(["dpkg", "-L", package], capture_output=True).returncode == 0


def contained_version(source, package):
    if installed(package):
        return version_of(package)
    return output("dpkg-deb", "--field", str(unpacked(source, package)), "Version").strip()


def version_of(package):
    return output("dpkg-query", "-W", "-f=${Version}\n", package).splitlines()[0]


def listed_for_development(source):
    out = []
    for line in (source / ".ci/packages").read_text().splitlines():
        words = line.split("#")[0].split()
        if len(words) == 1 and words[0].endswith("-dev") and words[0] not in FOR_TESTS:
            out.append(words[0])
    return out


def contained_packages(source, libraries):
    """Those of which the executable names no library. The link without version is the development package's."""
    sonames = set(libraries)
    out = []
    for package in listed_for_development(source):
        files = output("dpkg", "-L", package) if installed(package) else ""  # an unpacked one has headers alone
        links = [pathlib.Path(f) for f in files.splitlines() if f.endswith(".so")]
        if not any(link.resolve().name in {pathlib.Path(libraries[s]).resolve().name for s in sonames} for link in links):
            out.append(package)
    return out


def copyright_text(source, package):
    root = pathlib.Path("/") if installed(package) else unpacked(source, package).parent.parent
    return (root / f"usr/share/doc/{package}/copyright").read_text(errors="replace")


def npm_packages(source):
    lock = json.loads((source / "web/package-lock.json").read_text())
    for place, entry in sorted(lock["packages"].items()):
        if place and not entry.get("dev"):
            yield place, place.split("node_modules/")[-1], entry


def npm_licence_text(source, place, name, entry):
    folder = source / "web" / place
    texts = [p for p in sorted(folder.glob("*")) if re.match(r"(?i)(licen[cs]e|copying|notice)", p.name) and p.is_file()]
    if texts:
        return "\n".join(p.read_text(errors="replace") for p in texts)
    about = json.loads((folder / "package.json").read_text())
    author = about.get("author", "")
    author = author.get("name", "") if isinstance(author, dict) else author
    return f"Licence {entry['license']}; its package has no text of it. Author: {author or name}"


def spdx_id(*words):
    return "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]+", "-", "-".join(words)).strip("-")


def package(identifier, name, version, licence, location, reference):
    return {
        "SPDXID": identifier,
        "name": name,
        "versionInfo": version,
        "downloadLocation": location,
        "filesAnalyzed": False,
        "licenseConcluded": "NOASSERTION",
        "licenseDeclared": licence,
        "copyrightText": "NOASSERTION",
        "externalRefs": [
            {"referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl", "referenceLocator": reference}
        ],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("binary", "source", "version", "epoch", "sbom", "licences"):
        parser.add_argument("--" + name, required=True)
    given = parser.parse_args()
    source = pathlib.Path(given.source)
    libraries = needed_libraries(given.binary)
    own = package("SPDXRef-anchord", "anchord", given.version, "Apache-2.0", "NOASSERTION", f"pkg:deb/anchord@{given.version}")
    packages, relations, texts = [own], [], []

    def add(entry, relation):
        if any(one["SPDXID"] == entry["SPDXID"] for one in packages):
            return
        packages.append(entry)
        relations.append(
            {"spdxElementId": own["SPDXID"], "relationshipType": relation, "relatedSpdxElement": entry["SPDXID"]}
        )

    by_package = {}
    for soname, path in sorted(libraries.items()):
        by_package.setdefault(owner(path), []).append(soname)
    for name, sonames in sorted(by_package.items()):
        version = version_of(name)
        entry = package(spdx_id("deb", name), name, version, "NOASSERTION", "NOASSERTION", f"pkg:deb/debian/{name}@{version}")
        entry["comment"] = "linked: " + " ".join(sonames)
        entry["licenseComments"] = f"/usr/share/doc/{name}/copyright of the package"
        add(entry, "DYNAMIC_LINK")
    for name in contained_packages(source, libraries):
        version = contained_version(source, name)
        entry = package(spdx_id("deb", name), name, version, "NOASSERTION", "NOASSERTION", f"pkg:deb/debian/{name}@{version}")
        entry["licenseComments"] = "text in licences.txt"
        add(entry, "CONTAINS")
        texts.append((f"{name} {version} (in the executable)", copyright_text(source, name)))
    for place, name, entry in npm_packages(source):
        url = entry.get("resolved", "")
        purl = f"pkg:npm/{name.replace('@', '%40')}@{entry['version']}"
        # Where it came from is the registry of whoever built it; its name there is the same everywhere.
        location = f"https://registry.npmjs.org/{name}/-/{url.rsplit('/', 1)[-1]}" if url else "NOASSERTION"
        add(package(spdx_id("npm", name, entry["version"]), name, entry["version"], entry["license"], location, purl), "CONTAINS")
        texts.append((f"{name} {entry['version']} (in the dashboard)", npm_licence_text(source, place, name, entry)))

    created = datetime.datetime.fromtimestamp(int(given.epoch), datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    document = {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"anchord-{given.version}",
        "documentNamespace": f"urn:anchord:spdx:{given.version}:{given.epoch}",
        "creationInfo": {"created": created, "creators": ["Tool: anchord-sbom"]},
        "documentDescribes": [own["SPDXID"]],
        "packages": packages,
        "relationships": [
            {"spdxElementId": "SPDXRef-DOCUMENT", "relationshipType": "DESCRIBES", "relatedSpdxElement": own["SPDXID"]},
            *relations,
        ],
    }
    pathlib.Path(given.sbom).write_text(json.dumps(document, indent=1) + "\n")
    rule = "=" * 100
    pathlib.Path(given.licences).write_text(
        "What the executable anchord contains of others, and under which terms.\n\n"
        + "\n".join(f"{rule}\n{title}\n{rule}\n{text.rstrip()}\n" for title, text in texts)
    )


main()
