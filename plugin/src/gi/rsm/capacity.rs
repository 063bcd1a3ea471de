//! How many texels of maps the device can hold.

use bevy::log::warn_once;
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::WgpuLimits;

use crate::gi::compute::{largest_storage_buffer, limits_of};
use crate::gi::texels::TEXEL_BYTES;

/// Rows and texels that emissive surfaces and patches may need besides maps.
const OTHER_ROWS: u64 = 4096;
const OTHER_TEXELS: u64 = 32_768;

/// Texels, and rows of them, that the device can still take. A row of a map is a row of workgroups,
/// and all texels of the app are one storage buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct MapCapacity {
    rows: u64,
    texels: u64,
}

impl MapCapacity {
    /// That of a device; see [`limits_of`].
    pub(super) fn new(device: Option<&RenderDevice>) -> Self {
        Self::with(&limits_of(device))
    }

    fn with(limits: &WgpuLimits) -> Self {
        Self {
            rows: u64::from(limits.max_compute_workgroups_per_dimension).saturating_sub(OTHER_ROWS),
            texels: (largest_storage_buffer(limits) / TEXEL_BYTES).saturating_sub(OTHER_TEXELS),
        }
    }

    /// Texels that the device can still take.
    pub(super) fn texels(&self) -> u64 {
        self.texels
    }

    /// Reserves maps of `resolution` texels along their edges, if all of them fit;
    /// warns once if not.
    pub(super) fn take(&mut self, maps: usize, resolution: u32) -> bool {
        let rows = maps as u64 * u64::from(resolution);
        let texels = rows * u64::from(resolution);
        let fits = rows <= self.rows && texels <= self.texels;
        if fits {
            (self.rows, self.texels) = (self.rows - rows, self.texels - texels);
        } else {
            warn_once!(
                "the reflective shadow maps of all lights exceed this GPU's limits: the least important lights do not bounce (lower FrugalGi::rsm_resolution or GiLimits::max_rsm_count)"
            );
        }
        fits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_that_fit_are_taken_and_others_are_not() {
        let mut capacity = MapCapacity::with(&WgpuLimits::default());
        // 128 MiB are 4 M texels.
        assert!(!capacity.take(1, 2048), "with the texels of other sources it is too large");
        assert!(capacity.take(3, 1024) && !capacity.take(1, 1024) && capacity.take(1, 512));
        // 65,535 rows of workgroups.
        let large = WgpuLimits {
            max_storage_buffer_binding_size: u64::MAX,
            max_buffer_size: u64::MAX,
            ..Default::default()
        };
        let mut capacity = MapCapacity::with(&large);
        assert!(capacity.take(29, 2048) && !capacity.take(1, 2048) && capacity.take(1, 1024));
        let none = WgpuLimits { max_storage_buffer_binding_size: 0, ..Default::default() };
        assert!(!MapCapacity::with(&none).take(1, 16) && MapCapacity::with(&none).take(0, 16));
    }
}
