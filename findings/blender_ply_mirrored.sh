#!/usr/bin/env bash
# Blender (bpy 5.0.1), export of a mirrored object as PLY.
#
# Guess: an object with a scale of (-1, 1, 1), which Blender draws with its outside outwards, is outside
# outwards in every file that Blender writes with the transform applied.
# What happens: its OBJ and STL exporters turn the faces round, its PLY exporter does not: the same sphere has
# volume +4.12 in OBJ and STL, and -4.12 in PLY.
# Why it matters: half of many characters and props is made by mirroring. A reader that trusts the winding of a
# PLY file draws the body from behind (depth is that of the far side, the silhouette is right), so the sign of
# the volume has to be looked at, per closed body.
set -eu
cd "$(mktemp -d)"
python3.11 -m venv v
v/bin/pip install --quiet bpy==5.0.1
cat > run.py <<'PY'
import sys
import bpy
import numpy as np

print("Blender", bpy.app.version_string)
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_uv_sphere_add(radius=1)
bpy.context.object.scale = (-1, 1, 1)
bpy.ops.wm.obj_export(filepath="a.obj", export_triangulated_mesh=True)
bpy.ops.wm.stl_export(filepath="a.stl", ascii_format=True)
bpy.ops.wm.ply_export(filepath="a.ply", ascii_format=True, export_triangulated_mesh=True)


def volume(triangles):
    a, b, c = np.moveaxis(np.array(triangles), 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


lines = [line.split() for line in open("a.obj")]
v = [[float(x) for x in w[1:4]] for w in lines if w[:1] == ["v"]]
of_obj = volume([[v[int(c.split("/")[0]) - 1] for c in w[1:4]] for w in lines if w[:1] == ["f"]])
v = [[float(x) for x in line.split()[1:]] for line in open("a.stl") if line.split()[:1] == ["vertex"]]
of_stl = volume([v[i : i + 3] for i in range(0, len(v), 3)])
head, body = open("a.ply").read().split("end_header\n")
count = int(head.split("element vertex ")[1].split()[0])
rows = [line.split() for line in body.splitlines()]
v = [[float(x) for x in row[:3]] for row in rows[:count]]
faces = [[int(i) for i in row[1:]] for row in rows[count:] if row and row[0] == "3"]
of_ply = volume([[v[i] for i in f] for f in faces])
print(f"volume of the mirrored sphere: OBJ {of_obj:.3f}, STL {of_stl:.3f}, PLY {of_ply:.3f}")
sys.exit(not (of_obj > 4 and of_stl > 4 and of_ply < -4))
PY
v/bin/python run.py | grep -v "export\|Writing\|Finished"
exit "${PIPESTATUS[0]}"
