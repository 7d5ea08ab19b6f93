"""One module a loader: `seeds()`, small valid files of every kind it takes, and `run(data, folder)`, which loads one.

`run` may raise InputError, or OutputError, and nothing else; what it has loaded it checks: that numbers are finite,
indices within range, sizes within their limits.  A module may also set

MAX_LENGTH : bytes that an input has at most (4096).
PARSERS : packages written in Python that parse for the loader, whose coverage is followed along with raytracer's.
ADDRESS_LIMIT : bytes of address space that an input may ask for without using them (1 GB).
DICTIONARY : words of the format, bytes each, that inputs are made of.
"""
