//! Tests of the tree over instances: whatever was edited, a walk through it finds what is there.

use std::collections::BTreeMap;

use bevy::tasks::TaskPool;
use proptest::prelude::*;

use super::super::mirror::Upload;
use super::*;

/// A cube of half a metre around a place, as an instance that can be told from others.
fn placed(number: u32, place: [f32; 3]) -> Placed {
    let part = part(number);
    let instance = Instance { root: number, ..Instance::zeroed() };
    let (place, half) = (Vec3A::from(place), Vec3A::splat(0.25));
    (part, instance, (place - half, place + half))
}

fn part(number: u32) -> InstanceKey {
    let entity = bevy::ecs::entity::Entity::from_raw_u32(number).expect("an index");
    InstanceKey { entity, joint: 0 }
}

/// The instances whose boxes contain a point, as a ray would find them.
fn found(tree: &TopTree, point: Vec3A) -> Vec<u32> {
    let contains = |min: Vec3A, max: Vec3A| min.cmple(point).all() && point.cmple(max).all();
    let (mut index, mut found) = (0, Vec::new());
    let count = tree.nodes.first().map_or(0, |root| root.skip) as usize;
    assert_eq!(count, tree.nodes.len(), "the root skips everything");
    while index < count {
        let node = tree.nodes[index];
        if !contains(node.min.into(), node.max.into()) {
            assert!(node.skip as usize > index, "no way back");
            index = node.skip as usize;
            continue;
        }
        for slot in node.primitives() {
            let (min, max) = tree.bounds[slot];
            let root = tree.instances[slot].root;
            if root != Instance::NOTHING && contains(min, max) {
                found.push(root);
            }
        }
        index += 1;
    }
    found.sort_unstable();
    found
}

fn check(tree: &TopTree, there: &BTreeMap<u32, [f32; 3]>) {
    // The sum of areas, by which the tree is built anew, is that of its boxes.
    let area: f64 = tree.nodes.iter().skip(1).map(|node| f64::from(node.half_area())).sum();
    assert!((tree.area - area).abs() <= 1e-3 * area + 1e-3, "{} {area}", tree.area);
    assert_eq!(tree.slots.len(), there.len());
    for (number, place) in there {
        assert!(tree.holds(&part(*number)));
        let expected: Vec<u32> = there
            .iter()
            .filter(|(_, other)| other.iter().zip(place).all(|(a, b)| (a - b).abs() <= 0.25))
            .map(|(number, _)| *number)
            .collect();
        assert_eq!(found(tree, Vec3A::from(*place)), expected);
    }
}

/// Waits for the background.
fn finish(tree: &TopTree) {
    while tree.rebuilding.is_some() && !tree.is_rebuilt() {
        std::thread::yield_now();
    }
}

proptest! {
    #[test]
    fn edits_find_what_is_there(
        first in prop::collection::btree_map(0u32..60, prop::array::uniform3(-9i8..9), 0..40),
        edits in prop::collection::vec(
            (
                prop::collection::btree_map(0u32..60, prop::array::uniform3(-9i8..9), 0..12),
                prop::collection::btree_set(0u32..60, 0..12),
            ),
            0..12,
        ),
    ) {
        let metres = |place: [i8; 3]| place.map(f32::from);
        let mut there: BTreeMap<u32, [f32; 3]> =
            first.into_iter().map(|(number, place)| (number, metres(place))).collect();
        let all: Vec<_> = there.iter().map(|(number, place)| placed(*number, *place)).collect();
        let mut tree = TopTree::default();
        tree.build(&all, usize::MAX);
        check(&tree, &there);
        for (set, removed) in edits {
            let gone: Vec<_> =
                removed.iter().filter(|number| !set.contains_key(number)).map(|n| part(*n)).collect();
            there.retain(|number, _| !gone.contains(&part(*number)));
            there.extend(set.iter().map(|(number, place)| (*number, metres(*place))));
            let set = set.into_iter().map(|(number, place)| placed(number, metres(place)));
            tree.edit(set.collect(), &gone, usize::MAX);
            check(&tree, &there);
        }
    }
}

#[test]
fn large_trees_are_rebuilt_in_the_background_while_meshes_come_and_go() {
    AsyncComputeTaskPool::get_or_init(TaskPool::new);
    let place =
        |number: u32| [(number % 40) as f32, (number / 40 % 40) as f32, (number / 1600) as f32];
    let mut there: BTreeMap<u32, [f32; 3]> = (0..3000).map(|n| (n, place(n))).collect();
    let all: Vec<_> = there.iter().map(|(number, place)| placed(*number, *place)).collect();
    let mut tree = TopTree::default();
    tree.build(&all, usize::MAX);
    let mut rebuilt = 0;
    for step in 0..60_u32 {
        let removed: Vec<_> = (step * 50..step * 50 + 50).collect();
        let set: Vec<_> = (3000 + step * 50..3050 + step * 50).collect();
        there.retain(|number, _| !removed.contains(number));
        there.extend(set.iter().map(|n| (*n, place(*n))));
        // Edits while the background is at work, and edits that find it done.
        if step % 3 == 0 {
            finish(&tree);
        }
        rebuilt += u32::from(tree.is_rebuilt());
        let set = set.iter().map(|n| placed(*n, place(*n))).collect();
        let gone: Vec<_> = removed.iter().map(|n| part(*n)).collect();
        tree.edit(set, &gone, usize::MAX);
        if step % 7 == 0 {
            check(&tree, &there);
        }
    }
    check(&tree, &there);
    assert!(rebuilt >= 2, "{rebuilt}");
    // Neither what is gone nor the number of trees grows without end.
    assert!(tree.parts.len() < 2 * there.len() && tree.added < 2 * MAX_TREES);
}

#[test]
fn what_exceeds_the_largest_buffer_is_left_out() {
    let most = 3 * size_of::<Instance>() + 1;
    let all: Vec<_> = (0..5).map(|n| placed(n, [n as f32, 0.0, 0.0])).collect();
    let mut tree = TopTree::default();
    tree.build(&all[..2], most);
    tree.edit(all[2..].to_vec(), &[], most);
    assert_eq!((tree.instances.len(), tree.len()), (3, 3));
    let mut none = TopTree::default();
    none.build(&all, 0);
    assert!(none.nodes.is_empty() && none.instances.is_empty());
}

#[test]
fn one_of_many_that_moves_writes_itself_and_the_boxes_above() {
    let mut all: Vec<_> =
        (0..10_000).map(|n| placed(n, [(n % 100) as f32, 0.0, (n / 100) as f32])).collect();
    let mut tree = TopTree::default();
    tree.build(&all, usize::MAX);
    let room = usize::MAX;
    let version = |upload: Option<Upload>| upload.map_or(0, |upload| upload.version);
    let (mut instances, mut nodes) =
        (version(tree.instances.missing(0, room)), version(tree.nodes.missing(0, room)));
    let bytes = |upload: &Upload| -> usize { upload.pieces.iter().map(|(_, b)| b.len()).sum() };
    for step in 1..40 {
        tree.end_version();
        all[777] = placed(777, [77.0, step as f32 % 3.0, 7.0]);
        all[777].1.local_from_world[0][0] = step as f32;
        tree.edit(vec![all[777]], &[], usize::MAX);
        let upload = tree.instances.missing(instances, room).expect("it moved");
        assert_eq!(bytes(&upload), size_of::<Instance>());
        instances = upload.version;
        let upload = tree.nodes.missing(nodes, room).expect("its boxes changed");
        let written = bytes(&upload) / size_of::<Node>();
        assert!(written < tree.nodes.len() / 10, "{written} of {}", tree.nodes.len());
        nodes = upload.version;
    }
}
