//! Arrays of which the GPU holds a copy: what changed of them is uploaded, not all.
//!
//! Each array counts its versions, and knows what differs from the last one. The renderer says which
//! version it holds; if that is the last one, it gets the items that changed, else all.

use std::ops::Range;

use bevy::log::warn_once;
use bytemuck::Pod;

/// Items that lie so near each other are uploaded at once, with those between them.
const GAP: usize = 16;

/// An array of which the GPU holds a copy.
#[derive(Debug)]
pub(super) struct Mirrored<T> {
    items: Vec<T>,
    /// Items that differ from the last version.
    dirty: Vec<Range<usize>>,
    /// 0: never written.
    version: u64,
    /// Changes still count to this version.
    is_open: bool,
}

// The derive would ask for the default of an item.
impl<T> Default for Mirrored<T> {
    fn default() -> Self {
        Self { items: Vec::new(), dirty: Vec::new(), version: 0, is_open: false }
    }
}

impl<T> std::ops::Deref for Mirrored<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.items
    }
}

impl<T: Pod + PartialEq> Mirrored<T> {
    /// Ends a version. To be called once in each frame, before changes.
    pub(super) fn end_version(&mut self) {
        self.is_open = false;
    }

    fn open(&mut self) {
        if !self.is_open {
            self.dirty.clear();
            (self.version, self.is_open) = (self.version + 1, true);
        }
    }

    /// Writes one item.
    pub(super) fn set(&mut self, index: usize, item: T) {
        if self.items[index] != item {
            self.open();
            self.items[index] = item;
            match self.dirty.last_mut().filter(|last| last.end == index) {
                Some(last) => last.end += 1,
                None => self.dirty.push(index..index + 1),
            }
        }
    }

    /// Writes items from `first` on, and makes the array longer where they reach beyond its end.
    pub(super) fn write(&mut self, first: usize, items: &[T]) {
        if items.is_empty() {
            return;
        }
        self.open();
        let end = first + items.len();
        if end > self.items.len() {
            self.items.resize(end, T::zeroed());
        }
        self.items[first..end].copy_from_slice(items);
        self.dirty.push(first..end);
    }

    /// Writes items behind the last one.
    pub(super) fn extend(&mut self, items: &[T]) {
        self.write(self.items.len(), items);
    }

    /// Takes all items out.
    pub(super) fn take(&mut self) -> Vec<T> {
        if !self.items.is_empty() {
            self.open();
            self.dirty.clear();
        }
        std::mem::take(&mut self.items)
    }

    /// What a buffer lacks that holds a version with room for `capacity` items; `None` if nothing.
    pub(super) fn missing(&self, held: u64, capacity: usize) -> Option<Upload> {
        if held == self.version {
            return None;
        }
        let follows = held != 0 && held + 1 == self.version;
        let is_whole = !follows || self.items.len() > capacity;
        let piece = |range: Range<usize>| {
            let first = range.start * size_of::<T>();
            (first, bytemuck::cast_slice(&self.items[range]).to_vec())
        };
        let pieces = if is_whole {
            vec![piece(0..self.items.len())]
        } else {
            merged(self.dirty.clone()).into_iter().map(piece).collect()
        };
        Some(Upload { version: self.version, count: self.items.len(), is_whole, pieces })
    }
}

/// What a buffer lacks.
#[derive(Debug, Default)]
pub(super) struct Upload {
    /// The version that it then holds.
    pub version: u64,
    /// Number of items of the array.
    pub count: usize,
    /// It is the whole array, in one piece.
    pub is_whole: bool,
    /// Bytes, and where they belong.
    pub pieces: Vec<(usize, Vec<u8>)>,
}

/// Ranges in order, with those that overlap or lie near each other as one.
fn merged(mut ranges: Vec<Range<usize>>) -> Vec<Range<usize>> {
    ranges.sort_unstable_by_key(|range| range.start);
    let mut merged: Vec<Range<usize>> = Vec::new();
    for range in ranges {
        match merged.last_mut().filter(|last| range.start <= last.end + GAP) {
            Some(last) => last.end = last.end.max(range.end),
            None => merged.push(range),
        }
    }
    merged
}

/// Warns once that there is no room for more.
pub(super) fn warn_of_full_buffer() {
    warn_once!(
        "the scene's meshes exceed this GPU's largest storage buffer: those that are left out occlude no indirect light"
    );
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A buffer, as the renderer keeps one.
    #[derive(Default)]
    struct Copy {
        version: u64,
        capacity: usize,
        items: Vec<u32>,
    }

    impl Copy {
        fn update(&mut self, array: &Mirrored<u32>) -> usize {
            let Some(upload) = array.missing(self.version, self.capacity) else { return 0 };
            if upload.is_whole {
                self.capacity = self.capacity.max(upload.count);
                self.items = vec![0; self.capacity];
            }
            for (first, bytes) in &upload.pieces {
                let items: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
                self.items[first / 4..first / 4 + items.len()].copy_from_slice(&items);
            }
            self.version = upload.version;
            upload.pieces.iter().map(|(_, bytes)| bytes.len()).sum()
        }
    }

    #[derive(Clone, Debug)]
    enum Edit {
        Set(usize, u32),
        Extend(Vec<u32>),
        Write(usize, Vec<u32>),
        Take,
        NextFrame,
        /// The renderer has no frame.
        Skip,
        /// The renderer drops its buffer.
        Drop,
    }

    fn edit() -> impl Strategy<Value = Edit> {
        let items = || prop::collection::vec(any::<u32>(), 0..40);
        prop_oneof![
            8 => (any::<usize>(), 0u32..4).prop_map(|(index, item)| Edit::Set(index, item)),
            2 => items().prop_map(Edit::Extend),
            2 => (any::<usize>(), items()).prop_map(|(first, items)| Edit::Write(first, items)),
            1 => Just(Edit::Take),
            6 => Just(Edit::NextFrame),
            1 => Just(Edit::Skip),
            1 => Just(Edit::Drop),
        ]
    }

    proptest! {
        #[test]
        fn the_copy_is_the_array_whatever_was_written(edits in prop::collection::vec(edit(), 0..80)) {
            let (mut array, mut copy) = (Mirrored::<u32>::default(), Copy::default());
            for edit in edits {
                match edit {
                    Edit::Set(index, item) if !array.is_empty() => array.set(index % array.len(), item),
                    Edit::Set(..) => {}
                    Edit::Extend(items) => array.extend(&items),
                    Edit::Write(first, items) => array.write(first % (array.len() + 1), &items),
                    Edit::Take => drop(array.take()),
                    Edit::Skip => array.end_version(),
                    Edit::Drop => copy = Copy::default(),
                    Edit::NextFrame => {
                        copy.update(&array);
                        prop_assert_eq!(&copy.items[..array.len()], &array[..]);
                        prop_assert_eq!(copy.update(&array), 0, "nothing is uploaded twice");
                        array.end_version();
                    }
                }
            }
        }
    }

    #[test]
    fn one_item_of_many_is_uploaded_alone() {
        let (mut array, mut copy) = (Mirrored::default(), Copy::default());
        array.extend(&(0..10_000).collect::<Vec<u32>>());
        assert_eq!(copy.update(&array), 40_000);
        array.end_version();
        array.set(7, 7);
        assert_eq!(copy.update(&array), 0, "it is what it was");
        array.set(7, 8);
        array.set(9_000, 1);
        array.set(9_010, 1);
        assert_eq!(copy.update(&array), 4 * (1 + 11));
    }
}
