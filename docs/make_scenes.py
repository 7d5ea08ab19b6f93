"""Write docs/reference/scenes, the reference of scene files, from their schema: `make docs`.

Each kind has a page, made whole: what the kind's docstring says, its scene of scenes/kinds with its picture, and its
keys. Other pages are written by hand, and hold tables between markers, `<!-- keys film -->` and `<!-- end -->`. A test
compares all of them with what is made.
"""

import functools
import posixpath
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from docs.documents import link, with_links  # noqa: E402
from docs.scene_tables import (  # noqa: E402
    FAMILIES,
    MARKED,
    OUTPUT,
    cell,
    definition,
    formats,
    nested_by_key,
    specs_by_name,
    table,
    written_pages,
)
from raytracer.plugins.cameras.base.placement import PlacedSpec  # noqa: E402
from raytracer.plugins.materials.base.interface import MaterialSpec  # noqa: E402
from raytracer.plugins.shapes.base.interface import ShapeSpec  # noqa: E402
from raytracer.scene.json_schema import scene_schema  # noqa: E402
from raytracer.scene.python_api import FAMILIES as PYTHON_FAMILIES  # noqa: E402
from raytracer.scene.spec import SceneSpec  # noqa: E402
from raytracer.schema.spec import Spec  # noqa: E402

EXAMPLES = ROOT / "scenes" / "kinds"
PICTURES = "../../gallery/kinds"


SHARED: dict[str, tuple[type[Spec], str, str]] = {
    "cameras": (PlacedSpec, "every camera", "cameras/index.md#keys-of-every-camera"),
    "materials": (MaterialSpec, "every material", "normal-mapping.md"),
    "shapes": (ShapeSpec, "every object", "objects.md"),
}
"""Classes whose keys all kinds of a family have, what these keys are called, and where their table is."""

CHAPTERS: dict[str, tuple[str, ...]] = {
    "cameras": ("lecture.md", "lecture/04-field-of-view.md"),
    "cameras/camera_array": ("lightfields.md", "lecture/12-light-fields.md"),
    "cameras/camera_box": ("lightfields-poses.md", "lecture/12-light-fields.md"),
    "cameras/camera_sphere": ("lightfields-poses.md",),
    "cameras/fisheye": ("lecture/04-field-of-view.md", "lenses-gallery.md"),
    "cameras/lens": ("lenses.md", "lenses-gallery.md"),
    "cameras/light_field": ("lightfields.md", "lecture/12-light-fields.md"),
    "cameras/light_slab": ("lightfields.md", "lecture/12-light-fields.md"),
    "cameras/none": ("lecture/02-no-lens.md",),
    "cameras/pinhole": ("lecture/03-pinhole.md", "lecture/04-field-of-view.md"),
    "cameras/ray": ("lecture/12-light-fields.md",),
    "cameras/thin_lens": ("lecture/10-thin-lens.md", "lecture/11-defocus.md"),
    "apertures": ("lecture/11-defocus.md",),
    "filters": ("decisions/sampling.md",),
    "environments": ("decisions/light-sampling.md",),
    "lights": ("decisions/light-sampling.md",),
    "lights/flash": ("lecture/09-fast-and-slow.md",),
    "materials": ("decisions/light-transport.md",),
    "materials/boundary": ("decisions/media.md",),
    "materials/dielectric": ("dispersion.md", "decisions/nested-dielectrics.md"),
    "materials/rough_dielectric": ("dispersion.md", "decisions/nested-dielectrics.md"),
    "media": ("decisions/media.md",),
    "shapes": ("decisions/primitives-and-instances.md",),
    "shapes/mesh": ("decisions/meshes.md",),
    "textures": ("decisions/textures-and-normals.md",),
}
"""Documents that say more of a kind, or of all kinds of a family that have none of their own."""


def paragraphs(docstring: str | None) -> Iterator[str]:
    """Go through the paragraphs of a docstring, with documents that they name as links."""
    for paragraph in textwrap.dedent("    " + (docstring or "")).strip().split("\n\n"):
        yield with_links(" ".join(paragraph.split()))


def snippet(docstring: str | None) -> str:
    """The indented part of a kind's module docstring: a piece of a scene.

    Raises
    ------
    ValueError : the docstring holds none.
    """
    lines = [line for line in (docstring or "").splitlines() if line.startswith("    ")]
    if not lines:
        raise ValueError("the docstring of a kind's module must hold an indented piece of a scene")
    return textwrap.dedent("\n".join(lines))


# ---- What stands between markers


_HAS_SCENE = {"motion"}
"""Mappings whose page has a scene already."""


def nested_keys(key: str) -> Iterator[str]:
    """Write of what a mapping within others is the value, what it is, and the tables of its keys."""
    nested = nested_by_key()[key]
    # Groups hold what the list of objects does.
    places = dict.fromkeys(place.replace("groups.NAME[]", "objects[]").rstrip("[]") for place in nested.places)
    yield f"The value of {', '.join(f'`{place}`' for place in places)}.\n"
    known = specs_by_name()
    specs = [None if name is None else known[name] for name in nested.names]
    for spec in specs:
        if spec is not None and spec.__doc__:
            yield "\n\n".join(paragraphs(spec.__doc__)).replace("References:", "*References*:") + "\n"
            text = sys.modules[spec.__module__].__doc__ or ""
            if "In a scene:" in text and first_of_module()[spec.__module__] == key not in _HAS_SCENE:
                yield f"```yaml\n{snippet(text)}\n```\n"
    for number, (spec, form) in enumerate(zip(specs, nested.forms, strict=True)):
        if number:
            yield "or:\n"
        yield from table(spec, form)


@functools.cache
def first_of_module() -> Mapping[str, str]:
    """Find the mapping that shows the example of its module, of several the first, by modules; kinds show their own."""
    found = {spec.__module__: "" for family in FAMILIES.values() for spec in family.specs().values()}
    known = specs_by_name()
    for key, nested in nested_by_key().items():
        for name in nested.names:
            if name is not None:
                found.setdefault(known[name].__module__, key)
    return found


def keys(what: str) -> Iterator[str]:
    """Write the tables of the file's keys, of those that all kinds of a family have, or of a mapping within others."""
    shared = next((name for name, (_, called, _) in SHARED.items() if called == what), None)
    if what == "scene":
        yield from table(SceneSpec, scene_schema())
    elif shared is not None:
        kind = next(iter(FAMILIES[shared].specs().values()))
        yield from table(kind, definition(kind), frozenset(kind.model_fields) - own_keys_of(SHARED[shared][0]))
    else:
        yield from nested_keys(what)


def own_keys_of(base: type[Spec]) -> frozenset[str]:
    """List the keys of a base class but the type."""
    return frozenset(base.model_fields) - {"type"}


def first_sentence(docstring: str | None) -> str:
    """Return the first sentence of a docstring, without the stop."""
    return next(paragraphs(docstring)).rstrip(".")


def kinds(name: str) -> Iterator[str]:
    """Write the table of the kinds of a family, with their pictures."""
    yield "| picture | kind |\n|---|---|"
    for kind, spec in FAMILIES[name].specs().items():
        page, picture = f"{name}/{kind}.md", f"![{kind}]({PICTURES}/{name}/{kind}.jpg)"
        yield f"| [{picture}]({page}) | [**{kind}**]({page})<br>{cell(first_sentence(spec.__doc__))} |"


def families() -> Iterator[str]:
    """Write the table of all kinds."""
    yield "| family | kinds |\n|---|---|"
    for name, family in FAMILIES.items():
        listed = ", ".join(f"[{kind}]({name}/{kind}.md)" for kind in family.specs())
        yield f"| [{name.capitalize()}]({name}/index.md) | {listed} |"


# ---- Pages


def example(name: str) -> Path:
    """Find the example scene of a kind, such as `cameras/pinhole`.

    Raises
    ------
    ValueError : there is none.
    """
    path = EXAMPLES / f"{name}.yaml"
    if not path.exists():
        raise ValueError(f"{name} has no example: write {path.relative_to(ROOT)}")
    return path


def kind_page(name: str, kind: str, spec: type[Spec]) -> Iterator[str]:
    """Write the page of a kind: what it is, an example with its picture, its keys, and what says more."""
    family = FAMILIES[name]
    yield f"# {kind} ({family.noun})\n"
    text = example(f"{name}/{kind}").read_text(encoding="utf-8")
    first, *said = paragraphs(spec.__doc__)
    yield f"{first}\n"
    yield f"![{text.splitlines()[0].removeprefix('# ')}]({PICTURES}/{name}/{kind}.jpg)\n"
    yield from (f"{paragraph}\n" for paragraph in said if not paragraph.startswith("References:"))
    yield f"```yaml\n{snippet(sys.modules[spec.__module__].__doc__)}\n```\n"
    word = next(word for word, other in PYTHON_FAMILIES.items() if other is family)
    yield f"In [Python](../python/index.md) it is `rt.{word}.{kind}(...)`.\n"

    yield "## Example\n"
    yield f"```\n$ rt render scenes/kinds/{name}/{kind}.yaml\n```\n"
    yield f"```yaml\n{text}```\n"

    yield "## Keys\n"
    base, called, place = SHARED.get(name, (None, "", ""))
    shared = own_keys_of(base) if base else frozenset()
    yield from table(spec, definition(spec), shared | {"type"})
    if shared:
        listed = ", ".join(f"`{key}`" for key in definition(spec)["properties"] if key in shared)
        yield f"Besides, it may have the [keys of {called}]({place}): {listed}.\n"

    yield "## See also\n"
    for document in CHAPTERS.get(f"{name}/{kind}", CHAPTERS[name]):
        yield f"- {link(document)}"
    yield from (f"- {paragraph}" for paragraph in said if paragraph.startswith("References:"))


def placed(text: str, page: str) -> str:
    """Make the links of a text lead there from its page; they are written as from the folder of the reference."""

    def relative(found: re.Match[str]) -> str:
        path, hash_, anchor = found[1].partition("#")
        if path == page and hash_:
            return f"](#{anchor})"
        return f"]({posixpath.relpath(path, posixpath.dirname(page) or '.')}{hash_}{anchor})"

    return re.sub(r"\]\(([^)\s]+)\)", relative, text)


def filled(page: str) -> str:
    """Put what is made between the markers of a page that is written by hand."""
    makers = {"families": lambda _: families(), "formats": lambda _: formats(), "keys": keys, "kinds": kinds}

    def fill(mark: re.Match[str]) -> str:
        made = "\n".join(makers[mark[1]](mark[2].strip())).rstrip()
        return f"<!-- {mark[1]}{mark[2]} -->\n\n{placed(made, page)}\n\n<!-- end -->\n"

    return MARKED.sub(fill, (OUTPUT / page).read_text(encoding="utf-8"))


def reference() -> dict[str, str]:
    """Make the texts of all pages, by their paths in the reference."""
    made = {page: filled(page) for page in written_pages()}
    for name, family in FAMILIES.items():
        for kind, spec in family.specs().items():
            page = f"{name}/{kind}.md"
            made[page] = placed("\n".join(kind_page(name, kind, spec)).rstrip() + "\n", page)
    return made


def main() -> None:
    """Write all pages, and remove those of kinds that are no more."""
    made = reference()
    for path in OUTPUT.glob("*/*.md"):
        if path.relative_to(OUTPUT).as_posix() not in made:
            path.unlink()
    for name, text in made.items():
        (OUTPUT / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
