#!/usr/bin/env bash
# sleap-io 0.9.5 (PyPI), which converts SLEAP's files to others.
# Guess: its DeepLabCut CSV has the score of each predicted joint in the column `likelihood`, as its other CSVs have it.
# What happens: the column is there and empty, and rows are called labeled-data/video/img0007.png, whatever the video.
# Why it matters: DeepLabCut keeps joints whose likelihood exceeds a cutoff, and nothing exceeds an empty field: the file
# has no joints. A reader has to take an empty likelihood beside a position for a joint that is there.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check sleap-io==0.9.5 pandas==3.0.0
cat > see.py <<'PY'
import numpy as np, pandas, sleap_io
print("sleap-io", sleap_io.__version__)
skeleton = sleap_io.Skeleton(nodes=["nose", "tail"])
person = sleap_io.PredictedInstance.from_numpy(
    np.array([[10.0, 20.0], [30.0, 40.0]]), skeleton=skeleton, point_scores=np.array([0.9, 0.8]), score=0.85)
video = sleap_io.Video(filename="run.mp4")
labels = sleap_io.Labels([sleap_io.LabeledFrame(video=video, frame_idx=7, instances=[person])])
sleap_io.save_csv(labels, "sleap.csv", format="sleap", include_score=True)
sleap_io.save_csv(labels, "dlc.csv", format="dlc", include_score=True)
own = pandas.read_csv("sleap.csv")
print("scores in SLEAP's CSV:", own["nose.score"].tolist() + own["tail.score"].tolist())
table = pandas.read_csv("dlc.csv", header=[0, 1, 2], index_col=0)
likelihood = table.xs("likelihood", axis=1, level="coords")
print("likelihoods in DeepLabCut's:", likelihood.values.tolist()[0], "of", table.index[0])
print("joints above a cutoff of 0.6:", int((likelihood > 0.6).values.sum()))
PY
venv/bin/python see.py | tee seen.txt
diff seen.txt - <<'SEEN'
sleap-io 0.9.5
scores in SLEAP's CSV: [0.9, 0.8]
likelihoods in DeepLabCut's: [nan, nan] of labeled-data/video/img0007.png
joints above a cutoff of 0.6: 0
SEEN
echo "as described"
