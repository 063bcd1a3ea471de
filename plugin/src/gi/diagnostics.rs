//! Counters of global illumination's work in a frame.

use std::sync::{Arc, Mutex, PoisonError};

use bevy::app::{App, PreUpdate};
use bevy::diagnostic::{Diagnostic, DiagnosticPath, Diagnostics, RegisterDiagnostic};
use bevy::ecs::prelude::*;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::camera::ExtractedCamera;
use bevy::render::{Render, RenderApp, RenderSystems};

use crate::gi::bounces::BounceCamera;
use crate::gi::cache::{self, CacheView};
use crate::gi::denoise::History;
use crate::gi::fog::FogView;
use crate::gi::forward::ForwardView;
use crate::gi::gather::GatherView;
use crate::gi::rsm::RsmView;
use crate::gi::sky::SkyCamera;
use crate::gi::texels::TexelStore;
use crate::gi::trace::OccluderBuffers;
use crate::gi::view::{GiFrame, GiShare, GiView};
use crate::gi::vpl::VplView;

/// GI's work in the last frame. A resource of the render world; the main world has it as
/// diagnostics, a frame or two later.
#[derive(Resource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Clone, PartialEq)]
#[non_exhaustive]
pub struct GiCounts {
    /// Reflective shadow maps rendered.
    pub maps: u32,
    /// Maps that are out of date and wait for a later frame.
    pub waiting_maps: u32,
    /// Cameras that gathered; the others show their last gather.
    pub cameras: u32,
    /// Cameras whose temporal accumulation still converges.
    pub settling: u32,
    /// Patches that reflected, times their rounds.
    pub patches: u64,
    /// Virtual point lights sampled.
    pub vpls: u64,
    /// VPL–pixel pairs evaluated, sky samples included.
    pub pairs: u64,
    /// Upper bound of the rays traced from pixels, and from places around cameras: a stratum of VPLs
    /// without unoccluded irradiance takes none.
    pub rays: u64,
    /// Bytes of GPU memory that GI holds.
    pub bytes: u64,
    /// Bytes of the scene uploaded: what occludes, texels of emissive surfaces, and patches.
    pub uploaded: u64,
}

pub(super) fn finish(app: &mut App) {
    let shared = SharedCounts::default();
    app.sub_app_mut(RenderApp)
        .insert_resource(shared.clone())
        .init_resource::<GiCounts>()
        .add_systems(Render, count.in_set(RenderSystems::PrepareBindGroups));
    for (path, suffix, _) in DIAGNOSTICS {
        app.register_diagnostic(Diagnostic::new(path).with_suffix(suffix));
    }
    app.insert_resource(shared).add_systems(PreUpdate, publish);
}

/// Paths of its fields among Bevy's diagnostics. GPU times are in Bevy's render diagnostics under
/// `frugal_gi/…`.
impl GiCounts {
    /// [`GiCounts::maps`].
    pub const MAPS: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/maps");
    /// [`GiCounts::waiting_maps`].
    pub const WAITING_MAPS: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/waiting_maps");
    /// [`GiCounts::cameras`].
    pub const CAMERAS: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/cameras");
    /// [`GiCounts::settling`].
    pub const SETTLING: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/settling");
    /// [`GiCounts::patches`].
    pub const PATCHES: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/patches");
    /// [`GiCounts::vpls`].
    pub const VPLS: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/vpls");
    /// [`GiCounts::pairs`].
    pub const PAIRS: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/pairs");
    /// [`GiCounts::rays`].
    pub const RAYS: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/rays");
    /// [`GiCounts::bytes`], in MiB.
    pub const MEMORY: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/memory");
    /// [`GiCounts::uploaded`], in KiB.
    pub const UPLOADS: DiagnosticPath = DiagnosticPath::const_new("frugal_gi/uploads");
}

/// A diagnostic: path, unit suffix, and its value.
type Count = (DiagnosticPath, &'static str, fn(&GiCounts) -> f64);

const DIAGNOSTICS: [Count; 10] = [
    (GiCounts::MAPS, "", |counts| f64::from(counts.maps)),
    (GiCounts::WAITING_MAPS, "", |counts| f64::from(counts.waiting_maps)),
    (GiCounts::CAMERAS, "", |counts| f64::from(counts.cameras)),
    (GiCounts::SETTLING, "", |counts| f64::from(counts.settling)),
    (GiCounts::PATCHES, "", |counts| counts.patches as f64),
    (GiCounts::VPLS, "", |counts| counts.vpls as f64),
    (GiCounts::PAIRS, "", |counts| counts.pairs as f64),
    (GiCounts::RAYS, "", |counts| counts.rays as f64),
    (GiCounts::MEMORY, " MiB", |counts| counts.bytes as f64 / 1_048_576.0),
    (GiCounts::UPLOADS, " KiB", |counts| counts.uploaded as f64 / 1024.0),
];

/// Shared by both worlds.
#[derive(Resource, Clone, Debug, Default)]
struct SharedCounts(Arc<Mutex<GiCounts>>);

fn publish(shared: Res<SharedCounts>, mut diagnostics: Diagnostics) {
    let counts = *shared.0.lock().unwrap_or_else(PoisonError::into_inner);
    for (path, _, value) in &DIAGNOSTICS {
        diagnostics.add_measurement(path, || value(&counts));
    }
}

/// Low-resolution pixels, or places of the image, that are gathered in this frame.
fn gathered_pixels(view: &GiView) -> u64 {
    match view.work.gather {
        true if view.gi.caches() => cache::samples(view),
        true => view.cells().as_u64vec2().element_product(),
        false => 0,
    }
}

/// Counts the work of this frame, after its views are prepared.
fn count(
    mut counts: ResMut<GiCounts>,
    shared: Res<SharedCounts>,
    store: Res<TexelStore>,
    occluders: Res<OccluderBuffers>,
    views: Query<(
        (&GiView, &GiShare),
        &VplView,
        &GatherView,
        Option<&CacheView>,
        Option<&ForwardView>,
        Has<FogView>,
        Option<&History>,
        Option<&BounceCamera>,
    )>,
    skies: Query<&SkyCamera>,
    frame: Res<GiFrame>,
    maps: Query<(), (With<RsmView>, With<ExtractedCamera>)>,
) {
    *counts = GiCounts {
        maps: maps.iter().count() as u32,
        waiting_maps: frame.waiting,
        uploaded: store.uploaded + occluders.uploaded(),
        bytes: store.bytes() + occluders.bytes() + skies.iter().map(SkyCamera::bytes).sum::<u64>(),
        ..GiCounts::default()
    };
    for ((view, share), vpl, gather, cache, forward, has_fog, history, bounces) in &views {
        counts.cameras += u32::from(view.work.gather);
        counts.settling += u32::from(
            share.0 < 1.0
                || history.is_some_and(History::is_converging)
                || view.work.gather && cache.is_some_and(CacheView::is_settling),
        );
        counts.vpls += vpl.sampled(view);
        let (pixels, per_set) = (gathered_pixels(view), vpl.plan.per_set);
        counts.pairs += pixels * u64::from(per_set + view.sky_samples);
        let visibility = view.gi.visibility;
        let rays = visibility.rays().min(per_set) + visibility.sky_rays().min(view.sky_samples);
        counts.rays += pixels * u64::from(rays) + forward.map_or(0, |forward| forward.rays(view));
        counts.bytes += vpl.bytes()
            + gather.bytes()
            + cache.map_or(0, CacheView::bytes)
            + forward.map_or(0, ForwardView::bytes)
            + if has_fog { FogView::BYTES } else { 0 }
            + history.map_or(0, History::bytes)
            + bounces.map_or(0, BounceCamera::bytes);
        if let Some(bounces) = bounces.filter(|_| view.work.sample) {
            counts.patches += bounces.patches_due();
        }
    }
    *shared.0.lock().unwrap_or_else(PoisonError::into_inner) = *counts;
}
