"""Whether two noisy images are of the same scene, and how far apart they are.

Two renders of one scene differ by their noise, which each knows: the variance of its pixels.  `z_test` asks whether
they differ by more than that; the metrics say by how much, noise included; `compare` does both for files and arrays.
"""

from raytracer.comparison.difference import KINDS, Shown, check_kind, encode, show, with_legend
from raytracer.comparison.folders import Folders, Pair, compare_folders
from raytracer.comparison.limits import Limits
from raytracer.comparison.metrics import METRICS, flip, flip_map, mae, mrse, mse, psnr, relmse, rmse, ssim
from raytracer.comparison.pairs import ALPHA, Checks, checked, compare, judge, known_metrics
from raytracer.comparison.reading import Picture, read
from raytracer.comparison.result import Comparison
from raytracer.comparison.verdict import TESTS, Verdict, z_test

__all__ = [
    "ALPHA",
    "KINDS",
    "METRICS",
    "TESTS",
    "Checks",
    "Comparison",
    "Folders",
    "Limits",
    "Pair",
    "Picture",
    "Shown",
    "Verdict",
    "check_kind",
    "checked",
    "compare",
    "compare_folders",
    "encode",
    "flip",
    "flip_map",
    "judge",
    "known_metrics",
    "mae",
    "mrse",
    "mse",
    "psnr",
    "read",
    "relmse",
    "rmse",
    "show",
    "ssim",
    "with_legend",
    "z_test",
]
