#!/usr/bin/env bash
# Ultralytics 8.3.0 and 8.4.190 (PyPI), label text of poses as `predict(save_txt=True)` and `Results.save_txt` write it.
# Guess: a joint is x, y and how visible it is, 0 for a joint that is missing, as in Ultralytics' own labels for training;
# the same text means the same in both versions.
# What happens: the third number is the network's confidence. 8.3.0 moves joints of a confidence below 0.5 to 0 0 and leaves
# their confidence (0.3), in JSON as well; 8.4.190 leaves them where they were seen. With save_conf=True the box's
# confidence comes last, after the joints, not after the box.
# Why it matters: a reader that goes by the third number puts such joints into the upper left corner of the picture, and
# takes them for sure if it knows only 0, 1 and 2. 0 0 has to count as missing whatever stands behind it.
# It needs Python 3.10, for the last PyTorch that is one wheel without CUDA's own.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
${PYTHON:-python3.10} -m venv venv
pip() { venv/bin/pip install --quiet --disable-pip-version-check "$@"; }
pip torch==1.12.1 torchvision==0.13.1 "numpy<2" "opencv-python-headless<5" pandas py-cpuinfo tqdm seaborn scipy psutil \
    pyyaml requests matplotlib pillow polars
pip --no-deps --target old ultralytics==8.3.0
pip --no-deps --target new ultralytics==8.4.190
cat > see.py <<'PY'
import numpy as np, torch, ultralytics
from ultralytics.engine.results import Results
joints = torch.tensor([[[100.0, 100.0, 0.9]] * 16 + [[320.0, 120.0, 0.3]]])
boxes = torch.tensor([[50.0, 60.0, 350.0, 400.0, 0.8, 0.0]])
seen = Results(np.zeros((480, 640, 3), np.uint8), path="a.jpg", names={0: "person"}, boxes=boxes, keypoints=joints)
seen.save_txt(f"{ultralytics.__version__}.txt", save_conf=True)
words = open(f"{ultralytics.__version__}.txt").read().split()
own = seen.summary()[0]["keypoints"]
print("ultralytics", ultralytics.__version__, "numbers", len(words), "last joint", *words[-4:-1], "then", words[-1],
      "in JSON", *(round(own[k][-1], 3) for k in ("x", "y", "visible")))
PY
for version in old new; do
    PYTHONPATH=$version YOLO_CONFIG_DIR=$work venv/bin/python see.py 2> $version.log | tail -n 1
done | tee seen.txt
diff seen.txt - <<'SEEN'
ultralytics 8.3.0 numbers 57 last joint 0 0 0.3 then 0.8 in JSON 0.0 0.0 0.3
ultralytics 8.4.190 numbers 57 last joint 0.5 0.25 0.3 then 0.8 in JSON 320.0 120.0 0.3
SEEN
echo "as described"
