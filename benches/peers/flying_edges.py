"""Marching 256³ nodes that were sampled beforehand: VTK's FlyingEdges3D and ours, on the same file, in turns.

    flying_edges.py EXTRACTION [NODES [THREADS]]

EXTRACTION is the built program `extraction` of if-benches (release). Prints the median and the least of seven runs of each, the
number of triangles, and exit status 1 where ours is slower by its median. VTK interpolates in single precision into one array of
points and one of triangles; ours in double precision, and the mesh is checked. Needs: pip install vtk numpy
"""
import os
import subprocess
import sys
import tempfile
import time

import numpy as np

nodes = int(sys.argv[2]) if len(sys.argv) > 2 else 256
threads = sys.argv[3] if len(sys.argv) > 3 else "2"
os.environ["VTK_SMP_MAX_THREADS"] = threads
import vtk
from vtk.util import numpy_support

vtk.vtkSMPTools.Initialize(int(threads))
x = (np.arange(nodes, dtype=np.float32) - 0.5 * (nodes - 1)) / np.float32(nodes)
values = np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2) - np.float32(0.375)
image = vtk.vtkImageData()
image.SetDimensions(nodes, nodes, nodes)
image.GetPointData().SetScalars(numpy_support.numpy_to_vtk(values.ravel(), deep=False))


def vtk_runs():
    times, cells = [], 0
    for _ in range(7):
        filter = vtk.vtkFlyingEdges3D()
        filter.SetInputData(image)
        filter.SetValue(0, 0.0)
        filter.ComputeNormalsOff()
        filter.ComputeGradientsOff()
        filter.ComputeScalarsOff()
        start = time.perf_counter()
        filter.Update()
        times.append(1e3 * (time.perf_counter() - start))
        cells = filter.GetOutput().GetNumberOfPolys()
    return sorted(times), cells


with tempfile.TemporaryDirectory() as folder:
    path = os.path.join(folder, "grid.f32")
    values.astype("<f4").tofile(path)
    print(f"VTK {vtk.vtkVersion.GetVTKVersion()}, backend {vtk.vtkSMPTools.GetBackend()}, {vtk.vtkSMPTools.GetEstimatedNumberOfThreads()} threads; load {os.getloadavg()[0]:.1f}")
    slower = 0
    for turn in range(3):
        times, cells = vtk_runs()
        ours = subprocess.run([sys.argv[1], "grid", path], env={**os.environ, "RAYON_NUM_THREADS": threads}, capture_output=True, text=True, check=True).stdout
        median = float(ours.split("median ")[1].split(" ms")[0])
        print(f"VTK {cells} triangles: median {times[3]:.1f} ms, least {times[0]:.1f} ms | ours {ours.strip()} | ratio {median / times[3]:.2f}")
        slower += median > times[3]
sys.exit(slower > 1)
