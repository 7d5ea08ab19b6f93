"""Record of an effect, and the effects that the kinds of a family are."""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from raytracer.report.wording import count


class Effect(NamedTuple):
    """Effect of a scene.

    active : it is simulated.
    why : the reason, in words.
    """

    active: bool
    why: str


def kind_effects(
    family: str,
    modules: Mapping[str, str],
    used: Iterable[str],
    user: str,
    of: object,
    tables: Iterable[object] | None = None,
) -> dict[str, Effect]:
    """List one effect a kind of a family, by name, with how often it is used.

    modules : of the kinds, by name.
    used : the kind of each use.
    user, of : what uses them, and the whole that these are part of, such as an `object` of 3.
    tables : the packed ones, by which kinds are active; else those are that are used.
    """
    numbers = Counter(used)
    packed = None if tables is None else {type(table).__module__ for table in tables}
    effects = {}
    for kind, module in modules.items():
        active = numbers[kind] > 0 if packed is None else module in packed
        added = ", and in the file of a mesh" if active and not numbers[kind] else ""
        effects[f"{family}.{kind}"] = Effect(active, f"{count(numbers[kind], user)} of {of}{added}")
    return effects
