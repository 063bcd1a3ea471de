//! What has to be done again in a frame: light that nobody moved is not gathered twice.
//!
//! Maps are rendered while something that they show changes; after a mesh, a texture or a material
//! has come, for a few frames more, since it may not be drawn in its first. A camera gathers while
//! its maps change or it moves. In a still picture nothing is left but the composite, which adds
//! what was gathered.

use bevy::app::{App, PostUpdate};
use bevy::asset::AssetEvent;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::camera::{Camera, CameraUpdateSystems};
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::NotShadowCaster;
use bevy::log::info_once;
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::extract_resource::{ExtractResource, ExtractResourcePlugin};
use bevy::transform::components::{GlobalTransform, Transform};

use super::cut::CameraCut;
use super::rsm::{MapsTouched, RsmSystems, RsmView};
use super::settings::FrugalGi;
use super::visibility::GiOccluders;
use crate::pipelines::PipelinesBusy;

/// When reflective shadow maps are rendered and light is gathered. A resource of the main world.
#[derive(Resource, ExtractResource, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Resource, Default, Clone, PartialEq)]
pub enum GiRefresh {
    /// When something moved or changed: meshes, their materials' handles, standard materials,
    /// images, lights, skins, morphs; for the gather, the camera, too. What a changed material or
    /// mesh asset sends on is a frame late, as Bevy tells of assets after cameras. While a mesh has
    /// a material of another kind it is as [`EveryFrame`](Self::EveryFrame), since such a material
    /// may change by itself.
    #[default]
    OnChange,
    /// As `OnChange`, but that cameras gather in every frame, as if they moved: what a walk through
    /// a still scene costs. For measuring.
    AsIfCamerasMoved,
    /// All of it in every frame. For what changes unseen: vertex shaders that move by the clock,
    /// buffers that the GPU writes.
    EveryFrame,
}

/// Frames for which an asset counts as arriving. It is prepared in its first frame or the next,
/// what is made of it in the one after, and drawn then.
const ARRIVAL: u32 = 4;

/// What this frame does.
#[derive(Resource, ExtractResource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct GiFrame {
    /// Counts frames since the last camera cut: what follows a cut does not depend on when it came.
    pub number: u32,
    /// Whether maps are rendered.
    pub maps: bool,
    /// Whether cameras gather even if they have not moved.
    pub gather: bool,
    /// Frames since something changed that maps or cameras show.
    pub(super) quiet: u32,
    /// Frames for which an asset is still arriving.
    pub(super) arriving: u32,
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<GiRefresh>()
        .init_resource::<GiFrame>()
        .register_type::<GiRefresh>()
        .add_plugins((
            ExtractResourcePlugin::<GiRefresh>::default(),
            ExtractResourcePlugin::<GiFrame>::default(),
        ))
        .add_systems(
            PostUpdate,
            (decide, wake_maps).chain().after(RsmSystems::Maintain).before(CameraUpdateSystems),
        );
}

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
struct SceneChanges<'w, 's> {
    meshes: Query<'w, 's, (), (With<Mesh3d>, Touched)>,
    // A child's place is only known after transforms have been propagated, which may be later in
    // the frame.
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
    // All are read, or the rest would be found in the next frame.
    events.as_mut().is_some_and(|events| events.read().filter(|event| touches(event)).count() > 0)
}

/// What happened in a frame.
#[derive(Clone, Copy, Debug, Default)]
struct Happened {
    /// Something that maps show is other than before.
    changed: bool,
    /// An asset came, changed or went.
    arrived: bool,
    /// Something may not be drawn yet.
    missing: bool,
    /// Everything is to be done in every frame.
    always: bool,
    /// Texels are no longer where they were.
    laid_out: bool,
    /// A camera is cut.
    cut: bool,
}

impl SceneChanges<'_, '_> {
    /// Reads everything, so that no change is seen twice.
    fn read(&mut self) -> Happened {
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
        Happened { changed, arrived: assets.contains(&true), ..Default::default() }
    }
}

fn decide(
    mut frame: ResMut<GiFrame>,
    policy: Res<GiRefresh>,
    maps: Res<MapsTouched>,
    busy: Option<Res<PipelinesBusy>>,
    occluders: Res<GiOccluders>,
    cameras: Query<(&Camera, &FrugalGi)>,
    cuts: Query<(), With<CameraCut>>,
    other_materials: Query<(), (With<Mesh3d>, Without<MeshMaterial3d<StandardMaterial>>)>,
    mut scene: SceneChanges,
) {
    let mut happened = scene.read();
    // The renderer tells of pipelines a frame late or two: what it left out is then drawn again.
    let busy = busy.is_some_and(|busy| busy.get()) || occluders.waiting() > 0;
    happened.missing = busy;
    happened.changed |= maps.moved;
    happened.laid_out = maps.laid_out;
    happened.cut = !cuts.is_empty();
    happened.always = *policy == GiRefresh::EveryFrame || !other_materials.is_empty();
    if happened.always && *policy != GiRefresh::EveryFrame {
        info_once!(
            "a mesh has no StandardMaterial: global illumination is refreshed in every frame, since its material may change by itself"
        );
    }
    let periods = cameras
        .iter()
        .filter(|(camera, gi)| camera.is_active && gi.vpl_count > 0)
        .map(|(_, gi)| gi.refresh_period.max(1));
    *frame = frame.next(happened, periods.min().unwrap_or(1));
}

impl GiFrame {
    fn next(self, happened: Happened, period: u32) -> Self {
        let number = if happened.cut { 0 } else { self.number.wrapping_add(1) };
        let quiet =
            if happened.changed || happened.laid_out { 0 } else { self.quiet.saturating_add(1) };
        let arriving = if happened.arrived {
            ARRIVAL
        } else {
            self.arriving.saturating_sub(1).max(u32::from(happened.missing))
        };
        // A whole period from the last change on: one frame in it renders maps.
        let gather = happened.always || arriving > 0 || quiet < period;
        // What has moved to another place in the store must be there before it is drawn from, and
        // what was missing is not for a period to keep back.
        Self {
            number,
            quiet,
            arriving,
            gather,
            maps: happened.laid_out || arriving > 0 || gather && number.is_multiple_of(period),
        }
    }
}

/// A map that need not be rendered is a camera that is switched off.
fn wake_maps(frame: Res<GiFrame>, mut maps: Query<&mut Camera, With<RsmView>>) {
    for mut camera in &mut maps {
        if camera.is_active != frame.maps {
            camera.is_active = frame.maps;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Happened = Happened {
        changed: false,
        arrived: false,
        missing: false,
        always: false,
        laid_out: false,
        cut: false,
    };
    const CHANGE: Happened = Happened { changed: true, ..NOTHING };

    #[test]
    fn maps_rest_after_the_last_change() {
        let frame = GiFrame::default().next(CHANGE, 1);
        assert!(frame.maps && frame.gather);
        let frame = frame.next(NOTHING, 1);
        assert!(!frame.maps && !frame.gather);
        assert!(frame.next(Happened { always: true, ..NOTHING }, 1).maps);
    }

    #[test]
    fn what_arrives_is_waited_for() {
        let mut frame = GiFrame { quiet: 99, ..Default::default() }
            .next(Happened { arrived: true, ..NOTHING }, 1);
        for _ in 0..ARRIVAL {
            assert!(frame.maps && frame.gather);
            frame = frame.next(NOTHING, 1);
        }
        assert!(!frame.maps && !frame.gather);
    }

    #[test]
    fn with_a_period_maps_are_rendered_so_often_and_once_after_the_last_change() {
        for period in 1..=8 {
            for offset in 0..period {
                let mut frame = GiFrame { number: offset, ..Default::default() };
                let mut rendered = 0;
                for _ in 0..4 * period {
                    frame = frame.next(CHANGE, period);
                    rendered += u32::from(frame.maps);
                }
                assert_eq!(rendered, 4, "every {period}th frame");
                let last = u32::from(frame.maps);
                let after = (0..20).filter(|_| {
                    frame = frame.next(NOTHING, period);
                    frame.maps
                });
                assert_eq!(last + after.count() as u32, 1, "period {period} from {offset}");
            }
        }
    }

    #[test]
    fn what_is_new_is_rendered_at_once() {
        let frame = GiFrame { number: 0, quiet: 99, ..Default::default() };
        assert!(!frame.next(CHANGE, 8).maps);
        assert!(frame.next(Happened { arrived: true, ..NOTHING }, 8).maps);
        assert!(frame.next(Happened { missing: true, ..NOTHING }, 8).maps);
        assert!(frame.next(Happened { laid_out: true, ..NOTHING }, 8).maps);
    }

    #[test]
    fn a_cut_begins_a_period() {
        for number in 0..8 {
            let cut = GiFrame { number, quiet: 99, ..Default::default() }
                .next(Happened { cut: true, ..CHANGE }, 4);
            assert!(cut.maps && cut.gather);
            let mut frame = cut;
            let rendered: Vec<_> = std::iter::from_fn(|| {
                frame = frame.next(CHANGE, 4);
                Some(frame.maps)
            })
            .take(5)
            .collect();
            assert_eq!(rendered, [false, false, false, true, false], "from {number}");
        }
    }

    #[test]
    fn counters_at_their_end_go_on() {
        let end = GiFrame { number: u32::MAX, quiet: u32::MAX, ..Default::default() };
        assert_eq!(end.next(NOTHING, u32::MAX).number, 0);
        assert!(!end.next(NOTHING, 1).gather);
    }
}
