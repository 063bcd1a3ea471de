//! Changes of the scene, which decide whether maps are rendered and light is gathered.

use bevy::asset::AssetEvent;
use bevy::camera::Camera;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::NotShadowCaster;
use bevy::log::info_once;
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::{GlobalTransform, Transform};

use crate::gi::rsm::{MapDelta, RsmView};
use crate::gi::settings::FrugalGi;
use crate::gi::trace::GiOccluders;
use crate::gi::view::{CameraCut, GiFrame, GiRefresh, SceneDelta};
use crate::pipelines::PipelinesBusy;

type Touched = Or<(
    Changed<Transform>,
    Changed<GlobalTransform>,
    Changed<Mesh3d>,
    Changed<MeshMaterial3d<StandardMaterial>>,
    Changed<InheritedVisibility>,
    Changed<MeshMorphWeights>,
    Changed<RenderLayers>,
    Changed<NotShadowCaster>,
)>;

/// Whether anything in the scene changed since the last frame.
#[derive(bevy::ecs::system::SystemParam)]
pub(super) struct SceneChanges<'w, 's> {
    meshes: Query<'w, 's, (), (With<Mesh3d>, Touched)>,
    // A child's global transform is known only after propagation, which may be later in the frame.
    parents: Query<'w, 's, (), (With<Children>, Without<Camera>, Changed<Transform>)>,
    skins: Query<'w, 's, &'static SkinnedMesh>,
    moved: Query<'w, 's, (), Or<(Changed<Transform>, Changed<GlobalTransform>)>>,
    gone: RemovedComponents<'w, 's, Mesh3d>,
    unhidden: RemovedComponents<'w, 's, NotShadowCaster>,
    mesh_assets: Option<MessageReader<'w, 's, AssetEvent<Mesh>>>,
    image_assets: Option<MessageReader<'w, 's, AssetEvent<Image>>>,
    material_assets: Option<MessageReader<'w, 's, AssetEvent<StandardMaterial>>>,
}

fn touches<A: bevy::asset::Asset>(events: &mut Option<MessageReader<AssetEvent<A>>>) -> bool {
    let touches = |event: &AssetEvent<A>| {
        !matches!(event, AssetEvent::Unused { .. } | AssetEvent::LoadedWithDependencies { .. })
    };
    // Reads all events, or the rest would count in the next frame.
    events.as_mut().is_some_and(|events| events.read().filter(|event| touches(event)).count() > 0)
}

impl SceneChanges<'_, '_> {
    /// Reads everything, so that no change counts twice.
    fn read(&mut self) -> SceneDelta {
        let gone = self.gone.read().count() + self.unhidden.read().count() > 0;
        let assets = [
            touches(&mut self.mesh_assets),
            touches(&mut self.image_assets),
            touches(&mut self.material_assets),
        ];
        let skins = || {
            self.skins.iter().flat_map(|skin| &skin.joints).any(|joint| self.moved.contains(*joint))
        };
        let changed = gone || !self.meshes.is_empty() || !self.parents.is_empty() || skins();
        SceneDelta { changed, arrived: assets.contains(&true), ..Default::default() }
    }
}

pub(super) fn decide(
    mut frame: ResMut<GiFrame>,
    policy: Res<GiRefresh>,
    maps: Res<MapDelta>,
    busy: Option<Res<PipelinesBusy>>,
    occluders: Res<GiOccluders>,
    cameras: Query<(&Camera, &FrugalGi)>,
    cuts: Query<(), With<CameraCut>>,
    other_materials: Query<(), (With<Mesh3d>, Without<MeshMaterial3d<StandardMaterial>>)>,
    mut scene: SceneChanges,
) {
    let mut delta = scene.read();
    // The renderer reports pipelines one or two frames late: meshes that it left out are then
    // rendered again.
    let busy = busy.is_some_and(|busy| busy.get()) || occluders.waiting() > 0;
    delta.missing = busy;
    delta.changed |= maps.moved;
    delta.laid_out = maps.laid_out;
    delta.cut = !cuts.is_empty();
    delta.always = *policy == GiRefresh::EveryFrame || !other_materials.is_empty();
    if delta.always && *policy != GiRefresh::EveryFrame {
        info_once!(
            "a mesh has no StandardMaterial: global illumination is refreshed in every frame, since its material may change by itself"
        );
    }
    let periods = cameras
        .iter()
        .filter(|(camera, gi)| camera.is_active && gi.vpl_count > 0)
        .map(|(_, gi)| gi.refresh_period.max(1));
    *frame = frame.next(delta, periods.min().unwrap_or(1));
}

/// Switches off the cameras of maps that need not be rendered.
pub(super) fn activate_maps(frame: Res<GiFrame>, mut maps: Query<&mut Camera, With<RsmView>>) {
    for mut camera in &mut maps {
        if camera.is_active != frame.maps {
            camera.is_active = frame.maps;
        }
    }
}
