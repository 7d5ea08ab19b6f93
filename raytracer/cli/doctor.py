"""`rt doctor`: tells whether this installation works, and what to do where it does not."""

import textwrap

from raytracer.cli.base import options
from raytracer.cli.base.outputs import print_json

EXAMPLE = """\b
Example:
  rt doctor
  rt doctor --json
"""

_FAILED = 1


def doctor(*, as_json: options.AsJson = False) -> int:
    """Check the installation: versions, processor, memory, Embree, compiler, cache of kernels, extras, terminal.

    Nothing is taken on trust: a ray is traced by Embree, a small kernel compiled, or loaded from the cache.  Each line
    says `ok`, `warning` or `failed`, and what to do; a `-` is what is not there and need not be.  Exit status 1 if
    something failed.
    """
    from raytracer.analysis.doctor.diagnosis import diagnose

    checks = []
    for check in diagnose():
        checks.append(check)
        if not as_json:
            status = "-" if check.status == "absent" else check.status
            print(f"{status:8} {check.name:10} {check.found}", flush=True)
            if check.remedy:
                print(textwrap.indent(check.remedy, " " * 20))
    if as_json:
        print_json([check.json() for check in checks])
    return _FAILED if any(check.status == "failed" for check in checks) else 0
