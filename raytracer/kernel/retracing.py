"""Paths that are traced again from the camera, for each wavelength that parted from the first."""

from raytracer.core.compiler.dispatch import kernel
from raytracer.kernel.aovs.base.layers import finish_aov_retrace, start_aov_retrace
from raytracer.kernel.camera_medium import initialize_medium
from raytracer.kernel.camera_rays import start_path
from raytracer.kernel.hero_wavelength import needs_retrace, restart_rgb_path
from raytracer.kernel.path_log import Retrace, begin_round, record
from raytracer.kernel.path_state import path_time


@kernel
def restart_paths(scene, aovs, work, number, size):
    """Queue the paths of those of the batch's `size` samples whose wavelength `number` was terminated.

    Returns the number of rays traced to find what the camera is in.
    """
    for sample in range(size):
        if needs_retrace(work, sample):
            begin_round(work.log, 0)
            start_aov_retrace(aovs, work, sample)
            origin, direction = restart_rgb_path(work, sample, number)
            record(work.log, work, sample, Retrace(number))
            start_path(scene, work, sample, origin, direction, path_time(work, sample))
    return initialize_medium(scene.nested_dielectrics, scene, work)


@kernel
def finish_retrace(aovs, work, size):
    """Add what AOVs have recorded of the paths that were traced again."""
    for sample in range(size):
        if needs_retrace(work, sample):
            finish_aov_retrace(aovs, work, sample)
