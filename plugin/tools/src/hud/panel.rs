//! A camera's panel: its nodes, and what is written into them.

use bevy::asset::RenderAssetUsages;
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_frugal_gi::control::{
    AppBudget, Budget, FrontierSource, PowerController, PowerCorrection, PowerFeedback, Selection,
    frontier_in_play,
};
use bevy_frugal_gi::error_meter::{ErrorProbe, MeasuredError};
use bevy_frugal_gi::frontier::{
    CostPoint, Frontier, FrontierMap, FrontierStore, KnobEffects, MapFit, camera_view,
};
use bevy_frugal_gi::knobs::{KnobSettings, WarmKnobs};
use bevy_frugal_gi::power::MeteredPower;
use bevy_frugal_gi::units::Watts;

use super::HudPart;
use super::log::SwitchLog;
use super::plot::{self, Plot};
use super::text::{Facts, caption};
use super::wipe::WipeCamera;

/// A camera that has a panel. Not the hidden ones of the wipe and of error meters.
pub(super) type HasPanel = (
    With<Camera>,
    Or<(With<Selection>, With<KnobSettings>)>,
    Without<WipeCamera>,
    Without<ErrorProbe>,
);

/// Space inside a panel's border, logical pixels.
const PADDING: f32 = 6.0;
const SHADE: Color = Color::srgba(0.0, 0.0, 0.0, 0.65);

/// The panel of a camera, with its nodes.
#[derive(Component)]
pub(super) struct Panel {
    pub camera: Entity,
    pub summary: Entity,
    plot: Entity,
    pub log: Entity,
    pub knobs: Entity,
    image: Handle<Image>,
    drawn: Option<Plot>,
}

/// Spawns an empty panel for `camera`, drawn by the UI camera `drawn_by`.
pub(super) fn spawn(
    commands: &mut Commands,
    images: Option<&mut Assets<Image>>,
    camera: Entity,
    drawn_by: Entity,
) {
    let image = images.map(|images| images.add(image_of(&Plot::default()))).unwrap_or_default();
    let text = || (Text::default(), TextFont { font_size: FontSize::Px(11.0), ..default() });
    let size = Vec2::new(plot::WIDTH as f32, plot::HEIGHT as f32);
    let plot_node = Node { width: px(size.x), height: px(size.y), flex_shrink: 0.0, ..default() };
    let summary = commands.spawn(text()).id();
    let plot = commands.spawn((plot_node, ImageNode::new(image.clone()))).id();
    let log = commands.spawn(text()).id();
    let knobs = commands.spawn(text()).id();
    let column = Node {
        flex_direction: FlexDirection::Column,
        // A width of its own: the panel must not jump with the length of its texts.
        width: px(size.x),
        row_gap: px(4),
        ..default()
    };
    let column = commands.spawn(column).add_children(&[summary, plot, log]).id();
    let root = Node {
        position_type: PositionType::Absolute,
        padding: UiRect::all(px(PADDING)),
        column_gap: px(14),
        overflow: Overflow::clip(),
        ..default()
    };
    let panel = Panel { camera, summary, plot, log, knobs, image, drawn: None };
    commands
        .spawn((HudPart, panel, root, BackgroundColor(SHADE), GlobalZIndex(i32::MAX)))
        .insert(UiTargetCamera(drawn_by))
        .add_children(&[column, knobs]);
}

fn image_of(plot: &Plot) -> Image {
    let (width, height) = (plot::WIDTH as u32, plot::HEIGHT as u32);
    let size = Extent3d { width, height, depth_or_array_layers: 1 };
    let format = TextureFormat::Rgba8UnormSrgb;
    Image::new(size, TextureDimension::D2, plot.draw(), format, RenderAssetUsages::default())
}

/// Width of a panel's room from which it says what levels save and cost, logical pixels.
const EFFECTS_WIDTH: f32 = 840.0;

/// A camera that has a panel.
#[derive(QueryData)]
pub(super) struct PanelQuery {
    entity: Entity,
    name: Option<&'static Name>,
    camera: &'static Camera,
    transform: &'static GlobalTransform,
    projection: Option<&'static Projection>,
    selection: Option<&'static Selection>,
    budget: Option<&'static Budget>,
    fit: Option<&'static MapFit>,
    settings: Option<&'static KnobSettings>,
    warming: Option<&'static WarmKnobs>,
    map: Option<&'static PowerController>,
    source: Option<&'static FrontierSource>,
    measured: Option<&'static MeasuredError>,
}

impl PanelQueryItem<'_, '_> {
    fn store<'a>(&'a self, maps: Option<&'a Assets<FrontierMap>>) -> Option<&'a dyn FrontierStore> {
        match (self.source, self.map) {
            (Some(source), _) => Some(source.store()),
            (None, Some(handle)) => Some(maps?.get(handle.0.id())?),
            (None, None) => None,
        }
    }

    /// What levels save and cost alone, at the map's frame rate.
    fn effects<'a>(
        &'a self,
        maps: Option<&'a Assets<FrontierMap>>,
    ) -> Option<(&'a KnobEffects, f64)> {
        let store = self.store(maps)?;
        let is_its_space = self.settings.is_some_and(|it| *it.space == *store.knobs());
        let rate = store.conditions()?.capture.frames_per_second;
        Some((store.knob_effects().filter(|_| is_its_space)?, rate))
    }

    /// The frontier that the controller chooses from at the camera's view.
    fn frontier<'a>(
        &'a self,
        maps: Option<&'a Assets<FrontierMap>>,
        feedback: Option<&PowerFeedback>,
    ) -> Option<&'a Frontier> {
        let view = camera_view(self.transform, self.projection);
        let has_left_map = feedback.is_some_and(|feedback| feedback.has_left_map);
        let store = self.store(maps)?;
        Some(frontier_in_play(store, store.look_up(&view)?, has_left_map))
    }

    fn plot(&self, frontier: Option<&Frontier>, correction: PowerCorrection) -> Plot {
        let points = frontier.map_or(&[][..], Frontier::points).iter();
        let plain = |cost: CostPoint| (cost.power.0, cost.error);
        Plot {
            points: points
                .map(|point| (correction.corrected(point.cost.power).0, point.cost.error))
                .collect(),
            applied: self.selection.and_then(|selection| selection.predicted_applied).map(plain),
            target: self.selection.and_then(|selection| selection.predicted).map(plain),
            power_limit: self.budget.and_then(|budget| budget.power).and_then(finite),
            error_limit: self.budget.and_then(|budget| budget.error).filter(|e| e.is_finite()),
        }
    }
}

fn finite(limit: Watts) -> Option<f64> {
    Some(limit.0).filter(|limit| limit.is_finite())
}

/// What all panels show.
#[derive(SystemParam)]
pub(super) struct Sources<'w> {
    budget: Option<Res<'w, AppBudget>>,
    metered: Option<Res<'w, MeteredPower>>,
    feedback: Option<Res<'w, PowerFeedback>>,
    maps: Option<Res<'w, Assets<FrontierMap>>>,
    log: Res<'w, SwitchLog>,
    scale: Option<Res<'w, UiScale>>,
}

/// Writes every panel, where its content differs.
pub(super) fn write(
    sources: Sources,
    cameras: Query<PanelQuery, HasPanel>,
    mut panels: Query<(Entity, &mut Panel)>,
    mut nodes: Query<&mut Node>,
    mut texts: Query<&mut Text>,
    mut images: Option<ResMut<Assets<Image>>>,
) {
    let scale = sources.scale.as_ref().map_or(1.0, |scale| scale.0);
    // Where a camera's viewport begins, in the interface's pixels.
    let corner_of = |camera: &Camera| {
        camera.logical_viewport_rect().map_or(Vec2::ZERO, |viewport| viewport.min / scale)
    };
    let feedback = sources.feedback.as_deref();
    let correction = feedback.map(PowerFeedback::per_camera).unwrap_or_default();
    let all: Vec<_> =
        panels.iter().filter_map(|(_, panel)| cameras.get(panel.camera).ok()).collect();
    let mut corners: Vec<Vec2> = Vec::with_capacity(all.len());
    for (root, mut panel) in &mut panels {
        let Ok(shown) = cameras.get(panel.camera) else { continue };
        // Cameras that share a corner have their panels one below the other.
        let corner = corner_of(shown.camera);
        let above = corners.iter().filter(|other| **other == corner).count();
        let sharing = all.iter().filter(|other| corner_of(other.camera) == corner).count();
        corners.push(corner);
        let room = shown.camera.logical_viewport_size();
        let room = room.map(|size| Vec2::new(size.x, size.y / sharing.max(1) as f32) / scale);
        let top = corner.y + room.map_or(0.0, |room| room.y * above as f32);
        let id = shown.entity.to_string();
        let facts = Facts {
            name: (all.len() > 1).then(|| shown.name.map_or(id.as_str(), Name::as_str)),
            warming: shown.warming.map(WarmKnobs::progress),
            selection: shown.selection,
            budget: shown.budget,
            app_budget: sources.budget.as_ref().and_then(|budget| budget.power),
            fit: shown.fit,
            settings: shown.settings,
            // Narrower, their lines would wrap.
            effects: room
                .is_none_or(|room| room.x >= EFFECTS_WIDTH)
                .then(|| shown.effects(sources.maps.as_deref()))
                .flatten(),
            metered: sources.metered.as_deref(),
            measured: shown.measured,
            feedback,
        };
        let frontier = shown.frontier(sources.maps.as_deref(), feedback);
        let mut log = caption(frontier, correction);
        for line in sources.log.lines(panel.camera, 6, 2) {
            log.push('\n');
            log.push_str(&line);
        }
        for (entity, text) in
            [(panel.summary, facts.summary()), (panel.log, log), (panel.knobs, facts.knobs())]
        {
            if let Ok(mut old) = texts.get_mut(entity) {
                old.set_if_neq(Text(text));
            }
        }
        let has_plot = shown.selection.is_some();
        let mut change = |entity: Entity, change: &dyn Fn(&mut Node)| {
            let Ok(mut node) = nodes.get_mut(entity) else { return };
            let mut new = node.clone();
            change(&mut new);
            node.set_if_neq(new);
        };
        change(root, &|node| {
            (node.left, node.top) = (px(corner.x), px(top));
            if let Some(room) = room {
                (node.max_width, node.max_height) = (px(room.x), px(room.y));
            }
        });
        let display = if has_plot { Display::Flex } else { Display::None };
        for part in [panel.plot, panel.log] {
            change(part, &|node| node.display = display);
        }
        if has_plot {
            draw(&mut panel, shown.plot(frontier, correction), images.as_deref_mut());
        }
    }
}

/// Draws the plot anew if it differs from the one shown.
fn draw(panel: &mut Panel, plot: Plot, images: Option<&mut Assets<Image>>) {
    if panel.drawn.as_ref() == Some(&plot) {
        return;
    }
    if let Some(mut image) = images.and_then(|images| images.get_mut(&panel.image)) {
        *image = image_of(&plot);
    }
    panel.drawn = Some(plot);
}
