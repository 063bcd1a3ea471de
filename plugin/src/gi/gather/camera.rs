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
use crate::gi::cut::CutCameras;
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
    /// What was filtered and what was shown before, where there is a filter. What is shown is then
    /// written back to where was gathered.
    pub(in crate::gi) history: Option<History>,
    settings: Buffer,
    pub(in crate::gi) visibility: GiVisibility,
    /// Samples of the sky that each cell evaluates.
    pub(super) sky_samples: u32,
}

impl GiCamera {
    /// Bytes held on the GPU for this camera.
    pub(in crate::gi) fn bytes(&self) -> u64 {
        filter::bytes_of_texture(&self.irradiance)
            + self.history.as_ref().map_or(0, History::bytes)
            + self.drawing.as_ref().map_or(0, DrawingBuffers::bytes)
            + [&self.vpls, &self.plan_buffer, &self.settings]
                .map(|buffer| buffer.size())
                .iter()
                .sum::<u64>()
    }

    /// Whether what it shows will change although nothing moves.
    pub(in crate::gi) fn is_settling(&self) -> bool {
        self.history.as_ref().is_some_and(History::is_settling)
    }

    /// Gathered pixels along both axes.
    fn cells(&self) -> UVec2 {
        filter::size_of_texture(&self.irradiance)
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
        self.gathered_pixels()
            * u64::from(
                self.visibility.rays().min(self.plan.per_set)
                    + self.visibility.sky_rays().min(self.sky_samples),
            )
    }

    fn gathered_pixels(&self) -> u64 {
        let cells = self.cells().as_u64vec2();
        if self.work.gather { cells.x * cells.y } else { 0 }
    }
}

pub(super) fn first_of(buffer: &Buffer, size: u64) -> BindingResource<'_> {
    BindingResource::Buffer(BufferBinding { buffer, offset: 0, size: BufferSize::new(size) })
}

/// What a GI camera's buffers and textures are made for.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Layout {
    plan: VplPlan,
    /// Pixels of the picture.
    size: UVec2,
    fraction: GiPixelFraction,
    filter_window: u32,
}

impl Layout {
    fn new(gi: &FrugalGi, size: UVec2, has_rows: bool) -> Self {
        let plan = VplPlan::new(gi.vpl_count, gi.interleave);
        let plan = if has_rows { plan } else { plan.without_vpls() };
        Self { plan, size, fraction: gi.pixel_fraction, filter_window: filter::window(gi) }
    }

    /// Gathered pixels along both axes.
    fn cells(&self) -> UVec2 {
        let (width, height) = self.fraction.cell();
        UVec2::new(self.size.x.div_ceil(width), self.size.y.div_ceil(height))
    }
}

/// What is made for a plan: the plan itself, room for its VPLs, and the settings of its dispatches.
fn plan_buffers(device: &RenderDevice, plan: &VplPlan, fraction: GiPixelFraction) -> [Buffer; 3] {
    let filled = |label, contents: &[u8], usage| {
        device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        })
    };
    let vpls = BufferDescriptor {
        label: Some("bevy_frugal_gi/vpls"),
        size: plan.buffer_bytes(),
        usage: BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    };
    [
        filled("bevy_frugal_gi/vpl_plan", bytemuck::bytes_of(plan), BufferUsages::STORAGE),
        device.create_buffer(&vpls),
        filled(
            "bevy_frugal_gi/gather_settings",
            &plan::settings_bytes(plan, fraction),
            BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        ),
    ]
}

impl GiCamera {
    /// One that has gathered nothing.
    fn new(device: &RenderDevice, layout: &Layout, rows: Vec<MapRow>, seen: Seen) -> Self {
        let [plan_buffer, vpls, settings] = plan_buffers(device, &layout.plan, layout.fraction);
        Self {
            // Its buffers are empty, whatever the period says.
            work: Work { draw: true, gather: true, quiet: 0 },
            seen,
            plan: layout.plan,
            plan_buffer,
            vpls,
            drawing: (!rows.is_empty()).then(|| DrawingBuffers::new(device, rows)),
            irradiance: filter::gathered_texture(device, layout.cells()),
            fraction: layout.fraction,
            filter_window: layout.filter_window,
            history: (layout.filter_window > 1).then(|| History::new(device, layout.cells())),
            settings,
            visibility: GiVisibility::None,
            sky_samples: 0,
        }
    }

    /// Makes anew what another layout or other maps need, and keeps the rest, so that what was
    /// shown outlives a switch of the settings.
    fn fit(
        &mut self,
        device: &RenderDevice,
        queue: &RenderQueue,
        layout: &Layout,
        rows: Vec<MapRow>,
    ) -> Fit {
        let mut fit = Fit::Same;
        if self.plan != layout.plan {
            [self.plan_buffer, self.vpls, self.settings] =
                plan_buffers(device, &layout.plan, layout.fraction);
            (self.plan, fit) = (layout.plan, Fit::Empty);
        } else if self.fraction != layout.fraction {
            queue.write_buffer(
                &self.settings,
                0,
                &plan::settings_bytes(&layout.plan, layout.fraction),
            );
        }
        match &mut self.drawing {
            Some(drawing) if !drawing.fits(&rows) => {
                (self.drawing, fit) =
                    ((!rows.is_empty()).then(|| DrawingBuffers::new(device, rows)), Fit::Empty);
            }
            Some(drawing) if drawing.rows != rows => {
                drawing.set_rows(queue, rows);
                fit = fit.max(Fit::LaidOut);
            }
            None if !rows.is_empty() => {
                (self.drawing, fit) = (Some(DrawingBuffers::new(device, rows)), Fit::Empty)
            }
            _ => (),
        }
        let cells = layout.cells();
        if self.cells() != cells {
            fit = fit.max(Fit::LaidOut);
        }
        if layout.filter_window == 1 {
            self.history = None;
            if self.cells() != cells {
                self.irradiance = filter::gathered_texture(device, cells);
            }
        } else if self.history.is_none() {
            self.history = Some(History::new(device, cells));
            fit = fit.max(Fit::LaidOut);
        }
        (self.fraction, self.filter_window) = (layout.fraction, layout.filter_window);
        fit
    }
}

/// What of a camera's buffers still serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Fit {
    /// All of it.
    Same,
    /// Its VPLs are sampled and gathered anew, when their period says so.
    LaidOut,
    /// Nothing was sampled into its buffers.
    Empty,
}

/// Gives every GI camera that has light to gather its VPL buffers and its textures, and takes them
/// from the others; and finds out what it has to do.
pub(in crate::gi) fn prepare_cameras(
    mut commands: Commands,
    (device, queue): (Res<RenderDevice>, Res<RenderQueue>),
    store: Res<RsmStore>,
    (frame, policy, cuts): (Res<GiFrame>, Res<GiRefresh>, Res<CutCameras>),
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
        let Some(size) = camera.physical_viewport_size.filter(|size| size.min_element() > 0) else {
            continue;
        };
        if !gi.gathers() || (rows.is_empty() && sky.is_none()) {
            if held.contains(entity) {
                commands.entity(entity).remove::<GiCamera>();
            }
            continue;
        }
        let layout = Layout::new(gi, size, !rows.is_empty());
        let always = jitters || sky.as_ref().is_some_and(|sky| sky.is_generated());
        let seen = Seen::new(gi, camera, view, sky, occluders.is_kept());
        let now = PastView::new(camera, view, size, gi.pixel_fraction);
        let mut new = None;
        let (giving, step) = match held.get_mut(entity) {
            Ok(held) => {
                let held = held.into_inner();
                let is_cut = cuts.0.contains(&main_entity.id());
                let fit = held.fit(&device, &queue, &layout, rows);
                let moved = held.seen != seen || is_cut;
                held.work = match fit {
                    Fit::Empty => Work { draw: true, gather: true, quiet: 0 },
                    _ => held.work.next(
                        moved || fit == Fit::LaidOut,
                        always,
                        &frame,
                        *policy,
                        gi.refresh_period.max(1),
                    ),
                };
                let step = match held.work.gather {
                    false => Step::Rests,
                    true if is_cut => Step::Begins,
                    true if !held.seen.has_settings_of(&seen) => Step::Switches,
                    true if moved || fit > Fit::Same || always || frame.gather => Step::Moves,
                    true => Step::Begins,
                };
                held.seen = seen;
                (held, step)
            }
            Err(_) => (new.insert(GiCamera::new(&device, &layout, rows, seen)), Step::Begins),
        };
        (giving.visibility, giving.sky_samples) = (gi.visibility, sky_samples);
        let GiCamera { history, irradiance, .. } = &mut *giving;
        if let Some(history) = history {
            history.advance(irradiance, now, step, gi, (&device, &queue));
        }
        if let Some(new) = new {
            commands.entity(entity).insert(new);
        }
    }
}

/// Rows of every map that serves `camera`, in the order of the store.
fn rows_of(camera: Entity, maps: &Query<(&RsmView, &RsmLight, &RsmCut)>) -> Vec<MapRow> {
    let mut serving: Vec<_> = maps
        .iter()
        .filter(|(map, ..)| map.camera.is_none_or(|owner| owner == camera))
        .map(|(_, light, cut)| (light, *cut))
        .collect();
    serving.sort_by_key(|(light, _)| light.texel_offset);
    let mut rows = Vec::new();
    for (RsmLight { texel_offset, resolution, .. }, cut) in serving {
        MapRow::add_map(&mut rows, *texel_offset, *resolution, *resolution, cut);
    }
    rows
}
