"""`study` on made-up pictures and times, of which the truth is known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from raytracer.analysis.cost import predict as predicting
from raytracer.analysis.cost.study import study
from raytracer.analysis.cost.study_options import StudyOptions
from raytracer.analysis.cost.text import study_text
from raytracer.film.window import Window
from raytracer.rendering.tile_scheduler import split_into_tiles
from raytracer.util.errors import InputError
from tests.analysis.cost.made_up import World, scene_of


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    monkeypatch.setattr(predicting, "_RESAMPLES", 200)


@pytest.fixture
def spec(tmp_path):
    return scene_of(tmp_path)


@pytest.fixture
def little(tmp_path):
    """A scene of twelve tiles, for what needs no statistics."""
    return scene_of(tmp_path, 64, 48)


def studied(spec, world, **options):
    own = {name: options.pop(name) for name in StudyOptions.__dataclass_fields__ if name in options}
    return study(spec, StudyOptions(**{"threads": 2, **own}), **{"bench": world.bench(), **options})


def variant(found, name):
    (only,) = (variant for variant in found.variants if variant.name == name)
    return only


def holds(interval, truth, slack=0.0):
    """Tell if an interval, widened by `slack` of the truth, holds it."""
    _, low, high = interval
    return low - slack * truth <= truth <= high + slack * truth


# ---- Prediction


def test_prediction_is_that_of_the_world(spec):
    world = World()
    found = studied(spec, world, variants=[], budget=10.0, load_seconds=0.5)
    prediction = found.prediction
    for point in prediction.points:
        assert holds(point.error, math.sqrt(world.mse(point.spp)), slack=0.01)
        assert point.error.value == pytest.approx(math.sqrt(world.mse(point.spp)), rel=0.03)
    # 2 threads, and tiles that are as slow as they are.
    per_sample = 160 * 112 * world.per_sample / 2 * world.unevenness(split_into_tiles(Window(0, 0, 160, 112))).mean()
    assert prediction.per_sample.value == pytest.approx(per_sample, rel=0.1)
    # Made up: load 0.5, build 0.5, develop 0.25; packing is real, and quick.
    assert 1.25 < prediction.fixed.value < 3.0
    # 0.13 / N + 0.09 / N^1.5 = 1e-4 for N = 1323.
    assert prediction.target_spp.value == pytest.approx(1323.0, rel=0.06)
    assert holds(prediction.target_spp, 1323.0, slack=0.03)
    assert prediction.target_seconds.value == pytest.approx(
        prediction.fixed.value + prediction.target_spp.value * prediction.per_sample.value
    )
    bought = (10.0 - prediction.fixed.value) / prediction.per_sample.value
    assert prediction.budget_spp == pytest.approx(bought)
    assert prediction.budget_error.value == pytest.approx(math.sqrt(world.mse(bought)), rel=0.05)


def test_mean_of_four_is_worse_than_an_unbroken_run(spec):
    world = World(linear=0.05, steep=0.5)
    prediction = studied(spec, world, variants=[]).prediction
    last = prediction.points[-1].spp
    assert prediction.halving == pytest.approx(world.mse(last) / 4 / world.mse(4 * last), rel=0.02)


def with_sampler(spec, sampler):
    return spec.model_copy(update={"render": spec.render.model_copy(update={"sampler": sampler})})


def test_slopes_are_the_sampler_s_and_stratified_samples_are_rendered_anew_for_each_level(spec):
    prediction = studied(with_sampler(spec, "independent"), World(), variants=[]).prediction
    assert (prediction.steep, prediction.early, prediction.exponent) == (0.0, 0.0, 1.0)
    world = World(linear=0.13, steep=0.0)
    prediction = studied(with_sampler(spec, "stratified"), world, variants=[]).prediction
    levels = [point.spp for point in prediction.points]
    assert levels == [4**k for k in range(2, 2 + len(levels))]
    # Means on the way to more samples are none of fewer: their strata are not all filled.
    assert set(levels) <= {spp for _, spp, _ in world.calls}


def test_a_tenth_of_the_tiles_tell_of_all(tmp_path):
    spec, world = scene_of(tmp_path, 1280, 800), World(per_sample=3e-5)
    found = studied(spec, world, variants=[])
    assert found.tiles == 80 * 50
    assert found.tiles_measured < 400
    point = found.prediction.points[0]
    assert holds(point.error, math.sqrt(world.mse(point.spp)), slack=0.02)
    known = np.isfinite(found.error_map)
    assert known.sum() == found.tiles_measured * 256
    # The error of a pixel from four replicates: a mean square of chi-square numbers.
    assert np.sqrt(np.mean(found.error_map[known] ** 2)) == pytest.approx(
        found.prediction.points[-1].error.value, rel=0.2
    )


# ---- Variants


def is_fast(prepared):
    return prepared.spec.render.accuracy == "fast"


def is_short(prepared):
    return prepared.scene.depth == 2


def test_equal_variants_show_no_difference_and_a_planted_one_its_size(spec):
    world = World(
        slower=lambda prepared: 1.3 if is_fast(prepared) else 1.0,
        noisier=lambda prepared: 0.5 if is_short(prepared) else 1.0,
        brighter=lambda prepared: 0.98 if is_short(prepared) else 1.0,
    )
    names = ["scene", "A/A", "accuracy=fast", "roulette=off", "max_depth=2"]
    found = studied(spec, world, variants=names[:1:-1], target=0.03)
    scene, control, slow, same, short = (variant(found, name) for name in names)
    assert [row.name for row in found.variants] == names
    assert found.rounds == 9
    # The scene's row is the prediction.
    assert scene.target_seconds == found.prediction.target_seconds.value
    assert scene.noise.value == pytest.approx(found.prediction.error(scene.spp))
    told = {row.name: (row.time_differs, row.noise_differs, row.bias_resolved) for row in found.variants[1:]}
    nothing = (False, False, False)
    assert told == dict(zip(names[1:], [nothing, (True, False, False), nothing, (False, True, True)], strict=True))
    # The control has random numbers of its own; roulette has no bias by construction, so none is measured.
    assert control.bias.high < 0.01
    assert control.noise_ratio.low < control.noise_ratio.value < control.noise_ratio.high
    assert (scene.bias, same.bias, same.unbiased) == (None, None, True)
    assert control.target_seconds == same.target_seconds == scene.target_seconds
    # Time alone.
    fixed = found.prediction.fixed.value
    assert slow.time.value == pytest.approx(1.3, rel=0.03)
    assert (slow.target_seconds - fixed) / (scene.target_seconds - fixed) == pytest.approx(1.3, rel=0.05)
    # Noise, and a bias of 2 % of the value, which the floor of the weights lessens: of 3 % in all, 2 % are bias.
    bias = 0.02 / math.sqrt(1.01)
    assert holds(short.noise_ratio, 0.5, slack=0.02)
    assert holds(short.bias, bias, slack=0.02)
    assert short.brightness.value == pytest.approx(-0.02, abs=0.002)
    assert 0.5 * world.mse(short.target_spp) + bias**2 == pytest.approx(0.03**2, rel=0.05)


def test_a_bias_that_may_exceed_the_target_is_doubted(spec):
    # Almost a hundredth, and noise that hides how much it is from a few rounds.
    world = World(
        linear=5.0,
        brighter=lambda prepared: 1.008 if is_short(prepared) else 1.0,
        noisier=lambda prepared: 4.0 if is_short(prepared) else 1.0,
    )
    found = studied(spec, world, variants=["max_depth=2", "roulette=off"], tiles=16)
    row = variant(found, "max_depth=2")
    assert row.bias.value < 0.01 < row.bias.high
    assert row.target_seconds is not None
    assert row.why_blank == "its bias may exceed the target"
    assert variant(found, "roulette=off").why_blank == variant(found, "A/A").why_blank == ""
    assert "[1]  its bias may exceed the target" in study_text(found)


def test_another_sampler_has_a_slope_of_its_own(spec):
    class Samplers(World):
        def render(self, prepared, windows, spp, *more):
            independent = prepared.spec.render.sampler == "independent"
            self.linear, self.steep = (0.5, 0.0) if independent else (0.05, 0.5)
            return super().render(prepared, windows, spp, *more)

    found = studied(spec, Samplers(), variants=["sampler=independent"])
    row = variant(found, "sampler=independent")
    assert row.target_spp == pytest.approx(0.5 / 1e-4, rel=0.1)
    ratio = (0.5 / row.spp) / (0.05 / row.spp + 0.5 / row.spp**1.5)
    assert row.noise_ratio.value == pytest.approx(ratio, rel=0.05)


def test_a_variant_that_cannot_be_packed_says_so_in_its_row(little, monkeypatch):
    world = World()
    prepare = world.prepare

    def broken(scene, packed):
        if scene.render.accuracy == "fast":
            raise InputError("there is nothing left")
        return prepare(scene, packed)

    monkeypatch.setattr(world, "prepare", broken)
    found = studied(little, world, variants=["accuracy=fast", "accuracy=robust"])
    assert variant(found, "accuracy=fast").failed == "there is nothing left"
    assert math.isnan(variant(found, "accuracy=fast").time.value)
    assert variant(found, "accuracy=robust").failed == ""
    assert variant(found, "accuracy=robust").time.value == pytest.approx(1.0, abs=0.1)


# ---- What may go wrong


def test_of_a_black_picture_nothing_can_be_told(spec):
    found = studied(spec, World(brightness=0.0), variants=["defocus"], budget=30.0)
    prediction = found.prediction
    unknown = [prediction.target_spp, prediction.target_seconds, prediction.budget_error]
    unknown = [interval.value for interval in (*unknown, *(point.error for point in prediction.points))]
    assert all(map(math.isnan, [prediction.power_spp, prediction.plain_spp, *unknown]))
    # What a sample takes is known.
    assert prediction.per_sample.value > 0.0
    assert "black" in found.warnings[0]
    assert not any("no noise" in warning for warning in found.warnings)
    # There is nothing to compare.
    assert found.variants == ()
    assert not found.interrupted
    shown = study_text(found)
    assert "takes could not be told" in shown
    for misleading in ("error of 0", "0 %", " 1 spp", "power law", "halving"):
        assert misleading not in shown


class Lamp(World):
    """Runs of a few samples have not found the light yet."""

    first: int = 16

    def render(self, prepared, windows, spp, seed, threads, keep=()):
        patch = super().render(prepared, windows, spp, seed, threads, keep)
        levels = {n: mean if n >= self.first else np.zeros_like(mean) for n, mean in patch.levels.items()}
        return patch._replace(mean=patch.mean if spp >= self.first else np.zeros_like(patch.mean), levels=levels)


@pytest.mark.parametrize("count", [30, None])
def test_a_light_that_the_pilot_missed_is_no_black_picture(spec, count):
    found = studied(spec, Lamp(), variants=[], tiles=count)
    point = found.prediction.points[-1]
    assert point.error.value == pytest.approx(math.sqrt(World().mse(point.spp)), rel=0.15 if count else 0.03)
    assert found.prediction.target_spp.value == pytest.approx(1323.0, rel=0.3 if count else 0.06)
    assert not any("black" in warning for warning in found.warnings)


def test_a_picture_without_noise_takes_one_sample(spec):
    noisier = World(linear=0.0, steep=0.0)
    found = studied(spec, noisier, variants=["defocus"])
    assert found.prediction.target_spp.value == 1.0
    assert any("no noise: one sample per pixel is enough" in warning for warning in found.warnings)
    shown = study_text(found)
    for misleading in ("power law", "halving", "< 0 %"):
        assert misleading not in shown
    assert found.variants[2].target_spp == 1.0


@pytest.mark.parametrize(("width", "height"), [(1, 1), (16, 16), (5, 40)])
def test_small_pictures(tmp_path, width, height):
    found = studied(scene_of(tmp_path, width, height), World(), variants=["defocus"])
    assert found.tiles == -(-width // 16) * -(-height // 16)
    assert found.tiles_measured == found.tiles
    assert found.error_map.shape == (height, width)
    assert math.isnan(found.top_share)
    if found.tiles == 1:
        assert math.isnan(found.prediction.target_spp.low)
        assert any("one tile" in warning for warning in found.warnings)


def test_an_interrupt_leaves_what_there_is(little):
    whole = World()
    studied(little, whole, variants=["defocus"], rounds=9)
    before_rounds = len(whole.calls) - 27
    # In round 5, of which 4 are whole.
    found = studied(little, replace(whole, calls=[], interrupt_after=before_rounds + 3 * 4 + 1), variants=["defocus"])
    assert found.interrupted
    assert found.rounds == 4
    assert variant(found, "defocus").time.value == pytest.approx(1.0, abs=0.1)
    assert any("4 of 9 rounds" in warning for warning in found.warnings)
    # Before a second round, or while variants are made ready.
    for calls in (before_rounds + 4, before_rounds - 1):
        found = studied(little, replace(whole, calls=[], interrupt_after=calls), variants=["defocus"])
        assert found.interrupted
        assert found.variants == ()
        assert found.prediction.target_spp.value > 1.0
    # Before there is a prediction.
    with pytest.raises(KeyboardInterrupt):
        studied(little, replace(whole, calls=[], interrupt_after=5), variants=["defocus"])


@pytest.mark.parametrize(
    ("world", "options", "what", "value", "words"),
    [
        (World(), {"budget": 0.2, "load_seconds": 1.0}, "budget_spp", 0.0, "budget"),
        (World(), {"budget": 0.2, "load_seconds": 1.0}, "budget_error", math.inf, "budget"),
        (World(), {"target": 1e-4}, "target_spp", 0.13 / 1e-8, "times as many samples as were measured"),
        (World(bad=2), {}, "target_spp", 1323.0, "8 samples were not finite"),
    ],
)
def test_what_makes_a_prediction_doubtful_is_warned_of(spec, world, options, what, value, words):
    found = studied(spec, world, variants=[], **options)
    predicted = getattr(found.prediction, what)
    assert getattr(predicted, "value", predicted) == pytest.approx(value, rel=0.1)
    assert any(words in warning for warning in found.warnings)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"target": 0.0}, "target 0: must be greater than 0"),
        ({"target": 2.0}, "target 2: must be greater than 0 and less than 1"),
        ({"target": math.nan}, "target nan"),
        ({"budget": -1.0}, "budget -1"),
        ({"rounds": 8}, "rounds 8: must be at least 9"),
        ({"variants": ["defocsu"]}, "did you mean 'defocus'?"),
        ({"variants": ["environment"]}, "no variant without environment: it is all the light"),
    ],
)
def test_questions_without_sense_are_refused_before_the_work(spec, options, words):
    world = World()
    with pytest.raises(InputError, match=words.replace("?", r"\?")):
        studied(spec, world, **options)
    assert world.calls == []


def test_where_noise_is_rare_most_tiles_are_measured_where_it_is(tmp_path):
    class Spot(World):
        def unevenness(self, windows):
            return np.array([40.0 if w.left < 64 and w.top < 64 else 0.6 for w in windows])

    spec, world = scene_of(tmp_path, 640, 640), Spot(per_sample=3e-6)
    found = studied(spec, world, variants=[], tiles=100)
    measured = np.isfinite(found.error_map)
    assert measured[:64, :64].all()
    # A tenth of the tiles would hold one or two of the sixteen that matter.
    mean = (16 * 40.0 + (1600 - 16) * 0.6) / 1600
    assert found.prediction.points[-1].error.value == pytest.approx(
        math.sqrt(mean * world.mse(found.prediction.points[-1].spp)), rel=0.03
    )


def test_no_number_of_samples_reaches_a_target_below_the_bias(little):
    world = World(brighter=lambda prepared: 0.95 if is_short(prepared) else 1.0)
    row = variant(studied(little, world, variants=["max_depth=2"]), "max_depth=2")
    assert row.target_spp is None
    assert row.target_seconds is None
    assert "bias" in row.why_blank


def test_brightness_is_certain_where_all_tiles_are_measured(spec):
    class Lit(World):
        """As much brighter in some tiles as darker in others."""

        def render(self, prepared, windows, *more):
            patch = super().render(prepared, windows, *more)
            if not is_short(prepared):
                return patch
            factors = np.array([0.5 if (w.left // 16 + w.top // 16) % 2 else 1.5 for w in windows])
            return patch._replace(mean=patch.mean * factors[:, None, None, None])

    row = variant(studied(spec, Lit(), variants=["max_depth=2"]), "max_depth=2")
    assert row.brightness.low <= 0.0 <= row.brightness.high
    assert row.brightness.high - row.brightness.low < 0.02


def test_all_variants_of_a_round_have_one_seed_and_the_control_another(little):
    world = World()
    found = studied(little, world, variants=["defocus"])
    last = world.calls[-27:-18]
    assert {spp for _, spp, _ in last} == {found.variants[0].spp}
    in_rounds = [[seed for _, _, seed in last[3 * r : 3 * r + 3]] for r in range(3)]
    # Scene, control, variant; then each a place earlier.
    assert in_rounds[0][0] == in_rounds[0][2] != in_rounds[0][1]
    assert in_rounds[1][2] == in_rounds[1][1] != in_rounds[1][0]
    assert in_rounds[2][0] == in_rounds[2][1] != in_rounds[2][2]
    assert len({seed for row in in_rounds for seed in row}) == 6


def test_the_same_seed_finds_the_same(little):
    first, again, other = (studied(little, World(), variants=["defocus"], seed=seed) for seed in (3, 3, 4))
    assert first.prediction.points[0].error == again.prediction.points[0].error
    assert first.variants[2].noise == again.variants[2].noise
    assert first.prediction.points[0].error != other.prediction.points[0].error


def test_levels_that_missed_a_light_do_not_make_the_target_cheap(spec):
    world = Lamp()
    world.first = 64
    found = studied(spec, world, variants=["sampler=independent"])
    assert found.prediction.points[0].error.value == 0.0
    for guess in (found.prediction.target_spp.value, found.prediction.power_spp, found.prediction.plain_spp):
        assert guess == pytest.approx(1323.0, rel=0.15)
    assert found.prediction.target_spp.low > 1000.0
    assert variant(found, "sampler=independent").target_spp == pytest.approx(1323.0, rel=0.25)


def test_a_noisy_variant_of_a_scene_without_noise(spec):
    class Lens(World):
        def mse(self, spp):
            return 0.0 if self.sharp else 0.01 / spp

        def render(self, prepared, *more):
            self.sharp = prepared.scene.depth != 2
            return super().render(prepared, *more)

    row = variant(studied(spec, Lens(), variants=["max_depth=2"]), "max_depth=2")
    assert row.noise.value == pytest.approx(math.sqrt(0.01 / row.spp), rel=0.05)
    assert row.target_spp == pytest.approx(100.0, rel=0.1)


def test_a_slow_scene_is_measured_on_few_tiles_and_says_so(tmp_path):
    # 1000 samples a second: a sample in every pixel takes four minutes.
    world = World(per_sample=2e-3, linear=1.0)
    found = studied(scene_of(tmp_path, 640, 400), world, variants=["defocus"])
    spent = sum(tiles * spp for tiles, spp, _ in world.calls) * 256 * 2e-3 / 2
    assert found.tiles_measured < 16
    assert any("tiles were measured" in warning for warning in found.warnings)
    # A minute for the prediction, and what little tells anything of a variant.
    assert spent < 4 * 60


def test_progress_goes_from_phase_to_phase(little):
    seen = []
    studied(little, World(), variants=["defocus"], progress=seen.append)
    phases = list(dict.fromkeys(progress.phase for progress in seen))
    assert phases == ["pack", "plan", "prepare", "warm up", "predict", "develop", "compile variants", "compare"]
    for phase in ("predict", "compile variants", "compare"):
        fractions = [progress.fraction for progress in seen if progress.phase == phase]
        assert fractions == sorted(fractions)
        assert fractions[-1] == pytest.approx(1.0)
