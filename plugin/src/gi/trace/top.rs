//! The tree over instances, edited as meshes come, move and go.
//!
//! A large tree takes a frame's time to build. So new instances get a small tree of their own behind
//! it, removed instances become empty slots, and moved ones widen the boxes around them, up to the
//! root. Rays traverse the trees one after another, as children of one root. Once too much has
//! changed, all are rebuilt as one, in the background where they are large.

use bevy::math::Vec3A;
use bevy::platform::collections::HashMap;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use bytemuck::Zeroable;
use obvhs::BvhBuildParams;

use super::bvh::{FlatBvh, Node};
use super::mesh::Instance;
use super::mirror::{Mirrored, warn_of_full_buffer};
use super::skin::InstanceKey;

/// A box: its lower and its upper corner.
pub(super) type Bounds = (Vec3A, Vec3A);

/// An instance of a part, and the box around it.
pub(super) type Placed = (InstanceKey, Instance, Bounds);

/// Trees of up to so many instances are built at once, in less than a millisecond.
const AT_ONCE: usize = 1024;
/// All are built anew when their boxes have grown by this factor,
const MAX_GROWTH: f64 = 2.0;
/// when so many trees were added,
const MAX_TREES: usize = 16;
/// or when this share of the instances is gone, as a divisor.
const GONE_SHARE: usize = 4;
/// All boxes are fitted at once where this share of the instances moved, as a divisor.
const MOVED_SHARE: usize = 8;

/// A new order of instances, built in the background.
struct Rebuilt {
    tree: FlatBvh,
    parts: Vec<InstanceKey>,
    boxes: Vec<Bounds>,
}

/// The instances, and the tree over them.
#[derive(Default)]
pub(super) struct TopTree {
    pub nodes: Mirrored<Node>,
    pub instances: Mirrored<Instance>,
    slots: HashMap<InstanceKey, usize>,
    /// By slot; `None` where an instance is gone.
    parts: Vec<Option<InstanceKey>>,
    bounds: Vec<Bounds>,
    /// The leaf of each slot.
    leaves: Vec<u32>,
    /// The node above each node; the root's is the root.
    parents: Vec<u32>,
    gone: usize,
    /// Number of trees added since all were built.
    added: usize,
    /// Sum of the half areas of all boxes but the root's: now, and when they were built or added.
    area: f64,
    area_built: f64,
    rebuilding: Option<Task<Rebuilt>>,
}

impl TopTree {
    /// Whether a new order is built, which [`edit`](Self::edit) adopts.
    pub(super) fn is_rebuilt(&self) -> bool {
        self.rebuilding.as_ref().is_some_and(Task::is_finished)
    }

    /// Whether a part has an instance.
    pub(super) fn holds(&self, part: &InstanceKey) -> bool {
        self.slots.contains_key(part)
    }

    /// Number of instances.
    pub(super) fn len(&self) -> usize {
        self.slots.len()
    }

    /// Ends a version of both arrays.
    pub(super) fn end_version(&mut self) {
        self.nodes.end_version();
        self.instances.end_version();
    }

    /// Takes all out; returns it, and the instances.
    fn restart(&mut self) -> (Self, Vec<Instance>) {
        self.nodes.take();
        let instances = self.instances.take();
        let empty = Self {
            nodes: std::mem::take(&mut self.nodes),
            instances: std::mem::take(&mut self.instances),
            ..Self::default()
        };
        (std::mem::replace(self, empty), instances)
    }

    /// Takes all out.
    pub(super) fn clear(&mut self) {
        self.restart();
    }

    /// A tree over these instances, each of another part, in buffers of at most `most` bytes.
    pub(super) fn build(&mut self, placed: &[Placed], most: usize) {
        self.clear();
        self.append(placed, BvhBuildParams::medium_build(), most);
        self.fit(0);
        self.added = 0;
    }

    /// The tree after instances of parts were set and removed.
    pub(super) fn edit(&mut self, set: Vec<Placed>, removed: &[InstanceKey], most: usize) {
        for part in removed {
            if let Some(slot) = self.slots.remove(part) {
                let instance = Instance { root: Instance::NOTHING, ..self.instances[slot] };
                self.instances.set(slot, instance);
                self.parts[slot] = None;
                self.gone += 1;
            }
        }
        let (mut new, mut moved) = (Vec::new(), Vec::new());
        for (part, instance, bounds) in set {
            match self.slots.get(&part) {
                Some(slot) => {
                    self.instances.set(*slot, instance);
                    if self.bounds[*slot] != bounds {
                        self.bounds[*slot] = bounds;
                        moved.push(*slot);
                    }
                }
                None => new.push((part, instance, bounds)),
            }
        }
        if let Some(rebuilt) = self.rebuilding.as_mut().and_then(check_ready) {
            self.adopt(rebuilt);
            moved.clear();
        }
        self.append(&new, BvhBuildParams::very_fast_build(), most);
        if moved.len() * MOVED_SHARE > self.parts.len() {
            self.area = self.fit_from(1);
        } else {
            for slot in moved {
                self.fit(self.leaves[slot] as usize);
            }
        }
        self.fit(0);
        let must_build = self.area > MAX_GROWTH * self.area_built
            || self.added > MAX_TREES
            || self.gone * GONE_SHARE > self.parts.len();
        if must_build && self.rebuilding.is_none() {
            if self.slots.len() <= AT_ONCE {
                let placed: Vec<_> = self.live(&self.instances).collect();
                return self.build(&placed, most);
            }
            let (parts, boxes): (Vec<_>, Vec<_>) =
                self.live(&self.instances).map(|(part, _, bounds)| (part, bounds)).unzip();
            let build = async move {
                Rebuilt { tree: FlatBvh::new(&boxes, BvhBuildParams::medium_build()), parts, boxes }
            };
            self.rebuilding = Some(AsyncComputeTaskPool::get().spawn(build));
        }
    }

    /// A node with the box around what lies below it.
    fn fitted(&self, index: usize) -> Node {
        let node = self.nodes[index];
        let (mut min, mut max) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        if node.leaf != 0 {
            for (low, high) in &self.bounds[node.primitives()] {
                (min, max) = (min.min(*low), max.max(*high));
            }
        } else {
            let mut child = index + 1;
            while child < node.skip as usize {
                let below = self.nodes[child];
                (min, max) = (min.min(below.min.into()), max.max(below.max.into()));
                child = below.skip as usize;
            }
        }
        Node { min: min.to_array(), max: max.to_array(), ..node }
    }

    /// Fits the box of a node, and those above it for as long as they change.
    fn fit(&mut self, mut index: usize) {
        while index < self.nodes.len() {
            let before = self.nodes[index];
            let now = self.fitted(index);
            if now == before {
                return;
            }
            self.nodes.set(index, now);
            if index == 0 {
                return;
            }
            self.area += f64::from(now.half_area()) - f64::from(before.half_area());
            index = self.parents[index] as usize;
        }
    }

    /// Fits the boxes of the nodes from `first` on. Returns the sum of their half areas, by which
    /// trees can be compared: it grows as instances leave their neighbours.
    fn fit_from(&mut self, first: usize) -> f64 {
        let mut area = 0.0;
        // Children lie behind their parents.
        for index in (first..self.nodes.len()).rev() {
            let node = self.fitted(index);
            self.nodes.set(index, node);
            area += f64::from(node.half_area());
        }
        area
    }

    /// The instances that are there.
    fn live<'a>(&'a self, instances: &'a [Instance]) -> impl Iterator<Item = Placed> + 'a {
        let slots = self.parts.iter().zip(instances).zip(&self.bounds);
        slots.filter_map(|((part, instance), bounds)| Some(((*part)?, *instance, *bounds)))
    }

    /// Adds a tree behind the others.
    fn append(&mut self, placed: &[Placed], effort: BvhBuildParams, most: usize) {
        let room = (most / size_of::<Instance>()).saturating_sub(self.instances.len());
        if placed.len() > room {
            warn_of_full_buffer();
        }
        let placed = &placed[..placed.len().min(room)];
        if placed.is_empty() {
            return;
        }
        let boxes: Vec<Bounds> = placed.iter().map(|(.., bounds)| *bounds).collect();
        self.push(FlatBvh::new(&boxes, effort), |index| {
            let (part, instance, bounds) = placed[index];
            (Some(part), instance, bounds)
        });
        self.added += 1;
    }

    /// Puts a tree behind the others. `placed`: the instance at an index of what it was made of,
    /// without a part where that is gone.
    fn push(
        &mut self,
        FlatBvh { nodes, order }: FlatBvh,
        placed: impl Fn(usize) -> (Option<InstanceKey>, Instance, Bounds),
    ) {
        let placed: Vec<_> = order.iter().map(|index| placed(*index as usize)).collect();
        if self.nodes.is_empty() {
            // The root of all trees.
            self.nodes.extend(&[Node { leaf: 0, ..Node::NOTHING }]);
            self.parents.push(0);
        }
        let (first_node, first) = (self.nodes.len(), self.instances.len());
        for (slot, (part, ..)) in (first..).zip(&placed) {
            self.parts.push(*part);
            match part {
                Some(part) => {
                    self.slots.insert(*part, slot);
                }
                None => self.gone += 1,
            }
        }
        let nodes: Vec<Node> =
            nodes.into_iter().map(|node| node.moved(first_node, first)).collect();
        self.nodes.extend(&nodes);
        let instances: Vec<Instance> = placed.iter().map(|(_, instance, _)| *instance).collect();
        self.instances.extend(&instances);
        self.bounds.extend(placed.iter().map(|(.., bounds)| *bounds));
        let area = self.fit_from(first_node);
        (self.area, self.area_built) = (self.area + area, self.area_built + area);
        self.link(first_node);
        let root = Node { skip: self.nodes.len() as u32, ..self.nodes[0] };
        self.nodes.set(0, root);
    }

    /// Notes what lies above the nodes from `first` on.
    fn link(&mut self, first: usize) {
        self.parents.resize(self.nodes.len(), 0);
        self.leaves.resize(self.parts.len(), 0);
        for index in first..self.nodes.len() {
            let node = self.nodes[index];
            if node.leaf != 0 {
                self.leaves[node.primitives()].fill(index as u32);
                continue;
            }
            let mut child = index + 1;
            while child < node.skip as usize {
                self.parents[child] = index as u32;
                child = self.nodes[child].skip as usize;
            }
        }
    }

    /// Takes over a new order. What has gone meanwhile is an instance of nothing, and what has come
    /// gets a tree behind it.
    fn adopt(&mut self, Rebuilt { tree, parts, boxes }: Rebuilt) {
        let (old, instances) = self.restart();
        let gone = Instance { root: Instance::NOTHING, ..Instance::zeroed() };
        self.push(tree, |index| match old.slots.get(&parts[index]) {
            Some(slot) => (Some(parts[index]), instances[*slot], old.bounds[*slot]),
            None => (None, gone, boxes[index]),
        });
        let come: Vec<_> = old.live(&instances).filter(|(part, ..)| !self.holds(part)).collect();
        self.append(&come, BvhBuildParams::very_fast_build(), usize::MAX);
    }
}

#[cfg(test)]
#[path = "top_tests.rs"]
mod tests;
