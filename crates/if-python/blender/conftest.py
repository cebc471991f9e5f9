"""`--extension FILE.zip`: tests the packed extension, installed as Blender installs it."""

import os
import tempfile

# Before Blender starts: not into the user's own settings.
_settings = tempfile.TemporaryDirectory()
os.environ["BLENDER_USER_RESOURCES"] = _settings.name


def pytest_addoption(parser):
    parser.addoption("--extension", help="the packed extension; left out, it is not installed")
