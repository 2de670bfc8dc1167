"""Makes tests/data/depths: one depth map as other programs write it.

    pip install numpy==2.4.6 opencv-python-headless==5.0.0.93 tifffile==2026.3.3 imagecodecs OpenEXR==3.5.3
    python tests/data/make_depths.py
"""
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import tifffile

folder = Path(__file__).parent / "depths"
z = np.full((6, 8), 1.5, np.float32)
z[0, 0], z[1, 1], z[2, 2], z[5, 7] = 0, np.nan, np.inf, 2.25
millimetres = np.where(np.isfinite(z), z * 1000, 0).astype(np.uint16)
cv2.imwrite(str(folder / "opencv_float.tiff"), z)
cv2.imwrite(str(folder / "opencv_16.tiff"), millimetres)
tifffile.imwrite(folder / "deflate.tiff", z, compression="deflate", predictor=True)
tifffile.imwrite(folder / "half.tiff", z.astype(np.float16))
tifffile.imwrite(folder / "big_endian.tiff", z, byteorder=">", bigtiff=True)


def exr(name, channels, **header):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | header
    OpenEXR.File(header, channels).write(str(folder / name))


colours = {f"ViewLayer.Combined.{c}": np.full_like(z, i) for i, c in enumerate("RGBA")}
exr("passes.exr", colours | {"ViewLayer.Depth.Z": np.where(np.isinf(z), np.float32(1e10), z)})
exr("half.exr", {"Y": z.astype(np.float16)}, compression=OpenEXR.PIZ_COMPRESSION)
exr("grey.exr", {c: z for c in "RGB"})
window = (np.array([2, 1], np.int32), np.array([9, 6], np.int32))
exr("cropped.exr", {"Z": z}, dataWindow=window, displayWindow=(np.array([0, 0], np.int32), np.array([9, 7], np.int32)))
