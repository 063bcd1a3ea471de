//! Ranges of an array, handed out and taken back.

use std::ops::Range;

/// Which ranges of an array are in use.
#[derive(Debug, Default)]
pub(super) struct Arena {
    /// Unused ranges below the end, in order, none next to another.
    free: Vec<Range<usize>>,
    /// One after the last item in use.
    end: usize,
}

impl Arena {
    /// A range of `count` items that nothing uses: the first that is large enough, else behind the
    /// last one; `None` where that would reach beyond `most` items.
    pub(super) fn take(&mut self, count: usize, most: usize) -> Option<Range<usize>> {
        if let Some(index) = self.free.iter().position(|range| range.len() >= count) {
            let first = self.free[index].start;
            self.free[index].start += count;
            if self.free[index].is_empty() {
                self.free.remove(index);
            }
            return Some(first..first + count);
        }
        let end = self.end.checked_add(count).filter(|end| *end <= most)?;
        Some(std::mem::replace(&mut self.end, end)..end)
    }

    /// Takes a range back.
    pub(super) fn give(&mut self, range: Range<usize>) {
        if range.is_empty() {
            return;
        }
        let index = self.free.partition_point(|free| free.start < range.start);
        self.free.insert(index, range);
        if index + 1 < self.free.len() && self.free[index].end == self.free[index + 1].start {
            self.free[index].end = self.free.remove(index + 1).end;
        }
        if index > 0 && self.free[index - 1].end == self.free[index].start {
            self.free[index - 1].end = self.free.remove(index).end;
        }
        if let Some(last) = self.free.pop_if(|last| last.end == self.end) {
            self.end = last.start;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_two_ranges_overlap_and_what_is_given_back_is_used_again(
            steps in prop::collection::vec((0usize..9, any::<usize>(), any::<bool>()), 0..200),
        ) {
            const MOST: usize = 60;
            let mut arena = Arena::default();
            let mut held: Vec<Range<usize>> = Vec::new();
            for (count, which, gives) in steps {
                if gives && !held.is_empty() {
                    arena.give(held.swap_remove(which % held.len()));
                } else if let Some(range) = arena.take(count, MOST) {
                    prop_assert_eq!(range.len(), count);
                    held.push(range);
                }
                let mut used = [0; MOST];
                held.iter().cloned().flatten().for_each(|item| used[item] += 1);
                prop_assert!(used.iter().all(|count| *count <= 1));
                prop_assert_eq!(arena.end, used.iter().rposition(|count| *count > 0).map_or(0, |last| last + 1));
                let free: usize = arena.free.iter().map(Range::len).sum();
                prop_assert_eq!(free + used.iter().sum::<usize>(), arena.end);
                prop_assert!(arena.free.windows(2).all(|two| two[0].end < two[1].start));
            }
        }
    }
}
