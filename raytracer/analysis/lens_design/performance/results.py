"""Results of the analyses: plain numbers, and float64 arrays for curves.

Every class is a NamedTuple; units are in the names of the fields.  Where a curve has no value its array holds NaN.
`meridian` is "y" for lenses of revolution; lenses with cylinders have each result that depends on it twice, for "y" and
"x".
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.optics.glass import LINE_C, LINE_D, LINE_F

Curve = NDArray[np.float64]


class Settings(NamedTuple):
    """Settings of a study.

    f_number : None for the widest.
    focus_distance_mm : from the entrance pupil, may be infinite.
    sensor_mm : width and height; the largest field is its corner, or the lens's image circle if that is less.
    wavelengths_nm : the first, the primary colour, is that of results in one colour; the second and third are the ends
        between which chromatic aberration is measured.  The lens is focused in the d line.
    fields : heights in the image at which spots and MTF are taken, as parts of the largest.
    rays : across the pupil, of a spot diagram.
    steps : samples of a curve over the field or the pupil.
    frequencies_per_mm : line pairs a millimetre, of the MTF over the field.
    circle_of_confusion_mm : for the depth of focus; None for a 1500th of the picture's diagonal.
    """

    f_number: float | None = None
    focus_distance_mm: float = float("inf")
    sensor_mm: tuple[float, float] = (36.0, 24.0)
    wavelengths_nm: tuple[float, ...] = (LINE_D, LINE_F, LINE_C)
    fields: tuple[float, ...] = (0.0, 0.35, 0.5, 0.7, 0.85, 1.0)
    rays: int = 64
    steps: int = 41
    frequencies_per_mm: tuple[float, ...] = (10.0, 30.0, 50.0)
    circle_of_confusion_mm: float | None = None


class FirstOrder(NamedTuple):
    """First-order data by ray transfer matrices, beside the same by traced rays (at the primary wavelength).

    Places (`_z_mm`) are from the front vertex; `back_focus_mm` from the last vertex to the rear focal point.
    `*_traced_mm` come from real rays in the limit of small height; the `difference`s are relative.
    `f_number` is focal length over entrance pupil; `working_f_number` 1 / (2 sin u') of
    the outermost real ray from the axis that gets through.
    Pupils may be at infinity (telecentric): inf.  Fields of view are full angles over the sensor, by traced chief rays.
    """

    meridian: str
    wavelength_nm: float
    focal_length_mm: float
    focal_length_traced_mm: float
    focal_length_difference: float
    published_focal_length_mm: float
    back_focus_mm: float
    back_focus_traced_mm: float
    back_focus_difference: float
    front_focus_z_mm: float
    rear_focus_z_mm: float
    front_principal_z_mm: float
    rear_principal_z_mm: float
    front_nodal_z_mm: float
    rear_nodal_z_mm: float
    entrance_pupil_z_mm: float
    entrance_pupil_diameter_mm: float
    exit_pupil_z_mm: float
    exit_pupil_diameter_mm: float
    stop_z_mm: float
    stop_diameter_mm: float
    f_number: float
    working_f_number: float
    magnification: float
    film_z_mm: float
    image_distance_mm: float
    total_track_mm: float
    half_field_deg: float
    half_field_image_height_mm: float
    field_of_view_width_deg: float
    field_of_view_height_deg: float
    field_of_view_diagonal_deg: float
    petzval_radius_mm: float


class Spherical(NamedTuple):
    """Longitudinal spherical aberration over the zones of the pupil, by wavelength.

    pupil (k,) : height of the ray in the stop, as a part of that of the outermost ray that gets through.
    height_mm (k,) : in the entrance pupil's plane.
    longitudinal_mm (wavelengths, k) : place where the ray crosses the axis, from the primary colour's paraxial image.
    transverse_um (wavelengths, k) : height on the film, from the axis.
    third_order_mm (k,) : from the Seidel sum of the primary colour; NaN for lenses with cylinders.
    sine_condition (k,) : offence against it, of the primary colour, 0 where coma is absent (Welford 1986, ch. 9).
    """

    meridian: str
    wavelengths_nm: Curve
    pupil: Curve
    height_mm: Curve
    longitudinal_mm: Curve
    transverse_um: Curve
    third_order_mm: Curve
    sine_condition: Curve


class Fan(NamedTuple):
    """Transverse ray aberrations of one field: rays across the pupil, from the place of the primary colour's chief ray.

    pupil (k,) : height of the rays in the stop, -1 to 1 being what light of the axis fills.
    tangential_um (wavelengths, k) : dy over a meridional fan, NaN where blocked.
    sagittal_um (wavelengths, k) : dx over a fan across it, NaN where blocked.
    """

    meridian: str
    field: float
    field_deg: float
    wavelengths_nm: Curve
    pupil: Curve
    tangential_um: Curve
    sagittal_um: Curve


class FieldCurvature(NamedTuple):
    """Foci of narrow pencils around the chief rays, along the axis from the film (mm), by Coddington's equations.

    field (k,) : part of the largest.
    field_deg (k,), image_height_mm (k,) : of the same field points.
    tangential_mm, sagittal_mm (wavelengths, k) : the foci.
    petzval_mm (k,) : the Petzval surface, of the primary colour, from the paraxial image.
    """

    meridian: str
    wavelengths_nm: Curve
    field: Curve
    field_deg: Curve
    image_height_mm: Curve
    tangential_mm: Curve
    sagittal_mm: Curve
    petzval_mm: Curve


class DistortionCurve(NamedTuple):
    """Distortion of the primary colour's chief rays against ideal projections.

    percent (k,) : (y - y0) / y0 with y0 = f tan(field), NaN from 90 degrees on.
    f_theta_percent (k,) : against f x field (radians).
    projection : the one that fits best of "f tan", "f theta", "2f sin(theta/2)", "2f tan(theta/2)" and "f sin theta".
    projection_percent (k,) : against that.

    f is the scale of the paraxial chief ray on the film: the focal length, corrected for the distance of the film from
    the paraxial focus; for a near object the magnification times its distance from the entrance pupil.
    """

    meridian: str
    field: Curve
    field_deg: Curve
    image_height_mm: Curve
    percent: Curve
    f_theta_percent: Curve
    projection: str
    projection_percent: Curve


class ChromaticAberration(NamedTuple):
    """Chromatic aberration by wavelength.

    wavelengths_nm (w,) : densely over the visible spectrum.
    axial_mm (w,) : paraxial image from that of the primary colour.
    axial_between_ends_mm : of the second wavelength minus the third of the settings (blue - red; negative for a
        singlet).
    edge_wavelengths_nm (e,) : of the settings.
    lateral_um (e, k) : chief ray's image height minus that of the primary, over field (k,).
    """

    meridian: str
    wavelengths_nm: Curve
    axial_mm: Curve
    axial_between_ends_mm: float
    edge_wavelengths_nm: Curve
    field: Curve
    field_deg: Curve
    image_height_mm: Curve
    lateral_um: Curve


class Illumination(NamedTuple):
    """Light on the film from a uniformly bright scene, relative to the axis, over image height.

    relative (k,) : the irradiance, with all effects.
    cos4 (k,) : of a small unvignetted pupil at the place of the paraxial exit pupil.
    pupil (k,) : the first over the second, below 1 where rims cut the pupil off, above 1 where it grows towards the
        field.
    irradiance_over_pi_radiance : on the axis, E / (pi L) = sin^2 u'.
    """

    meridian: str
    field: Curve
    image_height_mm: Curve
    relative: Curve
    pupil: Curve
    cos4: Curve
    irradiance_over_pi_radiance: float


class Spot(NamedTuple):
    """Spot diagram of one field point, in one colour.

    points_um (n, 2) : x and y on the film, from the place of the primary colour's chief ray (y along the field, upwards
        being away from the axis; x across it).
    rms_um, largest_um : distances from the centroid.
    transmitted : light of the point that gets through, relative to a point on the axis: cross-section of the beam, or
        solid angle if it is near.
    """

    meridian: str
    field: float
    field_deg: float
    wavelength_nm: float
    points_um: Curve
    centroid_um: tuple[float, float]
    rms_um: float
    largest_um: float
    transmitted: float


class SpotsOfField(NamedTuple):
    """Spot diagrams of one field in all colours; rms_um and largest_um are of all together, about their centroid."""

    meridian: str
    field: float
    field_deg: float
    image_height_mm: float
    spots: tuple[Spot, ...]
    rms_um: float
    largest_um: float


class Mtf(NamedTuple):
    """Geometric MTF of one field, all colours alike: of the spot, without diffraction.

    frequencies_per_mm (k,) : line pairs a millimetre.
    tangential (k,) : of lines across the field's direction.
    sagittal (k,) : of lines along it.
    """

    meridian: str
    field: float
    field_deg: float
    image_height_mm: float
    frequencies_per_mm: Curve
    tangential: Curve
    sagittal: Curve


class MtfOverField(NamedTuple):
    """Geometric MTF over image height at a few frequencies (f,): tangential, sagittal (f, k)."""

    meridian: str
    field: Curve
    image_height_mm: Curve
    frequencies_per_mm: Curve
    tangential: Curve
    sagittal: Curve


class DiffractionLimit(NamedTuple):
    """MTF of a perfect lens of this working f-number, for reference: diffraction is not simulated elsewhere."""

    wavelength_nm: float
    f_number: float
    cutoff_per_mm: float
    frequencies_per_mm: Curve
    mtf: Curve


class Seidel(NamedTuple):
    """Seidel sums by surface (mm): arrays (n,) in the order of the surfaces; `total_*` are their sums.

    Of paraxial rays: the marginal ray of the stop as it is set, and the chief ray that lands at the largest image
    height, which is defined for fisheyes too.  asphere (n,) is the part of the spherical sum that comes from aspheric
    departures.  Welford 1986, "Aberrations of Optical Systems", chs. 8 and 10.
    """

    wavelength_nm: float
    image_height_mm: float
    lagrange_mm: float
    spherical: Curve
    coma: Curve
    astigmatism: Curve
    petzval: Curve
    distortion: Curve
    axial_colour: Curve
    lateral_colour: Curve
    asphere: Curve
    total_spherical: float
    total_coma: float
    total_astigmatism: float
    total_petzval: float
    total_distortion: float
    total_axial_colour: float
    total_lateral_colour: float


class Sensitivity(NamedTuple):
    """Sensitivity of the lens to a small error of one number.

    surface : from 1.
    parameter : radius, thickness or index.
    unit : of the step: "%", "mm", or "" for index.
    step : the error.
    back_focus_mm : change of the paraxial focus.
    back_focus_per_unit : derivative by the number itself (mm per mm, or mm per unit of index).
    spot_um : change of the RMS spot on the axis, with the film where it is.
    spot_refocused_um : the same with the film at the best focus.
    """

    surface: int
    parameter: str
    unit: str
    step: float
    back_focus_mm: float
    back_focus_per_unit: float
    spot_um: float
    spot_refocused_um: float


class Tolerances(NamedTuple):
    """Depth of focus and of field, and manufacturing tolerances (by finite differences).

    depth_of_focus_mm : distance to each side by which the film may be off for the circle of confusion.
    best_focus_mm : place of the least RMS spot on the axis, from the film.
    near_limit_mm, far_limit_mm : planes of the scene, from the entrance pupil, whose blur is that circle, at the
        primary wavelength, by first order.
    rss_back_focus_mm : root of the sum of squares of all sensitivities.
    """

    meridian: str
    circle_of_confusion_mm: float
    depth_of_focus_mm: float
    best_focus_mm: float
    rms_on_axis_um: float
    rms_on_axis_best_um: float
    near_limit_mm: float
    far_limit_mm: float
    sensitivities: tuple[Sensitivity, ...]
    rss_back_focus_mm: float


class Note(NamedTuple):
    """Note on a result that is missing or limited.

    topic : name of a field of the study.
    reason : sentence.
    """

    topic: str
    reason: str
