#!/usr/bin/env bash
# bvhio 1.5.4 (PyPI) and three.js 0.187.0 (npm), two readers of BVH files. Blender 5.0.1 (`bpy`, left out here for its
# size) does as bvhio.
# Guess: a joint with an OFFSET and position channels stands at offset plus position, as Meredith and Maddock's description
# of the format has it, and so do all readers.
# What happens: three.js adds them. bvhio and Blender take the position channels in place of the offset, of roots and of
# other joints: the same file has its hips at a height of 10 in one and on the ground in the others, and a knee with
# position channels of 0 in its parent's hip.
# Why it matters: the only way to write a body that stands in the same place everywhere is a root with OFFSET 0 0 0 and
# position channels for the root alone, as pose.bvh has them; a reader of others' files has to know who wrote them.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > steps.bvh <<'BVH'
HIERARCHY
ROOT hips
{
	OFFSET 0 10 0
	CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
	JOINT knee
	{
		OFFSET 0 -4 0
		CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
		End Site
		{
			OFFSET 0 -3 1
		}
	}
}
MOTION
Frames: 2
Frame Time: 0.0333333
0 0 0 0 0 0 0 0 0 0 0 0
0 10 0 0 0 0 0 -4 0 0 0 0
BVH
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check bvhio==1.5.4
npm install --silent --no-audit --no-fund three@0.187.0 > npm.log 2>&1
cat > see.py <<'PY'
import bvhio
from importlib.metadata import version
print("bvhio", version("bvhio"))
tree = bvhio.readAsHierarchy("steps.bvh")
for frame in range(2):
    tree.loadPose(frame, recursive=True)
    print("frame", frame, *("%s y %g" % (j.Name, round(j.PositionWorld.y, 3)) for j, _, _ in tree.layout()))
PY
cat > see.mjs <<'JS'
import * as three from "three";
import { BVHLoader } from "three/examples/jsm/loaders/BVHLoader.js";
import fs from "fs";
console.log("three", three.REVISION);
const { skeleton, clip } = new BVHLoader().parse(fs.readFileSync("steps.bvh", "utf8"));
const mixer = new three.AnimationMixer(skeleton.bones[0]);
mixer.clipAction(clip).play();
[0, 0.0333333].forEach((at, frame) => {
  mixer.setTime(at - 1e-9 * frame);
  skeleton.bones[0].updateMatrixWorld(true);
  const y = (b) => Math.round(1000 * b.getWorldPosition(new three.Vector3()).y) / 1000;
  console.log("frame", frame, ...skeleton.bones.slice(0, 2).map((b) => `${b.name} y ${y(b)}`));
});
JS
venv/bin/python see.py > bvhio.txt
node see.mjs > three.txt
cat bvhio.txt three.txt
diff bvhio.txt - <<'SEEN'
bvhio 1.5.4
frame 0 hips y 0 knee y 0
frame 1 hips y 10 knee y 6
SEEN
diff three.txt - <<'SEEN'
three 187
frame 0 hips y 10 knee y 6
frame 1 hips y 20 knee y 12
SEEN
echo "as described"
