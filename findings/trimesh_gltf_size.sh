#!/usr/bin/env bash
# trimesh (PyPI 5.2.0), reading valid glTF files whose size is not that of the plain numbers in their buffer.
#
# Guess: trimesh.load gives the size that viewers show, or an error or a warning where it cannot.
# Seen, without a warning:
# * positions as normalised 16-bit integers (KHR_mesh_quantization, which the file requires; glTF Transform and gltfpack
#   write such) are taken for the integers themselves: a cube of 2 m is 65534 m;
# * copies of a mesh (EXT_mesh_gpu_instancing, as Blender writes) are one mesh: 7 m of cubes are 1 m;
# * morph targets are drawn without the mesh's default weights (a key at 1 in Blender): 3 m are 2 m.
# Why it matters: trimesh is the usual way to scale meshes for a scene, a depth map or an evaluation in metres.
set -eu
dir=$(mktemp -d); trap 'rm -rf "$dir"' EXIT
"${PYTHON:-python3}" -m venv "$dir/venv"
"$dir/venv/bin/pip" -q install trimesh==5.2.0 numpy
cat > "$dir/see.py" <<'PY'
import json, logging, struct, sys, warnings
import numpy as np
import trimesh

said = []
class Keep(logging.Handler):
    def emit(self, record):
        said.append(record.getMessage())
logging.getLogger().addHandler(Keep(logging.WARNING))
logging.getLogger("trimesh").addHandler(Keep(logging.WARNING))
warnings.showwarning = lambda message, *_: said.append(str(message))

corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], "f4")
faces = np.array([0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3], "u2")

def write(path, positions, component, normalized, more, node=None, mesh=None, extensions=(), required=()):
    """A cube; `more` are further accessors of three floats."""
    data, views, accessors = b"", [], []
    arrays = [(positions, component, "VEC3"), (faces, 5123, "SCALAR")] + [(np.array(m, "f4"), 5126, "VEC3") for m in more]
    for k, (a, component, kind) in enumerate(arrays):
        data += b"\0" * (-len(data) % 4)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": a.nbytes})
        if k == 0 and a.shape[1] == 4:
            views[0]["byteStride"] = 8
        accessors.append({"bufferView": k, "componentType": component, "count": len(a), "type": kind})
        data += a.tobytes()
        if kind == "VEC3":
            accessors[k] |= {"min": a[:, :3].min(0).tolist(), "max": a[:, :3].max(0).tolist()}
    accessors[0] |= {"normalized": True} if normalized else {}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1} | (mesh or {}).pop("primitive", {})
    d = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0} | (node or {})],
         "meshes": [{"primitives": [primitive]} | (mesh or {})], "accessors": accessors, "bufferViews": views,
         "buffers": [{"byteLength": len(data)}]}
    if extensions:
        d["extensionsUsed"] = list(extensions)
    if required:
        d["extensionsRequired"] = list(required)
    text = json.dumps(d).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    with open(path, "wb") as f:
        f.write(b"glTF" + struct.pack("<III", 2, 28 + len(text) + len(data), len(text)) + b"JSON" + text)
        f.write(struct.pack("<I", len(data)) + b"BIN\0" + data)

path = sys.argv[1]
wide = {}
shorts = np.c_[corners * 32767, np.zeros(8)].astype("i2")
write(path, shorts, 5122, True, [], extensions=["KHR_mesh_quantization"], required=["KHR_mesh_quantization"])
wide["normalised, 2 m"] = trimesh.load(path).extents[0]
places = [[0, 0, 0], [2, 0, 0], [4, 0, 0], [6, 0, 0]]
copies = {"extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}}
write(path, corners / 2, 5126, False, [places], node=copies, extensions=["EXT_mesh_gpu_instancing"])
wide["copies, 7 m"] = trimesh.load(path).extents[0]
key = {"weights": [1], "primitive": {"targets": [{"POSITION": 2}]}}
write(path, corners, 5126, False, [corners / 2], mesh=key)
wide["morph target, 3 m"] = trimesh.load(path).extents[0]
for what, x in wide.items():
    print(f"SEEN {what}: trimesh {x:g} m")
print("SEEN trimesh", trimesh.__version__, "warnings:", said)
sys.exit(0 if np.allclose(list(wide.values()), [65534, 1, 2]) and not said else 1)
PY
status=0
"$dir/venv/bin/python" "$dir/see.py" "$dir/cube.glb" > "$dir/out" 2>&1 || status=$?
grep "^SEEN" "$dir/out" || tail -5 "$dir/out"
exit $status
