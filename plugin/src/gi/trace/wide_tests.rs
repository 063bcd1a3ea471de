use bevy::math::Vec3;
use proptest::prelude::*;

use super::*;

/// Indices of the triangles in the leaves below a node.
pub(in super::super) fn below(nodes: &[WideNode], root: usize) -> Vec<usize> {
    let node = &nodes[root];
    let mut all: Vec<_> = (0..WIDTH).flat_map(|child| held(node, child)).collect();
    let children = node.first_child as usize..node.first_child as usize + inner(node);
    all.extend(children.flat_map(|child| below(nodes, child)));
    all
}

/// Triangles in pseudorandom places of a cube of ten metres.
pub(in super::super) fn soup(count: usize, seed: u32) -> Vec<[Vec3; 3]> {
    let mut state = seed | 1;
    let mut random = move || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 8) as f32 / (1 << 24) as f32
    };
    let mut triangle = || {
        let center = Vec3::new(random(), random(), random()) * 10.0;
        [(); 3].map(|()| center + Vec3::new(random(), random(), random()) * 1.5)
    };
    (0..count).map(|_| triangle()).collect()
}

/// The bits of a child.
fn bits(node: &WideNode, child: usize) -> u32 {
    node.held[child / 2] >> (16 * (child % 2)) & 0xffff
}

/// Number of inner children, which come first.
fn inner(node: &WideNode) -> usize {
    let count = (0..WIDTH).take_while(|child| bits(node, *child) >> 8 != 0).count();
    assert!((0..count).all(|child| bits(node, child) == 1 << (8 + child)));
    count
}

/// Triangles of a child, if it is a leaf.
fn held(node: &WideNode, child: usize) -> impl Iterator<Item = usize> {
    let (bits, first) = (bits(node, child), node.first_triangle as usize);
    (0..8).filter(move |bit| bits >> bit & 1 == 1).map(move |bit| first + bit)
}

/// A child's box, as a ray meets it.
fn boxed(node: &WideNode, child: usize) -> (Vec3A, Vec3A) {
    let corner = |words: &[u32; 3]| {
        Vec3A::from_array(std::array::from_fn(|axis| {
            let step = f32::from_bits((node.grid >> (8 * axis) & 255) << 23);
            node.origin[axis] + (words[axis] >> (8 * child) & 255) as f32 * step
        }))
    };
    (corner(&node.lower), corner(&node.upper))
}

/// How a ray went through a tree.
pub(in super::super) struct Walk {
    /// The triangle that it met.
    pub found: Option<usize>,
    /// Nodes that it loaded.
    pub loads: usize,
    /// Most entries of its stack.
    pub deepest: usize,
}

/// The traversal of `trace/trace.wgsl`, step by step and in its precision.
pub(in super::super) fn walk(
    nodes: &[WideNode],
    origin: Vec3,
    direction: Vec3,
    meets: &mut dyn FnMut(usize) -> bool,
) -> Walk {
    let mut walk = Walk { found: None, loads: 0, deepest: 0 };
    let least = Vec3::splat(1e-25);
    let (above, below) = (direction.max(least), direction.min(-least));
    let inverse = Vec3::select(direction.cmplt(Vec3::ZERO), below, above).recip();
    let mut stack: Vec<Vec<usize>> = Vec::new();
    let mut left = if nodes.is_empty() { Vec::new() } else { vec![0] };
    loop {
        if left.is_empty() {
            match stack.pop() {
                Some(group) => left = group,
                None => return walk,
            }
        }
        let node = &nodes[left.remove(0)];
        walk.loads += 1;
        let met: Vec<usize> =
            (0..WIDTH).filter(|child| is_met(node, *child, origin, inverse)).collect();
        let first = node.first_child as usize;
        let inner: Vec<_> =
            met.iter().filter(|child| **child < inner(node)).map(|child| first + child).collect();
        if !inner.is_empty() {
            if !left.is_empty() {
                stack.push(std::mem::take(&mut left));
                walk.deepest = walk.deepest.max(stack.len());
            }
            left = inner;
        }
        walk.found = met.iter().flat_map(|child| held(node, *child)).find(|index| meets(*index));
        if walk.found.is_some() {
            return walk;
        }
    }
}

/// Whether a ray meets a child's box.
fn is_met(node: &WideNode, child: usize, origin: Vec3, inverse: Vec3) -> bool {
    let (mut near, mut far) = (0.0f32, 1.0f32);
    for axis in 0..3 {
        let step = f32::from_bits((node.grid >> (8 * axis) & 255) << 23) * inverse[axis];
        let start = (node.origin[axis] - origin[axis]) * inverse[axis];
        let plane = |words: &[u32; 3]| (words[axis] >> (8 * child) & 255) as f32 * step + start;
        let (a, b) = (plane(&node.lower), plane(&node.upper));
        let (a, b) = if inverse[axis] < 0.0 { (b, a) } else { (a, b) };
        (near, far) = (near.max(a), far.min(b));
    }
    near <= far * 1.000_000_4
}

fn boxes(triangles: &[[Vec3; 3]]) -> Vec<(Vec3A, Vec3A)> {
    triangles.iter().map(|[a, b, c]| (a.min(*b).min(*c).into(), a.max(*b).max(*c).into())).collect()
}

/// Every triangle is in the boxes of all nodes above it; returns the number of levels.
fn check(tree: &WideBvh, boxes: &[(Vec3A, Vec3A)], index: usize) -> u32 {
    let node = &tree.nodes[index];
    let mut levels = 0;
    for child in 0..WIDTH {
        let (min, max) = boxed(node, child);
        let mut inside = held(node, child).collect::<Vec<_>>();
        if child < inner(node) {
            assert!(inside.is_empty(), "inner children hold none themselves");
            let child = node.first_child as usize + child;
            assert!(child > index, "no way back");
            levels = levels.max(check(tree, boxes, child));
            inside = below(&tree.nodes, child);
        }
        for triangle in inside {
            let (low, high) = boxes[tree.order[triangle] as usize];
            assert!(min.cmple(low).all() && max.cmpge(high).all(), "{min} {low} {high} {max}");
        }
    }
    levels + 1
}

#[test]
fn every_triangle_is_in_one_leaf_and_in_all_boxes_above_it() {
    for count in [1, 2, 4, 5, 16, 17, 300] {
        for (scale, shift) in [(1.0, 0.0), (1e-12, 0.0), (1e6, 1e8), (1.0, -3e5)] {
            let moved = |v: Vec3| v * scale + shift;
            let triangles: Vec<_> =
                soup(count, count as u32).into_iter().map(|t| t.map(moved)).collect();
            let boxes = boxes(&triangles);
            let tree = WideBvh::new(&boxes);
            let mut order = tree.order.clone();
            order.sort_unstable();
            assert_eq!(order, (0..count as u32).collect::<Vec<_>>());
            let mut reached = below(&tree.nodes, 0);
            reached.sort_unstable();
            assert_eq!(reached, (0..count).collect::<Vec<_>>());
            assert!(check(&tree, &boxes, 0) <= MAX_LEVELS);
        }
    }
    assert_eq!(WideBvh::new(&[]), WideBvh::default());
}

#[test]
fn no_tree_is_deeper_than_the_stack() {
    // Each is a tenth of the one around it: a tree by areas takes them one by one.
    let nested: Vec<_> = (0..60)
        .map(|level| {
            let half = Vec3A::splat(1e18 * 0.25f32.powi(level));
            (-half, half)
        })
        .collect();
    let tree = WideBvh::new(&nested);
    let levels = check(&tree, &nested, 0);
    assert!((3..=MAX_LEVELS).contains(&levels), "{levels}");
    let same = vec![(Vec3A::ZERO, Vec3A::ONE); 5000];
    assert!(check(&WideBvh::new(&same), &same, 0) <= MAX_LEVELS);
}

proptest! {
    #[test]
    fn a_grid_covers_its_range(low in -1e12f32..1e12, extent in 0.0f32..1e12, share in 0.0f32..=1.0) {
        let high = low + extent;
        let (origin, exponent) = grid(low, high);
        let step = f32::from_bits(exponent << 23);
        prop_assert!(origin <= low && origin + 255.0 * step >= high);
        prop_assert_eq!(origin % step, 0.0);
        let at = (low + extent * share).clamp(low, high);
        let node = WideNode::new(&[(Vec3A::splat(low), Vec3A::splat(high)), (Vec3A::splat(at), Vec3A::splat(at))]);
        let fine = f32::from_bits((node.grid & 255) << 23);
        let slack = 1e-4 * fine;
        let [below, above] = [node.lower[0], node.upper[0]].map(|bytes| (bytes >> 8 & 255) as f32);
        prop_assert!(node.origin[0] + below * fine <= at + slack);
        prop_assert!(node.origin[0] + above * fine >= at - slack);
        // No coarser than needed: within two steps of the finest grid.
        prop_assert!(step <= (2.1 * extent / 255.0).max(low.abs().max(high.abs()) * 1.2e-7).max(1e-37));
    }
}
