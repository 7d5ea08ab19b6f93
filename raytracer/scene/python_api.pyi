# Made by `make docs` from the schema of scene files; change the descriptions in the code instead.
# fmt: off
# ruff: noqa: A001, A002, E501, I001, N802
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from raytracer.schema.registry import Family
from raytracer.plugins.materials.base.interface import MaterialSpec
from raytracer.plugins.textures.base.interface import TextureSpec
from raytracer.core.camera_shake import Shake as _Shake
from raytracer.core.motion.spec import Keyframe as _Keyframe
from raytracer.core.motion.spec import Motion as _Motion
from raytracer.core.motion.spec import Spin as _Spin
from raytracer.core.shutter.spec import ShutterSpec as _ShutterSpec
from raytracer.film.tone import ToneCurveSpec as _ToneCurveSpec
from raytracer.optics.sensor_formats import SensorSpec as _SensorSpec
from raytracer.optics.thin_lens import AutoExposure as _AutoExposure
from raytracer.plugins.apertures.base.vignetting import Vignetting as _Vignetting
from raytracer.plugins.apertures.image import ImageAperture as _ImageAperture
from raytracer.plugins.apertures.polygon import PolygonAperture as _PolygonAperture
from raytracer.plugins.apertures.round import Round as _Round
from raytracer.plugins.cameras.base.microlenses import Microlenses as _Microlenses
from raytracer.plugins.cameras.camera_array import CameraArray as _CameraArray
from raytracer.plugins.cameras.camera_box import CameraBox as _CameraBox
from raytracer.plugins.cameras.camera_sphere import CameraSphere as _CameraSphere
from raytracer.plugins.cameras.equirectangular import Equirectangular as _Equirectangular
from raytracer.plugins.cameras.fisheye import Fisheye as _Fisheye
from raytracer.plugins.cameras.lens import RealLens as _RealLens
from raytracer.plugins.cameras.light_field import LightField as _LightField
from raytracer.plugins.cameras.light_slab import LightSlab as _LightSlab
from raytracer.plugins.cameras.none import BareSensor as _BareSensor
from raytracer.plugins.cameras.orthographic import Orthographic as _Orthographic
from raytracer.plugins.cameras.pinhole import Pinhole as _Pinhole
from raytracer.plugins.cameras.ray import Ray as _Ray
from raytracer.plugins.cameras.thin_lens import ThinLens as _ThinLens
from raytracer.plugins.environments.constant import Constant as _Constant
from raytracer.plugins.environments.gradient import Gradient as _Gradient
from raytracer.plugins.environments.image import ImageEnvironment as _ImageEnvironment
from raytracer.plugins.environments.sky import Sky as _Sky
from raytracer.plugins.filters.box import Box as _FilterBox
from raytracer.plugins.filters.gaussian import Gaussian as _Gaussian
from raytracer.plugins.filters.mitchell import Mitchell as _Mitchell
from raytracer.plugins.lights.flash import FlashLight as _FlashLight
from raytracer.plugins.lights.point import PointLight as _PointLight
from raytracer.plugins.lights.spot import SpotLight as _SpotLight
from raytracer.plugins.lights.sun import Sun as _Sun
from raytracer.plugins.materials.boundary import Boundary as _Boundary
from raytracer.plugins.materials.cutout import Cutout as _Cutout
from raytracer.plugins.materials.dielectric import Dielectric as _Dielectric
from raytracer.plugins.materials.emitter import Emitter as _Emitter
from raytracer.plugins.materials.lambertian import Lambertian as _Lambertian
from raytracer.plugins.materials.metal import Metal as _Metal
from raytracer.plugins.materials.mixture import Mixture as _Mixture
from raytracer.plugins.materials.principled import Principled as _Principled
from raytracer.plugins.materials.rough_conductor import RoughConductor as _RoughConductor
from raytracer.plugins.materials.rough_dielectric import RoughDielectric as _RoughDielectric
from raytracer.plugins.materials.thin_dielectric import ThinDielectric as _ThinDielectric
from raytracer.plugins.materials.two_sided import TwoSided as _TwoSided
from raytracer.plugins.media.grid import Grid as _Grid
from raytracer.plugins.media.homogeneous import Homogeneous as _Homogeneous
from raytracer.plugins.shapes.box import Box as _ObjectBox
from raytracer.plugins.shapes.disc import Disc as _Disc
from raytracer.plugins.shapes.instance import Instance as _Instance
from raytracer.plugins.shapes.mesh import Frame as _Frame
from raytracer.plugins.shapes.mesh import Mesh as _Mesh
from raytracer.plugins.shapes.quad import Quad as _Quad
from raytracer.plugins.shapes.scatter import Scatter as _Scatter
from raytracer.plugins.shapes.sphere import Sphere as _Sphere
from raytracer.plugins.shapes.triangle import Triangle as _Triangle
from raytracer.plugins.textures.checker import Checker as _Checker
from raytracer.plugins.textures.image import ImageTexture as _ImageTexture
from raytracer.plugins.textures.noise import Noise as _Noise
from raytracer.scene.render_settings import Film as _Film
from raytracer.scene.render_settings import Render as _Render

_Numbers: TypeAlias = Sequence[float | str] | NDArray[np.floating[Any] | np.integer[Any]]
_Rows: TypeAlias = Sequence[_Numbers] | NDArray[np.floating[Any] | np.integer[Any]]
_Keys: TypeAlias = Mapping[str, Any]

FAMILIES: dict[str, Family]

def parts() -> dict[str, type[Any]]: ...

class _Apertures:
    @staticmethod
    def image(
        *,
        file: str | PathLike[str],
        encoding: Literal["linear", "srgb"] = ...,
        anamorphic: float | str = ...,
    ) -> _ImageAperture:
        """A mask before the lens: white lets light through, black does not, grey and half transparent places do in part.

        The middle of the picture is on the axis, its pixels are square, and its top is up.  What counts is how much light
        pixels let through in proportion to each other; the whole is made as large as lets through what the round aperture
        does.

        Parameters
        ----------
        file : picture (.png .jpg .bmp .tga .tif .webp .exr .hdr .npy), relative to the scene
        encoding : what the picture's values are: the transmission itself, or the sRGB code of it
        anamorphic : height of the shape over its width, once stretched without a change of area; 2 for the upright
            ovals of an anamorphic lens
        """
    @staticmethod
    def polygon(
        *,
        blades: int = ...,
        rotation: float | str = ...,
        curvature: float | str = ...,
        anamorphic: float | str = ...,
    ) -> _PolygonAperture:
        """A regular polygon with a corner at the top, whose edges may bulge.

        Each edge is an arc of a circle whose curvature is `curvature` times that of the circle through the corners: a
        straight line for 0, and for 1 that circle itself, so that the opening is round.

        Parameters
        ----------
        blades : blades of the diaphragm, one an edge
        rotation : turn, anticlockwise as seen from behind the camera [degrees, or with a unit]
        curvature : how far the edges bulge: 0 straight, 1 along the circle through the corners
        anamorphic : height of the shape over its width, once stretched without a change of area; 2 for the upright
            ovals of an anamorphic lens
        """
    @staticmethod
    def round(
        *,
        anamorphic: float | str = ...,
    ) -> _Round:
        """A circle, as of a lens wide open; stretched, an ellipse.

        Parameters
        ----------
        anamorphic : height of the shape over its width, once stretched without a change of area; 2 for the upright
            ovals of an anamorphic lens
        """

class _Cameras:
    @staticmethod
    def camera_array(
        *,
        rows: int,
        columns: int,
        spacing: _Numbers | float | str,
        convergence_distance: float | str | None = ...,
        fill: bool = ...,
        defocus_angle: float | str | None = ...,
        aperture: float | str | None = ...,
        vignetting: _Vignetting | _Keys | None = ...,
        pupil: Literal["aplanatic", "flat"] = ...,
        focus_distance: float | str | None = ...,
        focus_on: str | None = ...,
        focus_at: _Numbers | None = ...,
        aperture_shape: Literal["image", "polygon", "round"] | _ImageAperture | _Keys | _PolygonAperture | _Round | None = ...,
        vfov: float | str | None = ...,
        hfov: float | str | None = ...,
        dfov: float | str | None = ...,
        focal_length: float | str | None = ...,
        equivalent_focal_length: float | str | None = ...,
        f_number: float | str | None = ...,
        sensor: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | _SensorSpec | _Keys | None = ...,
        sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = ...,
        iso: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _CameraArray:
        """Rows and columns of equal cameras that look along parallel axes, their middle at `look_from`.

        The film of each is shifted so that all of them see the plane at `convergence_distance` alike: a point of it is at
        the same pixel of all views, as at the focal plane of one large lens of which each camera is a part.  The picture
        holds the views side by side, the highest row at the top and the leftmost column at the left, each of the film's
        width x height; `--crop` and `--pixel` count its pixels, the shutter's rows and columns are those of each view.

        Views are pinholes, or thin lenses of their own with an opening, focused at `focus_distance`.  With `fill` the
        opening of each is the rectangle around it that is `spacing` wide and high: together they are one lens without gaps,
        and the mean of all views is its photograph, focused at `convergence_distance`.

        References: Wilburn et al. 2005, "High Performance Imaging Using Large Camera Arrays"; Levoy and Hanrahan 1996,
        "Light Field Rendering", sec. 3 (sheared frustums); Isaksen, McMillan and Gortler 2000.

        Parameters
        ----------
        rows : rows of cameras
        columns : cameras in a row
        spacing : from one camera to the next (m), such as 20 mm; or two, to the right and upwards: [20 mm, 30 mm]
            [metres, or with a unit]
        convergence_distance : distance of the plane that is at the same place in all views (m), inf for views that are
            not shifted; default: that of the plane of focus [metres, or with a unit]
        fill : gives each camera an opening as wide and high as `spacing`, so that together they are one lens
        defocus_angle : apex angle (deg) of the cone from a point in focus to the lens [degrees, or with a unit]
        aperture : diameter of the lens (mm) [millimetres, or with a unit]
        vignetting : a rim in front of the lens, {diameter: mm, distance: mm}, that cuts what comes in from the side;
            without effect where the lens has no opening
        pupil : how a wide lens exposes the film: `aplanatic`, as a corrected lens that loses no light; `flat`, as an
            even disc of light in its place
        focus_distance : distance of the plane of focus along the axis, from the lens, of one of glass from its entrance
            pupil (m), inf allowed; default: |look_at - look_from| [metres, or with a unit]
        focus_on : name of the object whose middle is in focus, in place of `focus_distance`; for the surface that is
            seen of it, see `focus_at`
        focus_at : place in the frame at which what is seen is in focus: fractions of its width and height, from the top
            left, in place of `focus_distance`; infinity where nothing is seen; cutouts count as solid
        aperture_shape : shape of the opening, of the same area as the round one: a type, or a mapping; round by default
        vfov : vertical field of view (deg), between 0 and 180; 90 where nothing says how much is seen [degrees, or with
            a unit]
        hfov : horizontal field of view (deg), in place of `vfov` [degrees, or with a unit]
        dfov : diagonal field of view (deg), in place of `vfov` [degrees, or with a unit]
        focal_length : focal length (mm) [millimetres, or with a unit]
        equivalent_focal_length : focal length (mm) that has the same diagonal field of view on 36 x 24 mm, in place of
            `focal_length` [millimetres, or with a unit]
        f_number : focal length over the diameter of the entrance pupil; inf for a pinhole
        sensor : a name (medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
            1/3.2-inch), or {width: 36 mm, height: 24 mm}; full_frame where only a focal length is given, or there is no
            lens
        sensor_fit : how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest part
            of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it
        iso : speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which 1 is what
            saturates the sensor
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def camera_box(
        *,
        rows: int,
        columns: int,
        size: _Numbers | float | str,
        faces: Sequence[Literal["front", "right", "back", "left", "top", "bottom"]] = ...,
        facing: Literal["inward", "outward"] = ...,
        defocus_angle: float | str | None = ...,
        aperture: float | str | None = ...,
        vignetting: _Vignetting | _Keys | None = ...,
        pupil: Literal["aplanatic", "flat"] = ...,
        focus_distance: float | str | None = ...,
        focus_on: str | None = ...,
        focus_at: _Numbers | None = ...,
        aperture_shape: Literal["image", "polygon", "round"] | _ImageAperture | _Keys | _PolygonAperture | _Round | None = ...,
        vfov: float | str | None = ...,
        hfov: float | str | None = ...,
        dfov: float | str | None = ...,
        focal_length: float | str | None = ...,
        equivalent_focal_length: float | str | None = ...,
        f_number: float | str | None = ...,
        sensor: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | _SensorSpec | _Keys | None = ...,
        sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = ...,
        iso: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _CameraBox:
        """Rows and columns of equal cameras on each face of a box, that look at right angles to it, inward or outward.

        The box lies about `look_at`, or about `look_from` where the cameras look outward; its front is the face at the side
        of `look_from`, or towards `look_at`.  The cameras of a face stand in the middles of equal parts of it and look in
        parallel.  Films of cameras that look inward are shifted so that all cameras of a face see the plane through the
        middle of the box alike, as those of a `camera_array`.  The picture of all holds the faces below each other, and the
        views of each side by side, each of the film's width x height.

        References: Gortler et al. 1996, "The Lumigraph", sec. 2.1 (a cube round the object); Levoy and Hanrahan 1996,
        "Light Field Rendering", sec. 2 (arrangements of light slabs).

        Parameters
        ----------
        rows : rows of cameras on a face
        columns : cameras in a row of a face
        size : width, height and depth of the box (m), as seen from `look_from`, or one length for all [metres, or with
            a unit]
        faces : those that have cameras, in the order of the picture; default: all
        facing : `inward`: the cameras stand round `look_at` and look there; `outward`: round `look_from`, looking away
            from it
        defocus_angle : apex angle (deg) of the cone from a point in focus to the lens [degrees, or with a unit]
        aperture : diameter of the lens (mm) [millimetres, or with a unit]
        vignetting : a rim in front of the lens, {diameter: mm, distance: mm}, that cuts what comes in from the side;
            without effect where the lens has no opening
        pupil : how a wide lens exposes the film: `aplanatic`, as a corrected lens that loses no light; `flat`, as an
            even disc of light in its place
        focus_distance : distance of the plane of focus along the axis, from the lens, of one of glass from its entrance
            pupil (m), inf allowed; default: |look_at - look_from| [metres, or with a unit]
        focus_on : name of the object whose middle is in focus, in place of `focus_distance`; for the surface that is
            seen of it, see `focus_at`
        focus_at : place in the frame at which what is seen is in focus: fractions of its width and height, from the top
            left, in place of `focus_distance`; infinity where nothing is seen; cutouts count as solid
        aperture_shape : shape of the opening, of the same area as the round one: a type, or a mapping; round by default
        vfov : vertical field of view (deg), between 0 and 180; 90 where nothing says how much is seen [degrees, or with
            a unit]
        hfov : horizontal field of view (deg), in place of `vfov` [degrees, or with a unit]
        dfov : diagonal field of view (deg), in place of `vfov` [degrees, or with a unit]
        focal_length : focal length (mm) [millimetres, or with a unit]
        equivalent_focal_length : focal length (mm) that has the same diagonal field of view on 36 x 24 mm, in place of
            `focal_length` [millimetres, or with a unit]
        f_number : focal length over the diameter of the entrance pupil; inf for a pinhole
        sensor : a name (medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
            1/3.2-inch), or {width: 36 mm, height: 24 mm}; full_frame where only a focal length is given, or there is no
            lens
        sensor_fit : how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest part
            of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it
        iso : speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which 1 is what
            saturates the sensor
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def camera_sphere(
        *,
        rows: int,
        columns: int,
        radius: float | str | None = ...,
        elevation: _Numbers | float | str = ...,
        azimuth: _Numbers | float | str = ...,
        facing: Literal["inward", "outward"] = ...,
        defocus_angle: float | str | None = ...,
        aperture: float | str | None = ...,
        vignetting: _Vignetting | _Keys | None = ...,
        pupil: Literal["aplanatic", "flat"] = ...,
        focus_distance: float | str | None = ...,
        focus_on: str | None = ...,
        focus_at: _Numbers | None = ...,
        aperture_shape: Literal["image", "polygon", "round"] | _ImageAperture | _Keys | _PolygonAperture | _Round | None = ...,
        vfov: float | str | None = ...,
        hfov: float | str | None = ...,
        dfov: float | str | None = ...,
        focal_length: float | str | None = ...,
        equivalent_focal_length: float | str | None = ...,
        f_number: float | str | None = ...,
        sensor: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | _SensorSpec | _Keys | None = ...,
        sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = ...,
        iso: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _CameraSphere:
        """Rows and columns of equal cameras on a sphere, or on a part of one, that look at its middle or away from it.

        Rows are circles of latitude, columns meridians: middles of equal parts of the ranges `elevation` and `azimuth`, the
        highest row at the top.  Both angles are 0 in the direction in which `look_from` lies from `look_at`, for cameras
        that look outward in that in which `look_at` lies from `look_from`; `up` is the axis.  Each camera has the picture
        upright.  The picture of all holds the views side by side, each of the film's width x height.

        A light field in space without obstacles has four dimensions: what the cameras on a surface round an object see is
        all that can be seen of it from outside of that surface.

        References: Gortler et al. 1996, "The Lumigraph", sec. 2; Levoy and Hanrahan 1996, "Light Field Rendering", sec. 2;
        Camahort, Lerios and Fussell 1998, "Uniformly Sampled Light Fields".

        Parameters
        ----------
        rows : rows of cameras, each at one elevation
        columns : cameras in a row, each at one azimuth
        radius : of the sphere (m); default for cameras that look inward: |look_at - look_from| [metres, or with a unit]
        elevation : range (deg) above the equator that the rows divide, or one angle for a row [degrees, or with a unit]
        azimuth : range (deg) to the right that the columns divide: cameras with more stand further to the right as seen
            from where they look from [degrees, or with a unit]
        facing : `inward`: the cameras stand round `look_at` and look there; `outward`: round `look_from`, looking away
            from it
        defocus_angle : apex angle (deg) of the cone from a point in focus to the lens [degrees, or with a unit]
        aperture : diameter of the lens (mm) [millimetres, or with a unit]
        vignetting : a rim in front of the lens, {diameter: mm, distance: mm}, that cuts what comes in from the side;
            without effect where the lens has no opening
        pupil : how a wide lens exposes the film: `aplanatic`, as a corrected lens that loses no light; `flat`, as an
            even disc of light in its place
        focus_distance : distance of the plane of focus along the axis, from the lens, of one of glass from its entrance
            pupil (m), inf allowed; default: |look_at - look_from| [metres, or with a unit]
        focus_on : name of the object whose middle is in focus, in place of `focus_distance`; for the surface that is
            seen of it, see `focus_at`
        focus_at : place in the frame at which what is seen is in focus: fractions of its width and height, from the top
            left, in place of `focus_distance`; infinity where nothing is seen; cutouts count as solid
        aperture_shape : shape of the opening, of the same area as the round one: a type, or a mapping; round by default
        vfov : vertical field of view (deg), between 0 and 180; 90 where nothing says how much is seen [degrees, or with
            a unit]
        hfov : horizontal field of view (deg), in place of `vfov` [degrees, or with a unit]
        dfov : diagonal field of view (deg), in place of `vfov` [degrees, or with a unit]
        focal_length : focal length (mm) [millimetres, or with a unit]
        equivalent_focal_length : focal length (mm) that has the same diagonal field of view on 36 x 24 mm, in place of
            `focal_length` [millimetres, or with a unit]
        f_number : focal length over the diameter of the entrance pupil; inf for a pinhole
        sensor : a name (medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
            1/3.2-inch), or {width: 36 mm, height: 24 mm}; full_frame where only a focal length is given, or there is no
            lens
        sensor_fit : how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest part
            of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it
        iso : speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which 1 is what
            saturates the sensor
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def equirectangular(
        *,
        hfov: float | str = ...,
        vfov: float | str = ...,
        wavelength: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _Equirectangular:
        """Longitude across the picture and latitude up it, both in equal steps; the poles are the camera's `up` and down.

        `look_at` is in the middle, and longitude grows to the right.  A film twice as wide as high has square pixels in
        the middle of the full panorama; other shapes stretch it.

        References: Snyder 1987, "Map Projections: A Working Manual", USGS Professional Paper 1395, pp. 90-91.

        Parameters
        ----------
        hfov : longitudes (deg) from the left edge to the right, up to 360 [degrees, or with a unit]
        vfov : latitudes (deg) from the lower edge to the upper, up to 180 [degrees, or with a unit]
        wavelength : the one wavelength (nm) that is seen, 380 to 780: pixels are its spectral radiance, relative to the
            light of D65, so that what is white has 1 at every wavelength; without it they are red, green and blue
            [nanometres, or with a unit]
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def fisheye(
        *,
        projection: Literal["equidistant", "equisolid", "stereographic", "orthographic"] = ...,
        fov: float | str = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _Fisheye:
        """A picture in a circle, whose diameter is the shorter side of the film; what lies outside it is black.

        With r the distance from the middle and t the angle from the axis, r is proportional to
        `equidistant`: t, so that angles can be measured; `equisolid`: sin(t / 2), so that areas are solid angles;
        `stereographic`: tan(t / 2), so that small shapes keep theirs; `orthographic`: sin(t), so that areas are what a sky
        counts for on the ground, solid angle times cosine.

        References: Kannala & Brandt 2006, "A Generic Camera Model and Calibration Method for Conventional, Wide-Angle, and
            Fish-Eye Lenses", IEEE TPAMI 28(8), eq. 1-5.

        Parameters
        ----------
        projection : how the angle from the axis becomes a distance in the picture
        fov : angle (deg) of a diameter of the circle, up to 360 [degrees, or with a unit]
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def lens(
        *,
        lens: str | PathLike[str],
        f_number: float | str | None = ...,
        focus: Literal["marginal", "rms"] = ...,
        dispersion: bool = ...,
        flare: bool = ...,
        focus_distance: float | str | None = ...,
        focus_on: str | None = ...,
        focus_at: _Numbers | None = ...,
        aperture_shape: Literal["image", "polygon", "round"] | _ImageAperture | _Keys | _PolygonAperture | _Round | None = ...,
        sensor: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | _SensorSpec | _Keys | None = ...,
        sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = ...,
        iso: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _RealLens:
        """A lens of glass, as its prescription has it, through which every ray goes, surface by surface.

        So the picture has the lens's own aberrations, distortion and vignetting, and its blur the shape of what of the
        pupil is seen from each place.  `look_from` is the middle of the entrance pupil near the axis, from where distances
        are measured; the lens with its front before that, and the film behind it, stand in the scene but are not seen.

        Without `iso`, a picture of an even scene has its radiance in the middle, and is darker to its corners by the
        lens's vignetting and the fourth power of the cosine.  With it, the film gathers what arrives through the exit
        pupil, E = integral of L cos^4 / Z^2 dA.

        References: Kolb, Mitchell, Hanrahan 1995, "A Realistic Camera Model for Computer Graphics", SIGGRAPH; Steinert,
        Dammertz, Hanika, Lensch 2011, "General Spectral Camera Lens Simulation", CGF 30(6).

        Parameters
        ----------
        lens : prescription of the lens (.yaml .dat .zmx), relative to the scene
        f_number : f-number to which the stop closes; by default it is as wide open as it goes
        focus : what is sharp: where light through the zone of the pupil that halves its area meets on the axis, or
            where the spot of a point of the axis has the least root mean square radius (`rms`)
        dispersion : whether the lens's glasses have an index by wavelength, where its prescription says so; else each
            has that of the d line for all colours
        flare : whether the lens's surfaces reflect light too: what is lost, ghosts of two reflections, and flare
        focus_distance : distance of the plane of focus along the axis, from the lens, of one of glass from its entrance
            pupil (m), inf allowed; default: |look_at - look_from| [metres, or with a unit]
        focus_on : name of the object whose middle is in focus, in place of `focus_distance`; for the surface that is
            seen of it, see `focus_at`
        focus_at : place in the frame at which what is seen is in focus: fractions of its width and height, from the top
            left, in place of `focus_distance`; infinity where nothing is seen; cutouts count as solid
        aperture_shape : shape of the opening, of the same area as the round one: a type, or a mapping; round by default
        sensor : a name (medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
            1/3.2-inch), or {width: 36 mm, height: 24 mm}; full_frame where only a focal length is given, or there is no
            lens
        sensor_fit : how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest part
            of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it
        iso : speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which 1 is what
            saturates the sensor
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def light_field(
        *,
        lens: str | PathLike[str] | None = ...,
        dispersion: bool | None = ...,
        microlenses: _Microlenses | _Keys = ...,
        defocus_angle: float | str | None = ...,
        aperture: float | str | None = ...,
        vignetting: _Vignetting | _Keys | None = ...,
        pupil: Literal["aplanatic", "flat"] = ...,
        focus_distance: float | str | None = ...,
        focus_on: str | None = ...,
        focus_at: _Numbers | None = ...,
        aperture_shape: Literal["image", "polygon", "round"] | _ImageAperture | _Keys | _PolygonAperture | _Round | None = ...,
        vfov: float | str | None = ...,
        hfov: float | str | None = ...,
        dfov: float | str | None = ...,
        focal_length: float | str | None = ...,
        equivalent_focal_length: float | str | None = ...,
        f_number: float | str | None = ...,
        sensor: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | _SensorSpec | _Keys | None = ...,
        sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = ...,
        iso: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _LightField:
        """A main lens, an array of microlenses near its image, and a sensor behind that.

        The main lens is a thin one, with all keys of `thin_lens`, or one of glass, `lens: FILE`, with the aberrations and
        the vignetting of the camera `lens`.

        The picture is that of the sensor, upright, so turned by 180 degrees: a mosaic of sub-images, one behind each
        microlens, in which every pixel sees one part of the main lens.  Each pixel sees through the microlens whose
        sub-image it is part of, and no other, also where sub-images would overlap, as behind a main lens that is wider than
        the microlenses are made for; with `crosstalk: true` it sees through all whose sub-images cover it.

        Plain pixels are the mean radiance of what comes through the part of the main lens that a pixel sees, where the lens
        is not there 0: the mean over a sub-image, over what of it is lit, is the pixel of an ordinary photograph on sensors
        of the microlenses' size.  Exposed by `iso` it is the irradiance on the sensor, on which the light of a microlens is
        spread over all of its sub-image.

        References: Ng, Levoy, Bredif, Duval, Horowitz, Hanrahan 2005, "Light Field Photography with a Hand-Held Plenoptic
        Camera", Stanford CTSR 2005-02; Lumsdaine, Georgiev 2009, "The Focused Plenoptic Camera", ICCP.

        Parameters
        ----------
        lens : prescription of a main lens of glass (.yaml .dat .zmx), relative to the scene, in place of a thin one
        dispersion : whether glasses of `lens` have an index by wavelength, where its prescription says so; true by
            default
        microlenses : the array before the sensor: {pixels: 15} or {pitch: 125 um} or {count: 100}, layout, model,
            focal_length, distance, arrangement, crosstalk, rotation, offset
        defocus_angle : apex angle (deg) of the cone from a point in focus to the lens [degrees, or with a unit]
        aperture : diameter of the lens (mm) [millimetres, or with a unit]
        vignetting : a rim in front of the lens, {diameter: mm, distance: mm}, that cuts what comes in from the side;
            without effect where the lens has no opening
        pupil : how a wide lens exposes the film: `aplanatic`, as a corrected lens that loses no light; `flat`, as an
            even disc of light in its place
        focus_distance : distance of the plane of focus along the axis, from the lens, of one of glass from its entrance
            pupil (m), inf allowed; default: |look_at - look_from| [metres, or with a unit]
        focus_on : name of the object whose middle is in focus, in place of `focus_distance`; for the surface that is
            seen of it, see `focus_at`
        focus_at : place in the frame at which what is seen is in focus: fractions of its width and height, from the top
            left, in place of `focus_distance`; infinity where nothing is seen; cutouts count as solid
        aperture_shape : shape of the opening, of the same area as the round one: a type, or a mapping; round by default
        vfov : vertical field of view (deg), between 0 and 180; 90 where nothing says how much is seen [degrees, or with
            a unit]
        hfov : horizontal field of view (deg), in place of `vfov` [degrees, or with a unit]
        dfov : diagonal field of view (deg), in place of `vfov` [degrees, or with a unit]
        focal_length : focal length (mm) [millimetres, or with a unit]
        equivalent_focal_length : focal length (mm) that has the same diagonal field of view on 36 x 24 mm, in place of
            `focal_length` [millimetres, or with a unit]
        f_number : focal length over the diameter of the entrance pupil; inf for a pinhole
        sensor : a name (medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
            1/3.2-inch), or {width: 36 mm, height: 24 mm}; full_frame where only a focal length is given, or there is no
            lens
        sensor_fit : how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest part
            of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it
        iso : speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which 1 is what
            saturates the sensor
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def light_slab(
        *,
        rows: int,
        columns: int,
        uv: _Numbers | float | str,
        st: _Numbers | float | str,
        separation: float | str | None = ...,
        fill: bool = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _LightSlab:
        """The two-plane light field by itself: L(u, v, s, t), without cameras.

        The plane of u and v stands at `look_from`, that of s and t before it at `separation`, both across the view.  The
        first is cut into rows x columns cells, the second into the film's pixels.  The picture holds the cells side by
        side, the highest row at the top, each of the film's width x height, which shows what passes from the cell's middle,
        or with `fill` from all of the cell, through each pixel of the second plane.

        References: Levoy and Hanrahan 1996, "Light Field Rendering", sec. 2; Gortler et al. 1996, "The Lumigraph".

        Parameters
        ----------
        rows : rows of cells of the plane of u and v
        columns : cells in a row
        uv : width and height of the rectangle of the first plane (m), or one length for both [metres, or with a unit]
        st : width and height of the rectangle of the second plane (m), or one length for both; of one that is not of
            the film's shape, the largest part that is [metres, or with a unit]
        separation : from the first plane to the second (m); default: |look_at - look_from| [metres, or with a unit]
        fill : takes the rays of all of a cell, in place of those of its middle
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def none(
        *,
        sensor: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | _SensorSpec | _Keys | None = ...,
        sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = ...,
        iso: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _BareSensor:
        """A sensor at `look_from`, facing `look_at`, with neither lens nor pinhole.

        Each of its pixels is lit by all that lies before it, so they record nearly the same.  Without `iso` a pixel is
        irradiance (W/m2), which is pi where all is of the radiance 1.  The picture is upright: its top is the sensor's top.

        Parameters
        ----------
        sensor : a name (medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
            1/3.2-inch), or {width: 36 mm, height: 24 mm}; full_frame where only a focal length is given, or there is no
            lens
        sensor_fit : how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest part
            of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it
        iso : speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which 1 is what
            saturates the sensor
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def orthographic(
        *,
        height: float | str | None = ...,
        width: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _Orthographic:
        """Parallel rays from a rectangle around `look_from`, along the view; what lies behind the rectangle is not seen.

        Give the height or the width of the rectangle; pixels are square, so the film's shape gives the other.

        References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 5.2.1.

        Parameters
        ----------
        height : height of what is seen (m) [metres, or with a unit]
        width : width of what is seen (m), in place of `height` [metres, or with a unit]
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def pinhole(
        *,
        diameter: float | str | None = ...,
        vfov: float | str | None = ...,
        hfov: float | str | None = ...,
        dfov: float | str | None = ...,
        focal_length: float | str | None = ...,
        equivalent_focal_length: float | str | None = ...,
        f_number: float | str | None = ...,
        aperture_shape: Literal["image", "polygon", "round"] | _ImageAperture | _Keys | _PolygonAperture | _Round | None = ...,
        sensor: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | _SensorSpec | _Keys | None = ...,
        sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = ...,
        iso: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _Pinhole:
        """Rays through one point, or through a hole: perspective without focus.

        A hole of the diameter d, at the focal length f from the film, spreads a point at the distance z to d (1 + f / z).
        Without a `diameter` the hole is a point, which lets in as much light as an `f_number` says.

        With an `aperture_shape` the hole is a mask of the same area, and each point of the scene casts the shadow of the
        mask: a camera of coded aperture, without a lens, whose picture is reconstructed afterwards.

        References: Young 1971, "Pinhole Optics", Applied Optics 10(12); Fenimore and Cannon 1978, "Coded aperture imaging
        with uniformly redundant arrays", Applied Optics 17(3).

        Parameters
        ----------
        diameter : diameter of the hole (mm); its distance from the film is the focal length [millimetres, or with a
            unit]
        vfov : vertical field of view (deg), between 0 and 180; 90 where nothing says how much is seen [degrees, or with
            a unit]
        hfov : horizontal field of view (deg), in place of `vfov` [degrees, or with a unit]
        dfov : diagonal field of view (deg), in place of `vfov` [degrees, or with a unit]
        focal_length : focal length (mm) [millimetres, or with a unit]
        equivalent_focal_length : focal length (mm) that has the same diagonal field of view on 36 x 24 mm, in place of
            `focal_length` [millimetres, or with a unit]
        f_number : focal length over the diameter of the entrance pupil; inf for a pinhole
        aperture_shape : shape of the opening, of the same area as the round one: a type, or a mapping; round by default
        sensor : a name (medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
            1/3.2-inch), or {width: 36 mm, height: 24 mm}; full_frame where only a focal length is given, or there is no
            lens
        sensor_fit : how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest part
            of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it
        iso : speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which 1 is what
            saturates the sensor
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def ray(
        *,
        wavelength: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _Ray:
        """The radiance that comes to `look_from` out of the direction of `look_at`: the plenoptic function at one place.

        Every sample of every pixel is of the same ray, with random numbers of its own, so pixels differ by noise alone and
        their mean is the measurement: `rt probe` takes it.  `up` has no say.

        References: Adelson & Bergen 1991, "The Plenoptic Function and the Elements of Early Vision".

        Parameters
        ----------
        wavelength : the one wavelength (nm) that is seen, 380 to 780: pixels are its spectral radiance, relative to the
            light of D65, so that what is white has 1 at every wavelength; without it they are red, green and blue
            [nanometres, or with a unit]
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """
    @staticmethod
    def thin_lens(
        *,
        defocus_angle: float | str | None = ...,
        aperture: float | str | None = ...,
        vignetting: _Vignetting | _Keys | None = ...,
        pupil: Literal["aplanatic", "flat"] = ...,
        focus_distance: float | str | None = ...,
        focus_on: str | None = ...,
        focus_at: _Numbers | None = ...,
        aperture_shape: Literal["image", "polygon", "round"] | _ImageAperture | _Keys | _PolygonAperture | _Round | None = ...,
        vfov: float | str | None = ...,
        hfov: float | str | None = ...,
        dfov: float | str | None = ...,
        focal_length: float | str | None = ...,
        equivalent_focal_length: float | str | None = ...,
        f_number: float | str | None = ...,
        sensor: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | _SensorSpec | _Keys | None = ...,
        sensor_fit: Literal["crop", "horizontal", "vertical", "overscan"] | None = ...,
        iso: float | str | None = ...,
        look_from: _Numbers = ...,
        look_at: _Numbers = ...,
        up: _Numbers = ...,
        medium: str | None = ...,
        shutter: _ShutterSpec | _Keys | float | str | None = ...,
        time: float | str | None = ...,
        motion: _Motion | _Keys | None = ...,
        shake: _Shake | _Keys | None = ...,
        exposure: _AutoExposure | _Keys | None = ...,
        exposure_compensation: float | str | None = ...,
    ) -> _ThinLens:
        """An ideal lens: what lies in the plane of focus is sharp, what does not is a circle of confusion.

        With a focal length, the film lies where the plane of focus is sharp, by Gauss's equation 1/f = 1/z_i + 1/z_o: the
        nearer it is, the farther the film, the narrower the field of view, and the darker the picture.  A field of view
        that is given as an angle is that of the picture, wherever its focus is.  With none of `defocus_angle`, `aperture`
        and `f_number`, or where they make no opening, the lens is a pinhole and costs as little.

        Exposed by `iso`, the lens loses no light: what a patch of the plane of focus sends through it arrives in the image
        of that patch.  On the axis the film then gets E = pi L / (4 N^2 (1 + m)^2) whatever the f-number, as behind lenses
        that are corrected for coma (Abbe's sine condition), so each stop is a factor of 2.  With `pupil: flat` it gets what
        an even disc of light in the plane of the lens would send: E = pi L / (1 + 4 N^2 (1 + m)^2), and Foote's formula off
        the axis; the two agree where N is large.

        References: Kingslake 1983, "Optical System Design", ch. 7; Foote 1915, "Illumination from a Radiating Disk",
        Bull. Bureau of Standards 12; Shirley et al. 2024, "Ray Tracing in One Weekend", sec. 13; Pharr et al. 2023,
        sec. 5.2.3.

        Parameters
        ----------
        defocus_angle : apex angle (deg) of the cone from a point in focus to the lens [degrees, or with a unit]
        aperture : diameter of the lens (mm) [millimetres, or with a unit]
        vignetting : a rim in front of the lens, {diameter: mm, distance: mm}, that cuts what comes in from the side;
            without effect where the lens has no opening
        pupil : how a wide lens exposes the film: `aplanatic`, as a corrected lens that loses no light; `flat`, as an
            even disc of light in its place
        focus_distance : distance of the plane of focus along the axis, from the lens, of one of glass from its entrance
            pupil (m), inf allowed; default: |look_at - look_from| [metres, or with a unit]
        focus_on : name of the object whose middle is in focus, in place of `focus_distance`; for the surface that is
            seen of it, see `focus_at`
        focus_at : place in the frame at which what is seen is in focus: fractions of its width and height, from the top
            left, in place of `focus_distance`; infinity where nothing is seen; cutouts count as solid
        aperture_shape : shape of the opening, of the same area as the round one: a type, or a mapping; round by default
        vfov : vertical field of view (deg), between 0 and 180; 90 where nothing says how much is seen [degrees, or with
            a unit]
        hfov : horizontal field of view (deg), in place of `vfov` [degrees, or with a unit]
        dfov : diagonal field of view (deg), in place of `vfov` [degrees, or with a unit]
        focal_length : focal length (mm) [millimetres, or with a unit]
        equivalent_focal_length : focal length (mm) that has the same diagonal field of view on 36 x 24 mm, in place of
            `focal_length` [millimetres, or with a unit]
        f_number : focal length over the diameter of the entrance pupil; inf for a pinhole
        sensor : a name (medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
            1/3.2-inch), or {width: 36 mm, height: 24 mm}; full_frame where only a focal length is given, or there is no
            lens
        sensor_fit : how a picture of another shape than the sensor's lies on it: `crop`, the default, the largest part
            of the sensor; `horizontal`, its whole width; `vertical`, its whole height; `overscan`, all of it
        iso : speed of the sensor: asks for photographic exposure, by aperture, shutter and speed, after which 1 is what
            saturates the sensor
        look_from : position of the camera (m) [metres, or with a unit]
        look_at : point in the centre of the picture (m) [metres, or with a unit]
        up : direction that is up in the picture
        medium : name of the medium that the camera stands in; the scene's `medium` by default
        shutter : when light is gathered: {open: 0, close: 1} in seconds of scene time, or for how long from `time` on,
            such as 1/125 s, or {duration: 1/125 s, opening, ramp, readout, direction, curtain}; without it the picture
            is of one moment [seconds, or with a unit]
        time : time of the scene (s) at which a shutter given by its duration opens; default 0 [seconds, or with a unit]
        motion : how the camera moves: velocity (m/s), spin {axis, rate, center} or keyframes
        shake : how the hand that holds the camera turns it: {amplitude: 0.1 deg, bandwidth: 10 Hz, seed: 0}; the
            amplitude is the root mean square of the angle about each of three axes
        exposure : auto, or {metering: spot, at: [x, y], size}: exposes the picture by what is metered in it; without it
            and `iso`, pixels are plain radiance
        exposure_compensation : stops (EV) by which the picture is made brighter than `iso` or `exposure` make it
        """

class _Environments:
    @staticmethod
    def constant(
        *,
        radiance: _Numbers | float | str,
    ) -> _Constant:
        """The same radiance from all directions; 0 is no environment.

        Parameters
        ----------
        radiance : radiance (W/(m2 sr)), by channel or grey
        """
    @staticmethod
    def gradient(
        *,
        horizon: _Numbers | float | str = ...,
        zenith: _Numbers | float | str = ...,
    ) -> _Gradient:
        """Blends linearly with the height y of the unit direction: `horizon` at y = -1, `zenith` at y = +1.

        References: Shirley et al. 2024, "Ray Tracing in One Weekend", sec. 4.2.

        Parameters
        ----------
        horizon : radiance straight down, at y = -1
        zenith : radiance straight up, at y = +1
        """
    @staticmethod
    def image(
        *,
        file: str | PathLike[str],
        scale: _Numbers | float | str = ...,
        rotation: float | str = ...,
        encoding: Literal["auto", "srgb", "linear"] = ...,
    ) -> _ImageEnvironment:
        """A picture of all directions: 360 degrees across, 180 degrees down, +y at the top.

        The left and right edges meet at -z, +x is a quarter of the width from the left, +z in the middle, -x at three
        quarters.  Between pixels the picture is bilinear.  Next-event estimation samples
        directions in proportion to their radiance.

        Parameters
        ----------
        file : image file, relative to the scene
        scale : factor to radiance (W/(m2 sr)), by channel or one for all; 0: none
        rotation : turn about +y, counter-clockwise as seen from above [degrees, or with a unit]
        encoding : what the file's values are; auto: sRGB if they are integers, else linear
        """
    @staticmethod
    def sky(
        *,
        sun_elevation: float | str = ...,
        sun_azimuth: float | str = ...,
        sun_direction: _Numbers | None = ...,
        turbidity: float | str = ...,
        ground_albedo: _Numbers | float | str = ...,
        scale: float | str = ...,
        sun: bool = ...,
    ) -> _Sky:
        """The sky on a day without clouds, and if asked for its sun; below the horizon, a ground that they light.

        Luminance is converted at 179 lm/W, so a clear sky is some 30 W/(m2 sr) and full sunlight some 500 W/m2: `scale`
        brings them to where a picture without exposure needs them.  Light that reaches the ground from the sky and, if
        there is one, from the sun leaves it evenly; the ground is part of the environment and casts no shadow.

        References: Preetham, Shirley, Smits 1999, "A Practical Analytic Model for Daylight", SIGGRAPH '99, appendix A;
        Perez, Seals, Michalsky 1993, "All-weather Model for Sky Luminance Distribution".

        Parameters
        ----------
        sun_elevation : the sun's height above the horizon [degrees, or with a unit]
        sun_azimuth : where the sun stands: clockwise from above, 0 at -z, 90 at +x [degrees, or with a unit]
        sun_direction : direction to the sun, in place of elevation and azimuth; y at least 0
        turbidity : haze: 2 is very clear, 3 clear, 6 warm and moist, 10 hazy
        ground_albedo : albedo of the ground below the horizon
        scale : factor to all radiance; 0: none
        sun : whether the sun itself is there: a light of kind `sun`
        """

class _Filters:
    @staticmethod
    def box(
        *,
        width: float | str = ...,
    ) -> _FilterBox:
        """The mean over a square around the pixel's centre.

        Parameters
        ----------
        width : edge of the square (pixels)
        """
    @staticmethod
    def gaussian(
        *,
        sigma: float | str = ...,
        radius: float | str = ...,
    ) -> _Gaussian:
        """exp(-r^2 / (2 sigma^2)) up to a radius from the pixel's centre, cut off there and not shifted down to 0.

        Every sample counts the same, so an even surface has no noise from the filter.

        References: Box, Muller 1958, "A Note on the Generation of Random Normal Deviates", up to a radius: r^2 / 2 sigma^2
        is distributed exponentially.

        Parameters
        ----------
        sigma : standard deviation (pixels)
        radius : distance from the centre at which it ends (pixels)
        """
    @staticmethod
    def mitchell(
        *,
        b: float | str = ...,
        c: float | str = ...,
    ) -> _Mitchell:
        """A cubic, separable filter of radius 2 with negative lobes, drawn by its magnitude and weighted by its sign.

        Pixels beside bright edges may thereby be below zero, of which renders tell the number.

        References: Mitchell, Netravali 1988, "Reconstruction Filters in Computer Graphics", eq. 8.

        Parameters
        ----------
        b : blur: Mitchell and Netravali's B
        c : ringing: Mitchell and Netravali's C; B + 2 C = 1 suits best
        """

class _Lights:
    @staticmethod
    def flash(
        *,
        energy: _Numbers | float | str,
        position: _Numbers | None = ...,
        curtain: Literal["first", "second"] = ...,
        duration: float | str = ...,
        offset: float | str = ...,
    ) -> _FlashLight:
        """A point that radiates evenly in all directions for a short time: what moves is frozen in its light.

        A plane at distance d gets the radiant exposure energy cos / d^2 (J/m2).  In the picture, which is a mean over the
        exposure time T, that is as much as a point light of intensity energy / T gives.

        The flash begins when the shutter is fully open everywhere (first curtain), or ends when it begins to close anywhere
        (second curtain).  What the shutter covers at that moment does not see it: where the exposure is shorter than the
        readout, only a band does.  No ray can meet the flash itself.

        Parameters
        ----------
        energy : radiant energy per solid angle (J/sr) by channel, or one number for all
        position : where it is; default: the camera's place at the moment [metres, or with a unit]
        curtain : first: it begins when the shutter is fully open; second: it ends when the shutter begins to close
        duration : for how long it shines (s), evenly [seconds, or with a unit]
        offset : by how much later (s) it shines than its curtain says [seconds, or with a unit]
        """
    @staticmethod
    def point(
        *,
        position: _Numbers,
        intensity: _Numbers | float | str,
    ) -> _PointLight:
        """A point that radiates evenly: the irradiance of a surface at distance d is intensity cos / d^2.

        No ray can meet it, so it is not seen by the camera, in mirrors, or through glass.

        Parameters
        ----------
        position : where it is [metres, or with a unit]
        intensity : radiant intensity (W/sr) by channel, or one number for all
        """
    @staticmethod
    def spot(
        *,
        position: _Numbers,
        intensity: _Numbers | float | str,
        angle: float | str,
        direction: _Numbers | None = ...,
        look_at: _Numbers | None = ...,
        penumbra: float | str = ...,
    ) -> _SpotLight:
        """A point that radiates into a cone: evenly, and within the penumbra less and less, down to nothing at the edge.

        The falloff over the penumbra is linear in the angle from the axis.  No ray can meet the light itself.

        Parameters
        ----------
        position : where it is [metres, or with a unit]
        intensity : radiant intensity on the axis (W/sr) by channel, or one number for all
        angle : the cone's full angle, edge to edge [degrees, or with a unit]
        direction : the cone's axis, along which the light travels
        look_at : a point on the axis, in place of `direction` [metres, or with a unit]
        penumbra : angle within the cone, from its edge inwards, over which the intensity rises; 0: at once [degrees, or
            with a unit]
        """
    @staticmethod
    def sun(
        *,
        direction: _Numbers,
        irradiance: _Numbers | float | str,
        angle: float | str = ...,
    ) -> _Sun:
        """A disc at infinity of even radiance, or with angle 0 light that is exactly parallel.

        The disc is seen by the camera and in mirrors where nothing stands before it, on top of the environment.  Its
        radiance is irradiance / (pi sin^2(angle / 2)).

        Parameters
        ----------
        direction : the direction in which the light travels, from the sun to the scene
        irradiance : irradiance (W/m2) of a plane that faces the sun, by channel, or one number for all
        angle : angular diameter of the disc; 0: parallel light, which no ray can meet [degrees, or with a unit]
        """

class _Materials:
    @staticmethod
    def boundary(
        *,
        clear: bool = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _Boundary:
        """Light goes straight through and counts no path segment; only the medium that it is in may change.

        Parameters
        ----------
        clear : whether inside there is no medium but the object's own; else light stays in the one that it comes
            through where the object has none
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def cutout(
        *,
        material: str | MaterialSpec | _Keys | None,
        opacity: float | str | TextureSpec | _Keys = ...,
        threshold: float | str | None = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _Cutout:
        """A material where the surface is, and nothing where it is not.

        Between 0 and 1 the opacity is the share of light that meets the material; the rest goes straight on, as do the
        rays that look for shadows. What goes on counts no path segment of `max_depth`, for up to 1024 surfaces a path.

        Parameters
        ----------
        material : the material, by name or inline
        opacity : how much of the surface is there, from 0 to 1; of an image's alpha with `channel: a`
        threshold : opacity from which on the surface is all there, and below which it is not at all
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def dielectric(
        *,
        outside_absorption: _Numbers | float | str | None = ...,
        ior: float | str | _Keys = ...,
        outside_ior: float | str | _Keys = ...,
        priority: int | None = ...,
        absorption: _Numbers | float | str | None = ...,
        attenuation_color: _Numbers | float | str | None = ...,
        attenuation_distance: float | str | None = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _Dielectric:
        """A smooth, clear boundary with exact Fresnel reflection.

        Radiance is carried as basic radiance L / n^2, which refraction leaves unchanged; so what is lit and seen through
        glass is exact, and an emitter inside glass is given by the radiance it would show in air.

        Of light that comes to the boundary from within, over a distance d, the fraction exp(-absorption d) is kept. On the
        way to other things inside the glass none is lost: give it a `priority` where that matters.

        Where an index depends on the wavelength, wavelengths part: see docs/dispersion.md.

        Closed objects whose materials have a `priority` may overlap. Where they do, the one with the highest is there, of
        equals the one that comes first in the scene; surfaces hidden in it let light straight through, shadow rays too, and
        each surface that is seen is a boundary to what lies behind it. Light knows what it is in, also where the camera
        stands in it, and loses what that absorbs on all its ways. Make things that touch overlap by a little, as water and
        its glass: of two faces in the same place a ray meets but one. Glass without a priority has no part in this: within
        water that has one, its surface is one to `outside_ior`, and the water goes on absorbing in it. Where nothing has a
        priority, a face between two glasses is one surface, with `ior` and `outside_ior`. Up to 256 materials of a scene
        may have a priority; how many objects have them, and overlap, is not limited.

        References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 9.5; basic radiance: Nicodemus 1963;
        priorities: Schmidt, Budge 2002, "Simple Nested Dielectrics in Ray Traced Images", JGT 7(2); absorption: Beer 1852;
        attenuation by colour and distance: KHR_materials_volume of glTF.

        Parameters
        ----------
        outside_absorption : absorption coefficient of the outside by channel (1/m); none by default
        ior : index of refraction on the inside: a number, a glass of the catalogue such as N-BK7, or {index, abbe},
            {cauchy} or {sellmeier}; glass whose index depends on the wavelength disperses light
        outside_ior : index on the outside, likewise: of the glass that this one is embedded in
        priority : where objects overlap that have a priority, the one with the highest is there; takes the place of
            `outside_ior`
        absorption : absorption coefficient of the inside by channel (1/m); none by default; of a `rough_dielectric` it
            needs a `priority`
        attenuation_color : in place of `absorption`: the colour of white light after `attenuation_distance`
        attenuation_distance : the distance within which light takes on `attenuation_color` (m) [metres, or with a unit]
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def emitter(
        *,
        radiance: _Numbers | float | str | TextureSpec | _Keys,
        two_sided: bool = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _Emitter:
        """A surface that radiates evenly to the side of its normal (outwards from a sphere or box), and absorbs.

        Parameters
        ----------
        radiance : radiance (W/(m2 sr)) by channel, or plain numbers as in One Weekend
        two_sided : radiate to both sides
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def lambertian(
        *,
        albedo: _Numbers | float | str | TextureSpec | _Keys = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _Lambertian:
        """A matte surface: the same radiance to all sides.

        References: Lambert 1760, "Photometria"; f = albedo / pi.

        Parameters
        ----------
        albedo : fraction of light reflected, by channel
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def metal(
        *,
        albedo: _Numbers | float | str | TextureSpec | _Keys = ...,
        fuzz: float | str | TextureSpec | _Keys = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _Metal:
        """The mirrored unit direction plus `fuzz` times a random unit vector; what would go below the surface is lost.

        References: Shirley et al. 2024, "Ray Tracing in One Weekend", sec. 10.5.

        Parameters
        ----------
        albedo : fraction of light reflected, by channel
        fuzz : radius of the random vector that is added; 0 is a mirror
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def mixture(
        *,
        materials: Sequence[str | MaterialSpec | _Keys],
        weight: float | str | TextureSpec | _Keys = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _Mixture:
        """One of two materials at each hit: on average the mean of both, weighted.

        As with dust on paint or rust on steel, a texture as weight says where there is how much of which.

        Parameters
        ----------
        materials : the two materials, by name or inline
        weight : share of the second material, from 0 to 1
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def principled(
        *,
        base_color: _Numbers | float | str | TextureSpec | _Keys = ...,
        metallic: float | str | TextureSpec | _Keys = ...,
        roughness: float | str | TextureSpec | _Keys = ...,
        ior: float | str = ...,
        specular: float | str = ...,
        transmission: float | str | TextureSpec | _Keys = ...,
        emission: _Numbers | float | str | TextureSpec | _Keys = ...,
        two_sided: bool = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _Principled:
        """glTF's metallic-roughness material, made to keep energy.

        A metal of the base colour, mixed by `metallic` with a matte body of the base colour under a clear coat; `roughness`
        is that of the metal and of the coat. Facets are GGX with the Fresnel term by Schlick. The body gets what the coat
        leaves, by the coat's directional albedo on the way in and out, where glTF's sample code would reflect up to twice
        the light at grazing angles; and the metal gets back what facets reflect more than once. With `transmission` a part
        of the body is thin-walled glass of the base colour: light goes through as if mirrored to the other side.

        References: Khronos Group, "glTF 2.0 Specification", appendix B, and KHR_materials_transmission, _ior, _specular;
        Ashikhmin, Shirley 2000, "An Anisotropic Phong BRDF Model", sec. 3 (body and coat), with albedos as in Kelemen,
        Szirmay-Kalos 2001, "A Microfacet Based Coupled Specular-Matte BRDF Model"; Kulla, Conty 2017, "Revisiting
        Physically Based Shading at Imageworks".

        Parameters
        ----------
        base_color : colour of the body, or of the metal
        metallic : 0 is not a metal, 1 is one; between them a mixture
        roughness : 0 is a mirror, 1 is dull; its square is the slope of the facets
        ior : index of refraction of the coat
        specular : strength of the coat's reflection; 0 is no coat
        transmission : part of the body that is thin-walled glass, with the coat's roughness
        emission : radiance that it gives besides (W/(m2 sr)), on the side of the normal
        two_sided : give the `emission` to both sides
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def rough_conductor(
        *,
        metal: Literal["gold", "silver", "copper", "aluminium"] | None = ...,
        eta: _Numbers | float | str | None = ...,
        k: _Numbers | float | str | None = ...,
        albedo: _Numbers | float | str | TextureSpec | _Keys | None = ...,
        roughness: float | str | TextureSpec | _Keys = ...,
        multiple_scattering: bool = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _RoughConductor:
        """Metal of small mirrors (GGX), with the light that goes from mirror to mirror; alpha is the square of roughness.

        A mirror reflects by Fresnel's equations for a metal with measured indices, or with `eta` and `k`, or by Schlick's
        fit to them for a metal of a given `albedo`.  Below a roughness of 0.032 the surface is one mirror.

        References: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Kulla, Conty 2017,
        "Revisiting Physically Based Shading at Imageworks"; Burley 2012, "Physically-Based Shading at Disney" (roughness).

        Parameters
        ----------
        metal : the metal, with indices as measured; or else `eta` and `k`, or `albedo`
        eta : index of refraction by channel; goes with `k`
        k : extinction coefficient by channel; goes with `eta`
        albedo : fraction of light reflected at normal incidence, by channel
        roughness : 0 is a mirror, 1 as rough as can be
        multiple_scattering : count light that meets several facets; without it, rough metal is too dark
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def rough_dielectric(
        *,
        roughness: float | str | TextureSpec | _Keys = ...,
        multiple_scattering: bool = ...,
        ior: float | str | _Keys = ...,
        outside_ior: float | str | _Keys = ...,
        priority: int | None = ...,
        absorption: _Numbers | float | str | None = ...,
        attenuation_color: _Numbers | float | str | None = ...,
        attenuation_distance: float | str | None = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _RoughDielectric:
        """A clear boundary of small facets (GGX) that reflect and refract; alpha is the square of roughness.

        Each facet reflects by Fresnel's equations.  What is reflected or refracted into other facets is not lost: it
        leaves to both sides, and light in glass of any roughness is as much as came in.  Below a roughness of 0.032 the
        boundary is smooth.  Radiance is basic radiance, and objects may overlap by `priority`, as for `dielectric`.  Glass
        whose index depends on the wavelength is met at one wavelength at a time.

        Glass that absorbs needs a `priority`, by which light knows what it is in on all its ways, those to lights too:
        without one, `absorption` and `attenuation_color` are errors.

        References: Walter et al. 2007, "Microfacet Models for Refraction through Rough Surfaces"; Kulla, Conty 2017,
        "Revisiting Physically Based Shading at Imageworks"; Burley 2012, "Physically-Based Shading at Disney" (roughness).

        Parameters
        ----------
        roughness : 0 is smooth, 1 as rough as can be
        multiple_scattering : count light that meets several facets; without it, rough glass is too dark
        ior : index of refraction on the inside: a number, a glass of the catalogue such as N-BK7, or {index, abbe},
            {cauchy} or {sellmeier}; glass whose index depends on the wavelength disperses light
        outside_ior : index on the outside, likewise: of the glass that this one is embedded in
        priority : where objects overlap that have a priority, the one with the highest is there; takes the place of
            `outside_ior`
        absorption : absorption coefficient of the inside by channel (1/m); none by default; of a `rough_dielectric` it
            needs a `priority`
        attenuation_color : in place of `absorption`: the colour of white light after `attenuation_distance`
        attenuation_distance : the distance within which light takes on `attenuation_color` (m) [metres, or with a unit]
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def thin_dielectric(
        *,
        ior: float | str = ...,
        color: _Numbers | float | str | TextureSpec | _Keys = ...,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _ThinDielectric:
        """A pane of clear material too thin to shift what is seen through it: it mirrors, or lets light straight through.

        Light goes to and fro between the two faces; with the reflectance R of one, all together they reflect 2 R / (1 + R).
        Interference, as of soap films, is not simulated.

        References: Stokes 1862, "On the intensity of the light reflected from or transmitted through a pile of plates";
        Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 9.5.

        Parameters
        ----------
        ior : index of refraction of the pane over that around it
        color : fraction of the light that goes through which is not absorbed, by channel
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """
    @staticmethod
    def two_sided(
        *,
        front: str | MaterialSpec | _Keys,
        back: str | MaterialSpec | _Keys,
        bump: str | TextureSpec | _Keys | None = ...,
        bump_height: float | str = ...,
        normal_map: str | TextureSpec | _Keys | None = ...,
        normal_scale: float | str = ...,
    ) -> _TwoSided:
        """One material for what arrives on the side of the normal, another for what arrives on the other side.

        An emitter as `back` radiates to the back.

        Parameters
        ----------
        front : material of the side that the normal points to, by name or inline
        back : material of the other side
        bump : texture of heights, whose slopes the surface is shaded with: a name or a texture
        bump_height : height of the texture's value 1 above its value 0 (m) [metres, or with a unit]
        normal_map : texture of normals in the frame of u, v and the surface's own, as (n + 1) / 2, with green upwards
        normal_scale : what the map's slopes are multiplied by
        """

class _Mediums:
    @staticmethod
    def grid(
        *,
        file: str | PathLike[str],
        min: _Numbers = ...,
        max: _Numbers = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
        extinction: float | str = ...,
        albedo: _Numbers | float | str = ...,
        g: float | str = ...,
    ) -> _Grid:
        """Densities on a grid of voxels, in a box; nothing outside of it.

        The density is interpolated between the middles of voxels, and constant from the outermost ones to the box's faces.
        Times `extinction` it is what is lost per metre, in all channels alike, of which `albedo` is scattered, by Henyey
        and Greenstein's phase function.  An object's transform does not move the grid that fills it.

        References: Woodcock et al. 1965, "Techniques Used in the GEM Code for Monte Carlo Neutronics Calculations" (delta
        tracking); Novák et al. 2014, "Residual Ratio Tracking for Estimating Attenuation in Participating Media".

        Parameters
        ----------
        file : NumPy file (.npy) of densities, indexed by x, y, z; relative to the scene
        min : corner of the box with the least coordinates (m) [metres, or with a unit]
        max : opposite corner (m) [metres, or with a unit]
        transform : moves the box, as that of an object does
        extinction : lost per metre (1/m) where the density is 1
        albedo : the fraction of that which is scattered, by channel
        g : mean cosine of scattering: 1 forwards, 0 to all sides, -1 back to where it came from
        """
    @staticmethod
    def homogeneous(
        *,
        absorption: _Numbers | float | str | None = ...,
        scattering: _Numbers | float | str | None = ...,
        extinction: _Numbers | float | str | None = ...,
        albedo: _Numbers | float | str | None = ...,
        g: float | str = ...,
    ) -> _Homogeneous:
        """A medium of the same density everywhere: what is absorbed and scattered per metre, by channel.

        Give `absorption` and `scattering`, one of which may be left out, or their sum `extinction` and the `albedo` that
        says which fraction of it is scattered.  Light is scattered by Henyey and Greenstein's phase function.

        References: Pharr et al. 2023, "Physically Based Rendering", 4th ed., sec. 11.1 and 14.2.

        Parameters
        ----------
        absorption : absorbed per metre (1/m), by channel
        scattering : scattered per metre (1/m), by channel
        extinction : in place of both: their sum (1/m), by channel; 1 / extinction is the mean free path
        albedo : with `extinction`: the fraction of it that is scattered
        g : mean cosine of scattering: 1 forwards, 0 to all sides, -1 back to where it came from
        """

class _Objects:
    @staticmethod
    def box(
        *,
        min: _Numbers,
        max: _Numbers,
        motion: _Motion | _Keys | None = ...,
        name: str | None = ...,
        material: str | MaterialSpec | _Keys | None = ...,
        medium: str | None = ...,
        outside_medium: str | None = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
    ) -> _ObjectBox:
        """A box between two opposite corners; a transform may turn or shear it.

        Parameters
        ----------
        min : corner with the smallest coordinates (m) [metres, or with a unit]
        max : corner with the largest coordinates (m) [metres, or with a unit]
        motion : how the object moves in world space, after its transform: velocity (m/s), spin {axis, rate (deg/s),
            center} or keyframes [{time, transform}]
        name : Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object
        material : Name of a material under `materials`, or a material itself: {type: ...}
        medium : Name of the medium under `media` that fills the object; without a material it has no surface
        outside_medium : Name of the medium round the object; the scene's `medium` by default
        transform : Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], or a
            4x4 matrix
        """
    @staticmethod
    def disc(
        *,
        center: _Numbers,
        normal: _Numbers,
        radius: float | str,
        motion: _Motion | _Keys | None = ...,
        name: str | None = ...,
        material: str | MaterialSpec | _Keys | None = ...,
        medium: str | None = ...,
        outside_medium: str | None = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
    ) -> _Disc:
        """A flat circle that faces along its normal.

        Parameters
        ----------
        center : centre (m) [metres, or with a unit]
        normal : direction of its outside
        radius : radius (m) [metres, or with a unit]
        motion : how the object moves in world space, after its transform: velocity (m/s), spin {axis, rate (deg/s),
            center} or keyframes [{time, transform}]
        name : Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object
        material : Name of a material under `materials`, or a material itself: {type: ...}
        medium : Name of the medium under `media` that fills the object; without a material it has no surface
        outside_medium : Name of the medium round the object; the scene's `medium` by default
        transform : Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], or a
            4x4 matrix
        """
    @staticmethod
    def instance(
        *,
        of: str,
        placements: Sequence[Sequence[_Keys] | _Keys | _Rows] | str | None = ...,
        material: str | MaterialSpec | _Keys | None = ...,
        motion: _Motion | _Keys | None = ...,
        name: str | None = ...,
        medium: str | None = ...,
        outside_medium: str | None = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
    ) -> _Instance:
        """A group or an object of that name, placed once, or many times by `placements`.

        Parameters
        ----------
        of : name of a group under `groups`, or of an object
        placements : many transforms, each of which happens before `transform`: a list; or a file, .npy (n, 4, 4) or (n,
            3, 4), or .csv with columns x, y, z and optionally scale (or scale_x, scale_y, scale_z), angle (deg) and
            axis_x, axis_y, axis_z (default: the y axis)
        material : name of a material, or a material itself, that takes the place of all materials in it
        motion : how the object moves in world space, after its transform: velocity (m/s), spin {axis, rate (deg/s),
            center} or keyframes [{time, transform}]
        name : Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object
        medium : Name of the medium under `media` that fills the object; without a material it has no surface
        outside_medium : Name of the medium round the object; the scene's `medium` by default
        transform : Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], or a
            4x4 matrix
        """
    @staticmethod
    def mesh(
        *,
        file: str | PathLike[str] | None = ...,
        frames: Sequence[_Frame | _Keys] | None = ...,
        smooth: bool = ...,
        motion: _Motion | _Keys | None = ...,
        name: str | None = ...,
        material: str | MaterialSpec | _Keys | None = ...,
        medium: str | None = ...,
        outside_medium: str | None = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
    ) -> _Mesh:
        """Triangles from a file, with flat faces or with shading normals that run smoothly over them.

        Smooth meshes lose no light, however coarse: what a shading normal sends to the wrong side of a face is turned to
        the right one. Outlines stay those of the faces, and so does where light from a lamp ends.

        An object without a `material` takes those of a glTF file, face by face: `principled` ones with their textures, cut
        out by the base colour's alpha where the file's alphaMode says so. Both sides of a face are seen, whatever
        `doubleSided` says, which is about what the face emits. Vertex colours, occlusion, clear coats and other extensions
        than transmission, ior, emissive_strength and texture_transform are left out.

        Parameters
        ----------
        file : mesh file (.obj .ply .stl .gltf .glb), relative to the scene
        frames : instead of a file: at least two forms, [{time, file}, ...], in the order of their times; the first and
            the last are held before and after
        smooth : interpolate the file's vertex normals, or make some by angle
        motion : how the object moves in world space, after its transform: velocity (m/s), spin {axis, rate (deg/s),
            center} or keyframes [{time, transform}]
        name : Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object
        material : Name of a material under `materials`, or a material itself: {type: ...}
        medium : Name of the medium under `media` that fills the object; without a material it has no surface
        outside_medium : Name of the medium round the object; the scene's `medium` by default
        transform : Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], or a
            4x4 matrix
        """
    @staticmethod
    def quad(
        *,
        corner: _Numbers,
        edges: _Rows,
        motion: _Motion | _Keys | None = ...,
        name: str | None = ...,
        material: str | MaterialSpec | _Keys | None = ...,
        medium: str | None = ...,
        outside_medium: str | None = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
    ) -> _Quad:
        """A parallelogram; its normal is u x v.

        Parameters
        ----------
        corner : one corner (m) [metres, or with a unit]
        edges : the two edges from the corner, u and v (m); the normal is u x v
        motion : how the object moves in world space, after its transform: velocity (m/s), spin {axis, rate (deg/s),
            center} or keyframes [{time, transform}]
        name : Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object
        material : Name of a material under `materials`, or a material itself: {type: ...}
        medium : Name of the medium under `media` that fills the object; without a material it has no surface
        outside_medium : Name of the medium round the object; the scene's `medium` by default
        transform : Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], or a
            4x4 matrix
        """
    @staticmethod
    def scatter(
        *,
        count: int,
        corner: _Numbers,
        edges: _Rows,
        of: str,
        seed: int = ...,
        scale: _Numbers = ...,
        axis: _Numbers = ...,
        turn: float | str = ...,
        tilt: float | str = ...,
        spacing: float | str = ...,
        material: str | MaterialSpec | _Keys | None = ...,
        motion: _Motion | _Keys | None = ...,
        name: str | None = ...,
        medium: str | None = ...,
        outside_medium: str | None = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
    ) -> _Scatter:
        """Many copies of a group or an object, placed at random.

        Parameters
        ----------
        count : how many copies
        corner : a corner of the parallelogram on which they stand (m) [metres, or with a unit]
        edges : its two edges from the corner (m)
        of : name of a group under `groups`, or of an object
        seed : another seed gives other places
        scale : least and greatest factor, between which each is drawn
        axis : axis about which copies are turned
        turn : greatest angle of the turn, from 0 on [degrees, or with a unit]
        tilt : greatest angle by which the axis is tilted, to any side [degrees, or with a unit]
        spacing : least distance between any two places (m) [metres, or with a unit]
        material : name of a material, or a material itself, that takes the place of all materials in it
        motion : how the object moves in world space, after its transform: velocity (m/s), spin {axis, rate (deg/s),
            center} or keyframes [{time, transform}]
        name : Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object
        medium : Name of the medium under `media` that fills the object; without a material it has no surface
        outside_medium : Name of the medium round the object; the scene's `medium` by default
        transform : Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], or a
            4x4 matrix
        """
    @staticmethod
    def sphere(
        *,
        center: _Numbers,
        radius: float | str,
        motion: _Motion | _Keys | None = ...,
        name: str | None = ...,
        material: str | MaterialSpec | _Keys | None = ...,
        medium: str | None = ...,
        outside_medium: str | None = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
    ) -> _Sphere:
        """A sphere; a negative radius turns its normal inwards, which makes a hollow inside glass.

        Parameters
        ----------
        center : centre (m) [metres, or with a unit]
        radius : radius (m), not zero; negative turns the normal inwards [metres, or with a unit]
        motion : how the object moves in world space, after its transform: velocity (m/s), spin {axis, rate (deg/s),
            center} or keyframes [{time, transform}]
        name : Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object
        material : Name of a material under `materials`, or a material itself: {type: ...}
        medium : Name of the medium under `media` that fills the object; without a material it has no surface
        outside_medium : Name of the medium round the object; the scene's `medium` by default
        transform : Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], or a
            4x4 matrix
        """
    @staticmethod
    def triangle(
        *,
        vertices: _Rows,
        motion: _Motion | _Keys | None = ...,
        name: str | None = ...,
        material: str | MaterialSpec | _Keys | None = ...,
        medium: str | None = ...,
        outside_medium: str | None = ...,
        transform: Sequence[_Keys] | _Keys | _Rows | None = ...,
    ) -> _Triangle:
        """A triangle; its outside is where its vertices run anticlockwise.

        Parameters
        ----------
        vertices : the three corners (m), anticlockwise seen from outside
        motion : how the object moves in world space, after its transform: velocity (m/s), spin {axis, rate (deg/s),
            center} or keyframes [{time, transform}]
        name : Name by which messages, `focus_on` and `-D objects.NAME.key=...` find the object
        material : Name of a material under `materials`, or a material itself: {type: ...}
        medium : Name of the medium under `media` that fills the object; without a material it has no surface
        outside_medium : Name of the medium round the object; the scene's `medium` by default
        transform : Steps in order, [{scale: 2}, {rotate: {axis: [0, 1, 0], angle: 30}}, {translate: [0, 1, 0]}], or a
            4x4 matrix
        """

class _Textures:
    @staticmethod
    def checker(
        *,
        scale: float | str = ...,
        even: _Numbers | float | str = ...,
        odd: _Numbers | float | str = ...,
        space: Literal["solid", "uv"] = ...,
    ) -> _Checker:
        """Cubes of space in two colours by turns, or rectangles of a surface's parameters.

        A cell's colour is told by whether floor(x / scale) + floor(y / scale) + floor(z / scale) is even.

        References: Shirley et al. 2024, "Ray Tracing: The Next Week", sec. 4.3.

        Parameters
        ----------
        scale : edge of a cell (m); in `space: uv`, of u and v [metres, or with a unit]
        even : colour of the cell from the origin on
        odd : colour of its neighbours
        space : `solid`: cubes of space; `uv`: squares of the surface's parameters
        """
    @staticmethod
    def image(
        *,
        file: str | PathLike[str],
        encoding: Literal["auto", "srgb", "linear"] = ...,
        filter: Literal["bilinear", "nearest"] = ...,
        wrap: Literal["repeat", "clamp", "mirror"] | Sequence[Literal["repeat", "clamp", "mirror"]] = ...,
        channel: Literal["rgb", "r", "g", "b", "a", "luminance"] = ...,
        factor: _Numbers | float | str = ...,
        scale: _Numbers | float | str = ...,
        offset: _Numbers = ...,
        rotation: float | str = ...,
    ) -> _ImageTexture:
        """A picture over the surface: its lower left corner is at u = v = 0, its upper right corner at u = v = 1.

        Row 0 of the file, the top of the picture, is at v = 1, as in OBJ files.  The picture is looked up at offset +
        R(rotation) (scale * (u, v)), with R anticlockwise.  Texels are points in the middle of their squares, between which
        `bilinear` interpolates in linear light.

        Parameters
        ----------
        file : picture (.png .jpg .bmp .tga .tif .webp .exr .hdr .npy), relative to the scene
        encoding : what the file's numbers are; `auto`: sRGB if they are integers and stand for colours, else linear
        filter : what lies between texels
        wrap : what lies outside of 0..1; a name, or one for u and one for v
        channel : the colour, or one channel of the file, or its luminance, as grey
        factor : what the decoded values are multiplied by
        scale : how often the picture fits into u and v of 0..1; one number or two
        offset : where in the picture u = v = 0 lies
        rotation : by how much u and v are turned, anticlockwise [degrees, or with a unit]
        """
    @staticmethod
    def noise(
        *,
        pattern: Literal["perlin", "turbulence", "marble"] = ...,
        scale: float | str = ...,
        octaves: int | None = ...,
        seed: int = ...,
        low: _Numbers | float | str = ...,
        high: _Numbers | float | str = ...,
        turbulence: float | str = ...,
        turbulence_scale: float | str = ...,
    ) -> _Noise:
        """Perlin's gradient noise, which blends from the colour `low` to `high`.

        With n the sum of octaves, each of twice the frequency and half the size of the one before, `perlin` blends by
        (1 + n) / 2 with n scaled to -1..1, `turbulence` by |n|, and `marble` by (1 + sin(scale z + turbulence |n|)) / 2.

        References: Perlin 1985, "An Image Synthesizer"; Perlin 2002, "Improving Noise"; Shirley et al. 2024, "Ray Tracing:
        The Next Week", sec. 5.

        Parameters
        ----------
        pattern : clouds, their folded sum, or bands along z that turbulence bends
        scale : cells of the noise a metre; for `marble`, radians of the bands a metre along z
        octaves : how many octaves are summed; 1 for `perlin` and 7 for the others if not given
        seed : another seed is another noise
        low : colour where the pattern is lowest
        high : colour where the pattern is highest
        turbulence : how far turbulence moves marble's bands (rad)
        turbulence_scale : cells of marble's turbulence a metre
        """

aperture: _Apertures
camera: _Cameras
environment: _Environments
filter: _Filters
light: _Lights
material: _Materials
medium: _Mediums
object: _Objects
texture: _Textures

def AutoExposure(
    *,
    metering: Literal["mean", "center_weighted", "spot"] = ...,
    at: _Numbers = ...,
    size: float | str = ...,
) -> _AutoExposure:
    """Exposure by metering: a speed is chosen so that what is metered has the exposure 10 / S of ISO 12232.

    Parameters
    ----------
    metering : `mean` of all pixels; `center_weighted`, three quarters for a circle in the middle, half as wide as
        the frame's shorter side; or a `spot`
    at : middle of the spot: fractions of the frame's width and height, from the top left
    size : diameter of the spot, as a fraction of the frame's shorter side
    """

def Film(
    *,
    width: int,
    height: int,
    filter: Literal["box", "gaussian", "mitchell"] | _FilterBox | _Keys | _Gaussian | _Mitchell = ...,
    white_balance: float | str | _Numbers | None = ...,
    tone_curve: Literal["linear", "filmic"] | _ToneCurveSpec | _Keys = ...,
) -> _Film:
    """The image: its size, how samples become pixels, and how these are shown.

    Parameters
    ----------
    width : Pixels across
    height : Pixels down
    filter : Reconstruction filter: a name, or a mapping with its parameters
    white_balance : Light that is to look white: a colour temperature from 2000 to 25000 K, `auto`, which makes the
        mean of the picture grey, or gains of red, green and blue; by default colours stay as they are
    tone_curve : How .png and .jpg files show linear values: `linear`, clipped at 1, `filmic`, or {type: filmic,
        white: 4}; linear files are left as they are
    """

def Frame(
    *,
    time: float | str,
    file: str,
) -> _Frame:
    """The form of a mesh at a time.

    Parameters
    ----------
    time : time of the scene (s) [seconds, or with a unit]
    file : mesh file with the same triangles as that of the other frames
    """

def Keyframe(
    *,
    time: float | str,
    transform: Sequence[_Keys] | _Keys | _Rows,
) -> _Keyframe:
    """A pose at a time.

    Parameters
    ----------
    time : time of the scene (s) [seconds, or with a unit]
    transform : the pose: what happens to the object after its own transform
    """

def Microlenses(
    *,
    pixels: int | None = ...,
    pitch: float | str | None = ...,
    count: int | None = ...,
    layout: Literal["square", "hexagonal"] = ...,
    model: Literal["lens", "pinhole"] = ...,
    focal_length: float | str | _Numbers | None = ...,
    distance: float | str | None = ...,
    arrangement: Literal["plenoptic", "focused"] = ...,
    crosstalk: bool = ...,
    rotation: float | str = ...,
    offset: _Numbers = ...,
) -> _Microlenses:
    """An array of microlenses, and the sensor behind it.

    Parameters
    ----------
    pixels : pixels of the sensor across each sub-image, whole ones: the pitch is chosen so that sub-images, which
        are spaced wider than microlenses, fall on the pixels exactly; 15 by default
    pitch : distance between the middles of neighbours (mm; 125 um), in place of `pixels`; it need fit no pixels
        [millimetres, or with a unit]
    count : microlenses across the width of the picture, in place of `pixels`
    layout : how the microlenses are packed; in hexagonal rows every other one is half a step off
    model : `lens`, thin ones without gaps between them; `pinhole`, holes in their middles, sharp at any distance,
        which by convention let as much light through
    focal_length : focal length of a microlens (mm); by default that which has the sensor in focus on the main lens,
        with sub-images that just touch; three of them for focused hexagonal microlenses of three kinds,
        interleaved, of which the middle one is sharp in the plane of focus [millimetres, or with a unit]
    distance : distance of the sensor behind the microlenses (mm); by default where sub-images just touch, or by
        `focal_length` [millimetres, or with a unit]
    arrangement : `plenoptic` (1.0), the microlenses lie in the image of the plane of focus and show the main lens;
        `focused` (2.0), they lie before or behind that image, and show it sharply on the sensor
    crosstalk : whether light also falls under the neighbours of the microlens that it goes through, where the sub-
        images overlap; else each pixel sees through its own microlens alone
    rotation : angle (deg) by which the array is turned to the left in the picture, about its middle [degrees, or
        with a unit]
    offset : by how much the array is off its place on the sensor (mm), right and up in the picture
    """

def Motion(
    *,
    velocity: _Numbers | None = ...,
    spin: _Spin | _Keys | None = ...,
    keyframes: Sequence[_Keyframe | _Keys] | None = ...,
) -> _Motion:
    """Movement of an object or a camera in world space: a velocity, a spin or both, or keyframes.

    Parameters
    ----------
    velocity : velocity (m/s) [metres per second, or with a unit]
    spin : rotation at a constant rate
    keyframes : at least two poses in the order of their times; they are held before and after
    """

def Render(
    *,
    spp: int = ...,
    max_depth: int = ...,
    sampler: Literal["sobol", "independent", "stratified"] = ...,
    accuracy: Literal["exact", "robust", "fast"] = ...,
    light_sampling: Literal["mis", "lights", "paths"] = ...,
    seed: int = ...,
    rr_depth: int = ...,
    clamp: float | str | None = ...,
) -> _Render:
    """Samples, path lengths and sampling of the image.

    Parameters
    ----------
    spp : Samples per pixel
    max_depth : Path segments: 1 is what the camera ray hits, 2 adds one bounce
    sampler : Where the random numbers come from: Owen-scrambled Sobol points, a generator, or jittered strata
    accuracy : `exact` solves each hit again in float64, `robust` has Embree watertight, `fast` takes its hits as
        they are
    light_sampling : How light is found: `mis` by next-event estimation and by paths, weighted against each other,
        `lights` by paths only where no light can be sampled, `paths` by paths alone
    seed : Seed: the same scene, seed and spp give the same image
    rr_depth : Path segments before Russian roulette may end a path
    clamp : Largest radiance that a sample may have in any channel: brighter ones are made as dark as that, which
        takes away fireflies, and light; off by default
    """

def Sensor(
    *,
    format: Literal["medium_format", "full_frame", "aps_h", "aps_c", "four_thirds", "1-inch", "1/1.63-inch", "1/2.3-inch", "1/3.2-inch"] | None = ...,
    width: float | str | None = ...,
    height: float | str | None = ...,
    noise: bool = ...,
    full_well: float | str = ...,
    read_noise: float | str = ...,
    base_iso: float | str = ...,
    bit_depth: int = ...,
    black_level: int | None = ...,
    bayer: Literal["rggb", "bggr", "grbg", "gbrg"] | None = ...,
    seed: int | None = ...,
) -> _SensorSpec:
    """A sensor, by its name, `sensor: full_frame`, or by its size and by what it does to light.

    Parameters
    ----------
    format : name of a size: medium_format, full_frame, aps_h, aps_c, four_thirds, 1-inch, 1/1.63-inch, 1/2.3-inch,
        1/3.2-inch
    width : width (mm), in place of a name [millimetres, or with a unit]
    height : height (mm), in place of a name [millimetres, or with a unit]
    noise : whether the sensor is simulated: photon shot noise, read noise, saturation and quantization; without it
        the keys below do nothing
    full_well : electrons that a pixel holds, which saturate it at the base ISO
    read_noise : standard deviation of what reading adds (electrons)
    base_iso : ISO speed at which a full well is the largest number; a higher one amplifies
    bit_depth : bits of the numbers that the converter gives
    black_level : number that the converter gives for no light, which is subtracted again; default: 1/32 of the
        range, which is 512 of 14 bits
    bayer : colours of the filters on the first two pixels of the first two rows, what is missing being filled in
        (needs the extra raytracer[bayer]); without it each pixel records all three
    seed : seed of the noise; that of the render by default
    """

def Shake(
    *,
    amplitude: float | str,
    bandwidth: float | str = ...,
    seed: int = ...,
) -> _Shake:
    """Small irregular rotations of a hand-held camera about its own position.

    Each of the angles about the camera's axes is noise with an even spectrum up to a frequency: a sum of sinusoids
    whose frequencies and phases are random, which is Gaussian in the limit of many.

    References: Rice 1944, "Mathematical Analysis of Random Noise", Bell System Technical Journal 23(3), sec. 2.8 (the
    sum of sinusoids).

    Parameters
    ----------
    amplitude : root mean square (deg) of the angle about each axis of the camera: yaw, pitch and roll [degrees, or
        with a unit]
    bandwidth : highest frequency (Hz) in the shake [hertz, or with a unit]
    seed : seed: another one shakes otherwise
    """

def Shutter(
    *,
    open: float | str | None = ...,
    close: float | str | None = ...,
    duration: float | str | None = ...,
    opening: Literal["instant", "trapezoid"] | _Rows = ...,
    ramp: float | str | None = ...,
    readout: float | str = ...,
    direction: Literal["down", "up", "left", "right"] = ...,
    curtain: Literal["electronic", "focal_plane"] = ...,
) -> _ShutterSpec:
    """The time in which light is gathered.

    Parameters
    ----------
    open : time of the scene at which the shutter begins to open (s); default 0 [seconds, or with a unit]
    close : time of the scene at which it begins to close (s) [seconds, or with a unit]
    duration : for how long it is open (s), in place of `close`; with a ramp, at half its height [seconds, or with a
        unit]
    opening : instant; or trapezoid, which opens and closes linearly within `ramp`; or a curve [[time,
        transmission], ...], with times in seconds after it begins to open, linear between these points
    ramp : time (s) in which a trapezoid opens, and closes; at most the duration [seconds, or with a unit]
    readout : rolling shutter: time (s) that it takes from one edge of the picture to the other; 0: all at once
        [seconds, or with a unit]
    direction : direction in the picture in which the readout, or the slit, travels
    curtain : electronic: whole rows or columns of pixels are exposed at once; focal_plane: a slit travels
        continuously
    """

def Spin(
    *,
    axis: _Numbers,
    rate: float | str,
    center: _Numbers = ...,
) -> _Spin:
    """Rotation at a constant rate.

    Parameters
    ----------
    axis : axis; its length does not matter
    rate : rate (deg/s), counter-clockwise as seen from the tip of the axis [degrees per second, or with a unit]
    center : a point of the axis at time 0 (m); it moves with the velocity [metres, or with a unit]
    """

def ToneCurve(
    *,
    type: Literal["linear", "filmic"] = ...,
    white: float | str | None = ...,
) -> _ToneCurveSpec:
    """A tone curve for display: linear values as they are, clipped at 1, or as film would show them.

    Parameters
    ----------
    type : `linear`, clipped at 1; or `filmic`, with a toe and a shoulder
    white : value that `filmic` shows as white, the sensor's saturation being 1; default: 1 where the sensor is
        simulated, else 4
    """

def Vignetting(
    *,
    diameter: float | str,
    distance: float | str,
) -> _Vignetting:
    """A round rim in front of the lens, centred on the axis, that every ray has to pass.

    Seen from far off the axis, rim and aperture overlap in part only: the picture darkens to its corners, where lights
    out of focus have the shape of a cat's eye.  A rim smaller than the aperture takes light from the middle too.

    References: Asada, Amano, Baba 1996, "Photometric Calibration of Zoom Lens Systems", ICPR.

    Parameters
    ----------
    diameter : diameter of the rim (mm) [millimetres, or with a unit]
    distance : how far in front of the aperture it is (mm) [millimetres, or with a unit]
    """
