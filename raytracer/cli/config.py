"""`rt config`: shows the defaults of options, and where each comes from."""

import os

from raytracer.cli.base import options
from raytracer.cli.base.defaults import KEYS, defaults_file, read_defaults, variable
from raytracer.cli.base.outputs import print_json

EXAMPLE = """\b
Examples:
  rt config
  rt config --json
  RT_SPP=16 RT_THREADS=2 rt config

\b
A file rt.toml, which `rt config` names:
  threads = 8
  noise = "1%"
  max-memory = "4GB"
"""

_OTHERS = ("RT_ALLOW_FILES", "RT_TRACEBACK", "RAYTRACER_CACHE_DIR")


def config(as_json: options.AsJson = False) -> None:
    """Show the defaults that your file rt.toml and variables give to options, and where each comes from.

    The command line comes before a variable, and a variable before the file.  RT_TIME_LIMIT is the variable for
    --time-limit, and so on.
    """
    from raytracer.report.table import align_columns

    file, found = defaults_file(os.environ), read_defaults(os.environ)
    others = {name: os.environ[name] for name in _OTHERS if os.environ.get(name)}
    if as_json:
        values = {key: found[key]._asdict() if key in found else None for key in KEYS}
        print_json({"file": str(file), "defaults": values, "variables": others})
        return
    rows = [[key, _format(found[key].value), found[key].source] for key in KEYS if key in found]
    rows += [[key, "-", f"not set; {variable(key)} would"] for key in KEYS if key not in found]
    rows += [[name, value, "this variable"] for name, value in others.items()]
    print(f"{file}{'' if file.exists() else ' (not there)'}")
    for row in align_columns([["option", "default", "from"], *rows], left=3):
        print(f"  {row}".rstrip())


def _format(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
