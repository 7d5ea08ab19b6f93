"""Pages that a new user follows: their commands exist and work, and print what the pages say."""

import itertools
import operator
import re
import shlex
import statistics
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

import pytest
import typer

import raytracer
from raytracer.analysis.cost.text import study_text
from raytracer.analysis.explain import explain
from raytracer.cli.base.app import application
from raytracer.scene.load import load
from raytracer.scene.overrides import parse_overrides
from raytracer.util.errors import SceneError
from tests.analysis.cost import studies
from tests.repository import ROOT, script

COMMANDS = typer.main.get_command(application()).commands  # type: ignore[attr-defined]
PAGES = {
    path.stem: path.read_text(encoding="utf-8")
    for path in (
        ROOT / "README.md",
        *(
            ROOT / "docs" / f"{name}.md"
            for name in (
                "tutorial",
                "costs",
                "hard-cases",
                "only-what-is-called-for",
                "sweeps",
                "comparing",
                "aovs",
                "debugging",
                "regression",
                "dispersion",
                "cluster",
                "reliability",
                "lightfields",
                "lenses",
            )
        ),
    )
}
RT = Path(sysconfig.get_path("scripts")) / "rt"

every_page = pytest.mark.parametrize("name", PAGES)


def blocks(name: str, language: str = "") -> list[str]:
    found = re.findall(r"^```(\w*)\n(.*?)^```$", PAGES[name], re.DOTALL | re.MULTILINE)
    return [text for its, text in found if its == language]


def commands(name: str) -> list[tuple[list[str], list[str]]]:
    """The words of each `rt` command of a page, and the lines that stand below it where a prompt stands before it."""
    found = []
    for block in blocks(name):
        whole = re.sub(r" \\\n +", " ", block)
        for piece in re.split(r"^(?=\$ rt |rt )", whole, flags=re.MULTILINE)[1:]:
            first, *output = piece.splitlines()
            words = shlex.split(first.removeprefix("$ "), comments=True)
            found.append((words[1:], output if first.startswith("$") else []))
    return found


def overrides(words: list[str]) -> Any:
    return parse_overrides([value for option, value in itertools.pairwise(words) if option == "-D"])


def same(line: str) -> str:
    """A line without the widths of its columns."""
    return " ".join(line.split())


@every_page
def test_commands_and_their_options_exist(name: str) -> None:
    assert commands(name)
    for (verb, *words), _ in commands(name):
        command = COMMANDS[verb]
        below = getattr(command, "commands", {})
        known = {
            option for part in (command, *below.values()) for parameter in part.params for option in parameter.opts
        }
        assert {word for word in words if re.fullmatch(r"--[\w-]+|-[a-zA-Z]", word)} <= known, words


@every_page
def test_names_of_python_exist(name: str) -> None:
    for block in blocks(name, "python"):
        for found in re.findall(r"\brt((?:\.\w+)+)\(", block):
            operator.attrgetter(found[1:])(raytracer)
        for line in re.findall(r"^from raytracer.*$", block, re.MULTILINE):
            exec(line, {})


def test_pages_show_what_is_explained_of_shipped_scenes() -> None:
    shown = [
        (ROOT / words[1], "--all" in words, {same(line) for line in output} - {"..."})
        for name in PAGES
        for words, output in commands(name)
        if words[0] == "explain" and words[1].startswith("scenes/") and output
    ]
    assert len(shown) >= 3
    for scene, every_key, lines in shown:
        assert lines <= {same(line) for line in explain(load(scene), every_key=every_key).text().splitlines()}, scene


# ---- The tutorial, and README's five minutes


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A new user's folder with the scenes of the pages, and in it."""
    script("docs/make_tutorial.py").write_scenes(tmp_path)
    (tmp_path / "ball.yaml").write_text(blocks("README", "yaml")[0])
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["README", "tutorial"])
def test_what_a_new_user_is_told_is_printed(name: str, folder: Path) -> None:
    told = [(words, [line for line in output if line.strip() not in ("...", "")]) for words, output in commands(name)]
    for (verb, scene, *words), output in told:
        if verb == "explain":
            explanation = explain(load(scene, overrides(words)), every_key="--all" in words)
            printed = {same(line) for line in explanation.text().splitlines()}
            assert {same(line) for line in output} <= printed
        elif output:
            # A mistake: in the line that the page names, or by an override.
            (line,) = output
            if verb == "validate":
                number = int(line.split(":")[2])
                lines = Path(scene).read_text().splitlines()
                lines[number - 1] = lines[number - 1].replace("albedo", "albdo")
                Path(scene).write_text("\n".join(lines))
            with pytest.raises(SceneError) as caught:
                load(scene, overrides(words))
            assert line == f"rt: {caught.value}"
            Path(scene).write_text(Path(scene).read_text().replace("albdo", "albedo"))


def test_scenes_that_a_new_user_writes_have_the_cameras_that_the_tutorial_tells_of(folder: Path) -> None:
    cameras = {name: load(f"{name}.yaml").camera.type for name in ("array", "gauss", "sunny", "table")}
    assert cameras == {"array": "camera_array", "gauss": "lens", "sunny": "thin_lens", "table": "pinhole"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["README", "tutorial"])
def test_all_commands_of_a_new_user_work_in_the_order_of_the_page(name: str, folder: Path) -> None:
    small = ["-D", "film.width=48", "-D", "film.height=32"]
    for (verb, *words), output in commands(name):
        if output and verb in ("validate", "render"):
            continue
        # Dragons are another test's, and pixels those of a small film.
        if "dragons" in " ".join(words) or "--crop" in words or "--pixel" in words:
            continue
        takes = verb in ("render", "sweep", "cost") or words[0] == "render"
        done = subprocess.run(
            [RT, verb, *words, *(small if takes else [])], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, (verb, words, done.stderr)
    outputs = {word for words, _ in commands(name) for word in words if re.search(r"\.(png|html|lf)$", word)}
    missing = {word for word in outputs if not (folder / word).exists()}
    assert missing == ({"crop.png"} if name == "tutorial" else {"jade.png", "dragons.lf", "dragons.html"})


# ---- Only what is called for


def test_effects_of_scenes_are_those_of_the_page() -> None:
    text = PAGES["only-what-is-called-for"]
    cover = explain(load(ROOT / "scenes" / "cover.yaml"))
    assert f"Seven effects of {len(cover.effects)}" in text
    rows = re.findall(r"^\| `(scenes/\w+\.yaml)` \| (\d+) \|", text, re.MULTILINE)
    assert len(rows) == 6
    for path, count in rows:
        assert sum(effect.active for effect in explain(load(ROOT / path)).effects.values()) == int(count), path


# ---- What accuracy costs


def test_what_cost_prints_has_the_form_of_the_page() -> None:
    (shown,) = (output for (verb, *_), output in commands("costs") if verb == "cost")

    def form(line: str) -> str:
        """Words of a line, without its numbers and what depends on their widths."""
        return same(re.sub(r"N\^\S+|\S*\d\S*|\(|\)|\.\.|;|<|%|\bm?s\b|spp$", " ", line))

    printed = {form(line) for line in study_text(studies.study()).splitlines()}
    rows = [form(line) for line in shown]
    heads = [
        line for line in rows if re.match(r"Relative|error|by|after|time per|What each|repeat|without|with$", line)
    ]
    assert len(heads) == 10
    lost = [line for line in heads if not any(other.startswith(line.split(" no ")[0]) for other in printed)]
    assert not lost


def test_numbers_that_the_page_of_costs_reads_off_are_in_its_tables() -> None:
    text = PAGES["costs"]
    errors = {
        int(spp): float(error) for spp, error in re.findall(r"^ +(\d+) +[\d.]+ s +([\d.]+) %", text, re.MULTILINE)
    }
    (first, last, times) = re.findall(
        r"falls from ([\d.]+) to ([\d.]+) %: sixteen\ntimes the samples, ([\d.]+) times", text
    )[0]
    assert (float(first), float(last)) == (errors[16], errors[256])
    assert errors[16] / errors[256] == pytest.approx(float(times), abs=0.05)
    rows = re.findall(r"^\| \w+ \| [\d.]+ M \| ([\d.]+) .*? \| ([\d.]+) .*? \| ([\d.]+) ", text, re.MULTILINE)
    robust, fast, again = (statistics.median(map(float, column)) for column in zip(*rows, strict=True))
    assert len(rows) == 12
    told = re.search(r"`fast` takes ([\d.]+) times.*\nmedian, `robust` ([\d.]+) times, and .* ([\d.]+):", text)
    assert told is not None
    assert [float(number) for number in told.groups()] == pytest.approx([fast, robust, again], abs=0.0051)


def test_what_is_said_of_peers_and_of_effects_is_in_their_tables() -> None:
    text, peers = PAGES["costs"], (ROOT / "docs" / "peers.md").read_text(encoding="utf-8")
    default, best = re.findall(r"^\| geometric mean \| \| \| \| ([\d.]+) \| ([\d.]+) \|$", peers, re.MULTILINE)[0]
    ratios = {
        name: float(ratio)
        for name, ratio in re.findall(r"^\| (\w+), \d+ x \d+ \|.* \| ([\d.]+) \|$", peers, re.MULTILINE)
    }
    assert len(ratios) == 9
    low, high = min(ratios, key=ratios.__getitem__), max(ratios, key=ratios.__getitem__)
    assert f"It is {default} of Mitsuba's with its default sampler" in " ".join(text.split())
    assert f"in the geometric mean of the nine scenes, and {best} of" in " ".join(text.split())
    assert f"from {ratios[low]:.2g} (`{low}`) to {ratios[high]:.2g} (`{high}`)" in " ".join(text.split())
    effects = dict(re.findall(r"^\| (\w+: .*?) \| ([\d.]+) .* \|$", text, re.MULTILINE))
    for words, effect, times in (
        ("one moving ball costs a third more time", "motion: one small sphere moves", 4 / 3),
        ("a checker a quarter", "texture: checker on the ground", 5 / 4),
        ("haze without end ten times", "medium: haze everywhere, without end", 10.0),
    ):
        assert words in " ".join(PAGES["only-what-is-called-for"].split())
        assert float(effects[effect]) == pytest.approx(times, rel=0.1)


# ---- The table of the lecture


def anchors(path: Path) -> set[str]:
    """The sections of a page, as links name them."""
    heads = re.findall(r"^#+ (.*)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", head).lower().replace(" ", "-") for head in heads}


def test_each_item_of_the_lecture_is_shown_somewhere_or_said_to_be_missing() -> None:
    page = ROOT / "docs" / "lecture" / "items.md"
    text = page.read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| (.+) \| (.*) \| (shown|partly: .+|missing) \|$", text, re.MULTILINE)
    assert [int(number) for number, *_ in rows] == list(range(1, 151))
    assert len({item for _, item, *_ in rows}) == 150
    states = [state.partition(":")[0] for *_, state in rows]
    told = re.search(r"(\d+) are shown, (\d+) (?:is|are) shown\nin part, and (\d+) (?:is|are) missing", text)
    assert told is not None
    assert [int(count) for count in told.groups()] == [states.count(state) for state in ("shown", "partly", "missing")]
    for number, _, where, state in rows:
        links = re.findall(r"\]\(([^)#]+)#?([^)]*)\)", where)
        assert bool(links) == (state != "missing"), number
        for link, anchor in links:
            target = page.parent / link
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), (link, anchor)
