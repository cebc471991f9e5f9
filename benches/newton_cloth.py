"""Garments as cloth around a fixed body in Newton's vertex block descent (`SolverVBD`), for the programs beside this file.

Material, iterations and buffers are those of Newton's own example cloth_twist, and so are both contact distances: contact forces begin at
`margin`, and pairs are collected up to `margin + gap`. All layers are one self-contact system. The rest shape is the mesh as it starts. The body, as far as it lies
within 10 cm of a garment, is either triangles of that system that do not move (`particles`), or a collision shape with contacts of whole triangles and
motion bounds against it (`shape`: `enable_rigid_soft_full_surface_contact` and `rigid_soft_enable_dat`).
"""
import sys, time
from typing import NamedTuple
import numpy as np

try:
    import igl
    import newton
    import warp as wp
except ImportError as missing:
    sys.exit(f"{missing}. Install it: pip install newton warp-lang libigl")


class Settings(NamedTuple):
    frames: int = 100
    rate: float = 120.0  # frames a second
    substeps: int = 1  # of a frame; the example has 600 substeps a second
    iterations: int = 4
    margin: float = 2e-3  # metres
    gap: float = 1.5e-3  # metres
    gravity: float = 9.81
    density: float = 0.2  # kg/m²
    stiffness: float = 1e3  # of triangles and of contacts
    bending: float = 1e-3
    body: str = "particles"


class Run(NamedTuple):
    garments: list
    seconds: float  # of processor, in the frames only; Newton uses one thread there
    speed: float  # largest speed at the end, m/s
    overflow: bool  # a contact buffer was too small in the last step


def near(body, garments):
    """The triangles of the body of which a corner is within 10 cm of a garment."""
    starts = np.cumsum([0] + [len(vertices) for vertices, _ in garments])
    triangles = np.concatenate([t + start for (_, t), start in zip(garments, starts)])
    squared = igl.point_mesh_squared_distance(body[0], np.concatenate([v for v, _ in garments]), triangles)[0]
    kept = body[1][(squared[body[1]] < 0.01).any(1)]
    used, kept = np.unique(kept, return_inverse=True)
    return body[0][used], kept.reshape(-1, 3)


def simulate(body, garments, settings=Settings(), each_frame=None):
    """Positions after the frames. `each_frame(number, meshes)`, if given, is called after each."""
    s = settings
    if min(s.frames, s.substeps, s.iterations) < 1:
        raise ValueError(f"frames, substeps and iterations must be at least 1: {s}")
    body = near(body, garments)
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -s.gravity, 0.0))
    common = dict(pos=wp.vec3(), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(), particle_radius=s.margin)
    starts = [0]
    for vertices, triangles in garments:
        builder.add_cloth_mesh(vertices=vertices.tolist(), indices=triangles.ravel().tolist(), density=s.density, tri_ke=s.stiffness,
                               tri_ka=s.stiffness, tri_kd=2e-4, edge_ke=s.bending, edge_kd=1e-2, **common)
        starts.append(starts[-1] + len(vertices))
    if s.body == "particles":
        builder.add_cloth_mesh(vertices=body[0].tolist(), indices=body[1].ravel().tolist(), density=s.density, **common)
    else:
        config = newton.ModelBuilder.ShapeConfig(ke=s.stiffness, kd=1e-1, mu=0.2)
        builder.add_shape_mesh(-1, mesh=newton.Mesh(body[0].astype(np.float32), body[1].ravel().astype(np.int32)), cfg=config)
    builder.color()
    model = builder.finalize()
    model.soft_contact_ke, model.soft_contact_kd, model.soft_contact_mu = s.stiffness, 1e-1, 0.2
    flags = model.particle_flags.numpy()
    flags[starts[-1]:] &= ~int(newton.ParticleFlags.ACTIVE)
    model.particle_flags = wp.array(flags)
    more = {}
    if s.body == "shape":
        pipeline = newton.CollisionPipeline(model, soft_contact_gap=s.gap, enable_rigid_soft_full_surface_contact=True)
        more = dict(collision_pipeline=pipeline, rigid_soft_enable_dat=True)
    solver = newton.solvers.SolverVBD(model, iterations=s.iterations, particle_enable_self_contact=True, particle_self_contact_margin=s.margin,
                                      particle_self_contact_gap=s.gap, particle_vertex_contact_buffer_size=64, particle_edge_contact_buffer_size=128, **more)
    state, next_state, control = model.state(), model.state(), model.control()

    def meshes():
        positions = state.particle_q.numpy().astype(float)
        return [(positions[a:b], triangles) for a, b, (_, triangles) in zip(starts, starts[1:], garments)]

    begin, seconds = time.process_time(), 0.0
    for frame in range(s.frames):
        solver.rebuild_bvh(state)
        for _ in range(s.substeps):
            state.clear_forces()
            solver.step(state, next_state, control, None, 1 / (s.rate * s.substeps))
            state, next_state = next_state, state
        if each_frame:
            wp.synchronize()
            seconds += time.process_time() - begin
            each_frame(frame + 1, meshes())
            begin = time.process_time()
    wp.synchronize()
    seconds += time.process_time() - begin
    speed = float(np.linalg.norm(state.particle_qd.numpy()[:starts[-1]], axis=1).max())
    detector = getattr(solver, "trimesh_collision_detector", None)
    overflow = detector is not None and bool(detector.resize_flags.numpy().any())
    return Run(meshes(), seconds, speed, overflow)
