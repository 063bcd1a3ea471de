//! Which meshes changed, from the ticks of their components.
//!
//! A query with `Changed` asks every mesh for every component in turn, nearly always for nothing.
//! Here the ticks of a component are read as the table holds them, many at once. One scan serves all
//! that follows changes of meshes.

use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{InheritedVisibility, NoFrustumCulling, RenderLayers};
use bevy::ecs::change_detection::{ContiguousRef, Tick};
use bevy::ecs::prelude::*;
use bevy::light::NotShadowCaster;
use bevy::mesh::Mesh3d;
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::transform::components::GlobalTransform;

/// The components of a mesh that are watched.
pub(super) type Columns = (
    Entity,
    Ref<'static, Mesh3d>,
    Option<Ref<'static, GlobalTransform>>,
    Option<Ref<'static, MeshMaterial3d<StandardMaterial>>>,
    Option<Ref<'static, InheritedVisibility>>,
    Option<Ref<'static, RenderLayers>>,
    Option<Ref<'static, NotShadowCaster>>,
    Option<Ref<'static, SkinnedMesh>>,
    Option<Ref<'static, Aabb>>,
    Option<Ref<'static, MeshMorphWeights>>,
    Option<Ref<'static, NoFrustumCulling>>,
);

/// A way in which a mesh changes: one bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum ChangeKind {
    /// Its transform.
    Place = 1,
    /// Its mesh, material, visibility, render layers, skin, or whether it casts shadows.
    Kind = 2,
    /// Its bounding box, whether it is culled by it, or the weights of its morphs.
    Shape = 4,
}

/// A mesh that changed.
pub(super) struct ChangedMesh<'a> {
    pub entity: Entity,
    /// Bits of [`ChangeKind`].
    changes: u8,
    pub transform: Option<&'a GlobalTransform>,
    pub is_skinned: bool,
}

impl ChangedMesh<'_> {
    /// Whether it changed in this way.
    pub(super) fn has(&self, change: ChangeKind) -> bool {
        self.changes & change as u8 != 0
    }
}

/// Meshes whose ticks are looked at together before single ones are.
const BLOCK: usize = 256;

/// When each mesh of a table last changed in one component, and which way of changing that is.
type Ticks<'a> = (&'a [Tick], ChangeKind);

/// Calls `found` with every mesh that changed since the last run of the system. Returns whether the
/// meshes could be scanned: they can as long as Bevy keeps all of these components in tables.
pub(super) fn scan<'w>(
    meshes: &'w Query<'w, '_, Columns, With<Mesh3d>>,
    mut found: impl FnMut(ChangedMesh<'w>),
) -> bool {
    let Ok(tables) = meshes.contiguous_iter() else { return false };
    for (
        entities,
        mesh,
        transform,
        material,
        visible,
        layers,
        shadowless,
        skin,
        aabb,
        morph,
        unculled,
    ) in tables
    {
        let (last_run, this_run) = (mesh.last_run_tick(), mesh.this_run_tick());
        let columns: [Option<Ticks>; 10] = [
            Some((mesh.changed_ticks_slice(), ChangeKind::Kind)),
            ticks(&transform, ChangeKind::Place),
            ticks(&material, ChangeKind::Kind),
            ticks(&visible, ChangeKind::Kind),
            ticks(&layers, ChangeKind::Kind),
            ticks(&shadowless, ChangeKind::Kind),
            ticks(&skin, ChangeKind::Kind),
            ticks(&aabb, ChangeKind::Shape),
            ticks(&morph, ChangeKind::Shape),
            ticks(&unculled, ChangeKind::Shape),
        ];
        let columns: Vec<Ticks> = columns.into_iter().flatten().collect();
        let is_skinned = skin.is_some();
        let transforms = transform.map(ContiguousRef::into_inner);
        scan_table(&columns, entities.len(), (last_run, this_run), |row, changes| {
            found(ChangedMesh {
                entity: entities[row],
                changes,
                transform: transforms.map(|all| &all[row]),
                is_skinned,
            });
        });
    }
    true
}

fn ticks<'w, T>(column: &Option<ContiguousRef<'w, T>>, change: ChangeKind) -> Option<Ticks<'w>> {
    Some((column.as_ref()?.changed_ticks_slice(), change))
}

/// Calls `found` with every row that changed in any column, and the bits of what changed.
fn scan_table(
    columns: &[Ticks],
    rows: usize,
    (last_run, this_run): (Tick, Tick),
    mut found: impl FnMut(usize, u8),
) {
    // Without a branch for each tick, so that the compiler looks at many at once.
    let any = |ticks: &[Tick]| {
        ticks.iter().fold(false, |any, tick| any | tick.is_newer_than(last_run, this_run))
    };
    for first in (0..rows).step_by(BLOCK) {
        let block = first..(first + BLOCK).min(rows);
        if !columns.iter().any(|(changed, _)| any(&changed[block.clone()])) {
            continue;
        }
        for row in block {
            let newer = columns
                .iter()
                .filter(|(changed, _)| changed[row].is_newer_than(last_run, this_run));
            let changes = newer.fold(0, |all, (_, change)| all | *change as u8);
            if changes != 0 {
                found(row, changes);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::app::{App, Update};
    use bevy::asset::Handle;
    use proptest::prelude::*;

    use super::*;

    #[derive(Resource, Default)]
    struct Found(Vec<(Entity, u8)>);

    fn note(meshes: Query<Columns, With<Mesh3d>>, mut found: ResMut<Found>) {
        found.0.clear();
        assert!(scan(&meshes, |mesh| found.0.push((mesh.entity, mesh.changes))));
        found.0.sort_unstable();
    }

    fn app() -> App {
        let mut app = App::new();
        app.init_resource::<Found>().add_systems(Update, note);
        app
    }

    /// Changes a mesh in one way; returns the change.
    fn change(world: &mut World, mesh: Entity, what: u8) -> u8 {
        let mut mesh = world.entity_mut(mesh);
        match what {
            0 => mesh.insert(GlobalTransform::from_xyz(1.0, 2.0, 3.0)),
            1 => mesh.insert(Aabb::default()),
            2 => mesh.insert(RenderLayers::layer(3)),
            3 => mesh.insert(NotShadowCaster),
            4 => mesh.insert(InheritedVisibility::HIDDEN),
            5 => mesh.insert(MeshMaterial3d(Handle::<StandardMaterial>::default())),
            6 => mesh.insert(SkinnedMesh::default()),
            7 => mesh.insert(MeshMorphWeights::Value { weights: Vec::new() }),
            8 => mesh.insert(NoFrustumCulling),
            _ => mesh.insert(Mesh3d(Handle::default())),
        };
        match what {
            0 => ChangeKind::Place as u8,
            1 | 7 | 8 => ChangeKind::Shape as u8,
            _ => ChangeKind::Kind as u8,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn what_changed_is_found_once_and_nothing_else(
            count in 1usize..700,
            frames in prop::collection::vec(prop::collection::vec((0usize..700, 0u8..10), 0..6), 1..6),
        ) {
            let mut app = app();
            let meshes: Vec<Entity> = (0..count)
                .map(|_| app.world_mut().spawn(Mesh3d(Handle::default())).id())
                .collect();
            app.world_mut().spawn(GlobalTransform::IDENTITY);
            app.update();
            prop_assert_eq!(app.world().resource::<Found>().0.len(), count, "all are new");
            for changes in frames {
                let mut expected = std::collections::BTreeMap::<Entity, u8>::new();
                for (index, what) in changes {
                    let mesh = meshes[index % count];
                    *expected.entry(mesh).or_default() |= change(app.world_mut(), mesh, what);
                }
                app.update();
                let expected: Vec<(Entity, u8)> = expected.into_iter().collect();
                prop_assert_eq!(&app.world().resource::<Found>().0, &expected);
            }
        }
    }
}
