//! Several cameras in one of Bevy's atmospheres.
//!
//! Bevy 0.19.1 hands the atmosphere to the shading of meshes by one buffer, and writes it only while
//! exactly one camera has an atmosphere. With a second one there is no buffer, the pipelines expect
//! it all the same, and the app ends with a validation error. A split screen has two cameras; an
//! error meter and the HUD's wipe add one.
//!
//! So in a frame in which the atmosphere is new or changed, only one camera has it when Bevy looks.
//! The others have no sky in that frame. Invisible motion of the planet is no change.

use std::cmp::Reverse;

use bevy::app::App;
use bevy::camera::Camera3d;
use bevy::ecs::prelude::*;
use bevy::pbr::resources::{GpuAtmosphere, prepare_atmosphere_uniforms};
use bevy::render::camera::ExtractedCamera;
use bevy::render::extract_component::DynamicUniformIndex;
use bevy::render::view::ExtractedView;
use bevy::render::{GpuResourceAppExt, Render, RenderApp, RenderSystems};

/// Change of a camera's altitude, as a share of the atmosphere's height, and of the direction to the
/// planet's centre, radians, from which it is another atmosphere.
const OTHER_ALTITUDE: f32 = 0.01;
const OTHER_DIRECTION: f32 = 0.01;

/// What Bevy's buffer holds.
#[derive(Resource, Default)]
struct WrittenAtmosphere(Option<GpuAtmosphere>);

/// Lets several cameras be in one of Bevy's atmospheres, which otherwise ends an app with a second
/// such camera. For `Plugin::finish` of a plugin that adds cameras; may be called by several.
pub fn share_atmosphere(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    if render_app.world().contains_resource::<WrittenAtmosphere>() {
        return;
    }
    // Bevy's buffer is lost with the device.
    render_app.init_gpu_resource::<WrittenAtmosphere>().add_systems(
        Render,
        write_once
            .in_set(RenderSystems::Prepare)
            .after(prepare_atmosphere_uniforms)
            .before(RenderSystems::PrepareResources),
    );
}

fn write_once(
    mut written: ResMut<WrittenAtmosphere>,
    cameras: Query<
        (Entity, &GpuAtmosphere, &ExtractedView, Option<&ExtractedCamera>),
        With<Camera3d>,
    >,
    mut commands: Commands,
) {
    // Hidden copies of a camera are drawn before it.
    let first = cameras
        .iter()
        .max_by_key(|(entity, _, _, camera)| (camera.map(|camera| camera.order), Reverse(*entity)));
    let Some((first, atmosphere, view, _)) = first else { return };
    let is_alone = cameras.iter().count() == 1;
    let is_written = written.0.as_ref().is_some_and(|written| is_same(written, atmosphere, view));
    if is_alone {
        // Bevy does it in every frame.
        written.0 = Some(atmosphere.clone());
    } else if !is_written {
        written.0 = Some(atmosphere.clone());
        for (camera, ..) in cameras.iter().filter(|(camera, ..)| *camera != first) {
            // Without the index, no pass reads what is not written.
            commands.entity(camera).remove::<(GpuAtmosphere, DynamicUniformIndex<GpuAtmosphere>)>();
        }
    }
}

/// Whether a view looks the same in both.
fn is_same(a: &GpuAtmosphere, b: &GpuAtmosphere, view: &ExtractedView) -> bool {
    let size = |it: &GpuAtmosphere| (it.ground_albedo, it.inner_radius, it.outer_radius);
    let eye = view.world_from_view.translation();
    let [from_a, from_b] = [a, b].map(|it| it.world_to_atmosphere.transform_point3(eye));
    let height = b.outer_radius - b.inner_radius;
    size(a) == size(b)
        && (from_a.length() - from_b.length()).abs() <= OTHER_ALTITUDE * height
        && from_a.angle_between(from_b) <= OTHER_DIRECTION
}
