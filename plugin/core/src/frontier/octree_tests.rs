//! Tests of the octree's checks and look-ups.

use proptest::prelude::*;

use super::*;
use crate::testing::{corners_of, subdivided};

#[test]
fn a_valid_octree_passes() {
    assert_eq!(subdivided(0).validate(), Ok(()));
    assert_eq!(subdivided(1).validate(), Ok(()));
    assert_eq!(subdivided(2).validate(), Ok(()));
}

#[test]
fn every_fault_is_found() {
    let fault_of = |change: fn(&mut Octree)| {
        let mut octree = subdivided(1);
        change(&mut octree);
        octree.validate().expect_err("an invalid octree")
    };
    let faults: [(fn(&mut Octree), &str); 12] = [
        (|o| o.levels = 16, "has 16 levels"),
        (|o| o.nodes.clear(), "no nodes"),
        (|o| o.nodes[0] = 2, "node 0 has children from 2 on, but there are only 9"),
        (|o| o.nodes[0] = u32::MAX, "node 0 has children from 4294967295 on"),
        (|o| o.nodes.push(0), "node 9 has no parent"),
        (|o| o.levels = 0, "corner [0, 0, 2] lies outside the root, whose largest coordinate is 1"),
        (|o| o.corners.swap(3, 4), "corner [0, 1, 0] is out of order"),
        (
            |o| o.corners.insert(5, o.corners[4]),
            "corner [0, 1, 1] is out of order or appears twice",
        ),
        (|o| o.corners.truncate(26), "corner [2, 2, 2], which a leaf needs, is missing"),
        (|o| o.corners[7].frontiers[2] = 1_000_000, "uses frontier 1000000"),
        // A leaf of level 1 with the root's children as its own: a cycle, below the last level and
        // above it.
        (|o| o.nodes[8] = 1, "node 8 has children below the last level"),
        (|o| (o.levels, o.nodes[8]) = (2, 1), "node 1 is reached twice"),
    ];
    for (fault, words) in faults {
        let found = fault_of(fault);
        assert!(found.contains(words), "{found}");
    }
}

#[test]
fn look_ups_clamp_positions_out_of_range() {
    let octree = subdivided(1);
    let at = |x, y, z| octree.leaf_at(Vec3::new(x, y, z));
    assert_eq!(at(0.2, 0.7, 0.2), Leaf { min: [0, 1, 0], size: 1 });
    assert_eq!(
        at(0.5, 0.5, 0.499),
        Leaf { min: [1, 1, 0], size: 1 },
        "a border belongs to the leaf beyond it"
    );
    assert_eq!(at(1.0, 2.0, f32::INFINITY), Leaf { min: [1; 3], size: 1 });
    assert_eq!(at(f32::NAN, -1.0, f32::NEG_INFINITY), Leaf { min: [0; 3], size: 1 });
    assert_eq!(Octree::default().leaf_at(Vec3::ONE), Leaf { min: [0; 3], size: 1 });
}

#[test]
fn corners_serialise_as_nine_numbers_and_reject_others() {
    let corner = Corner { at: [0, 3, 32768], frontiers: [0, 7, 4, 1, 2, u32::MAX] };
    let text = ron::to_string(&corner).expect("serialisable");
    assert_eq!(text, "(0,3,32768,0,7,4,1,2,4294967295)");
    assert_eq!(ron::from_str::<Corner>(&text), Ok(corner));
    for bad in [
        "(-1,0,0,0,0,0,0,0,0)",
        "(65536,0,0,0,0,0,0,0,0)",
        "(0,0,0,-1,0,0,0,0,0)",
        "(0,0,0,4294967296,0,0,0,0,0)",
        "(0,0,0)",
    ] {
        assert!(ron::from_str::<Corner>(bad).is_err(), "{bad}");
    }
}

proptest! {
    #[test]
    fn any_data_is_validated_and_read_without_panic(
        levels: u8,
        nodes in prop::collection::vec(prop_oneof![Just(0_u32), 0..40_u32, any::<u32>()], 0..40),
        corners in prop::collection::vec((any::<[u16; 3]>(), any::<[u32; 6]>()), 0..20),
        position in prop::array::uniform3(prop::num::f32::ANY),
    ) {
        let corners = corners.into_iter().map(|(at, frontiers)| Corner { at, frontiers }).collect();
        let octree = Octree { levels, nodes, corners, frontiers: Vec::new() };
        let _ = octree.validate();
        let leaf = octree.leaf_at(Vec3::from_array(position));
        prop_assert!(leaf.size.is_power_of_two());
        prop_assert!(leaf.corner(7).iter().all(|coordinate| *coordinate <= octree.lattice()));
    }

    #[test]
    fn the_leaf_contains_the_position_and_has_its_corners(position in prop::array::uniform3(0.0_f32..=1.0)) {
        let octree = subdivided(3);
        let leaf = octree.leaf_at(Vec3::from_array(position));
        let far = leaf.corner(7);
        for axis in 0..3 {
            let lattice = position[axis] * f32::from(octree.lattice());
            prop_assert!(f32::from(leaf.min[axis]) <= lattice && lattice <= f32::from(far[axis]));
        }
        for at in corners_of(leaf) {
            prop_assert_eq!(octree.corner_index(at).map(|index| octree.corners[index].at), Some(at));
        }
    }
}
