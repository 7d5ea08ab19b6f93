"""Performance of a lens: first order, aberrations, spots, MTF, illumination and tolerances, as numbers and curves.

Each module has pure functions of a lens on an optical bench (`optical_bench`); `lens_study` calls them all.

Lengths are millimetres and angles degrees unless a name says otherwise.  The lens's own frame is used throughout: z is
the axis, from the scene to the film, with the front vertex at 0.  A field point lies above the axis, at +y (or at +x
where the meridian is x), so a lens that makes a real image puts it below; image heights are reported with the sign
turned, so that they are positive for an upright field as photographs show it.  Infinity and what has no value (a field
that no light reaches, a quantity that the lens does not have) are NaN or inf in arrays, and `None` in
`LensStudy.as_dict()`, whose `notes` give the reasons.
"""
