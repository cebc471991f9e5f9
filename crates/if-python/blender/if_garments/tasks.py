"""What the buttons do, as generators.

They read and write the scene, which only the main thread may, and yield the calls of the package
that take long: functions of a progress callback, whose results they are sent.
"""

import contextlib
from dataclasses import replace

import ifgarments
import numpy as np

from . import caches, meshes
from .meshes import MeshError

#: How often a result is resolved again that rounding to Blender's float32 made intersect.
_ROUNDINGS = 3
_ROUNDED = (
    "after rounding to Blender's single precision; apply the objects' transforms (Ctrl A) and "
    "resolve again"
)


class Unfinished(Exception):
    """What was reached is stored and marked, and is not what was asked for."""


def check(context):
    """Counts intersections and marks them."""
    body, garments = _things(context)
    if context.scene.if_garments.what == "FRAMES":
        depsgraph = context.evaluated_depsgraph_get()
        shapes = [meshes.evaluated(thing, depsgraph) for thing in (body, *garments)]
    else:
        shapes = [meshes.shown(thing) for thing in (body, *garments)]
    arrays, layers = _layers(shapes)
    found = yield lambda _: ifgarments.verify(arrays, layers)
    count = yield from _marked(context, (body, *garments), shapes, found.state)
    return f"{found.state}: {count}"


def resolve(context):
    """Resolves what the settings name."""
    if context.scene.if_garments.what == "FRAMES":
        return (yield from _resolve_frames(context))
    return (yield from _resolve_modelled(context))


def _resolve_modelled(context):
    body, garments = _things(context)
    before = [meshes.modelled(thing) for thing in garments]
    fixed = meshes.modelled(body)

    def store(positions):
        for thing, shape, found in zip(garments, before, positions):
            meshes.store_key(thing, shape, found)
        return [meshes.shown(thing) for thing in garments]

    stored, proven, error = yield from _settled(context, fixed, before, store)
    count = yield from _marked(context, (body, *garments), [fixed, *stored], proven.state)
    if error is not None:
        raise Unfinished(str(error)) from error
    if not _is_reached(context, proven):
        raise Unfinished(f"{proven.state} {_ROUNDED} ({count})")
    return f"{proven.state}: shape keys “{meshes.RESULT}”"


def _resolve_frames(context):
    scene = context.scene
    body, garments = _things(context)
    files = caches.paths(garments, caches.folder(scene.if_garments.caches))
    first, last, now = scene.frame_start, scene.frame_end, scene.frame_current
    written = [
        caches.Cache(path, len(thing.data.vertices), first)
        for path, thing in zip(files, garments)
    ]
    states = set()
    with contextlib.ExitStack() as cleanup:
        cleanup.callback(scene.frame_set, now)
        cleanup.callback(caches.switch, garments, True)
        for cache in written:
            cleanup.callback(cache.drop)
        caches.switch(garments, False)
        for frame in range(first, last + 1):
            scene.frame_set(frame)
            depsgraph = context.evaluated_depsgraph_get()
            fixed, *before = [meshes.evaluated(thing, depsgraph) for thing in (body, *garments)]

            def store(positions, before=before):
                return [
                    replace(shape, local=shape.inside(found).astype(np.float32))
                    for shape, found in zip(before, positions)
                ]

            item = f"frame {frame}"
            stored, proven, error = yield from _settled(context, fixed, before, store, item)
            if error is not None:
                raise MeshError(f"{item}: {error}") from error
            if not _is_reached(context, proven):
                raise MeshError(f"{item}: {proven.state} {_ROUNDED}")
            states.add(proven.state)
            for cache, shape in zip(written, stored):
                cache.add(shape.local)
        for cache in written:
            cache.finish()
    for thing, cache in zip(garments, written):
        caches.play(thing, cache)
    state = "clean everywhere" if states == {"clean everywhere"} else "clean between layers"
    scene.if_garments.state, scene.if_garments.pairs = state, ""
    return f"{state}: {last + 1 - first} frames in modifiers “{meshes.RESULT}”"


def _settled(context, fixed, before, store, item=""):
    """Resolves garments, stores them, and verifies what is stored, which Blender rounds.

    `store` takes positions and returns the shapes that are stored. Returns these, their
    verification, and an error if intersections remain.
    """
    arrays, layers = _layers([fixed, *before])
    for _ in range(_ROUNDINGS):
        positions, error = yield _call(context, arrays, layers, item)
        stored = store(positions)
        arrays, layers = _layers([fixed, *stored])
        proven = yield lambda _: ifgarments.verify(arrays, layers)
        if error is not None or _is_reached(context, proven):
            break
    return stored, proven, error


def _things(context):
    """The body and the garments."""
    settings = context.scene.if_garments
    garments = [item.mesh for item in settings.garments if item.mesh is not None]
    if settings.body is None:
        raise MeshError("choose the body")
    if not garments:
        raise MeshError("add garments, inner to outer")
    for k, thing in enumerate(garments):
        if thing == settings.body:
            raise MeshError(f"{thing.name}: it is the body, and cannot be a garment, too")
        if thing in garments[:k]:
            raise MeshError(f"{thing.name}: it is in the list twice")
    for thing in (settings.body, *garments):
        if thing.mode == "EDIT":
            raise MeshError(f"{thing.name}: leave edit mode first")
    return settings.body, garments


def _layers(shapes):
    """The body's arrays, and those of garments by name."""
    fixed, *garments = shapes
    return fixed.arrays(), {shape.name: shape.arrays() for shape in garments}


def _call(context, body, layers, item=""):
    """The call of `resolve`: its positions, and an error if intersections remain."""
    settings, unit = context.scene.if_garments, context.scene.unit_settings
    scale = 1.0 if unit.system == "NONE" else unit.scale_length
    clearance, strict = settings.clearance * scale, settings.strict

    def work(progress):
        def listen(report):
            progress(f"{item} {report.item} {report.stage}".strip())

        error = None
        try:
            found = ifgarments.resolve(
                body, layers, clearance=clearance, strict=strict, progress=listen
            )
        except ifgarments.IntersectionsRemain as remain:
            found, error = remain.partial, remain
        return [vertices for vertices, _ in found.layers.values()], error

    return work


def _is_reached(context, proven):
    return proven.state == "clean everywhere" or (
        proven.is_clean and not context.scene.if_garments.strict
    )


def _marked(context, things, shapes, state):
    """Marks intersections in vertex groups and selected faces, says in the panel what they are,
    and returns their number in words.
    """
    arrays, layers = _layers(shapes)
    found = yield lambda _: ifgarments.intersections(arrays, layers)
    names = ["body", *(shape.name for shape in shapes[1:])]
    triangles = {name: [] for name in names}
    for pair in found:
        triangles[pair.inner].append(pair.triangles[:, 0])
        triangles[pair.outer].append(pair.triangles[:, 1])
    for thing, shape, name in zip(things, shapes, names):
        at = np.unique(np.concatenate([np.zeros(0, np.int64), *triangles[name]]))
        meshes.mark(thing, np.unique(shape.triangles[at]))
        meshes.select(thing, np.unique(shape.polygons[at]))
    settings = context.scene.if_garments
    settings.state = state
    settings.pairs = "\n".join(
        f"{len(p.triangles):,} of {p.outer} "
        + ("with itself" if p.inner == p.outer else f"and {p.inner}")
        for p in found
    )
    count = sum(len(p.triangles) for p in found)
    return f"{count:,} intersecting pairs of triangles" if count else "no intersections"
