//! The tree over instances, edited as meshes come, move and go.
//!
//! A tree of ten thousand instances takes some 10 ms to build, a frame's time. So what came since it
//! was built gets a small tree of its own behind it, what went stays as an instance of nothing, and
//! what moved widens the boxes around it. Rays traverse the trees one after another, as children of
//! one root. Once too much has changed, all are built anew as one, in the background where they are
//! large.

use bevy::math::Vec3A;
use bevy::platform::collections::HashMap;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use bytemuck::Zeroable;

use super::bvh::{FlatBvh, Node, refit};
use super::data::{Instance, InstanceData, warn_of_full_buffer};
use super::skin::Part;

/// A box: its lower and its upper corner.
pub(super) type Bounds = (Vec3A, Vec3A);

/// An instance of a part, and the box around it.
pub(super) type Placed = (Part, Instance, Bounds);

/// Trees of up to so many instances are built at once, in less than a millisecond.
const AT_ONCE: usize = 1024;
/// All are built anew when their boxes have grown by this factor,
const MOST_GROWTH: f32 = 2.0;
/// when so many trees were added,
const MOST_TREES: usize = 16;
/// or when this share of the instances is gone, as a divisor.
const GONE_SHARE: usize = 4;

/// A new order of instances, built in the background.
struct Rebuilt {
    tree: FlatBvh,
    parts: Vec<Part>,
    boxes: Vec<Bounds>,
}

/// Where instances are in the current [`InstanceData`].
#[derive(Default)]
pub(super) struct TopTree {
    slots: HashMap<Part, usize>,
    /// By slot; `None` where an instance is gone.
    parts: Vec<Option<Part>>,
    bounds: Vec<Bounds>,
    gone: usize,
    /// Number of trees added since all were built.
    added: usize,
    /// Sum of the half areas of all boxes when they were built or added.
    area: f32,
    rebuilding: Option<Task<Rebuilt>>,
}

impl TopTree {
    /// Whether a new order is built, which [`edit`](Self::edit) adopts.
    pub(super) fn is_rebuilt(&self) -> bool {
        self.rebuilding.as_ref().is_some_and(Task::is_finished)
    }

    /// Whether a part has an instance.
    pub(super) fn holds(&self, part: &Part) -> bool {
        self.slots.contains_key(part)
    }

    /// A tree over these instances, each of another part, in buffers of at most `most` bytes.
    pub(super) fn build(&mut self, placed: &[Placed], most: usize) -> InstanceData {
        *self = Self::default();
        let mut data = InstanceData::default();
        self.append(&mut data, placed, most);
        refit(&mut data.nodes, &self.bounds);
        self.added = 0;
        data
    }

    /// The tree after instances of parts were set and removed.
    pub(super) fn edit(
        &mut self,
        before: &InstanceData,
        set: Vec<Placed>,
        removed: &[Part],
        most: usize,
    ) -> InstanceData {
        let mut data = before.clone();
        for part in removed {
            if let Some(slot) = self.slots.remove(part) {
                data.instances[slot].nodes = [0; 2];
                self.parts[slot] = None;
                self.gone += 1;
            }
        }
        let mut new = Vec::new();
        for (part, instance, bounds) in set {
            match self.slots.get(&part) {
                Some(slot) => (data.instances[*slot], self.bounds[*slot]) = (instance, bounds),
                None => new.push((part, instance, bounds)),
            }
        }
        if let Some(rebuilt) = self.rebuilding.as_mut().and_then(check_ready) {
            data = self.adopt(&data, rebuilt);
        }
        self.append(&mut data, &new, most);
        let all = refit(&mut data.nodes, &self.bounds);
        let area = all - data.nodes.first().map_or(0.0, Node::half_area);
        let must_build = area > MOST_GROWTH * self.area
            || self.added > MOST_TREES
            || self.gone * GONE_SHARE > self.parts.len();
        if must_build && self.rebuilding.is_none() {
            if self.slots.len() <= AT_ONCE {
                let placed: Vec<_> = self.live(&data).collect();
                return self.build(&placed, most);
            }
            let (parts, boxes): (Vec<_>, Vec<_>) =
                self.live(&data).map(|(part, _, bounds)| (part, bounds)).unzip();
            let build = async move { Rebuilt { tree: FlatBvh::new(&boxes), parts, boxes } };
            self.rebuilding = Some(AsyncComputeTaskPool::get().spawn(build));
        }
        data
    }

    /// The instances that are there.
    fn live<'a>(&'a self, data: &'a InstanceData) -> impl Iterator<Item = Placed> + 'a {
        let slots = self.parts.iter().zip(&data.instances).zip(&self.bounds);
        slots.filter_map(|((part, instance), bounds)| Some(((*part)?, *instance, *bounds)))
    }

    /// Adds a tree behind the others.
    fn append(&mut self, data: &mut InstanceData, placed: &[Placed], most: usize) {
        let room = (most / size_of::<Instance>()).saturating_sub(data.instances.len());
        if placed.len() > room {
            warn_of_full_buffer();
        }
        let placed = &placed[..placed.len().min(room)];
        if placed.is_empty() {
            return;
        }
        let boxes: Vec<Bounds> = placed.iter().map(|(.., bounds)| *bounds).collect();
        let tree = FlatBvh::new(&boxes);
        let part = |index: &u32| Some(placed[*index as usize].0);
        let parts: Vec<_> = tree.order.iter().map(part).collect();
        let placed = |index: &u32| {
            let (_, instance, bounds) = placed[*index as usize];
            (instance, bounds)
        };
        let placed: Vec<_> = tree.order.iter().map(placed).collect();
        self.push(data, tree.nodes, &parts, placed);
        self.added += 1;
    }

    /// Puts a tree of instances behind the others.
    fn push(
        &mut self,
        data: &mut InstanceData,
        mut nodes: Vec<Node>,
        parts: &[Option<Part>],
        placed: Vec<(Instance, Bounds)>,
    ) {
        let (instances, bounds): (Vec<_>, Vec<_>) = placed.into_iter().unzip();
        self.area += refit(&mut nodes, &bounds);
        if data.nodes.is_empty() {
            // The root of all trees.
            data.nodes.push(Node { leaf: 0, ..Node::NOTHING });
        }
        let (first_node, first) = (data.nodes.len(), data.instances.len());
        for (slot, part) in (first..).zip(parts) {
            if let Some(part) = part {
                self.slots.insert(*part, slot);
            }
        }
        self.parts.extend(parts);
        self.gone += parts.iter().filter(|part| part.is_none()).count();
        data.nodes.extend(nodes.into_iter().map(|node| node.moved(first_node, first)));
        data.instances.extend(instances);
        self.bounds.extend(bounds);
        data.nodes[0].skip = data.nodes.len() as u32;
    }

    /// Takes over a new order. What has gone meanwhile is an instance of nothing, and what has come
    /// gets a tree behind it.
    fn adopt(&mut self, before: &InstanceData, rebuilt: Rebuilt) -> InstanceData {
        let Rebuilt { tree, parts, boxes } = rebuilt;
        let old = std::mem::take(self);
        let mut data = InstanceData::default();
        let (ordered, placed): (Vec<_>, Vec<_>) = tree
            .order
            .iter()
            .map(|index| {
                let index = *index as usize;
                match old.slots.get(&parts[index]) {
                    Some(slot) => {
                        (Some(parts[index]), (before.instances[*slot], old.bounds[*slot]))
                    }
                    None => (None, (Instance::zeroed(), boxes[index])),
                }
            })
            .unzip();
        self.push(&mut data, tree.nodes, &ordered, placed);
        let come: Vec<_> = old.live(before).filter(|(part, ..)| !self.holds(part)).collect();
        self.append(&mut data, &come, usize::MAX);
        data
    }
}

#[cfg(test)]
#[path = "top_tests.rs"]
mod tests;
