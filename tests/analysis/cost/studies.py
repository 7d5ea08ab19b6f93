"""Studies that nobody measured, to show."""

import math
from dataclasses import replace
from functools import cache

import numpy as np

from raytracer.analysis.cost.results import UNKNOWN, ConvergencePoint, PlanItem, Prediction, Study, VariantResult
from raytracer.core.error_estimate.intervals import Interval

NAN, INF = math.nan, math.inf
NOWHERE = Interval(INF, INF, INF)

# What must be taken for text by everything that shows it: markup of HTML, of rich, of Matplotlib.
EVIL = "<b>&\"'[red]$x^2$</script>"

LINEAR, STEEP = 0.13, 0.11


def around(value, by=0.03):
    return Interval(value, value * (1.0 - by), value * (1.0 + by))


def predicted(**changes):
    """Of a picture that takes 0.3 s and 10 ms a sample, with MSE = 0.13 / N + 0.11 / N^1.5."""
    points = tuple(
        ConvergencePoint(n, 0.3 + 0.01 * n, around(math.sqrt(LINEAR / n + STEEP / n**1.5), 0.02)) for n in (16, 64, 256)
    )
    fit = {"linear": LINEAR, "steep": STEEP, "exponent": 1.04, "factor": 0.15, "halving": 1.06}
    asked = {"target": 0.01, "budget": 60.0, "budget_spp": 5970.0, "budget_error": around(0.0047)}
    seconds = {"fixed": around(0.3), "per_sample": around(0.01), "target_seconds": around(13.6)}
    guesses = {"plain_spp": 1370.0, "plain_seconds": 14.0, "power_spp": 1350.0, "power_seconds": 13.8}
    made = Prediction(points=points, target_spp=around(1330.0), **fit, **asked, **seconds, **guesses)
    return replace(made, **changes)


def variants():
    one = Interval(1.0, 1.0, 1.0)
    seconds = {"per_sample": around(0.01), "per_ray": around(34.2), "rays_per_sample": 2.7, "target_seconds": 13.6}
    noise = {"spp": 64, "noise": around(0.0464), "noise_ratio": one, "target_spp": 1330.0}
    scene = VariantResult("scene", "scene", "the scene as it is", time=one, **seconds, **noise)
    what = "the scene once more, to see what the machine's unrest alone does"
    ratios = {"time": Interval(1.002, 0.991, 1.008), "noise_ratio": Interval(1.01, 0.97, 1.05)}
    biases = {"bias": Interval(0.0, 0.0, 0.0041), "brightness": Interval(0.0, -0.001, 0.001)}
    control = replace(scene, name="A/A", group="control", what=what, **ratios, **biases)
    what = "all rays start at one point, as of a pinhole: everything is sharp"
    ratios = {"time": Interval(0.839, 0.821, 0.857), "noise_ratio": Interval(0.82, 0.77, 0.87)}
    biases = {"bias": Interval(0.154, 0.149, 0.159), "per_sample": around(0.0084), "noise": around(0.0421)}
    found = dict.fromkeys(("time_differs", "noise_differs", "bias_resolved"), True)
    why = "the bias exceeds the target, which no number of samples mends"
    blank = {"target_spp": None, "target_seconds": None, "why_blank": why}
    defocus = replace(control, name="defocus", group="effect", what=what, **ratios, **biases, **found, **blank)
    setting = replace(control, group="setting")
    sampler = replace(control, name="sampler=independent", group="sampler", what="samples know nothing of each other")
    return (
        scene,
        control,
        defocus,
        replace(defocus, name=f"material {EVIL}", what=f"{EVIL} scatters evenly", time=around(12.34)),
        VariantResult("media", "effect", "no fog", failed="the variant could not be packed: nothing is left to see"),
        replace(setting, name="accuracy=fast", what="hits as Embree finds them"),
        replace(setting, name="max_depth=4", what="paths end after 4 segments", bias=UNKNOWN),
        replace(sampler, noise_ratio=around(1.2), noise_differs=True, target_seconds=INF, target_spp=INF),
        VariantResult("roulette", "setting", "nobody knows"),
    )


PLAN = (
    PlanItem("simulated", "defocus", "the lens is open: defocus_angle is 0.6 deg"),
    PlanItem("simulated", EVIL, f"used by {EVIL}"),
    PlanItem("left out", "media", "no medium fills any space"),
    PlanItem(
        "setting", "spp", "500 samples in each pixel: error falls with their square root, and time grows with them"
    ),
)

MACHINE = {
    "processor": "A processor & Co. <4 cores>",
    "instruction_set": "AVX-512",
    "threads": 4,
    "load_before": 0.31,
    "versions": {"raytracer": "0.5", "numba": "0.68.1"},
    "seed": 0,
    "rounds": 9,
    "governors": ["performance", None],
}


@cache
def measured(width, height, part):
    rng = np.random.default_rng(1)
    rows, columns = -(-height // 16), -(-width // 16)
    there = rng.random((rows, columns)) < part
    there[0, 0] = True
    there = np.kron(there, np.ones((16, 16), dtype=bool))[:height, :width]
    y, x = np.mgrid[:height, :width]
    disc = np.hypot(x - 0.6 * width, y - 0.5 * height) < 0.3 * height
    picture = np.stack([np.where(disc, 0.8, 0.2), 0.3 + 0.3 * y / height, np.where(disc, 0.1, 0.6)], axis=-1)
    error = np.where(disc, 0.08, 0.01) * rng.lognormal(0.0, 0.4, (height, width))
    return np.where(there, error, NAN), np.where(there[..., None], picture, NAN)


def study(width=400, height=225, part=0.3, **changes):
    error_map, picture = measured(width, height, part)
    tiles = -(-height // 16) * -(-width // 16)
    made = Study(
        scene=f"scenes/{EVIL}.yaml",
        width=width,
        height=height,
        plan=PLAN,
        prediction=predicted(),
        variants=variants(),
        seconds={"load": 0.05, "pack": 0.02, "build": 0.004, "compile": 7.1, "measure": 65.0},
        machine=MACHINE,
        warnings=(f"the load was 5.1 on 4 cores: times are uncertain {EVIL}",),
        tiles=tiles,
        tiles_measured=max(1, round(part * tiles)),
        top_share=0.034,
        error_map=error_map,
        picture=picture,
    )
    return replace(made, **changes)


NO_FIT = dict.fromkeys(("linear", "steep", "exponent", "factor", "halving"), NAN)
NO_GUESS = dict.fromkeys(("plain_spp", "plain_seconds", "power_spp", "power_seconds"), NAN)
NO_TARGET = dict.fromkeys(("fixed", "per_sample", "target_spp", "target_seconds"), UNKNOWN)
NO_BUDGET = dict.fromkeys(("budget", "budget_spp", "budget_error"))
NO_PREDICTION = predicted(points=(), **NO_FIT, **NO_GUESS, **NO_TARGET, **NO_BUDGET)
NO_PICTURE = {"top_share": NAN, "error_map": np.full((225, 400), NAN), "picture": np.full((225, 400, 3), NAN)}


def nothing():
    return study(plan=(), prediction=NO_PREDICTION, variants=(), seconds={}, machine={}, warnings=(), **NO_PICTURE)


def black():
    """Of a black picture, to which no error is relative."""
    points = tuple(ConvergencePoint(n, 0.01 * n, UNKNOWN) for n in (16, 64))
    known = {"points": points, "fixed": around(0.3), "per_sample": around(0.01)}
    prediction = replace(NO_PREDICTION, **known, budget=30.0, budget_spp=2970.0, budget_error=UNKNOWN)
    return study(prediction=prediction, **(NO_PICTURE | {"picture": np.zeros((225, 400, 3))}))


def still():
    """Of a picture without any noise."""
    points = tuple(ConvergencePoint(n, 0.01 * n, Interval(0.0, 0.0, 0.0)) for n in (16, 64))
    prediction = predicted(points=points, linear=0.0, steep=0.0, halving=1.0, target_spp=around(1.0))
    return study(prediction=prediction, error_map=np.zeros((225, 400)))


def hopeless():
    """With a target that is out of reach, and a budget that buys nothing."""
    never = dict.fromkeys(NO_GUESS, INF) | {"target_spp": NOWHERE, "target_seconds": NOWHERE}
    return study(prediction=predicted(**never, budget=0.1, budget_spp=0.0, budget_error=NOWHERE))


ALL = {
    "usual": study,
    "nothing": nothing,
    "black": black,
    "still": still,
    "hopeless": hopeless,
    "one tile": lambda: study(width=9, height=5, part=1.0),
    "no variants": lambda: study(variants=()),
    "no budget": lambda: study(prediction=predicted(**NO_BUDGET)),
    "one point": lambda: study(prediction=predicted(points=predicted().points[:1])),
    "portrait": lambda: study(width=90, height=400, part=1.0),
}
