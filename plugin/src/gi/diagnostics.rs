//! What global illumination did in a frame, as numbers that an app can look at.

use std::sync::{Arc, Mutex, PoisonError};

use bevy::app::{App, PreUpdate};
use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::ecs::prelude::*;
use bevy::render::camera::ExtractedCamera;

use super::bounces::BounceCamera;
use super::gather::GiCamera;
use super::rsm::{RsmStore, RsmView};
use super::sources::SkyCamera;
use super::visibility::OccluderBuffers;

/// What GI did in the last frame. A resource of the render world; the main world has it, a frame or
/// two later, as diagnostics.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GiCounts {
    /// Reflective shadow maps rendered.
    pub maps: u32,
    /// Cameras that gathered; the others show what they gathered before.
    pub cameras: u32,
    /// Cameras whose light is on its way from an average over frames to what was gathered last.
    pub settling: u32,
    /// Patches that reflect light once more, each as often as it does.
    pub patches: u64,
    /// Virtual point lights drawn.
    pub vpls: u64,
    /// VPL–pixel pairs evaluated, samples of the sky included.
    pub pairs: u64,
    /// Rays traced from pixels, at most: a hand of VPLs that send nothing takes none.
    pub rays: u64,
    /// Bytes of GPU memory that GI holds.
    pub bytes: u64,
}

/// A diagnostic and its part of the counts.
type Count = (DiagnosticPath, &'static str, fn(&GiCounts) -> f64);

/// The diagnostics of global illumination, in Bevy's store; GPU times have `bevy_frugal_gi/…` paths
/// in Bevy's render diagnostics.
pub const GI_DIAGNOSTICS: [Count; 8] = [
    (DiagnosticPath::const_new("gi/maps"), "", |counts| f64::from(counts.maps)),
    (DiagnosticPath::const_new("gi/cameras"), "", |counts| f64::from(counts.cameras)),
    (DiagnosticPath::const_new("gi/settling"), "", |counts| f64::from(counts.settling)),
    (DiagnosticPath::const_new("gi/patches"), "", |counts| counts.patches as f64),
    (DiagnosticPath::const_new("gi/vpls"), "", |counts| counts.vpls as f64),
    (DiagnosticPath::const_new("gi/pairs"), "", |counts| counts.pairs as f64),
    (DiagnosticPath::const_new("gi/rays"), "", |counts| counts.rays as f64),
    (DiagnosticPath::const_new("gi/memory"), " MiB", |counts| counts.bytes as f64 / 1_048_576.0),
];

/// From one world to the other.
#[derive(Resource, Clone, Debug, Default)]
pub(super) struct SharedCounts(Arc<Mutex<GiCounts>>);

pub(super) fn build(app: &mut App) -> SharedCounts {
    for (path, suffix, _) in GI_DIAGNOSTICS {
        app.register_diagnostic(Diagnostic::new(path).with_suffix(suffix));
    }
    let shared = SharedCounts::default();
    app.insert_resource(shared.clone()).add_systems(PreUpdate, publish);
    shared
}

fn publish(shared: Res<SharedCounts>, mut diagnostics: Diagnostics) {
    let counts = *shared.0.lock().unwrap_or_else(PoisonError::into_inner);
    for (path, _, value) in &GI_DIAGNOSTICS {
        diagnostics.add_measurement(path, || value(&counts));
    }
}

/// After cameras are prepared: what this frame will do.
pub(super) fn count(
    mut counts: ResMut<GiCounts>,
    shared: Res<SharedCounts>,
    store: Res<RsmStore>,
    occluders: Res<OccluderBuffers>,
    cameras: Query<&GiCamera>,
    skies: Query<&SkyCamera>,
    bounces: Query<(&GiCamera, &BounceCamera)>,
    maps: Query<(), (With<RsmView>, With<ExtractedCamera>)>,
) {
    *counts = GiCounts {
        maps: maps.iter().count() as u32,
        cameras: cameras.iter().filter(|camera| camera.work.gather).count() as u32,
        settling: cameras.iter().filter(|camera| camera.is_settling()).count() as u32,
        patches: bounces
            .iter()
            .filter(|(camera, _)| camera.work.draw)
            .map(|(_, bounces)| bounces.patches_due())
            .sum(),
        vpls: cameras.iter().map(GiCamera::vpls_drawn).sum(),
        pairs: cameras.iter().map(GiCamera::pairs).sum(),
        rays: cameras.iter().map(GiCamera::rays).sum(),
        bytes: store.bytes()
            + occluders.bytes()
            + cameras.iter().map(GiCamera::bytes).sum::<u64>()
            + skies.iter().map(SkyCamera::bytes).sum::<u64>()
            + bounces.iter().map(|(_, bounces)| bounces.bytes()).sum::<u64>(),
    };
    *shared.0.lock().unwrap_or_else(PoisonError::into_inner) = *counts;
}
