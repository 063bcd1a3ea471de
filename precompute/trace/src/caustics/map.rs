//! Photons in a tree over their positions (Bentley 1975): the nearest ones, and those within a
//! distance.

use std::collections::BinaryHeap;

use glam::Vec3;

use crate::scene::extent;

/// Photons of a leaf.
const LEAF: usize = 8;

/// Light that arrived at a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Photon {
    /// Metres.
    pub(super) position: Vec3,
    /// To where it came from, unit length.
    pub(super) direction: Vec3,
    /// Linear RGB, lumens × number of photons that left lights.
    pub(super) power: Vec3,
    /// Surfaces that reflected it.
    pub(super) surfaces: u32,
    /// Metres from the light; for the sky and parallel light, from the first surface.
    pub(super) length: f64,
}

/// Photons, to be found by place.
#[derive(Clone, Debug, Default)]
pub(super) struct PhotonMap {
    /// The median of each range splits it; ranges of at most `LEAF` are not split.
    pub(super) photons: Vec<Photon>,
    /// The axis along which the photon of the same index splits its range.
    axes: Vec<u8>,
}

impl PhotonMap {
    /// A map of `photons`; those whose place, direction or power is not finite are left out.
    pub(super) fn new(mut photons: Vec<Photon>) -> Self {
        photons.retain(|photon| {
            photon.position.is_finite() && photon.direction.is_finite() && photon.power.is_finite()
        });
        let mut axes = vec![0; photons.len()];
        split(&mut photons, &mut axes);
        Self { photons, axes }
    }

    /// The `count` nearest photons to `place` within `reach`, metres, that arrived from above a
    /// surface with `normal`: each with its squared distance, m², the nearest first.
    pub(super) fn nearest(
        &self,
        place: Vec3,
        normal: Vec3,
        count: usize,
        reach: f32,
    ) -> Vec<(f32, Photon)> {
        // Squared distances are not negative: their bits have their order.
        let mut heap = BinaryHeap::with_capacity(count.min(self.photons.len()) + 1);
        let mut within = reach * reach;
        self.visit(0..self.photons.len(), place, &mut within, &mut |index, squared, within| {
            // In this form, NaN is below.
            let is_above = self.photons[index].direction.dot(normal) > 0.0;
            if !is_above {
                return;
            }
            heap.push((squared.to_bits(), index));
            if heap.len() > count {
                heap.pop();
            }
            if heap.len() == count {
                let farthest = heap.peek().map(|(bits, _)| f32::from_bits(*bits));
                *within = farthest.map_or(*within, |farthest| farthest.min(*within));
            }
        });
        let found = heap.into_sorted_vec().into_iter();
        found.map(|(bits, index)| (f32::from_bits(bits), self.photons[index])).collect()
    }

    /// Calls `found` with the squared distance, m², of each photon within `radius`, metres, that
    /// arrived from above a surface with `normal`, in any order.
    pub(super) fn within(
        &self,
        place: Vec3,
        normal: Vec3,
        radius: f32,
        mut found: impl FnMut(f32, &Photon),
    ) {
        let mut within = radius * radius;
        self.visit(0..self.photons.len(), place, &mut within, &mut |index, squared, _| {
            if self.photons[index].direction.dot(normal) > 0.0 {
                found(squared, &self.photons[index]);
            }
        });
    }

    /// Calls `visit` with index and squared distance of all photons of a range within a squared
    /// distance, which `visit` may lower.
    fn visit(
        &self,
        range: std::ops::Range<usize>,
        place: Vec3,
        within: &mut f32,
        visit: &mut impl FnMut(usize, f32, &mut f32),
    ) {
        let mut meet = |index: usize, within: &mut f32| {
            let squared = self.photons[index].position.distance_squared(place);
            if squared <= *within {
                visit(index, squared, within);
            }
        };
        if range.len() <= LEAF {
            range.for_each(|index| meet(index, within));
            return;
        }
        let middle = range.start + range.len() / 2;
        meet(middle, within);
        let axis = usize::from(self.axes[middle]);
        let offset = place[axis] - self.photons[middle].position[axis];
        let (low, high) = (range.start..middle, middle + 1..range.end);
        let (near, far) = if offset < 0.0 { (low, high) } else { (high, low) };
        self.visit(near, place, within, visit);
        if offset * offset <= *within {
            self.visit(far, place, within, visit);
        }
    }
}

/// Sorts photons into a tree.
fn split(photons: &mut [Photon], axes: &mut [u8]) {
    if photons.len() <= LEAF {
        return;
    }
    let axis = extent(photons.iter().map(|photon| photon.position)).max_position();
    let middle = photons.len() / 2;
    photons.select_nth_unstable_by(middle, |a, b| a.position[axis].total_cmp(&b.position[axis]));
    axes[middle] = axis as u8;
    let (low, high) = photons.split_at_mut(middle);
    let (low_axes, high_axes) = axes.split_at_mut(middle);
    let (high, high_axes) = (&mut high[1..], &mut high_axes[1..]);
    rayon::join(|| split(low, low_axes), || split(high, high_axes));
}
