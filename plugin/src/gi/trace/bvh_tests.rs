use super::super::wide::soup;
use super::*;

#[test]
fn a_refitted_tree_holds_primitives_where_they_moved() {
    let place = |index: usize, shift: f32| {
        let corner = Vec3A::new((index % 10) as f32, (index / 10) as f32, shift * index as f32);
        (corner, corner + 0.5)
    };
    for count in [1, 2, 5, 100] {
        let before: Vec<_> = (0..count).map(|index| place(index, 0.0)).collect();
        let FlatBvh { mut nodes, order } = FlatBvh::new(&before, BvhBuildParams::medium_build());
        let in_order = |shift: f32| -> Vec<_> {
            order.iter().map(|index| place(*index as usize, shift)).collect()
        };
        let still = nodes.clone();
        let area = refit(&mut nodes, &in_order(0.0));
        assert_eq!(nodes, still, "nothing moved");
        let grown = refit(&mut nodes, &in_order(0.3));
        assert!(count < 5 || grown > area, "{grown} {area}");
        let inside = |node: &Node, (min, max): (Vec3A, Vec3A)| {
            Vec3A::from(node.min).cmple(min).all() && Vec3A::from(node.max).cmpge(max).all()
        };
        let moved = in_order(0.3);
        for (index, node) in nodes.iter().enumerate() {
            // A node holds the primitives of all leaves up to its skip link.
            for leaf in nodes[index..node.skip as usize].iter().filter(|leaf| leaf.leaf != 0) {
                assert!(leaf.primitives().all(|primitive| inside(node, moved[primitive])));
            }
        }
    }
    assert_eq!(refit(&mut [], &[]), 0.0);
}

#[test]
fn skip_links_lead_forward_and_leaves_name_every_triangle_once() {
    let bvh = FlatBvh::new(
        &soup(777, 5)
            .iter()
            .map(|[a, b, c]| (a.min(*b).min(*c).into(), a.max(*b).max(*c).into()))
            .collect::<Vec<_>>(),
        BvhBuildParams::medium_build(),
    );
    let mut visits = vec![0; 777];
    for (index, node) in bvh.nodes.iter().enumerate() {
        assert!(node.skip as usize > index && node.skip as usize <= bvh.nodes.len());
        assert!(node.leaf == 0 || node.skip as usize == index + 1);
        node.primitives()
            .filter(|_| node.leaf > 0)
            .for_each(|index| visits[bvh.order[index] as usize] += 1);
    }
    assert_eq!(bvh.nodes[0].skip as usize, bvh.nodes.len());
    assert!(visits.iter().all(|count| *count == 1));
}
