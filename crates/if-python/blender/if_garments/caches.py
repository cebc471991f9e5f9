"""Point caches (PC2) of a frame range, and the modifiers that play them."""

import os
import struct

import bpy
import numpy as np

from .meshes import RESULT, MeshError

_HEADER = struct.Struct("<12siiffi")


class Cache:
    """A PC2 file that is written frame by frame, and takes its place when it is whole."""

    def __init__(self, path, vertices, start):
        self.path = path
        self.start = start
        self._vertices = vertices
        self._frames = 0
        self._file = open(path + ".part", "wb")
        self._head()

    def add(self, local):
        """Adds a frame: positions in the object's own space."""
        self._file.write(np.ascontiguousarray(local, dtype="<f4").tobytes())
        self._frames += 1

    def finish(self):
        self._file.seek(0)
        self._head()
        self._file.close()
        os.replace(self.path + ".part", self.path)

    def drop(self):
        self._file.close()
        if os.path.exists(self.path + ".part"):
            os.remove(self.path + ".part")

    def _head(self):
        head = (b"POINTCACHE2\0", 1, self._vertices, float(self.start), 1.0, self._frames)
        self._file.write(_HEADER.pack(*head))


def folder(setting):
    """The folder of the caches, which is made."""
    if setting.startswith("//") and not bpy.data.filepath:
        raise MeshError("save the Blender file first: point caches are written beside it")
    path = bpy.path.abspath(setting)
    os.makedirs(path, exist_ok=True)
    return path


def paths(things, path):
    """A file for each object."""
    found = [os.path.join(path, bpy.path.clean_name(thing.name) + ".pc2") for thing in things]
    for k, file in enumerate(found):
        if file.lower() in [other.lower() for other in found[:k]]:  # as some file systems
            raise MeshError(f"{things[k].name}: another garment has the file {file}; rename one")
    return found


def switch(things, on):
    """Switches our modifiers on or off."""
    for thing in things:
        modifier = thing.modifiers.get(RESULT)
        if modifier is not None:
            modifier.show_viewport = on


def play(thing, cache):
    """Plays a cache by the last modifier of an object."""
    modifier = thing.modifiers.get(RESULT)
    if modifier is None:
        modifier = thing.modifiers.new(RESULT, "MESH_CACHE")
    thing.modifiers.move(thing.modifiers.find(RESULT), len(thing.modifiers) - 1)
    modifier.cache_format = "PC2"
    modifier.filepath = cache.path
    modifier.deform_mode = "OVERWRITE"
    modifier.interpolation = "NONE"  # between two frames nothing is proven
    modifier.frame_start = cache.start
    modifier.show_viewport = modifier.show_render = True
