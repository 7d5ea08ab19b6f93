"""Values that a JSON schema asks for, chosen by bytes: most of them sensible, some of what nobody would write.

Bytes flipped in a YAML text end in its parser. A choice flipped here is another kind of camera, or a radius of 1e30.
"""

import math
import re
import struct

_NASTY = (
    0, -0.0, -1, 1e-30, 1e-12, 1e7, 1e18, 1e30, 1.7e308, -1e30, 5e-324, math.inf, -math.inf, math.nan, 2**31 - 1, 2**31,
    2**63, 2**64, 10**400, "1e400", "1/0", "1e-300/1e300", "0x7fffffff", "١٢", "50 mm", "1e9 km", "-3 parsec", "", " ",
    None, True, [], {}, "\x1b[31m", "a" * 300, "../../etc/passwd", "/dev/zero",
)  # fmt: skip
_SENSIBLE = (1.0, 0.5, 2, 0.25, 1.5, 0.1, 3.0, 0.01, 10.0, 0.9, -0.5, -1.0, 0.0, 1, 4, 0.75)
_FACTORS = (-1.0, 1e-3, 1e3, 0.5, 2.0, 1.0 + 1e-9, 1e-12, 1e12)
_NAMES = ("one", "two", "ball", "red")
_RARE = 3
"""Of 256 values, how many are nasty."""

_DEEPEST = 10
_UNITS = re.compile(r"\(([^()]*)\)\?\\s\*\$$")


class Choices:
    """Choices by the bytes of an input, one after the other; zeros once they have run out."""

    def __init__(self, data):
        self._bytes = iter(data)

    def byte(self):
        return next(self._bytes, 0)

    def one_of(self, values):
        return values[self.byte() % len(values)]

    def number(self):
        """One of eight bytes, one with a few digits, or one of those that are dear to us."""
        kind = self.byte() % 8
        if kind == 0:
            return struct.unpack("<d", bytes(self.byte() for _ in range(8)))[0]
        if kind == 1:
            return (self.byte() - 128) * 10.0 ** (self.byte() % 16 - 8)
        return self.one_of(_SENSIBLE)


class Grammar:
    """What a schema asks for.

    words : values by key that texts have, such as names of files; limits, by key, the greatest number that is given
        without being nasty, so that what is asked for takes little time.
    """

    def __init__(self, schema, words, limits):
        self._schema, self._words, self._limits = schema, words, limits

    def value(self, choices):
        """A value for the whole schema."""
        return self._of(self._schema, choices, "", 0)

    def changed(self, value, choices, times=1):
        """A valid value with some of its parts changed: taken away, doubled, nasty, or another that may stand there."""
        for _ in range(times):
            value = self._change(value, choices)
        return value

    def _change(self, value, choices):
        if isinstance(value, dict) and value:
            if choices.byte() % 8 or "camera" in value:
                key = choices.one_of(sorted(value))
                return value | {key: self._near(key, self._change(value[key], choices))}
            return self._other(value, choices)
        if isinstance(value, list) and value:
            deeper, place = choices.byte() % 4, choices.byte() % len(value)
            if deeper:
                return [*value[:place], self._change(value[place], choices), *value[place + 1 :]]
            return choices.one_of(([*value, value[place]], value[:place], [*value, *value], value[::-1]))
        if isinstance(value, bool):
            return not value
        if isinstance(value, int | float) and abs(value) <= 1e30 and choices.byte() % 8:
            factor = choices.one_of(_FACTORS)
            return choices.number() if choices.byte() % 2 else value * factor
        if isinstance(value, str) and choices.byte() % 4:
            return choices.one_of((*_NAMES, *(name for names in self._words.values() for name in names)))
        return choices.one_of(_NASTY)

    def _other(self, value, choices):
        """A mapping with a key fewer, or more, or another kind of what it is."""
        known = [one for one in self._schema["$defs"].values() if _type_of(one) is not None]
        how = choices.byte() % 8
        if how == 0:
            key = choices.one_of(sorted(value))
            return {name: item for name, item in value.items() if name != key}
        if how == 1:
            return self._of(choices.one_of(known), choices, "", 2)
        own = [one for one in known if _type_of(one) == value.get("type")] or [self._schema]
        properties = choices.one_of(own)["properties"]
        key = choices.one_of(sorted(properties))
        return value | {key: self._of(properties[key], choices, key, 2)}

    def _near(self, key, value):
        """A value that asks for no more work than one may ask for."""
        if key in self._limits and isinstance(value, int | float) and not value < self._limits[key]:
            return self._limits[key]
        return value

    def _of(self, schema, choices, key, depth):
        while "$ref" in schema:
            schema = self._schema["$defs"][schema["$ref"].rpartition("/")[2]]
        if "const" in schema:
            return schema["const"]
        if alternatives := schema.get("anyOf") or schema.get("oneOf"):
            simple = [one for one in alternatives if one.get("type") in ("null", "string")]
            return self._of(
                choices.one_of(simple if simple and depth > _DEEPEST else alternatives), choices, key, depth
            )
        if choices.byte() > 255 - _RARE:
            return choices.one_of(_NASTY)
        if "enum" in schema:
            return choices.one_of(schema["enum"])
        if schema.get("type") == "boolean":
            return bool(choices.byte() % 2)
        make = getattr(self, f"_{schema.get('type')}", None)
        return make and make(schema, choices, key, depth)

    def _object(self, schema, choices, key, depth):
        required = schema.get("required", ())
        result = {}
        for name, below in schema.get("properties", {}).items():
            if name in required or (depth <= _DEEPEST and choices.byte() % 4 == 0):
                result[name] = self._of(below, choices, name, depth + 1)
        extra = schema.get("additionalProperties")
        if isinstance(extra, dict):
            for name in _NAMES[: choices.byte() % 3]:
                result[name] = self._of(extra, choices, key, depth + 1)
        return result

    def _array(self, schema, choices, key, depth):
        least, most = schema.get("minItems", 0), schema.get("maxItems", 4)
        count = least + choices.byte() % (min(most, least + 3) - least + 1)
        items = [*schema.get("prefixItems", []), *[schema.get("items") or {}] * count][:count]
        return [self._of(item, choices, key, depth + 1) for item in items]

    def _string(self, schema, choices, key, depth):
        if "pattern" not in schema:
            return choices.one_of(self._words.get(key, _NAMES))
        found = _UNITS.search(schema["pattern"])
        return f"{choices.one_of(_SENSIBLE)} {choices.one_of(found[1].split('|')) if found else ''}"

    def _number(self, schema, choices, key, depth):
        number = choices.number()
        if key in self._limits:
            number = min(abs(number), self._limits[key])
        low, high = schema.get("minimum", schema.get("exclusiveMinimum")), schema.get("maximum")
        if low is not None and number < low and choices.byte() % 8:
            number = low + abs(number) if math.isfinite(number) else low
        if high is not None and number > high and choices.byte() % 8:
            number = high
        return number

    def _integer(self, schema, choices, key, depth):
        low, high = schema.get("minimum", 0), schema.get("maximum", 2**31)
        if choices.byte() % 16 == 0:
            return choices.one_of((low, high))
        return int(low + choices.byte() % (max(0, min(high, self._limits.get(key, low + 16)) - low) + 1))


def _type_of(schema):
    """Return the type that the definition of a kind has."""
    return schema.get("properties", {}).get("type", {}).get("const")


def written(value):
    """A value as YAML in one line, numbers to the last bit."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, float):
        return ".nan" if math.isnan(value) else repr(value).replace("inf", ".inf")
    if isinstance(value, int):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_quoted(key)}: {written(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(written, value)) + "]"
    return _quoted(value)


def _quoted(value):
    escaped = (c if c.isprintable() and c not in '"\\' and ord(c) < 128 else f"\\U{ord(c):08x}" for c in str(value))
    return '"' + "".join(escaped) + '"'
