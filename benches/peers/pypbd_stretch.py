"""Time of one PositionBasedDynamics visit of a distance constraint, on one thread.

The same 100 x 100 cloth as `cargo bench -p if-benches --bench stretch` (29,601 edges, 1 % stretched,
noise of 2 mm). A step also predicts, updates velocities and so on: the time of a visit is the slope
between 10 and 60 iterations a step; that of a whole step of one iteration stands beside it. It prints the median and the fastest of 15 runs of each, for
the plain and the XPBD constraint, after a check that the iterations did relax the cloth.

    pip install pyPBD numpy
    OMP_NUM_THREADS=1 python benches/peers/pypbd_stretch.py
"""

import os
import statistics
import time

os.environ["OMP_NUM_THREADS"] = "1"
import numpy as np  # noqa: E402
import pypbd as pbd  # noqa: E402

N, FEW, MANY, RUNS = 100, 10, 60, 15


def cloth():
    k = np.arange(N * N)
    rest = np.stack([(k % N) * 0.01, (k // N) * 0.01, 0.0 * k], axis=1)
    noise = 0.002 * np.stack([np.sin(12.9 * k), np.sin(78.2 * k), np.sin(37.7 * k)], axis=1)
    start = rest * [1.01, 1.01, 1.0] + noise
    edges = set()
    for j in range(N - 1):
        for i in range(N - 1):
            v = j * N + i
            for tri in ((v, v + 1, v + N + 1), (v, v + N + 1, v + N)):
                for a, b in zip(tri, tri[1:] + tri[:1]):
                    edges.add((min(a, b), max(a, b)))
    return rest, start, sorted(edges)


def build(xpbd):
    rest, start, edges = cloth()
    sim = pbd.Simulation.getCurrent()
    sim.initDefault()
    model = sim.getModel()
    faces = []
    for j in range(N - 1):
        for i in range(N - 1):
            v = j * N + i
            faces += [v, v + 1, v + N + 1, v, v + N + 1, v + N]
    model.addTriangleModel(rest, faces)
    particles = model.getParticles()
    for k in range(N * N):
        particles.setMass(k, 1.0)
    for a, b in edges:
        # XPBD: the stiffness 1/beta for the paper's beta of 1e-5.
        ok = model.addDistanceConstraint_XPBD(a, b, 1e5) if xpbd else model.addDistanceConstraint(a, b, 1.0)
        assert ok
    model.initConstraintGroups()
    return sim, model, particles, start, edges


def measure(xpbd):
    sim, model, particles, start, edges = build(xpbd)
    assert len(edges) == 29601 and len(model.getConstraints()) == len(edges)
    pbd.TimeManager.getCurrent().setTimeStepSize(1e-3)
    step = sim.getTimeStep()
    step.setValueUInt(pbd.TimeStepController.NUM_SUB_STEPS, 1)
    ends = np.array(edges)
    rest = np.linalg.norm(cloth()[0][ends[:, 0]] - cloth()[0][ends[:, 1]], axis=1)

    def run(iterations):
        step.setValueUInt(pbd.TimeStepController.MAX_ITERATIONS, iterations)
        for k in range(N * N):
            particles.setPosition(k, start[k])
            particles.setVelocity(k, np.zeros(3))
        begin = time.perf_counter()
        step.step(model)
        took = time.perf_counter() - begin
        p = np.array([particles.getPosition(k) for k in range(N * N)])
        length = np.linalg.norm(p[ends[:, 0]] - p[ends[:, 1]], axis=1)
        return took, float(np.sqrt(np.mean((length - rest) ** 2)))

    before = float(np.sqrt(np.mean((np.linalg.norm(start[ends[:, 0]] - start[ends[:, 1]], axis=1) - rest) ** 2)))
    single = min(run(1)[0] for _ in range(RUNS)) / len(edges) * 1e9
    few = [run(FEW) for _ in range(RUNS)]
    many = [run(MANY) for _ in range(RUNS)]
    assert many[0][1] < (0.8 if xpbd else 0.2) * before, f"not relaxed: {many[0][1]} of {before}"
    visits = (MANY - FEW) * len(edges)
    median = (statistics.median(t for t, _ in many) - statistics.median(t for t, _ in few)) / visits
    fastest = (min(t for t, _ in many) - min(t for t, _ in few)) / visits
    return median * 1e9, fastest * 1e9, single, before, many[0][1]


if __name__ == "__main__":
    for name, xpbd in (("DistanceConstraint", False), ("DistanceConstraint_XPBD", True)):
        median, fastest, single, before, after = measure(xpbd)
        print(f"{name}: median {median:.1f} ns, fastest {fastest:.1f} ns a visit; step of one: {single:.1f} ns (rms {before:.2e} -> {after:.2e} m)")
