"""The exit pupil of a lens as seen from each place of the film: what a camera aims its rays at.

On a plane across the axis, that of the exit pupil if it can be, an ellipse is put round all points through which light
of any wavelength gets from a place of the film to the scene.  Points of the ellipse are drawn evenly, so that its area,
which the weight of each ray has, is one over their density.  The ellipse is smallest at the places of a table, and
between these its middle and its axes are interpolated: what a picture shows does not depend on it, as long as it holds
the pupil.  So no rings come from steps between the places; in other renderers they came from areas that were not in the
weight.

`tables` holds the packed tables and draws points, `transmission` traces rays from the film, `search` finds the pupil's
edge and puts ellipses round it, `build` makes the tables and keeps them on the disk.

References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH, sec. 3.3; Pharr,
Jakob, Humphreys 2023, "Physically Based Rendering", 4th ed., sec. 5.4.4 (bounds by radius, as boxes).
"""
