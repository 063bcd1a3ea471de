//! Multiple diffuse bounces.

pub(crate) mod changes;
pub(crate) mod light;
pub(crate) mod limits;

use bevy_frugal_gi::gi::inspect;
use frugal::stage::Stage;
use frugal_tests::{gpu, set};

/// Every pixel gathered, with rays.
const RAYS: &str = "min,gi_refresh_period=1,gi_vpl_count=1024,gi_interleave=2x2,gi_visibility=fine,gi_pixel_fraction=1/1,resolution_scale=100%";

/// The stage, with another number of bounces.
fn with_bounces(stage: &mut Stage, bounces: u32) -> &mut Stage {
    set::gi(stage).bounces = bounces;
    stage
}

/// Patches of the last frame, as texels.
fn patches(stage: &Stage) -> Vec<gpu::Point> {
    let state = inspect::gpu_state(stage.render_world());
    let texels = gpu::rsm_texels(stage);
    let bounces = state
        .cameras
        .first()
        .and_then(|camera| camera.bounces.clone())
        .expect("light is reflected more than once");
    texels[bounces.texels.start as usize..bounces.texels.end as usize].to_vec()
}
