#!/usr/bin/env python3
"""Turns a pose prior by joint into the layout that human.pcad reads: by part, Cholesky factors as rows.

    python make_prior.py pose_prior_source.json pose_prior.json
"""
import json, sys

src = json.load(open(sys.argv[1]))
joints, limbs, comps, marg = src["joints"], src["limbs"], src["components"], src["marginals"]


def rows(packed, n):
    """The rows of a lower triangle given row by row."""
    out, at = [], 0
    for i in range(n):
        out.append([round(x, 5) for x in packed[at:at + i + 1]] + [0] * (n - i - 1))
        at += i + 1
    return out


parts, order = {}, []
for name, own in limbs.items():
    at = [3 * joints.index(j) + k for j in own for k in range(3)]
    order += at
    parts[name] = {
        "joints": own,
        "mean": [[c["mean"][i] for i in at] for c in comps],
        "chol": [rows(c["chol"][name], len(at)) for c in comps],
    }
out = {
    "about": "Mixture over the joint rotations of human.rig.json: rotation vectors in radians, zero is the A-pose. Given the "
             "component, the parts are independent normals. rig_order[i] is the place of number i of the rig's joints "
             "in the parts' numbers joined in order.",
    "source": src["source"],
    "terms": "This dataset of motions is free for all uses (mocap.cs.cmu.edu). See README.md.",
    "labels": [c["label"] for c in comps],
    "weights": [c["weight"] for c in comps],
    "weights_balanced": [c["weight_balanced"] for c in comps],
    "rig_order": [order.index(i) for i in range(3 * len(joints))],
    "lo": [marg[joints[i // 3]]["lo"][i % 3] for i in range(3 * len(joints))],
    "hi": [marg[joints[i // 3]]["hi"][i % 3] for i in range(3 * len(joints))],
    "parts": parts,
}
json.dump(out, open(sys.argv[2], "w"), separators=(",", ":"))
