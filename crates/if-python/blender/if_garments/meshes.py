"""Meshes of Blender as arrays in metres and y up, and back."""

from dataclasses import dataclass

import bpy
import numpy as np

#: Name of the shape key and of the modifier that hold a result.
RESULT = "Intersection-free"
#: Name of the vertex group of vertices at intersections.
INTERSECTIONS = "Intersections"

# Blender's z is up, and -y is the front: (x, z, -y) has y up, and the same orientation.
_TO_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


class MeshError(Exception):
    """An object cannot be used; the message says what to do."""


@dataclass
class Shape:
    """An object's mesh at one time."""

    name: str
    #: In the object's own space, as Blender stores them: float32, shape (n, 3).
    local: np.ndarray
    #: Indices of vertices, shape (m, 3), wound as in the scene.
    triangles: np.ndarray
    #: The polygon of each triangle.
    polygons: np.ndarray
    #: The object's space to metres with y up, shape (4, 4).
    matrix: np.ndarray

    def arrays(self):
        """Positions and triangles as the package takes them."""
        return self.outside(self.local), self.triangles

    def outside(self, local):
        """Positions in metres with y up: float32 where nothing is rounded, float64 else."""
        turn, move = self.matrix[:3, :3], self.matrix[:3, 3]
        exact = not move.any() and np.array_equal(turn, _TO_Y_UP)
        found = local.astype(np.float64) @ turn.T + move
        return found.astype(np.float32) if exact else found

    def inside(self, positions):
        """Positions in the object's own space, float64."""
        turn, move = self.matrix[:3, :3], self.matrix[:3, 3]
        shifted = np.asarray(positions, dtype=np.float64) - move
        if np.array_equal(turn, _TO_Y_UP):
            return shifted @ turn
        return np.linalg.solve(turn, shifted.T).T


def modelled(thing):
    """The mesh of an object with its shape keys, our own left out, and without modifiers."""
    mesh = thing.data
    keys = mesh.shape_keys
    if keys is None:
        return _shape(thing, mesh, _positions(mesh.vertices))
    ours = keys.key_blocks.get(RESULT)
    value = None if ours is None else ours.value
    if ours is not None:
        ours.value = 0.0
    try:
        return _shape(thing, mesh, _mix(thing))
    finally:
        if ours is not None:
            ours.value = value


def shown(thing):
    """The mesh of an object with all its shape keys, and without modifiers."""
    return _shape(thing, thing.data, _mix(thing))


def evaluated(thing, depsgraph):
    """The mesh of an object in the current frame, with its modifiers but for our own."""
    found = thing.evaluated_get(depsgraph)
    mesh = found.to_mesh()
    try:
        if len(mesh.vertices) != len(thing.data.vertices):
            raise MeshError(
                f"{thing.name}: its modifiers change the number of vertices from "
                f"{len(thing.data.vertices)} to {len(mesh.vertices)}; apply or switch off those "
                "(a point cache needs the same vertices)"
            )
        return _shape(thing, mesh, _positions(mesh.vertices), found.matrix_world)
    finally:
        found.to_mesh_clear()


def store_key(thing, before, positions):
    """Stores positions in a shape key with the value 1, and shows it."""
    mesh = thing.data
    if mesh.shape_keys is None:
        thing.shape_key_add(name="Basis", from_mix=False)
    key = mesh.shape_keys.key_blocks.get(RESULT)
    if key is None:
        key = thing.shape_key_add(name=RESULT, from_mix=False)
    key.relative_key = mesh.shape_keys.reference_key
    basis = _positions(mesh.shape_keys.reference_key.data).astype(np.float64)
    # Other keys add what they add to the basis.
    moved = before.inside(positions) - before.local
    wanted = np.where(moved == 0.0, basis, before.inside(positions) - (before.local - basis))
    key.data.foreach_set("co", wanted.astype(np.float32).ravel())
    key.slider_max = max(key.slider_max, 1.0)
    key.value = 1.0
    mesh.update()


def mark(thing, vertices):
    """Makes a vertex group of vertices at intersections; removes it if there are none."""
    group = thing.vertex_groups.get(INTERSECTIONS)
    if group is not None:
        thing.vertex_groups.remove(group)
    if len(vertices):
        group = thing.vertex_groups.new(name=INTERSECTIONS)
        group.add([int(v) for v in vertices], 1.0, "REPLACE")


def select(thing, polygons):
    """Selects these polygons of an object, and no others."""
    mesh = thing.data
    for part in (mesh.vertices, mesh.edges, mesh.polygons):
        part.foreach_set("select", np.zeros(len(part), dtype=bool))
    chosen = np.zeros(len(mesh.polygons), dtype=bool)
    chosen[polygons] = True
    mesh.polygons.foreach_set("select", chosen)
    mesh.update()


def _mix(thing):
    """Positions of an object with its shape keys."""
    if thing.data.shape_keys is None:
        return _positions(thing.data.vertices)
    shown_only = thing.show_only_shape_key
    thing.show_only_shape_key = False
    key = thing.shape_key_add(name="ifgarments", from_mix=True)
    try:
        return _positions(key.data)
    finally:
        thing.shape_key_remove(key)
        thing.show_only_shape_key = shown_only


def _positions(vertices):
    found = np.empty(3 * len(vertices), dtype=np.float32)
    vertices.foreach_get("co", found)
    return found.reshape(-1, 3)


def _shape(thing, mesh, local, matrix_world=None):
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    if count == 0:
        raise MeshError(f"{thing.name}: it has no faces")
    triangles = np.empty(3 * count, dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    polygons = np.empty(count, dtype=np.int32)
    mesh.loop_triangles.foreach_get("polygon_index", polygons)
    scene = bpy.context.scene.unit_settings
    unit = 1.0 if scene.system == "NONE" else scene.scale_length
    matrix = np.array(thing.matrix_world if matrix_world is None else matrix_world)
    matrix = matrix.astype(np.float64)
    whole = np.eye(4)
    whole[:3, :] = unit * (_TO_Y_UP @ matrix[:3, :])
    size = np.linalg.det(whole[:3, :3])
    if not np.isfinite(whole).all() or size == 0.0:
        raise MeshError(f"{thing.name}: its scale is zero or not finite")
    triangles = triangles.reshape(-1, 3)
    if size < 0.0:  # mirrored
        triangles = triangles[:, ::-1]
    return Shape(thing.name, local, np.ascontiguousarray(triangles), polygons, whole)
