"""Packs the Blender extension: the add-on with wheels of ifgarments.

    python package.py WHEEL [WHEEL ...] OUT.zip

One wheel for each system that the extension is for.
"""

import json
import pathlib
import sys
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
# Platforms as Blender names them, by how the names that wheels have for them begin and end.
PLATFORMS = {
    ("manylinux", "x86_64"): "linux-x64",
    ("linux", "x86_64"): "linux-x64",
    ("win", "amd64"): "windows-x64",
    ("win", "arm64"): "windows-arm64",
    ("macosx", "x86_64"): "macos-x64",
    ("macosx", "arm64"): "macos-arm64",
}

MANIFEST = """\
schema_version = "1.0.0"
id = "if_garments"
name = "Intersection-free garments"
tagline = "Layered clothes without intersections, proven"
version = {version}
type = "add-on"
maintainer = "The if-garments authors"
license = ["SPDX:MIT", "SPDX:Apache-2.0"]
tags = ["Mesh", "Modeling", "Animation"]
blender_version_min = "4.2.0"
platforms = {platforms}
wheels = {wheels}

[permissions]
files = "Writes point caches of frame ranges"
"""


def main(arguments):
    if len(arguments) < 2 or not all(a.endswith(".whl") for a in arguments[:-1]):
        sys.exit(__doc__)
    *wheels, out = map(pathlib.Path, arguments)
    # ifgarments-VERSION-PYTHON-ABI-PLATFORM.whl
    parts = [wheel.stem.split("-") for wheel in wheels]
    platforms = {
        name
        for p in parts
        for (start, end), name in PLATFORMS.items()
        if p[-1].startswith(start) and p[-1].endswith(end)
    }
    if len(platforms) != len(wheels):
        sys.exit(f"wheels must be of different systems among {sorted(set(PLATFORMS.values()))}")
    manifest = MANIFEST.format(
        version=json.dumps(parts[0][1]),
        platforms=json.dumps(sorted(platforms)),
        wheels=json.dumps([f"./wheels/{wheel.name}" for wheel in wheels]),
    )
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("blender_manifest.toml", manifest)
        for file in sorted((HERE / "if_garments").glob("*.py")):
            archive.write(file, file.name)
        for wheel in wheels:
            archive.write(wheel, f"wheels/{wheel.name}", zipfile.ZIP_STORED)


main(sys.argv[1:])
