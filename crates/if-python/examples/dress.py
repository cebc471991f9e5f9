"""From trimesh meshes to a picture: python dress.py [out.png]"""

import sys

import ifgarments
import trimesh

body, layers = ifgarments.demo_scene(resolution=0.7)
garments = {name: trimesh.Trimesh(*mesh, process=False) for name, mesh in layers.items()}
resolved = ifgarments.resolve(trimesh.Trimesh(*body, process=False), garments)
ifgarments.picture(body, resolved.layers, sys.argv[1] if len(sys.argv) > 1 else "dressed.png")
print(resolved.state, {name: len(mesh.vertices) for name, mesh in resolved.layers.items()})
