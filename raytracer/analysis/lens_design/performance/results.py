"""What the analyses give: plain numbers, and float64 arrays for curves.

Every class is a NamedTuple; units are in the names of the fields.  Where a curve has no value its array holds NaN.
`meridian` is "y" for lenses of revolution; lenses with cylinders have each result that depends on it twice, for "y" and
"x".
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from raytracer.glass import LINE_C, LINE_D, LINE_F

Curve = NDArray[np.float64]

FULL_FRAME = (36.0, 24.0)


class Settings(NamedTuple):
    """How a lens is looked at.

    f_number : None for the widest.
    focus_distance_mm : from the entrance pupil, may be infinite.
    sensor_mm : width and height; the largest field is its corner, or the lens's image circle if that is less.
    wavelengths_nm : the first, the primary colour, is that of results in one colour; the second and third are the ends
        between which colour errors are told.  The lens is focused in the d line.
    fields : heights in the image at which spots and MTF are taken, as parts of the largest.
    rays : of a spot diagram, across the pupil.
    steps : of a curve over the field or the pupil.
    frequencies_per_mm : line pairs a millimetre, of the MTF over the field.
    circle_of_confusion_mm : for the depth of focus; None for a 1500th of the picture's diagonal.
    """

    f_number: float | None = None
    focus_distance_mm: float = float("inf")
    sensor_mm: tuple[float, float] = FULL_FRAME
    wavelengths_nm: tuple[float, ...] = (LINE_D, LINE_F, LINE_C)
    fields: tuple[float, ...] = (0.0, 0.35, 0.5, 0.7, 0.85, 1.0)
    rays: int = 64
    steps: int = 41
    frequencies_per_mm: tuple[float, ...] = (10.0, 30.0, 50.0)
    circle_of_confusion_mm: float | None = None


class FirstOrder(NamedTuple):
    """Paraxial data by ray transfer matrices, beside the same by traced rays (at the primary wavelength).

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

    pupil (k,) : where the ray meets the stop, as a part of where the outermost one does that gets through; height_mm
    (k,) : its height in the entrance pupil's plane.
    longitudinal_mm (wavelengths, k) : where the ray meets the axis behind the primary colour's paraxial image.
    transverse_um (wavelengths, k) : where it meets the film, from the axis.
    third_order_mm (k,) : what the Seidel sum says of the primary colour; NaN for lenses with cylinders.
    sine_condition (k,) : the offence against it, of the primary colour, 0 where coma is absent (Welford 1986, ch. 9).
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
    """Transverse ray aberrations of one field: rays across the pupil, from where the primary colour's chief ray lands.

    pupil (k,) : where the rays meet the stop, -1 to 1 being what light of the axis fills; tangential_um, sagittal_um
    (wavelengths, k), NaN where blocked; tangential is dy over a meridional fan, sagittal dx over a fan across it.
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

    field (k,) part of the largest; field_deg (k,); image_height_mm (k,); tangential_mm, sagittal_mm
    (wavelengths, k); petzval_mm (k,) the Petzval surface, of the primary colour, from the paraxial image.
    """

    meridian: str
    wavelengths_nm: Curve
    field: Curve
    field_deg: Curve
    image_height_mm: Curve
    tangential_mm: Curve
    sagittal_mm: Curve
    petzval_mm: Curve


class Distortion(NamedTuple):
    """Where the chief rays of the primary colour land, against ideal projections.

    percent (k,) : (y - y0) / y0 with y0 = f tan(field), NaN from 90 degrees on; f_theta_percent (k,) : against f x
    field (radians).  f is the scale of the paraxial chief ray on the film: the focal length, but for what the film is
    off the paraxial focus, and for a near object the magnification times its distance from the entrance pupil.
    `projection` is the one that fits best of "f tan", "f theta", "2f sin(theta/2)", "2f tan(theta/2)" and
    "f sin theta"; projection_percent (k,) against it.
    """

    meridian: str
    field: Curve
    field_deg: Curve
    image_height_mm: Curve
    percent: Curve
    f_theta_percent: Curve
    projection: str
    projection_percent: Curve


class Colour(NamedTuple):
    """Colour errors by wavelength.

    wavelengths_nm (w,) : a dense row over the visible; axial_mm (w,) : paraxial image from that of the primary colour.
    axial_between_ends_mm : of the second wavelength minus the third of the settings (blue - red; negative for a
    singlet).  edge_wavelengths_nm (e,) the settings'; lateral_um (e, k) : chief ray's image height minus that of the
    primary, over field (k,).
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

    relative (k,) : the irradiance, all effects in; cos4 (k,) : what a small unvignetted pupil at the paraxial exit
    pupil's place would give; pupil (k,) : the first over the second, below 1 where rims cut the pupil off, above 1
    where it grows towards the field.
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
    """Where the light of one field point lands, in one colour.

    points_um (n, 2) : x and y on the film, from where the primary colour's chief ray lands (y along the field, upwards
    being away from the axis; x across it).  rms_um and largest_um about the centroid; transmitted : the light of the
    point that gets through, relative to a point on the axis: cross-section of the beam, or solid angle if it is near.
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
    """All colours of one field; rms_um and largest_um are of all of them together, about their common centroid."""

    meridian: str
    field: float
    field_deg: float
    image_height_mm: float
    spots: tuple[Spot, ...]
    rms_um: float
    largest_um: float


class Mtf(NamedTuple):
    """Geometric MTF of one field, all colours alike: of the spot, without diffraction.

    frequencies_per_mm (k,); tangential (k,), of lines across the field's direction; sagittal (k,), of lines along it.
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
    """What a small error of one number does: `surface` from 1; `parameter` is radius, thickness or index.

    step : the error, in `unit` ("%", "mm", or "" for index); back_focus_mm : what it moves the paraxial focus by;
    back_focus_per_unit : the derivative by the number itself (mm per mm, or mm per unit of index).
    spot_um : what it adds to the RMS spot on the axis with the film left where it is, spot_refocused_um: with the film
    moved to the best place.
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
    """How far the film may be off, and what small errors of making do (by finite differences).

    depth_of_focus_mm : the film may be that much nearer or farther for the circle of confusion; best_focus_mm : where
    the RMS spot on the axis is least, from the film; near_limit_mm, far_limit_mm : planes of the scene, from the
    entrance pupil, whose blur is that circle, at the primary wavelength, by first order; rss_back_focus_mm :
    the root of the sum of squares of all sensitivities.
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
    """Why something is missing or limited: `topic` is the name of a field of the study."""

    topic: str
    reason: str
