#!/usr/bin/env bash
# Blender (PyPI bpy 5.0.1, Python 3.11), importing a posed character under a mirrored node.
#
# Guess: two glTF files that differ only in how one node's matrix is written, as the scale (-1, 1, 1) or as half a
# turn about x with the scale (-1, -1, -1), look the same, because the matrices are the same.
# Seen: with the second the importer bends the skinned mesh the other way: a vertex of a strip 2 m long is 1.67 m from
# where the rule of the specification (the sum of weight x joint x inverse bind matrix) and other viewers have it.
# The second form is what Blender's own exporter writes for an armature with scale.x = -1, so a posed, mirrored
# character changes by export and import. At rest both are right.
# Why it matters: such files are used as ground truth for poses, and Blender to look at them. Compare with the file's
# own matrices, not with Blender's view of it.
set -eu
dir=$(mktemp -d); trap 'rm -rf "$dir"' EXIT
"${PYTHON:-python3.11}" -m venv "$dir/venv"
"$dir/venv/bin/pip" -q install bpy==5.0.1
cat > "$dir/see.py" <<'PY'
import base64, json, sys
import numpy as np
import bpy

HIP, KNEE = np.radians(15), np.radians(60)

def turn(angle):
    m = np.eye(4)
    m[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return m

def quaternion(angle):
    return [float(np.sin(angle / 2)), 0, 0, float(np.cos(angle / 2))]

def write(path, mirror):
    """A strip on two joints, and where its vertices are by the specification."""
    pos = np.array([[x, y, 0] for y in np.linspace(0, 2, 9) for x in (0.1, 0.3)], "f4")
    far = (pos[:, 1] > 1).astype("f4")
    weights = np.stack([1 - far, far, 0 * far, 0 * far], 1)
    joints = ((weights > 0) * [0, 1, 0, 0]).astype("u1")
    corners = np.array([[a, a + 1, a + 3, a, a + 3, a + 2] for a in range(0, 16, 2)], "u2").ravel()
    rig, up = np.diag([-1.0, 1, 1, 1]), np.eye(4)
    up[1, 3] = 1
    binds = [np.linalg.inv(rig), np.linalg.inv(rig @ up)]
    parts = [pos, weights, joints, corners, np.array([b.T for b in binds], "f4")]
    data, views = b"", []
    for p in parts:
        data += b"\0" * (-len(data) % 4)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": p.nbytes})
        data += p.tobytes()
    kinds = [(5126, len(pos), "VEC3"), (5126, len(pos), "VEC4"), (5121, len(pos), "VEC4"),
             (5123, len(corners), "SCALAR"), (5126, 2, "MAT4")]
    accessors = [{"bufferView": i, "componentType": c, "count": n, "type": t} for i, (c, n, t) in enumerate(kinds)]
    accessors[0] |= {"min": pos.min(0).tolist(), "max": pos.max(0).tolist()}
    json.dump({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"name": "strip", "mesh": 0, "skin": 0}, {"name": "rig", "children": [2], **mirror},
                  {"name": "hip", "children": [3], "rotation": quaternion(HIP)},
                  {"name": "knee", "translation": [0, 1, 0], "rotation": quaternion(KNEE)}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "WEIGHTS_0": 1, "JOINTS_0": 2}, "indices": 3}]}],
        "skins": [{"joints": [2, 3], "inverseBindMatrices": 4}], "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(data),
                     "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
    }, open(path, "w"))
    poses = [rig @ turn(HIP), rig @ turn(HIP) @ up @ turn(KNEE)]
    flat = np.c_[pos, np.ones(len(pos))]
    return sum(weights[:, [k]] * (flat @ (poses[k] @ binds[k]).T) for k in (0, 1))[:, :3]

def shown(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=path)
    strip = next(o for o in bpy.data.objects if o.type == "MESH" and o.name.startswith("strip"))
    o = strip.evaluated_get(bpy.context.evaluated_depsgraph_get())
    m = np.array(o.matrix_world)
    v = np.array([v.co[:] for v in o.to_mesh().vertices]) @ m[:3, :3].T + m[:3, 3]
    return np.stack([v[:, 0], v[:, 2], -v[:, 1]], 1)

apart = []
for mirror in ({"scale": [-1, 1, 1]}, {"rotation": [1, 0, 0, 0], "scale": [-1, -1, -1]}):
    known = write(sys.argv[1], mirror)
    apart.append(float(np.abs(shown(sys.argv[1]) - known).max()))
    print(f"SEEN {mirror}: farthest vertex {apart[-1]:.3f} m away")
print("SEEN Blender", bpy.app.version_string)
sys.exit(0 if apart[0] < 1e-3 and apart[1] > 1 else 1)
PY
status=0
"$dir/venv/bin/python" "$dir/see.py" "$dir/strip.gltf" > "$dir/out" 2>&1 || status=$?
grep "^SEEN" "$dir/out" || tail -5 "$dir/out"
exit $status
