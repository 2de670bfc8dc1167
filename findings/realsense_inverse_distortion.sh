#!/usr/bin/env bash
# pyrealsense2 2.59.1: what RealSense's models of distortion mean.
#
# Guess: "Inverse Brown-Conrady" maps distorted to undistorted positions, the inverse of "Modified
# Brown-Conrady"; and deprojecting a projected point gives the point.
#
# Seen: both project a point to the same pixel: "inverse" is forward distortion, too, and its tangential terms
# use the coordinates after the radial ones, unlike OpenCV's. `rs2_deproject_pixel_to_point` inverts "inverse",
# but ignores the coefficients of "modified" without a word, so that a round trip is off by 4 %.
#
# It matters to whoever reads intrinsics of a D400 (its colour camera says "Inverse Brown Conrady"), and gives
# the coefficients to an inverse, or to OpenCV.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv own
own/bin/pip install -q pyrealsense2==2.59.1.11053 libusb-package==1.0.26.3 opencv-python-headless==5.0.0.93 numpy==2.4.6
# The wheel needs libusb, which this one has.
mkdir lib
cp "$(find own -name 'libusb-1.0*.so*' | head -n 1)" lib/libusb-1.0.so.0
LD_LIBRARY_PATH="$PWD/lib" own/bin/python - <<'PY'
import cv2, numpy as np, pyrealsense2 as rs

print("pyrealsense2", rs.__version__)
coefficients = [-0.28, 0.09, 0.0012, -0.0007, -0.015]
point = [0.3, -0.2, 1.0]
i = rs.intrinsics()
i.width, i.height, i.fx, i.fy, i.ppx, i.ppy, i.coeffs = 640, 480, 600, 600, 320, 240, coefficients
seen = {}
for model in ("brown_conrady", "modified_brown_conrady", "inverse_brown_conrady"):
    i.model = getattr(rs.distortion, model)
    pixel = rs.rs2_project_point_to_pixel(i, point)
    seen[model] = np.array(pixel), np.array(rs.rs2_deproject_pixel_to_point(i, pixel, 1.0))
    print(f"{model:24s} pixel {np.round(pixel, 4)} and back {np.round(seen[model][1], 4)}")
k = np.array([[600, 0, 320], [0, 600, 240], [0, 0, 1.0]])
opencv = cv2.projectPoints(np.array([point]), np.zeros(3), np.zeros(3), k, np.array(coefficients))[0].ravel()
print("OpenCV                   pixel", np.round(opencv, 4))
assert np.allclose(seen["inverse_brown_conrady"][0], seen["modified_brown_conrady"][0], atol=1e-4)
assert np.linalg.norm(seen["inverse_brown_conrady"][0] - opencv) > 0.01
assert np.allclose(seen["brown_conrady"][0], opencv, atol=1e-3)
assert np.allclose(seen["inverse_brown_conrady"][1], point, atol=1e-5)
assert abs(seen["modified_brown_conrady"][1][0] - 0.3) > 0.005
PY
