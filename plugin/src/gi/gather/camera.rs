//! What a GI camera holds, and what it has to do in a frame.

use bevy::ecs::prelude::*;
use bevy::math::UVec2;
use bevy::render::camera::{ExtractedCamera, TemporalJitter};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::texture::CachedTexture;
use bevy::render::view::ExtractedView;

use super::plan::{self, GatherSettings, VplPlan};
use super::work::{Seen, Work};
use crate::gi::bounces::BounceCamera;
use crate::gi::filter::{self, History, PastView, Step};
use crate::gi::refresh::{GiFrame, GiRefresh};
use crate::gi::rsm::{RsmCut, RsmLight, RsmStore, RsmView};
use crate::gi::settings::{FrugalGi, GiPixelFraction, GiVisibility};
use crate::gi::sources::{GiEmitters, SkyCamera};
use crate::gi::visibility::GiOccluders;
use crate::gi::vpl::{DrawingBuffers, MapRow};

/// What a GI camera holds in the render world, while it has VPLs to gather.
#[derive(Component)]
pub struct GiCamera {
    /// What is done for it in this frame.
    pub(in crate::gi) work: Work,
    /// What it was last gathered for.
    seen: Seen,
    /// How its VPLs are shared out.
    pub(in crate::gi) plan: VplPlan,
    pub(in crate::gi) plan_buffer: Buffer,
    pub(in crate::gi) vpls: Buffer,
    /// None where there is nothing to draw VPLs from, but a sky.
    pub(in crate::gi) drawing: Option<DrawingBuffers>,
    /// What each cell gathered.
    pub(in crate::gi) irradiance: CachedTexture,
    pub(in crate::gi) fraction: GiPixelFraction,
    pub(in crate::gi) filter_window: u32,
    /// What was filtered and what was shown before, where there is a filter. What is shown is then written back to where was gathered.
    pub(in crate::gi) history: Option<History>,
    settings: Buffer,
    pub(in crate::gi) visibility: GiVisibility,
    /// Samples of the sky that each cell evaluates.
    pub(super) sky_samples: u32,
}

impl GiCamera {
    /// Bytes held on the GPU for this camera.
    pub(in crate::gi) fn bytes(&self) -> u64 {
        let past = self.history.as_ref();
        let textures = [Some(&self.irradiance), past.map(|past| &past.filtered), past.map(|past| &past.texture)].into_iter().flatten();
        let texels = textures.map(|texture| u64::from(texture.texture.width()) * u64::from(texture.texture.height()) * 8).sum::<u64>();
        texels
            + past.map_or(0, History::bytes)
            + self.drawing.as_ref().map_or(0, DrawingBuffers::bytes)
            + [&self.vpls, &self.plan_buffer, &self.settings].map(|buffer| buffer.size()).iter().sum::<u64>()
    }

    /// Whether what it shows will change although nothing moves.
    pub(in crate::gi) fn is_settling(&self) -> bool {
        self.history.as_ref().is_some_and(History::is_settling)
    }

    /// Gathered pixels along both axes.
    fn cells(&self) -> UVec2 {
        UVec2::new(self.irradiance.texture.width(), self.irradiance.texture.height())
    }

    /// What the composite shows.
    pub(in crate::gi) fn shown(&self) -> &CachedTexture {
        &self.irradiance
    }

    /// The settings of the first set, to which a dynamic offset may be added.
    pub(in crate::gi) fn first_settings(&self) -> BindingResource<'_> {
        first_of(&self.settings, size_of::<GatherSettings>() as u64)
    }

    /// VPLs that are drawn in this frame.
    pub(in crate::gi) fn vpls_drawn(&self) -> u64 {
        if self.work.draw { u64::from(self.plan.sets) * u64::from(self.plan.per_set) } else { 0 }
    }

    /// Pairs of pixel and VPL, or sample of the sky, that are evaluated in this frame.
    pub(in crate::gi) fn pairs(&self) -> u64 {
        self.gathered_pixels() * u64::from(self.plan.per_set + self.sky_samples)
    }

    /// Rays that are traced from pixels in this frame, at most.
    pub(in crate::gi) fn rays(&self) -> u64 {
        self.gathered_pixels() * u64::from(self.visibility.rays().min(self.plan.per_set) + self.visibility.sky_rays().min(self.sky_samples))
    }

    fn gathered_pixels(&self) -> u64 {
        let cells = self.cells().as_u64vec2();
        if self.work.gather { cells.x * cells.y } else { 0 }
    }
}

/// A texture of the camera's own: those of Bevy's cache may be another's in the next frame, and what was gathered must stay.
fn irradiance_texture(device: &RenderDevice, label: &'static str, size: UVec2) -> CachedTexture {
    let texture = device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: TextureFormat::Rgba16Float,
        usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let default_view = texture.create_view(&TextureViewDescriptor::default());
    CachedTexture { texture, default_view }
}

pub(super) fn first_of(buffer: &Buffer, size: u64) -> BindingResource<'_> {
    BindingResource::Buffer(BufferBinding { buffer, offset: 0, size: BufferSize::new(size) })
}

/// Gives every GI camera that has light to gather its VPL buffers and its textures, and takes them from the others; and finds out what it has to do.
pub(in crate::gi) fn prepare_cameras(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    store: Res<RsmStore>,
    frame: Res<GiFrame>,
    policy: Res<GiRefresh>,
    maps: Query<(&RsmView, &RsmLight, &RsmCut)>,
    (emitters, occluders): (Res<GiEmitters>, Res<GiOccluders>),
    cameras: Query<(
        Entity,
        &MainEntity,
        &FrugalGi,
        &ExtractedCamera,
        &ExtractedView,
        Has<TemporalJitter>,
        Option<&SkyCamera>,
        Option<&BounceCamera>,
    )>,
    mut held: Query<&mut GiCamera>,
    stale: Query<Entity, (With<GiCamera>, Or<(Without<FrugalGi>, Without<ExtractedCamera>)>)>,
) {
    for entity in &stale {
        commands.entity(entity).remove::<GiCamera>();
    }
    for (entity, main_entity, gi, camera, view, jitters, sky, bounces) in &cameras {
        let mut rows = rows_of(main_entity.id(), &maps);
        if gi.emissive {
            emitters.add_rows(camera.exposure, store.map_texels, &mut rows);
        }
        if let Some(bounces) = bounces {
            bounces.add_rows(&mut rows);
        }
        if store.texels.is_none() {
            rows.clear();
        }
        let sky = sky.and_then(SkyCamera::seen);
        let sky_samples = sky.as_ref().map_or(0, |sky| sky.samples());
        let Some(size) = camera.physical_viewport_size.filter(|size| size.min_element() > 0) else { continue };
        if !gi.gathers() || (rows.is_empty() && sky.is_none()) {
            if held.contains(entity) {
                commands.entity(entity).remove::<GiCamera>();
            }
            continue;
        }
        let plan = VplPlan::new(gi.vpl_count, gi.interleave);
        let plan = if rows.is_empty() { plan.without_vpls() } else { plan };
        let (width, height) = gi.pixel_fraction.cell();
        let cells = UVec2::new(size.x.div_ceil(width), size.y.div_ceil(height));
        let filter_window = filter::window(gi);
        let always = jitters || sky.as_ref().is_some_and(|sky| sky.is_generated());
        let seen = Seen::new(gi, camera, view, sky, occluders.is_kept());
        let period = gi.refresh_period.max(1);
        if let Ok(mut held) = held.get_mut(entity)
            && held.plan == plan
            && held.drawing.as_ref().map_or(rows.is_empty(), |drawing| drawing.fits(&rows))
            && held.cells() == cells
            && held.history.is_some() == (filter_window > 1)
        {
            if held.fraction != gi.pixel_fraction {
                queue.write_buffer(&held.settings, 0, &plan::settings_bytes(&plan, gi.pixel_fraction));
            }
            let others = held.drawing.as_mut().filter(|drawing| drawing.rows != rows);
            let laid_out = others.is_some();
            if let Some(drawing) = others {
                drawing.set_rows(&queue, rows);
            }
            let moved = held.seen != seen;
            let same_settings = held.seen.has_settings_of(&seen);
            held.work = held.work.next(moved || laid_out, always, &frame, *policy, period);
            let GiCamera { history, irradiance, work, .. } = &mut *held;
            if let Some(history) = history {
                let step = match (work.gather, same_settings && (moved || always || frame.gather)) {
                    (false, _) => Step::Rests,
                    (true, false) => Step::Begins,
                    (true, true) => Step::Moves,
                };
                history.advance(irradiance, PastView::new(camera, view), step, gi, &queue);
            }
            (held.seen, held.filter_window) = (seen, filter_window);
            (held.fraction, held.visibility, held.sky_samples) = (gi.pixel_fraction, gi.visibility, sky_samples);
            continue;
        }
        let empty =
            |label, size, usage| device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false });
        let filled =
            |label, contents: &[u8], usage| device.create_buffer_with_data(&BufferInitDescriptor { label: Some(label), contents, usage });
        let mut irradiance = irradiance_texture(&device, "bevy_frugal_gi/irradiance", cells);
        let history = (filter_window > 1).then(|| {
            let [filtered, shown] =
                ["bevy_frugal_gi/filtered", "bevy_frugal_gi/history"].map(|label| irradiance_texture(&device, label, cells));
            let mut history = History::new(&device, filtered, shown);
            // Gathers for the first time.
            history.advance(&mut irradiance, PastView::new(camera, view), Step::Begins, gi, &queue);
            history
        });
        let vpl_usage = BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::COPY_SRC;
        commands.entity(entity).insert(GiCamera {
            // Its buffers are empty, whatever the period says.
            work: Work { draw: true, gather: true, quiet: 0 },
            seen,
            plan,
            plan_buffer: filled("bevy_frugal_gi/vpl_plan", bytemuck::bytes_of(&plan), BufferUsages::STORAGE),
            vpls: empty("bevy_frugal_gi/vpls", plan.buffer_bytes(), vpl_usage),
            drawing: (!rows.is_empty()).then(|| DrawingBuffers::new(&device, rows)),
            filter_window,
            history,
            irradiance,
            fraction: gi.pixel_fraction,
            settings: filled(
                "bevy_frugal_gi/gather_settings",
                &plan::settings_bytes(&plan, gi.pixel_fraction),
                BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            ),
            visibility: gi.visibility,
            sky_samples,
        });
    }
}

/// Rows of every map that serves `camera`, in the order of the store.
fn rows_of(camera: Entity, maps: &Query<(&RsmView, &RsmLight, &RsmCut)>) -> Vec<MapRow> {
    let mut serving: Vec<_> =
        maps.iter().filter(|(map, ..)| map.camera.is_none_or(|owner| owner == camera)).map(|(_, light, cut)| (light, *cut)).collect();
    serving.sort_by_key(|(light, _)| light.texel_offset);
    let mut rows = Vec::new();
    for (RsmLight { texel_offset, resolution, .. }, cut) in serving {
        MapRow::add_map(&mut rows, *texel_offset, *resolution, *resolution, cut);
    }
    rows
}
