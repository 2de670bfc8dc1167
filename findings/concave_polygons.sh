#!/usr/bin/env bash
# MeshLab (pymeshlab 2025.7.post1) and trimesh 5.2.0, reading one concave polygon.
#
# Guess: a tool that cuts concave polygons into triangles rightly does so in every format; no format of the three
# limits polygons to convex ones.
# What happens: an L of area 3, begun at a corner from which a fan leaves it, has area 3 for MeshLab in OBJ and
# OFF, and 4 in PLY, without a word. trimesh makes fans: 4 in all three.
# Why it matters: n-gons of CAD programs and of Blender are concave as often as not. A fan covers what is not
# there, which changes silhouettes, depth and area, so files that went through such a tool as PLY are spoilt, and
# "compare with trimesh" is no check of a reader.
set -eu
cd "$(mktemp -d)"
python3 -m venv v
v/bin/pip install --quiet pymeshlab==2025.7.post1 trimesh==5.2.0 numpy==2.4.6
cat > run.py <<'PY'
import sys
import numpy as np
import pymeshlab
import trimesh

corners = [(2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0), (0, 0, 0), (2, 0, 0)]
rows = "".join("%g %g %g\n" % p for p in corners)
head = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
open("l.ply", "w").write(head + rows + "6 0 1 2 3 4 5\n")
open("l.off", "w").write("OFF\n6 1 0\n" + rows + "6 0 1 2 3 4 5\n")
open("l.obj", "w").write("".join("v %g %g %g\n" % p for p in corners) + "f 1 2 3 4 5 6\n")


def area(vertices, faces):
    a, b, c = (np.asarray(vertices, float)[np.asarray(faces)[:, k]] for k in range(3))
    return round(float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2), 6)


def meshlab(file):
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(file)
    mesh = meshes.current_mesh()
    return area(mesh.vertex_matrix(), mesh.face_matrix())


def by_trimesh(file):
    mesh = trimesh.load(file, force="mesh", process=False)
    return area(mesh.vertices, mesh.faces)


files = ("l.obj", "l.off", "l.ply")
seen = {name: [read(f) for f in files] for name, read in (("MeshLab", meshlab), ("trimesh", by_trimesh))}
print("pymeshlab 2025.7.post1, trimesh", trimesh.__version__)
print("an L of area 3, as OBJ, OFF, PLY:", seen)
sys.exit(seen != {"MeshLab": [3, 3, 4], "trimesh": [4, 4, 4]})
PY
v/bin/python run.py
