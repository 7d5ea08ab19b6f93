"""Comparison of images: error metrics, and a test of two noisy images for being of the same scene.

Two renders of one scene differ by their noise, which each knows: the variance of its pixels.  `z_test` tests if they
differ by more than that; the metrics measure by how much, noise included; `compare` does both for files and arrays.
"""

from raytracer.analysis.compare.compared_image import read
from raytracer.analysis.compare.difference_image import KINDS, check_kind, encode, show, with_legend
from raytracer.analysis.compare.folder_comparison import FolderComparison, FolderPair, compare_folders
from raytracer.analysis.compare.image_comparison import (
    ALPHA,
    PassCriteria,
    compare,
    compare_images,
    normalize_criteria,
    normalize_metric_names,
)
from raytracer.analysis.compare.metrics import METRICS, flip, flip_map, mae, mrse, mse, psnr, relmse, rmse, ssim
from raytracer.analysis.compare.result import Comparison
from raytracer.analysis.compare.z_test import TESTS, Verdict, z_test

__all__ = [
    "ALPHA",
    "KINDS",
    "METRICS",
    "TESTS",
    "Comparison",
    "FolderComparison",
    "FolderPair",
    "PassCriteria",
    "Verdict",
    "check_kind",
    "compare",
    "compare_folders",
    "compare_images",
    "encode",
    "flip",
    "flip_map",
    "mae",
    "mrse",
    "mse",
    "normalize_criteria",
    "normalize_metric_names",
    "psnr",
    "read",
    "relmse",
    "rmse",
    "show",
    "ssim",
    "with_legend",
    "z_test",
]
