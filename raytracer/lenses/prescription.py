"""A lens as its file has it: what stands in `scenes/lenses/*.yaml`.

    name: Plano-convex singlet 100 mm
    source: worked example of a textbook ...
    focal_length: 100 mm
    surfaces:
      - {type: flat, thickness: 5, material: 1.5, aperture: 25}
      - {type: spherical, radius: -50, thickness: 96.7, aperture: 25}

Lengths are millimetres; surfaces come in the order in which light from the scene meets them; `thickness` is the way to
the next surface, and `material` what fills it, air by default; `aperture` is the clear diameter.
"""
