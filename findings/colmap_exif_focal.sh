#!/usr/bin/env bash
# pycolmap 4.2.1: what a photograph's Exif data say of its lens.
#
# Guess: `infer_camera_from_image` takes FocalLengthIn35mmFilm where it is stated, and the pixels of the
# sensor (FocalPlaneXResolution) are of the picture as it was taken, so that of a smaller copy they are scaled.
#
# Seen: the 35 mm equivalent is used (by the diagonal) only if FocalLength is stated, too; alone, it is ignored
# without a word for the guess of 1.2 longer sides. And FocalPlaneXResolution counts as pixels of the copy,
# although PixelXDimension states the original: at a tenth of the size, the focal length is ten times what it
# should be, marked as known.
#
# It matters because a camera of COLMAP without a calibrated focal length is such a number, and resizing
# photographs before a reconstruction is usual.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv own
own/bin/pip install -q pycolmap==4.2.1 piexif==1.1.3 numpy==2.4.6 pillow==12.0.0
own/bin/python - <<'PY'
import numpy as np, piexif, pycolmap
from PIL import Image

E = piexif.ExifIFD
def seen(size, fields):
    picture = Image.fromarray(np.random.default_rng(1).integers(0, 255, (size[1], size[0], 3), np.uint8))
    picture.save("p.jpg", exif=piexif.dump({"0th": {piexif.ImageIFD.Make: b"Maker", piexif.ImageIFD.Model: b"Model"}, "Exif": fields}))
    camera = pycolmap.infer_camera_from_image("p.jpg")
    return camera.params[0], camera.has_prior_focal_length

print("pycolmap", pycolmap.__version__)
size = (800, 600)
alone = seen(size, {E.FocalLengthIn35mmFilm: 28})
both = seen(size, {E.FocalLengthIn35mmFilm: 28, E.FocalLength: (425, 100)})
per_inch = (4000 * 254, 360)  # 4000 pixels on 36 mm
sensor = {E.FocalLength: (50, 1), E.FocalPlaneXResolution: per_inch, E.FocalPlaneYResolution: per_inch,
          E.FocalPlaneResolutionUnit: 2, E.PixelXDimension: 4000, E.PixelYDimension: 3000}
small = seen((400, 300), sensor)
diagonal = 28 / 43.2666 * 1000
print(f"28 mm equivalent alone: {alone[0]:.1f} pixels, known: {alone[1]}; by the diagonal it is {diagonal:.1f}")
print(f"with FocalLength:       {both[0]:.1f} pixels, known: {both[1]}")
print(f"50 mm on a sensor of 36 mm, a copy of 400 pixels: {small[0]:.1f} pixels, known: {small[1]}; it is {50 / 36 * 400:.1f}")
assert alone == (1.2 * 800, False)
assert abs(both[0] - diagonal) < 0.5 and both[1]
assert abs(small[0] - 50 / 36 * 4000) < 1 and small[1]
PY
