use super::super::wide::soup;
use super::*;

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
