//! Path guiding: learns from photons, for each place, where much light comes from. A place is a leaf
//! of a tree over positions, of which each of six orientations of surfaces has one; or a cube.
//!
//! | module | job |
//! |---|---|
//! | `sources` | spheres that send much light to a place, and sampling of directions to them |
//! | `cut` | cuts the sources of a place's photons into spheres |
//! | `histogram` | directions from which more light comes than BSDF sampling expects |

mod cut;
mod histogram;
mod sources;

use glam::{DVec3, Vec3};

use crate::scene::extent;
use histogram::{Grid, Histogram};
pub(crate) use sources::around;
use sources::{Cones, Sources};

/// A leaf has at most this many photons times the square root of the number of all.
const LEAF_PHOTONS: f64 = 2.0;

/// Light that arrived at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Photon {
    /// Metres.
    pub(crate) position: Vec3,
    /// Normal of the surface on the side of the light, unit length.
    pub(crate) normal: Vec3,
    /// Where the light came from, metres.
    pub(crate) source: Vec3,
    /// Luminance of its power, in a unit that is the same for all; above 0.
    pub(crate) power: f32,
}

/// What sends light to each place.
#[derive(Clone, Debug)]
pub(crate) enum Field {
    Spheres(Tree),
    Histograms(Grid),
}

/// What sends light to a point.
pub(crate) enum Aims<'a> {
    Cones(Cones),
    Histogram(&'a Histogram),
}

impl Field {
    /// Learns spheres from `photons`, whose order it changes: for small bright parts.
    pub(crate) fn spheres(photons: &mut [Photon]) -> Self {
        Self::Spheres(Tree::learn(photons))
    }

    /// Learns histograms from `photons`: for large parts.
    pub(crate) fn histograms(photons: &mut [Photon]) -> Self {
        Self::Histograms(Grid::learn(photons))
    }

    /// What sends light to `position`, metres, on a surface with `normal`.
    pub(crate) fn aims(&self, position: DVec3, normal: DVec3) -> Option<Aims<'_>> {
        match self {
            Self::Spheres(tree) => {
                tree.at(position, normal).map(|sources| Aims::Cones(sources.seen_from(position)))
            }
            Self::Histograms(grid) => grid.at(position, normal).map(Aims::Histogram),
        }
    }
}

impl Aims<'_> {
    /// Branches per surface that [`sample`](Self::sample) should give a direction, on average; below 1.
    pub(crate) fn share(&self) -> f64 {
        match self {
            Self::Cones(cones) => cones.share(),
            Self::Histogram(histogram) => histogram.share(),
        }
    }

    /// A direction, of unit length. `choice` is in [0, share).
    pub(crate) fn sample(&self, choice: f64, pair: [f64; 2]) -> DVec3 {
        match self {
            Self::Cones(cones) => cones.sample(choice, pair),
            Self::Histogram(histogram) => histogram.sample(choice, pair),
        }
    }

    /// Share × density per steradian with which [`sample`](Self::sample) takes `direction`, a unit
    /// vector.
    pub(crate) fn density(&self, direction: DVec3) -> f64 {
        match self {
            Self::Cones(cones) => cones.density(direction),
            Self::Histogram(histogram) => histogram.density(direction),
        }
    }
}

/// Spheres by place: a tree for each of six orientations of surfaces.
#[derive(Clone, Debug)]
pub(crate) struct Tree {
    roots: [Node; 6],
}

#[derive(Clone, Debug)]
enum Node {
    Inner { axis: usize, at: f32, children: Box<[Node; 2]> },
    Leaf(Option<Sources>),
}

impl Tree {
    /// Learns from `photons`, whose order it changes.
    fn learn(photons: &mut [Photon]) -> Self {
        let most = ((photons.len() as f64).sqrt() * LEAF_PHOTONS) as usize;
        let mut rest = photons;
        let roots = std::array::from_fn(|wanted| {
            let count = partition(rest, |photon| face(photon.normal) == wanted);
            let (own, others) = std::mem::take(&mut rest).split_at_mut(count);
            rest = others;
            let striking = Sources::striking(own);
            Node::learn(own, most, striking.as_ref())
        });
        Self { roots }
    }

    /// What sends light to a place on a surface with `normal`.
    fn at(&self, position: DVec3, normal: DVec3) -> Option<&Sources> {
        let position = position.as_vec3();
        let mut node = &self.roots[face(normal.as_vec3())];
        loop {
            match node {
                Node::Leaf(sources) => return sources.as_ref(),
                Node::Inner { axis, at, children } => {
                    node = &children[usize::from(position[*axis] >= *at)];
                }
            }
        }
    }
}

impl Node {
    /// Splits at the median position. All leaves aim a little at what is `striking`.
    fn learn(photons: &mut [Photon], most: usize, striking: Option<&Sources>) -> Self {
        let axis = extent(photons.iter().map(|photon| photon.position)).max_position();
        let middle = photons.len() / 2;
        if photons.len() > most {
            let (_, photon, _) = photons.select_nth_unstable_by(middle, |a, b| {
                a.position[axis].total_cmp(&b.position[axis])
            });
            let at = photon.position[axis];
            let count = partition(photons, |photon| photon.position[axis] < at);
            if count > 0 {
                let (low, high) = photons.split_at_mut(count);
                let (low, high) = rayon::join(
                    || Self::learn(low, most, striking),
                    || Self::learn(high, most, striking),
                );
                return Self::Inner { axis, at, children: Box::new([low, high]) };
            }
        }
        Self::Leaf(Sources::learn(photons, striking))
    }
}

/// The cube with `side`, metres, in which a position lies; the last number is for one of six
/// orientations of surfaces.
pub(crate) fn cube(position: Vec3, normal: Vec3, side: f32) -> [i32; 4] {
    let [x, y, z] = (position / side).floor().to_array().map(|value| value as i32);
    [x, y, z, face(normal) as i32]
}

/// Which of the six axes a normal is nearest to.
fn face(normal: Vec3) -> usize {
    let axis = normal.abs().max_position();
    2 * axis + usize::from(normal[axis] < 0.0)
}

/// Moves photons that `is_first` before the others, and returns their number.
fn partition(photons: &mut [Photon], is_first: impl Fn(&Photon) -> bool) -> usize {
    let mut count = 0;
    for i in 0..photons.len() {
        if is_first(&photons[i]) {
            photons.swap(i, count);
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests;
