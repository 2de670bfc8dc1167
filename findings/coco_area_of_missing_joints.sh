#!/usr/bin/env bash
# pycocotools 2.0.11, COCO.loadRes and COCOeval("keypoints").
# Guess: joints that a result gives as 0, 0, 0 (COCO's own way to write a joint that is missing) play no part in where and
# how large the person is: a person 40 pixels tall stays "small" or "medium", whoever is missing an ankle.
# What happens: loadRes takes box and area of a keypoint result from the extremes of all 17 pairs of numbers, those at 0, 0
# included. A person of 40 x 40 pixels at 500, 400 without one joint gets a box from 0, 0 to 540, 440 and an area of 237600,
# and COCOeval counts it as large: the same false alarm spoils AP "large" instead of AP "medium". With a `segmentation`
# beside the keypoints, area and box are the mask's.
# Why it matters: keypoints.coco.json writes joints that a scene lacks as 0, 0, 0, and therefore has the mask as well.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check pycocotools==2.0.11 numpy==2.3.5
cat > "$work/see.py" <<'PY'
import contextlib, io, sys
from importlib.metadata import version
import numpy as np
from pycocotools import mask as runs
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

def joints(x, y, side, without=None):
    at = [(x + side * (k % 5) / 4, y + side * (k // 5) / 3, 2) for k in range(17)]
    return [v for k, j in enumerate(at) for v in ((0, 0, 0) if k == without else j)]

def person(i, x, y, side):
    return {"id": i, "image_id": 1, "category_id": 1, "keypoints": joints(x, y, side), "num_keypoints": 17,
            "bbox": [x, y, side, side], "area": side * side, "iscrowd": 0}

truth = {"images": [{"id": 1, "width": 640, "height": 480}], "categories": [{"id": 1, "name": "person"}],
         "annotations": [person(1, 100, 100, 40), person(2, 200, 150, 200)]}
found = [dict(image_id=1, category_id=1, keypoints=joints(100, 100, 40), score=0.8),
         dict(image_id=1, category_id=1, keypoints=joints(200, 150, 200), score=0.8)]
pixels = np.zeros((480, 640), np.uint8)
pixels[400:440, 500:540] = 1
segmentation = runs.encode(np.asfortranarray(pixels))

def judged(missing, **more):
    alarm = dict(image_id=1, category_id=1, keypoints=joints(500, 400, 40, missing), score=0.9, **more)
    with contextlib.redirect_stdout(io.StringIO()):
        gt = COCO()
        gt.dataset = truth
        gt.createIndex()
        dt = gt.loadRes([alarm] + [dict(f, **({"segmentation": segmentation} if more else {})) for f in found])
        e = COCOeval(gt, dt, "keypoints")
        e.evaluate(); e.accumulate(); e.summarize()
    a = dt.loadAnns(1)[0]
    return [float(v) for v in a["bbox"]], float(a["area"]), round(float(e.stats[3]), 3), round(float(e.stats[4]), 3)

print("pycocotools", version("pycocotools"))
seen = {}
for what, args in [("all joints", (None, {})), ("one missing", (16, {})), ("one missing, with a mask", (16, {"segmentation": segmentation}))]:
    seen[what] = judged(args[0], **args[1])
    print("a false alarm of 40 x 40 pixels, %s: box %s, area %.0f, AP medium %s, AP large %s" % (what, *seen[what]))
whole, less, masked = (seen[k] for k in seen)
sys.exit(not (whole[1] == 1600 and less[0][:2] == [0, 0] and less[1] > 96 ** 2
              and whole[2] < 0.6 and whole[3] == 1 and less[2] == 1 and less[3] < 0.6 and masked[1] == 1600))
PY
"$work/venv/bin/python" "$work/see.py"
echo "as described"
