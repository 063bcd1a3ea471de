//! A wipe between the current settings and the best ones, in the same image.
//!
//! A second camera renders the whole view into an image, of which the right part is shown: in a
//! smaller viewport, passes that read neighbours would differ at the border. It copies what affects
//! the first camera's image, with what knobs took away. Its own histories go on for as long as the
//! wipe is there.

use std::sync::Arc;

use bevy::camera::{CameraOutputMode, ImageRenderTarget, RenderTarget};
use bevy::ecs::entity::EntityCloner;
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;
use bevy_frugal_gi::camera_copy::copy_looks;
use bevy_frugal_gi::control::Selection;
use bevy_frugal_gi::knobs::KnobSettings;
use bevy_frugal_gi::resolution::ResolutionScale;

use super::{HudPart, UiCamera};

const BORDER: Color = Color::srgb(1.0, 0.9, 0.2);

/// The wipe: left of its border each controlled camera's image at the current settings, right of it
/// the same view at the best ones. For development: it renders every view twice, and a meter counts
/// both.
///
/// Knobs that Bevy keeps for the whole app (shadow maps) are at their best on both sides while it is
/// there. The camera's components are copied when it begins: toggle it where the app changes
/// exposure, fog or the like.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct HudWipe {
    /// The key that shows and hides it; `None` for none. Default: F4.
    pub key: Option<KeyCode>,
    /// The border, as a share of a viewport's width, 0 to 1: higher values show more of the current
    /// settings. NaN counts as one half. `None`: no wipe, at no cost. Default: `None`.
    pub at: Option<f32>,
}

impl Default for HudWipe {
    fn default() -> Self {
        Self { key: Some(KeyCode::F4), at: None }
    }
}

/// On the second camera.
#[derive(Component)]
pub(super) struct WipeCamera {
    /// The camera whose view it shows.
    pub of: Entity,
    image: Handle<Image>,
    node: Entity,
}

/// On the node that shows the second camera's image.
#[derive(Component)]
pub(super) struct WipeNode;

pub(super) fn toggle(keys: Res<ButtonInput<KeyCode>>, mut wipe: ResMut<HudWipe>) {
    if wipe.key.is_some_and(|key| keys.just_pressed(key)) {
        wipe.at = if wipe.at.is_some() { None } else { Some(0.5) };
    }
}

pub(super) fn is_wanted(wipe: Res<HudWipe>, cameras: Query<(), With<WipeCamera>>) -> bool {
    wipe.at.is_some() || !cameras.is_empty()
}

/// A camera that can have a wipe.
type Controlled = (With<Selection>, With<KnobSettings>, Without<WipeCamera>);

/// Spawns second cameras, and removes those of cameras that are gone.
pub(super) fn spawn(
    mut commands: Commands,
    wipe: Res<HudWipe>,
    ui_camera: UiCamera,
    mut images: ResMut<Assets<Image>>,
    cameras: Query<(Entity, &Camera), Controlled>,
    seconds: Query<(Entity, &WipeCamera)>,
) {
    let is_shown = |camera: Entity| {
        wipe.at.is_some() && cameras.get(camera).is_ok_and(|(_, camera)| camera.is_active)
    };
    for (entity, second) in &seconds {
        if !is_shown(second.of) {
            commands.entity(entity).despawn();
        }
    }
    let mut drawn_by = None;
    for (camera, view) in &cameras {
        if !is_shown(camera) || seconds.iter().any(|(_, second)| second.of == camera) {
            continue;
        }
        let Some(size) = view.physical_viewport_size() else { continue };
        let drawn_by = *drawn_by.get_or_insert_with(|| ui_camera.get(&mut commands));
        let image = images.add(target(size));
        let node = commands
            .spawn((HudPart, WipeNode, ImageNode::new(image.clone()), UiTargetCamera(drawn_by)))
            // Under the app's interface: both sides have that.
            .insert((GlobalZIndex(i32::MIN), BorderColor::all(BORDER)))
            .id();
        let second = commands.spawn_empty().id();
        commands.queue(move |world: &mut World| copy(world, camera, second));
        // Later commands: the target is not the original's.
        commands.entity(second).insert((
            HudPart,
            WipeCamera { of: camera, image: image.clone(), node },
            RenderTarget::Image(ImageRenderTarget::from(image)),
        ));
    }
}

/// Removes the node of a second camera, also where the app despawns all cameras.
pub(super) fn remove_node(
    gone: On<Remove, WipeCamera>,
    seconds: Query<&WipeCamera>,
    mut commands: Commands,
) {
    if let Ok(second) = seconds.get(gone.entity) {
        commands.entity(second.node).try_despawn();
    }
}

fn target(size: UVec2) -> Image {
    let size = size.max(UVec2::ONE);
    Image::new_target_texture(size.x, size.y, TextureFormat::Rgba8UnormSrgb, None)
}

/// Gives `to` the view of `from`, and what rendering reads of it.
fn copy(world: &mut World, from: Entity, to: Entity) {
    if world.get_entity(from).is_err() || world.get_entity(to).is_err() {
        return;
    }
    let mut cloner = EntityCloner::build_opt_in(world);
    cloner.allow::<(Camera, Projection, Transform, Visibility, ResolutionScale)>();
    cloner.clone_entity(from, to);
    copy_looks(world, from, to);
}

/// What a second camera copies in every frame.
type Original =
    (&'static Camera, &'static GlobalTransform, Option<&'static Projection>, &'static KnobSettings);

/// Keeps second cameras where the first ones are, at the best settings.
pub(super) fn follow(
    mut commands: Commands,
    wipe: Res<HudWipe>,
    scale: Option<Res<UiScale>>,
    mut images: ResMut<Assets<Image>>,
    originals: Query<Original, Without<WipeCamera>>,
    mut seconds: Query<(
        Entity,
        &WipeCamera,
        &mut Camera,
        &mut Transform,
        &mut GlobalTransform,
        Option<&mut Projection>,
        Option<&KnobSettings>,
    )>,
    mut nodes: Query<(&mut Node, &mut ImageNode), With<WipeNode>>,
) {
    // The interface's pixels.
    let scale = scale.map_or(1.0, |scale| scale.0);
    let px = |logical: f32| px(logical / scale);
    for (entity, wiped, mut camera, mut local, mut global, projection, knobs) in &mut seconds {
        let Ok((original, at, lens, current)) = originals.get(wiped.of) else { continue };
        // Before the first camera: its image is then of the same frame.
        camera.order = original.order.saturating_sub(1);
        camera.viewport = None;
        camera.output_mode = CameraOutputMode::default();
        *local = at.compute_transform();
        *global = *at;
        if let (Some(mut projection), Some(lens)) = (projection, lens) {
            *projection = lens.clone();
        }
        let best =
            KnobSettings { space: Arc::clone(&current.space), settings: current.space.highest() };
        if knobs != Some(&best) {
            commands.entity(entity).insert(best);
        }
        let Some(size) = original.physical_viewport_size() else { continue };
        if images.get(&wiped.image).is_some_and(|image| image.size() != size.max(UVec2::ONE))
            && let Some(mut image) = images.get_mut(&wiped.image)
        {
            *image = target(size);
        }
        let (Some(place), Ok((mut node, mut shown))) =
            (original.logical_viewport_rect(), nodes.get_mut(wiped.node))
        else {
            continue;
        };
        let share = wipe.at.filter(|share| !share.is_nan()).unwrap_or(0.5).clamp(0.0, 1.0);
        let left = (share * size.x as f32).round();
        let rect = Rect::new(left, 0.0, size.x as f32, size.y as f32);
        if shown.rect != Some(rect) {
            shown.rect = Some(rect);
        }
        let logical = left * place.width() / size.x.max(1) as f32;
        let new = Node {
            position_type: PositionType::Absolute,
            left: px(place.min.x + logical),
            top: px(place.min.y),
            width: px(place.width() - logical),
            height: px(place.height()),
            border: UiRect::left(px(2.0)),
            ..default()
        };
        node.set_if_neq(new);
    }
}
